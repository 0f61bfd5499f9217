"""How much silicone creeps through the joints of the bowl, and so how wide a joint may be (standard library only).

Notes:
    Flow between parallel plates, q = g^3 dp / (12 mu l) for each length of joint (Batchelor, An Introduction to Fluid
    Dynamics, 4.2): g joint clearance, l thickness of the bowl's wall, dp = rho g_0 h with h the height of the silicone
    over the tip, mu its viscosity as mixed for all of its pot life. On the safe side: only the tip has that head, and
    elsewhere along a joint it is lower; silicone only thickens.
"""

from __future__ import annotations

import math

from cad.materials import Silicone
from cad.params import EndcapParams

LEAK_RATIO = 0.01  # E: one per cent of the pour; wiped off as flash
DESIGN_RATIO = 0.0095  # what walls are made for: the closed form of the volume leaves out dents and fillet
GRAVITY_M_S2 = 9.81
BOWL_SEAMS = 3
LEAST_BOWL_WALL_MM = 6.0
MOST_BOWL_WALL_MM = 9.0  # a millimetre inside the dam, so that no surfaces of the bowl touch


def leak_ratio(
    params: EndcapParams, silicone: Silicone, joint_clearance_mm: float, bowl_wall_mm: float, cast_mm3: float
) -> float:
    """Fraction of the pour that could creep through the bowl's joints before it sets.

    Args:
        params: the design. silicone: what is poured. joint_clearance_mm: gap of the bowl's joints.
        bowl_wall_mm: thickness of its wall, the way that silicone creeps. cast_mm3: volume of the pour.
    """
    gap, path, radius = (1e-3 * mm for mm in (joint_clearance_mm, bowl_wall_mm, params.outer_radius_mm))
    head = 1e3 * silicone.density_g_cm3 * GRAVITY_M_S2 * (params.tip_height_mm - params.flange_thickness_mm) * 1e-3
    joints = BOWL_SEAMS * math.pi / 2 * radius
    flow_m3_s = gap**3 * head / (12 * silicone.viscosity_pa_s * path) * joints
    return flow_m3_s * 60 * silicone.pot_life_min * 1e9 / cast_mm3


def solid_shell_mm3(params: EndcapParams) -> float:
    """Volume of the shell above the flange in closed form, without a gyroid in it (dents, fillet left out)."""
    flange = params.flange_thickness_mm
    return _above_mm3(params, params.outer_radius_mm, flange) - _above_mm3(params, params.inner_radius_mm, flange)


def sizing_volume_mm3(params: EndcapParams) -> float:
    """The volume that walls and joints are sized by: the gyroid's zone without the cylinder that clips it.

    Where a thick wall has that clip, the cast itself is more, by up to 0.34 % with the released gyroid: on the safe
    side. The sizes that have been made and checked were sized by this number.
    """
    flange = params.flange_thickness_mm
    outer, inner = params.outer_radius_mm - params.skin_mm, params.inner_radius_mm + params.skin_mm
    zone = sum(
        sign * (_above_mm3(params, radius, flange) - _above_mm3(params, radius, params.interlock_top_mm))
        for sign, radius in ((1, outer), (-1, inner))
    )
    return solid_shell_mm3(params) - params.gyroid * zone


def bowl_wall_mm(params: EndcapParams, silicone: Silicone, joint_clearance_mm: float) -> float:
    """Thickness of the bowl's wall, the way that silicone must creep: as much as the joint needs.

    Args:
        params: the design. silicone: what is poured. joint_clearance_mm: gap of the bowl's joints.
    """
    thin = leak_ratio(params, silicone, joint_clearance_mm, LEAST_BOWL_WALL_MM, sizing_volume_mm3(params))
    return LEAST_BOWL_WALL_MM * min(max(1.0, thin / DESIGN_RATIO), MOST_BOWL_WALL_MM / LEAST_BOWL_WALL_MM)


def widest_joint_mm(params: EndcapParams, silicone: Silicone) -> float:
    """Largest joint clearance whose leak the thickest wall still holds: the leak goes as its cube."""
    at_one = leak_ratio(params, silicone, 1.0, MOST_BOWL_WALL_MM, sizing_volume_mm3(params))
    return (DESIGN_RATIO / at_one) ** (1 / 3)


def _above_mm3(params: EndcapParams, radius: float, height_mm: float) -> float:
    """Volume of a sphere round the dome's centre above a height."""
    depth = min(max(radius + params.centre_height_mm - height_mm, 0.0), 2 * radius)
    return math.pi * depth**2 * (3 * radius - depth) / 3
