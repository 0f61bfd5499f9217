"""Jigsaw joints: plane outlines of pieces that interlock with round tabs, extruded along the mold's axis.

A tab is a disc whose centre lies beyond the seam. Its chord on the seam is therefore narrower than its diameter, and
the joint slides along the axis only. The piece with the tab has the nominal outline; its neighbour is cut back by the
joint clearance everywhere, so that the gap is the same on seam and tab.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from build123d import Face, Pos, Rot, Solid, Vector

from cad.mold.layout import NECK_FILLET_MM, MoldLayout, rotated
from cad.outlines import disc, polygon
from cad.solids import one_solid

FAR_RATIO = 2.5  # radius of the outlines over the outer radius: beyond every mold part


@dataclass(frozen=True)
class Tab:
    """A round tab.

    Attributes:
        along_mm: distance from the axis along the seam, mm.
        radius_mm: radius of the disc, mm.
        beyond_mm: distance of the disc's centre beyond the seam, mm; less than the radius.
    """

    along_mm: float
    radius_mm: float
    beyond_mm: float


def sector_prisms(layout: MoldLayout, seams_deg: tuple[float, ...], tabs: tuple[Tab, ...]) -> list[Solid]:
    """Prisms of the sectors between seams with tabs, with which a body is intersected.

    Args:
        layout: mold sizes (reach, clearance).
        seams_deg: azimuths of the seams, ascending, equally spaced.
        tabs: tabs on every seam; the sector that ends at the seam has the tabs, the next one has the sockets.

    Returns:
        One prism for each sector, in the order of the seams at which they begin.
    """
    gap = layout.joint_clearance_mm
    step = math.radians(360.0 / len(seams_deg))
    far = FAR_RATIO * layout.params.outer_radius_mm
    reach = far / math.cos(step / 4)
    apex = gap / math.sin(step)
    opening = (gap / math.tan(step) + far, gap)  # on the first seam, shifted into the sector by the clearance
    outline = [
        (apex * math.cos(step), apex * math.sin(step)),
        opening,
        (reach * math.cos(step / 4), reach * math.sin(step / 4)),
        (reach * math.cos(step / 2), reach * math.sin(step / 2)),
        (reach * math.cos(3 * step / 4), reach * math.sin(3 * step / 4)),
        (far * math.cos(step), far * math.sin(step)),
    ]
    face = polygon(outline)
    for tab in tabs:
        face = face - disc((tab.along_mm, tab.beyond_mm), tab.radius_mm + gap)
        face = face + disc(rotated((tab.along_mm, tab.beyond_mm), math.degrees(step)), tab.radius_mm)
    return [Rot(0, 0, azimuth) * prism(face, layout) for azimuth in seams_deg]


def core_prisms(layout: MoldLayout) -> dict[str, Solid]:
    """The seven prisms that divide the core: ``core_centre``, ``core_key_1..3``, ``core_wedge_1..3``.

    The centre is a hexagon with three long edges (toward the keys), a tab on each, and three short ones (toward the
    wedges). It is drafted, so that it separates from its neighbours at the start of its travel. A key is a strip of
    constant width; a wedge fills the sector between two keys.
    """
    gap, inner, half = layout.joint_clearance_mm, layout.centre_inradius_mm, layout.key_half_width_mm
    far = FAR_RATIO * layout.params.outer_radius_mm
    key = polygon([(0.8 * inner, gap - half), (far, gap - half), (far, half - gap), (0.8 * inner, half - gap)])
    corner = (half / math.sqrt(3.0), half)  # where the sides of two keys would meet: inside the centre piece
    wedge = polygon([corner, (far, half), rotated((1.2 * far, 0.0), 60.0), rotated((far, -half), 120.0)])
    socket = drafted(_centre_outline(layout, gap), layout)
    pieces = {"core_centre": drafted(_centre_outline(layout, 0.0), layout)}
    for stem, outline in (("core_key", key), ("core_wedge", wedge)):
        blank = prism(outline, layout)
        for k, azimuth in enumerate(layout.key_azimuths_deg):
            pieces[f"{stem}_{k + 1}"] = one_solid((Rot(0, 0, azimuth) * blank).cut(socket), stem)
    return pieces


def _centre_outline(layout: MoldLayout, grown_mm: float) -> Face:
    """Outline of the centre piece at the mating plane, offset outward by ``grown_mm`` for its socket."""
    inner, half = layout.centre_inradius_mm, layout.key_half_width_mm
    tab, beyond = layout.core_tab_radius_mm, layout.core_tab_beyond_mm
    wider = half + grown_mm * math.tan(math.radians(30.0))  # corners of 120 degrees: both edges move outward
    faces = polygon([rotated((inner + grown_mm, y), a) for a in layout.key_azimuths_deg for y in (-wider, wider)])
    for azimuth in layout.key_azimuths_deg:
        faces = faces + disc(rotated((inner + beyond, 0.0), azimuth), tab + grown_mm)
    # Drafting a sharp inner corner would leave a wedge that starts with no width at all.
    necks = [vertex for vertex in faces.vertices() if _is_neck(layout, vertex.X, vertex.Y)]
    return faces.fillet_2d(NECK_FILLET_MM - grown_mm, necks)


def _is_neck(layout: MoldLayout, x: float, y: float) -> bool:
    """Whether a tab joins a long edge at a corner (x, y) of the outline; the other corners are the hexagon's own."""
    return math.hypot(x, y) < math.hypot(layout.centre_inradius_mm, 2 * layout.core_tab_radius_mm)


def drafted(face: Face, layout: MoldLayout) -> Solid:
    """Extrude an outline from the mating plane to beyond the tip, narrowing toward the tip by the core's draft."""
    return Solid.extrude_taper(face, Vector(0, 0, layout.params.tip_height_mm), layout.core_draft_deg)


def prism(face: Face, layout: MoldLayout) -> Solid:
    """Extrude an outline over the whole height of the mold."""
    below, above = -2.0 * layout.hanger_thickness_mm, layout.stand_height_mm + 5.0
    return Solid.extrude(Pos(0, 0, below) * face, Vector(0, 0, above - below))
