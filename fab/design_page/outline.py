"""Parts of an endcap as revolved profiles in closed form, which the page shows before anything has been made.

Endcap frame, millimetres. Holes, screws, dots and jigsaw seams are left out; the gyroid is replaced by its envelope.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import trimesh

from cad import arm_adapter, base, hanger, interface, ring_spacer, shell
from cad.interface import zone_clip_radius_mm, zone_radii_mm
from cad.led_ring import board
from cad.mold import core, cup
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.exports.preview import PreviewPart
from fab.meshing.mesh import joined

STEPS = 96  # round the axis
ARC_STEPS = 40
CAMERA_MM = 32.0  # M: side of the board

Profile = list[tuple[float, float]]  # (radius, height), closed, anticlockwise


@dataclass(frozen=True)
class Revolved:
    """One part.

    Attributes:
        name: of the part.
        group: ``endcap`` or ``mold``.
        profiles: closed outlines in the half plane, (radius, height).
        color: as shown on a screen.
        apart_mm: displacement along the axis in the exploded view.
    """

    name: str
    group: str
    profiles: tuple[Profile, ...]
    color: tuple[float, float, float]
    apart_mm: float


def parts(layout: MoldLayout) -> tuple[Revolved, ...]:
    """All parts of endcap and mold, from the tip down.

    Args:
        layout: mold sizes.
    """
    params = layout.params
    step = 0.42 * params.tip_height_mm + 14.0
    return (
        Revolved("shell", "endcap", (shell_profile(params),), shell.COLOR, 2 * step),
        Revolved("interface", "endcap", interface_profiles(params), interface.COLOR, step),
        Revolved("led_ring", "endcap", (_led_ring(),), board.COLOR, 0.45 * step),
        Revolved("ring_spacer", "endcap", (_spacer(),), ring_spacer.COLOR, 0.2 * step),
        Revolved("base", "endcap", (_base(params),), base.COLOR, -0.2 * step),
        Revolved("arm_adapter", "endcap", (_adapter(params),), arm_adapter.COLOR, -0.7 * step),
        Revolved("bowl", "mold", (_bowl(layout),), cup.COLOR, 2.2 * step),
        Revolved("core", "mold", (_core(layout),), core.COLOR, 0.7 * step),
        Revolved("collar", "mold", (_collar(layout),), (0.46, 0.62, 0.84), -0.2 * step),
        Revolved("hanger", "mold", (_hanger(layout),), hanger.COLOR, -0.9 * step),
    )


def shell_profile(params: EndcapParams) -> Profile:
    """Profile of the silicone: between the two spheres, above the flange.

    Args:
        params: the design.
    """
    low = params.flange_thickness_mm
    return [*_arc(params, params.outer_radius_mm, low), *reversed(_arc(params, params.inner_radius_mm, low))]


def interface_profiles(params: EndcapParams) -> tuple[Profile, Profile]:
    """Profiles of the TPU: the flange, and the envelope of the gyroid above it.

    Args:
        params: the design.
    """
    low, high = params.flange_thickness_mm, params.interlock_top_mm
    bore = params.bore_radius_mm
    rim = [(params.outer_radius_at(z), z) for z in np.linspace(0.0, low, 6).tolist()]
    inner, outer = zone_radii_mm(params)
    clip = zone_clip_radius_mm(params)
    heights = np.linspace(low, high, ARC_STEPS).tolist()
    outside = [(_radius(params, outer, z), z) for z in heights]
    inside = [(max(clip, _radius(params, inner, z)), z) for z in reversed(heights)]
    return [(bore, 0.0), *rim, (bore, low)], [*outside, *inside]


def preview_parts(layout: MoldLayout) -> list[PreviewPart]:
    """The parts as meshes, and the camera as a box.

    Args:
        layout: mold sizes.
    """
    params = layout.params
    found = []
    for part in parts(layout):
        mesh = joined([revolved(profile) for profile in part.profiles])
        found.append(PreviewPart(part.name, part.group, mesh, part.color, (0.0, 0.0, part.apart_mm)))
    camera = trimesh.creation.box((CAMERA_MM, CAMERA_MM, 1.6))
    lens = trimesh.creation.cylinder(7.5, params.camera_height_mm, sections=STEPS // 2)
    lens.apply_translation((0.0, 0.0, params.camera_height_mm / 2))
    found.append(PreviewPart("camera", "endcap", joined([camera, lens]), (0.10, 0.10, 0.12), (0, 0, 0)))
    return found


def revolved(profile: Profile) -> trimesh.Trimesh:
    """Mesh of a closed profile revolved about the axis.

    Args:
        profile: (radius, height) of its corners, mm.
    """
    ring = np.asarray(profile)
    angle = np.linspace(0.0, 2 * math.pi, STEPS, endpoint=False)
    radius, height = ring[:, 0], ring[:, 1]
    places = np.stack(
        [radius * np.cos(angle)[:, None], radius * np.sin(angle)[:, None], np.broadcast_to(height, (STEPS, len(ring)))],
        axis=-1,
    ).reshape(-1, 3)
    k, j = np.meshgrid(np.arange(STEPS), np.arange(len(ring)), indexing="ij")
    k2, j2 = (k + 1) % STEPS, (j + 1) % len(ring)
    a, b, c, d = (u * len(ring) + v for u, v in ((k, j), (k2, j), (k2, j2), (k, j2)))
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return trimesh.Trimesh(places, faces, process=False, validate=False)


def _radius(params: EndcapParams, sphere_mm: float, height_mm: float) -> float:
    """Cylindrical radius of a sphere about the endcap's centre."""
    return math.sqrt(max(0.0, sphere_mm**2 - (height_mm - params.centre_height_mm) ** 2))


