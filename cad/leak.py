"""Leakage of silicone through the bowl's joints, and the wall and joint that limit it (standard library only).

Notes:
    Flow between parallel plates, q = g^3 dp / (12 mu l) for each length of joint (Batchelor, An Introduction to Fluid
    Dynamics, 4.2): g joint clearance, l thickness of the bowl's wall, dp = rho g_0 h with h the height of the silicone
    over the tip, mu its viscosity as mixed. The pressure dp acts for the whole pot life. The result is on the safe
    side: along a joint the head is lower than at the tip, and the viscosity increases with time.
"""

from __future__ import annotations

import math

from cad.materials import Silicone
from cad.params import EndcapParams

LEAK_RATIO = 0.01  # E: largest accepted share of the pour; it is trimmed as flash
DESIGN_RATIO = 0.0095  # for which walls are sized: the closed form of the volume omits dents and fillet
GRAVITY_M_S2 = 9.81  # S: standard gravity, rounded
BOWL_SEAMS = 3  # joints between the segments of the bowl
LEAST_BOWL_WALL_MM = 6.0  # thickness of the bowl's wall where the leak would allow less
MOST_BOWL_WALL_MM = 9.0  # a millimetre inside the dam, so that no surfaces of the bowl touch


def leak_ratio(
    params: EndcapParams, silicone: Silicone, joint_clearance_mm: float, bowl_wall_mm: float, cast_mm3: float
) -> float:
    """Fraction of the pour that could leak through the bowl's joints within the pot life.

    Args:
        params: design of the endcap.
        silicone: the poured silicone.
        joint_clearance_mm: gap of the bowl's joints, mm.
        bowl_wall_mm: thickness of the bowl's wall, the length of the leakage path, mm.
        cast_mm3: volume of the pour, mm3.
    """
    gap, path, radius = (1e-3 * mm for mm in (joint_clearance_mm, bowl_wall_mm, params.outer_radius_mm))
    head = 1e3 * silicone.density_g_cm3 * GRAVITY_M_S2 * (params.tip_height_mm - params.flange_thickness_mm) * 1e-3
    joints = BOWL_SEAMS * math.pi / 2 * radius
    flow_m3_s = gap**3 * head / (12 * silicone.viscosity_pa_s * path) * joints
    return flow_m3_s * 60 * silicone.pot_life_min * 1e9 / cast_mm3


def solid_shell_mm3(params: EndcapParams) -> float:
    """Volume of the shell above the flange in closed form, without gyroid, dents and fillet, mm3."""
    flange = params.flange_thickness_mm
    return _above_mm3(params, params.outer_radius_mm, flange) - _above_mm3(params, params.inner_radius_mm, flange)


def sizing_volume_mm3(params: EndcapParams) -> float:
    """Volume for which walls and joints are sized: the shell less the TPU of a gyroid zone without its clip, mm3.

    Where a thick wall has that clip, the cast itself is larger by up to 0.34 % with the released gyroid, which is on
    the safe side. Molds that were made and checked have been sized with this volume.
    """
    flange = params.flange_thickness_mm
    outer, inner = params.outer_radius_mm - params.skin_mm, params.inner_radius_mm + params.skin_mm
    zone = sum(
        sign * (_above_mm3(params, radius, flange) - _above_mm3(params, radius, params.interlock_top_mm))
        for sign, radius in ((1, outer), (-1, inner))
    )
    return solid_shell_mm3(params) - params.gyroid * zone


def bowl_wall_mm(params: EndcapParams, silicone: Silicone, joint_clearance_mm: float) -> float:
    """Thickness of the bowl's wall that the joint needs, mm; the wall is the length of the leakage path.

    Args:
        params: design of the endcap.
        silicone: the poured silicone.
        joint_clearance_mm: gap of the bowl's joints, mm.
    """
    thin = leak_ratio(params, silicone, joint_clearance_mm, LEAST_BOWL_WALL_MM, sizing_volume_mm3(params))
    return LEAST_BOWL_WALL_MM * min(max(1.0, thin / DESIGN_RATIO), MOST_BOWL_WALL_MM / LEAST_BOWL_WALL_MM)


def widest_joint_mm(params: EndcapParams, silicone: Silicone) -> float:
    """Largest joint clearance at which the thickest wall limits the leak, mm; the leak grows with its cube."""
    at_one = leak_ratio(params, silicone, 1.0, MOST_BOWL_WALL_MM, sizing_volume_mm3(params))
    return (DESIGN_RATIO / at_one) ** (1 / 3)


def _above_mm3(params: EndcapParams, radius: float, height_mm: float) -> float:
    """Volume above a height of a sphere about the dome's centre, mm3."""
    depth = min(max(radius + params.centre_height_mm - height_mm, 0.0), 2 * radius)
    return math.pi * depth**2 * (3 * radius - depth) / 3
