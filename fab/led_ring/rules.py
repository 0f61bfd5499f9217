"""Design rule check of the LED ring on its fabrication files: nets, clearances, edges, holes, legend.

Millimetres. The nets are found from copper and plated holes alone and compared with the circuit: one island of copper
for each net, one net for each island. The limits are those of a plain two-layer board (0.15 mm, edge 0.3 mm), with some
room.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

from shapely import Point, Polygon, STRtree, box, union_all
from shapely.affinity import rotate, translate
from shapely.geometry.base import BaseGeometry

from cad import ring_spacer
from cad.led_ring.board import BOARD_INNER_RADIUS_MM, BOARD_OUTER_RADIUS_MM
from cad.led_ring.placement import Placement
from fab.checks.check import Check
from fab.led_ring.copper import Pad, polygons
from fab.led_ring.lands import leads_of

CLEARANCE_MM = 0.2
WIDTH_MM = 0.2
EDGE_MM = 0.3
RIM_MM = 0.15  # copper round a hole
DRILL_MM = 0.3
MASK_WEB_MM = 0.1
PART_GAP_MM = 0.15  # between the bodies of two parts
LAND_BEYOND_LEAD_MM = 0.55  # S: the largest toe of IPC-7351 (density level A); more is the land of a larger part
LEAD_OFF_LAND_MM2 = 1e-3
NECK_MM2 = 1e-3  # copper that an opening by the least width may lose: corners of turned pads
AREA_RATIO = 1e-4  # board in the files against the CAD part

Layers = dict[str, BaseGeometry]
Holes = Sequence[tuple[float, float, float]]


@dataclass(frozen=True)
class Island:
    """Connected copper on one side.

    Attributes:
        side: ``top`` or ``bottom``.
        shape: its area.
        node: number of its conductor, which plated holes continue on the other side.
    """

    side: str
    shape: Polygon
    node: int


def rule_checks(layers: Layers, holes: Holes, pads: Sequence[Pad], places: Sequence[Placement]) -> list[Check]:
    """Check all design rules.

    Args:
        layers: areas by layer, as read, mm.
        holes: (x, y, diameter) of each, as read, mm.
        pads: lands with the nets they should be on.
        places: parts with their envelopes.
    """
    islands = conductors(layers, holes)
    face = layers["Edge_Cuts"]
    wanted = math.pi * (BOARD_OUTER_RADIUS_MM**2 - BOARD_INNER_RADIUS_MM**2)
    return [
        Check("ring.board_area_error_ratio", abs(face.area / wanted - 1), high=AREA_RATIO),
        *net_checks(islands, pads),
        Check("ring.clearance_mm", least_clearance_mm(islands), low=CLEARANCE_MM),
        Check("ring.thin_copper_mm2", sum(_lost(island.shape) for island in islands), high=NECK_MM2 * len(islands)),
        Check("ring.copper_to_edge_mm", min(edge_distance_mm(i.shape, face) for i in islands), low=EDGE_MM),
        *hole_checks(layers, holes, face),
        *legend_checks(layers, pads),
        Check("ring.parts_gap_mm", least_part_gap_mm(places), low=PART_GAP_MM),
        *lead_checks(pads, places),
        Check("ring.plug_outside_notch_mm2", plug_outside_notch_mm2(pads), high=0),
    ]


def conductors(layers: Layers, holes: Holes) -> list[Island]:
    """Islands of copper on both sides, numbered by conductor; plated holes join islands.

    Args:
        layers: areas by layer, mm.
        holes: (x, y, diameter) of each, mm.
    """
    shapes = [(side, part) for side, name in (("top", "F_Cu"), ("bottom", "B_Cu")) for part in polygons(layers[name])]
    tree = STRtree([part for _, part in shapes])
    parent = list(range(len(shapes)))

    def root(k: int) -> int:
        while parent[k] != k:
            k = parent[k]
        return k

    for x, y, diameter in holes:
        barrel = Point(x, y).buffer(diameter / 2)
        touched = [int(k) for k in tree.query(barrel) if shapes[k][1].intersects(barrel)]
        for k in touched[1:]:
            parent[root(k)] = root(touched[0])
    return [Island(side, part, root(k)) for k, (side, part) in enumerate(shapes)]


def net_checks(islands: Sequence[Island], pads: Sequence[Pad]) -> list[Check]:
    """Check that each net is one conductor, each conductor one net, and that no copper is without a net.

    Args:
        islands: copper of both sides.
        pads: lands with their nets.
    """
    nodes: dict[str, set[int]] = {}
    for pad in pads:
        spot = pad.shape.buffer(-0.05)
        on = {i.node for i in islands if i.side == pad.side and i.shape.contains(spot)}
        nodes.setdefault(pad.net, set()).update(on or {-1 - len(nodes)})
    owners: dict[int, set[str]] = {}
    for net, members in nodes.items():
        for node in members:
            owners.setdefault(node, set()).add(net)
    return [
        Check("ring.open_nets", float(sum(len(members) > 1 for members in nodes.values())), high=0),
        Check("ring.shorted_nets", float(sum(len(nets) > 1 for nets in owners.values())), high=0),
        Check("ring.stray_conductors", float(len({i.node for i in islands} - set(owners))), high=0),
    ]


def least_clearance_mm(islands: Sequence[Island]) -> float:
    """Least gap between two conductors on one side, mm; 0 where their islands touch.

    Args:
        islands: copper of both sides.
    """
    return min(
        (a.shape.distance(b.shape) for a, b in combinations(islands, 2) if a.side == b.side and a.node != b.node),
        default=math.inf,
    )


def edge_distance_mm(shape: BaseGeometry, face: BaseGeometry) -> float:
    """Distance of copper from the board's edge, mm; negative where it extends beyond the edge.

    Args:
        shape: area of the copper, mm.
        face: area of the board, mm.
    """
    outside = shape - face
    if not outside.is_empty:
        return -outside.hausdorff_distance(face.boundary)
    return float(shape.distance(face.boundary))


def hole_checks(layers: Layers, holes: Holes, face: BaseGeometry) -> list[Check]:
    """Check each hole: drill size, copper round it on both sides, distance from the edge and from other holes.

    Args:
        layers: areas by layer, mm.
        holes: (x, y, diameter) of each, mm.
        face: area of the board, mm.
    """
    rims, edges = [], []
    for x, y, diameter in holes:
        at = Point(x, y)
        edges.append(at.distance(face.boundary) - diameter / 2)
        for name in ("F_Cu", "B_Cu"):
            inside = layers[name].contains(at)
            rims.append(at.distance(layers[name].boundary) - diameter / 2 if inside else -diameter / 2)
    gaps = [math.dist(a[:2], b[:2]) - (a[2] + b[2]) / 2 for a, b in combinations(holes, 2)]
    return [
        Check("ring.drill_mm", min(d for _, _, d in holes), low=DRILL_MM),
        Check("ring.copper_round_hole_mm", min(rims), low=RIM_MM),
        Check("ring.hole_to_edge_mm", min(edges), low=EDGE_MM + RIM_MM),
        Check("ring.hole_to_hole_mm", min(gaps, default=math.inf), low=0.5),
    ]


def legend_checks(layers: Layers, pads: Sequence[Pad]) -> list[Check]:
    """Check solder mask and legend: lands open, webs between openings, no ink on a land or beyond the edge.

    Args:
        layers: areas by layer, mm.
        pads: lands of the board.
    """
    webs, inked, covered = [], 0.0, 0.0
    for side, letter in (("top", "F"), ("bottom", "B")):
        openings = polygons(layers[f"{letter}_Mask"])
        webs += [a.distance(b) for a, b in combinations(openings, 2)]
        lands = union_all([pad.shape for pad in pads if pad.side == side])
        covered += (lands - layers[f"{letter}_Mask"]).area
        ink = layers[f"{letter}_Silk"]
        inked += (ink & layers[f"{letter}_Mask"]).area + (ink - layers["Edge_Cuts"]).area
    return [
        Check("ring.mask_web_mm", min(webs, default=math.inf), low=MASK_WEB_MM),
        Check("ring.masked_land_mm2", covered, high=1e-3),
        Check("ring.ink_where_none_may_be_mm2", inked, high=1e-3),
    ]


def least_part_gap_mm(places: Sequence[Placement]) -> float:
    """Least gap between the envelopes of two parts on one side, mm; 0 where they overlap.

    Args:
        places: parts of the board.
    """
    bodies = [(place.side, envelope(place)) for place in places]
    return min((a.distance(b) for (s, a), (t, b) in combinations(bodies, 2) if s == t), default=math.inf)


def lead_checks(pads: Sequence[Pad], places: Sequence[Placement]) -> list[Check]:
    """Check that each lead lies entirely on its land, and that no land belongs to a larger part.

    Args:
        pads: lands of the board.
        places: parts, whose rows of the table give the leads.
    """
    lands = {(pad.reference, pad.pin): pad.shape for pad in pads}
    off_mm2, beyond_mm = 0.0, 0.0
    for place in places:
        for pin, (x, y, width, height) in leads_of(place.part).items():
            at = place.on_board(x, y)
            lead = Pad(place.reference, pin, "", place.side, at, width, height, place.rotation_deg).shape
            land = lands[place.reference, pin]
            off_mm2 = max(off_mm2, float((lead - land).area))
            beyond_mm = max(beyond_mm, float(land.hausdorff_distance(lead)))
    return [
        Check("ring.lead_off_land_mm2", off_mm2, high=LEAD_OFF_LAND_MM2),
        Check("ring.land_beyond_lead_mm", beyond_mm, high=LAND_BEYOND_LEAD_MM),
    ]


def envelope(place: Placement) -> Polygon:
    """Outline of a part's body and leads on the board, mm.

    Args:
        place: of the part.
    """
    x, y = place.part.length_mm / 2, place.part.width_mm / 2
    return translate(rotate(box(-x, -y, x, y), place.rotation_deg, origin=(0, 0)), *place.centre_mm)


def plug_outside_notch_mm2(pads: Sequence[Pad]) -> float:
    """Area of solder on the bottom that would lie on the spacer, mm2: the board must rest flat beside its notch.

    Args:
        pads: lands of the board.
    """
    half = ring_spacer.NOTCH_WIDTH_MM / 2
    notch = box(-half, 0.0, half, ring_spacer.NOTCH_OUTER_RADIUS_MM)
    notch = rotate(notch, ring_spacer.NOTCH_AZIMUTH_DEG - 90.0, origin=(0, 0))
    solder = union_all([pad.shape for pad in pads if pad.side == "bottom"])
    return float((solder - notch - Point(0, 0).buffer(ring_spacer.INNER_RADIUS_MM)).area)


def _lost(shape: BaseGeometry) -> float:
    """Copper narrower than the least width, mm2."""
    half = WIDTH_MM / 2
    return float((shape - shape.buffer(-half, join_style="mitre").buffer(half, join_style="mitre")).area)