def _arc(params: EndcapParams, sphere_mm: float, low_mm: float) -> Profile:
    """A sphere's meridian from a height up to its tip."""
    start = math.asin(max(-1.0, min(1.0, (low_mm - params.centre_height_mm) / sphere_mm)))
    turns = np.linspace(start, math.pi / 2, ARC_STEPS)
    return [(sphere_mm * math.cos(t), params.centre_height_mm + sphere_mm * math.sin(t)) for t in turns.tolist()]


def _ring(inner: float, outer: float, low: float, high: float) -> Profile:
    return [(inner, low), (outer, low), (outer, high), (inner, high)]


def _led_ring() -> Profile:
    seat = ring_spacer.SEAT_Z_MM
    return _ring(board.BOARD_INNER_RADIUS_MM, board.BOARD_OUTER_RADIUS_MM, seat, seat + board.BOARD_THICKNESS_MM)


def _spacer() -> Profile:
    return _ring(ring_spacer.INNER_RADIUS_MM, base.RECESS_RADIUS_MM, -1.0, ring_spacer.SEAT_Z_MM)


def _base(params: EndcapParams) -> Profile:
    """The base without its pockets: its sphere, and the cone below it."""
    bottom = -params.base_thickness_mm
    tangent_z, _, bottom_radius = base.flank_profile(params)
    sphere = [(_radius(params, params.base_sphere_radius_mm, z), z) for z in np.linspace(tangent_z, 0.0, 12).tolist()]
    return [(0.0, bottom), (bottom_radius, bottom), *sphere, (base.RECESS_RADIUS_MM, 0.0), (35.0, -1.0), (0.0, -1.0)]


def _adapter(params: EndcapParams) -> Profile:
    """The adapter as a disc out to its arms' ends."""
    top = -params.base_thickness_mm - 0.3  # two faces in one plane would flicker on the screen
    reach = params.arm_circle_radius_mm + 7.5
    return _ring(arm_adapter.BORE_RADIUS_MM, reach, top - arm_adapter.THICKNESS_MM, top)


def _bowl(layout: MoldLayout) -> Profile:
    """The bowl: sphere inside, wall, dam and flange outside."""
    params, seam, top = layout.params, layout.seam_height_mm, layout.dam_top_mm
    outer, wall = params.outer_radius_mm, layout.bowl_wall_mm
    below = top + layout.bolt_flange_mm
    inside = [
        (outer * math.cos(t), seam + outer * math.sin(t)) for t in np.linspace(0.0, math.pi / 2, ARC_STEPS).tolist()
    ]
    start = math.acos(min(1.0, layout.dam_radius_mm / (outer + wall)))
    outside = [
        ((outer + wall) * math.cos(t), seam + (outer + wall) * math.sin(t))
        for t in np.linspace(start, math.pi / 2, ARC_STEPS).tolist()
    ]
    rim = [(layout.piston_radius_mm, seam), (layout.piston_radius_mm, top), (layout.flange_radius_mm, top)]
    rim += [(layout.flange_radius_mm, below), (layout.dam_radius_mm, below)]
    return [*rim, *outside, *reversed(inside)]


def _core(layout: MoldLayout) -> Profile:
    """The core: the inner sphere, and the neck in the bore."""
    params = layout.params
    neck = layout.neck_radius_mm
    start = -math.acos(min(1.0, neck / params.inner_radius_mm))
    ball = [
        (params.inner_radius_mm * math.cos(t), params.centre_height_mm + params.inner_radius_mm * math.sin(t))
        for t in np.linspace(start, math.pi / 2, ARC_STEPS).tolist()
    ]
    return [(0.0, 0.0), (neck, 0.0), *ball]


def _collar(layout: MoldLayout) -> Profile:
    params, seam = layout.params, layout.seam_height_mm
    top, bottom = layout.collar_flange_top_mm, layout.dam_top_mm
    inside = [(params.outer_radius_at(z), z) for z in np.linspace(seam, 0.0, 16).tolist()]
    flange, piston = layout.flange_radius_mm, layout.piston_radius_mm
    outside = [(flange, max(0.0, top)), (flange, bottom), (piston, bottom), (piston, seam)]
    return [*inside, (max(inside[-1][0], piston), 0.0), *outside]


def _hanger(layout: MoldLayout) -> Profile:
    return _ring(0.0, layout.hanger_radius_mm, -layout.hanger_thickness_mm, 0.0)
