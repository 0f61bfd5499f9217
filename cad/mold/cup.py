"""The mold cup: outer half of the mold, which consists of a bowl and a collar of three jigsaw segments each.

The silicone is poured dome-down. The bowl stands on its foot; the dam above its seam retains the silicone that rises
while the core is pressed down. The collar is lowered together with the hanger and slides into the dam; six M4 bolts
close the flanges and connect every segment to two of the other half. Millimetres, endcap frame, casting position.
"""

from __future__ import annotations

from build123d import Solid

from cad.errors import GeometryError
from cad.fasteners import ScrewJoint
from cad.jigsaw import Tab, sector_prisms
from cad.mold.layout import (
    FLANGE_TAB_BEYOND_MM,
    FLANGE_TAB_OFFSET_MM,
    FLANGE_TAB_RADIUS_MM,
    PILOT_RADIUS_MM,
    PIN_DEPTH_MM,
    PIN_SOCKET_RADIUS_MM,
    MoldLayout,
    rotated,
)
from cad.outlines import common, disc, polygon, rectangle, upright
from cad.part import Part, Recipe
from cad.solids import cut_holes, drill, intersected, one_solid, revolved

BOWL, COLLAR = (tuple(f"cup_{half}_{k}" for k in (1, 2, 3)) for half in ("bowl", "collar"))  # names of the segments
BOLT_HOLE_RADIUS_MM = 2.25  # S: M4, coarse clearance
SPOT_RADIUS_MM = 5.5  # of spot faces: M4 washer with room; clears the dam and cuts the flange's edge, no tangency
TIP_HOLE_RADIUS_MM = 1.6  # for the chamfered tip of an M3; 0.9 mm of PLA remain to the cavity
GUSSET_MM = 10.0  # height of the 45 degree gusset under each flange, which needs no support
# Rise over run of the cone under the bowl's skirt, tried in this order. 1 and steeper cones print without support; at
# some sizes (D=150..160 T=8) the kernel cannot cut the first cone near its axis and returns no shape.
SKIRT_STEEPNESS = (1.0, 1.04, 1.09, 1.15)
COLOR = (0.36, 0.56, 0.80)  # RGB, 0..1


def screw_joints(layout: MoldLayout) -> tuple[ScrewJoint, ...]:
    """Joints of the bolts that close the mold, one for each pair of segments that a bolt connects."""
    joints = []
    for azimuth in layout.bolt_azimuths_deg:
        bowl, collar = (
            next(k + 1 for k, seam in enumerate(seams) if (azimuth - seam) % 360.0 < 120.0)
            for seams in (layout.bowl_seams_deg, layout.collar_seams_deg)
        )
        pair = (f"cup_collar_{collar}", f"cup_bowl_{bowl}")
        joints.append(
            ScrewJoint(
                f"{pair[0]}_to_{pair[1][4:]}",
                "cup",
                "screw_m4",
                "ISO 4762 cap screw, steel",
                "casting",
                (rotated((layout.bolt_circle_radius_mm, 0), azimuth),),
                True,
                pair[0],
                pair,
                pair[1],
                "loose nut",
                1,
            )
        )
    return tuple(joints)


def bowl_body(layout: MoldLayout, steepness: float = SKIRT_STEEPNESS[0]) -> Solid:
    """Build the bowl before it is cut into segments; ``steepness`` is the rise over run of the cone under the skirt."""
    params, top, seam = layout.params, layout.dam_top_mm, layout.seam_height_mm
    outer, wall = params.outer_radius_mm, layout.bowl_wall_mm
    below = top + layout.bolt_flange_mm
    skirt = max(below + GUSSET_MM, seam)
    stand = layout.stand_height_mm
    flange = polygon(
        [
            (0.0, top),
            (layout.flange_radius_mm, top),
            (layout.flange_radius_mm, below),
            (layout.dam_radius_mm, below + GUSSET_MM),
            (layout.dam_radius_mm, skirt),
            (0.0, skirt + steepness * layout.dam_radius_mm),
        ]
    )
    round_wall = common(disc((0.0, seam), outer + wall), rectangle(0.0, outer + wall, seam, stand))
    foot = rectangle(0.0, layout.foot_radius_mm, seam, stand)
    socket = rectangle(0.0, layout.piston_radius_mm + layout.joint_clearance_mm, top - 1.0, seam)
    profile = common(flange, rectangle(0.0, layout.flange_radius_mm, top, stand)) + round_wall + foot
    body = revolved(upright(profile - disc((0.0, seam), outer) - socket))
    return one_solid(cut_holes(body, [*_bolts(layout, below), *_tip_holes(layout)]), "bowl")


def collar_body(layout: MoldLayout) -> Solid:
    """Build the collar before it is cut into segments."""
    params, seam = layout.params, layout.seam_height_mm
    bottom = layout.dam_top_mm - layout.joint_clearance_mm  # the piston bears on the seam; the flanges do not touch
    top = layout.collar_flange_top_mm
    outer, flange, piston = params.outer_radius_mm, layout.flange_radius_mm, layout.piston_radius_mm
    inside = params.bore_radius_mm  # inside the sphere at every height
    profile = [(inside, 0.0), *_gusset(top, flange, piston)]
    profile += [(flange, bottom), (piston, bottom), (piston, seam), (inside, seam)]
    screws = [
        drill(
            rotated((layout.collar_screw_circle_radius_mm, 0), a), PILOT_RADIUS_MM, -1.0, layout.collar_screw_depth_mm
        )
        for a in layout.bolt_azimuths_deg
    ]
    sockets = [
        drill(rotated((layout.pin_circle_radius_mm, 0), a), PIN_SOCKET_RADIUS_MM, -1.0, PIN_DEPTH_MM)
        for a in layout.bowl_seams_deg
    ]
    spots = [
        drill(rotated((layout.bolt_circle_radius_mm, 0), a), SPOT_RADIUS_MM, -1.0, top)
        for a in layout.bolt_azimuths_deg
    ]
    body = revolved(upright(polygon(profile) - disc((0.0, seam), outer)))
    tools = [*_bolt_holes(layout), *screws, *sockets, *(spots if top > 0 else [])]
    return one_solid(cut_holes(body, tools), "collar")


def cup_parts(layout: MoldLayout) -> list[Part]:
    """Cut bowl and collar into their segments: ``cup_bowl_1..3`` and ``cup_collar_1..3``.

    Raises:
        GeometryError: the kernel failed at all values of :data:`SKIRT_STEEPNESS`.
    """
    foot_tab = Tab(along_mm=0.45 * layout.params.outer_radius_mm, radius_mm=5.0, beyond_mm=3.2)
    tabs = (foot_tab, flange_tab(layout))
    for steepness in SKIRT_STEEPNESS:
        try:
            bowl = _segments(layout, "cup_bowl", bowl_body(layout, steepness), layout.bowl_seams_deg, tabs)
            break
        except GeometryError:
            if steepness == SKIRT_STEEPNESS[-1]:
                raise
    collar = _segments(layout, "cup_collar", collar_body(layout), layout.collar_seams_deg, tabs[1:])
    return bowl + collar


def _segments(
    layout: MoldLayout, stem: str, body: Solid, seams_deg: tuple[float, float, float], tabs: tuple[Tab, ...]
) -> list[Part]:
    prisms = sector_prisms(layout, seams_deg, tabs)
    names = [f"{stem}_{k + 1}" for k in range(len(prisms))]
    return [
        Part(name, "printed", "PLA", intersected(body, prism, name), COLOR, recipe=Recipe(body, (prism,)))
        for name, prism in zip(names, prisms, strict=True)
    ]


def flange_tab(layout: MoldLayout) -> Tab:
    """Tab in the bolt flanges of bowl and collar."""
    along = layout.params.outer_radius_mm + FLANGE_TAB_OFFSET_MM
    return Tab(along_mm=along, radius_mm=FLANGE_TAB_RADIUS_MM, beyond_mm=FLANGE_TAB_BEYOND_MM)


def _gusset(top: float, flange: float, piston: float) -> list[tuple[float, float]]:
    """Outline (radius, height) of the gusset of the collar's flange: 45 degrees, cut off at the mating plane."""
    run = flange - piston
    if top <= 0:
        return [(flange, 0.0)]
    if top < run:
        return [(flange - top, 0.0), (flange, top)]
    return [(piston, 0.0), (piston, top - run), (flange, top)]


def _bolt_holes(layout: MoldLayout) -> list[Solid]:
    return [
        drill(rotated((layout.bolt_circle_radius_mm, 0), a), BOLT_HOLE_RADIUS_MM, -1.0, layout.stand_height_mm)
        for a in layout.bolt_azimuths_deg
    ]


def _tip_holes(layout: MoldLayout) -> list[Solid]:
    """Blind holes in the bowl's seat for the collar's screws, whose tips pass the low collar below D = 99.12."""
    seam, depth, circle = layout.seam_height_mm, layout.collar_tip_depth_mm, layout.collar_screw_circle_radius_mm
    places = [rotated((circle, 0), a) for a in layout.bolt_azimuths_deg] if depth else []
    return [drill(place, TIP_HOLE_RADIUS_MM, seam - 1.0, seam + depth) for place in places]


def _bolts(layout: MoldLayout, below: float) -> list[Solid]:
    """Holes and spot faces under the bowl's flange."""
    spots = [
        drill(rotated((layout.bolt_circle_radius_mm, 0), a), SPOT_RADIUS_MM, below, below + 2 * GUSSET_MM)
        for a in layout.bolt_azimuths_deg
    ]
    return [*_bolt_holes(layout), *spots]
