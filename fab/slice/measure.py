"""Figures of a print from its moves: grams, cost, empty layers, unsupported starts, and the zone's infill and openness.

Millimetres; plate coordinates, the part's axis on the middle of the bed, z from the bed. Every number is
computed from :class:`fab.slice.gcode.Moves`; time alone is the slicer's estimate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from cad.interface import zone_clip_radius_mm, zone_radii_mm, zone_volume_mm3
from cad.params import EndcapParams
from fab.slice.excluded import reach_mm
from fab.slice.filaments import Filament
from fab.slice.gcode import Moves
from fab.slice.printers import Printer, printer
from fab.slice.settings import LINE_MM

PIXEL_MM = 0.2
REACH_MM = LINE_MM  # a line that starts this near to plastic sticks to it
BOUNDARY_STEP_MM = 0.2
_SAME_HEIGHT_MM = 0.01  # heights are written to 0.01 mm and less
INSET_MM = LINE_MM / 4  # halfway between the zone's boundary and the middle of a line that runs along it


@dataclass(frozen=True)
class PrintFigures:
    """Figures of one print.

    Attributes:
        time_s: the slicer's estimate, which includes accelerations.
        grams: extruded plastic, brim and support included.
        cost_usd: at the filament's price.
        layers: layers announced.
        empty_layers: gaps in the part's height where nothing of it is printed.
        floating_starts: lines that start with plastic neither below nor beside them.
        extent_mm: side of the box of all extruding moves, x, y and z.
        outside_bed_mm: how far a line reaches over the bed's edge, or into what is excluded of it (0 wanted).
        grams_error: grams against the slicer's own sum, relative.
    """

    time_s: float
    grams: float
    cost_usd: float
    layers: int
    empty_layers: int
    floating_starts: int
    extent_mm: tuple[float, float, float]
    outside_bed_mm: float
    grams_error: float


@dataclass(frozen=True)
class ZoneFigures:
    """Figures of the interlock zone.

    Attributes:
        fraction: plastic in the zone over its volume.
        open_share: share of its inner, outer and top boundary that no line covers.
        side_open_share: the same of its inner and outer boundary alone.
        worst_layer_open: the least of it over inner and outer boundary of one layer.
    """

    fraction: float
    open_share: float
    side_open_share: float
    worst_layer_open: float


def print_figures(moves: Moves, filament: Filament, where: Printer | None = None) -> PrintFigures:
    """Figures of a whole print.

    Args:
        moves: of the print.
        filament: that is extruded.
        where: the printer; by default any with a 256 mm bed.
    """
    where = where or printer()
    printed = moves.printed  # the 0.02 g that fill the nozzle before are none of the slicer's grams
    grams = float(printed.volume_mm3.sum()) * filament.density_g_cm3 / 1000
    ends = np.concatenate([printed.start, printed.end])
    half = float(printed.width_mm.max()) / 2
    low, high = ends.min(axis=0) - half, ends.max(axis=0) + half
    over = high - (where.width_mm, where.depth_mm)
    outside = max(0.0, float(-low.min()), float(over.max()), float(printed.top_mm.max()) - where.height_mm)
    if where.exclude_mm is not None:
        outside = max(outside, reach_mm(printed.start, printed.end, half, where.exclude_mm))
    size = high - low
    return PrintFigures(
        time_s=moves.slicer_time_s,
        grams=grams,
        cost_usd=grams / 1000 * filament.price_usd_kg,
        layers=len(moves.layer_tops_mm),
        empty_layers=empty_layers(moves),
        floating_starts=len(floating_starts(moves)),
        extent_mm=(float(size[0]), float(size[1]), float(printed.top_mm.max())),
        outside_bed_mm=outside,
        grams_error=abs(grams / moves.slicer_grams - 1),
    )


def empty_layers(moves: Moves) -> int:
    """Number of heights at which the part is interrupted: a layer does not begin where the one below ends.

    Layers of support alone lie between the part's own; they are no gaps.
    """
    part = moves.is_part
    tops, first = np.unique(moves.top_mm[part], return_index=True)
    bottoms = tops - moves.height_mm[part][first]
    below = np.concatenate([[0.0], tops[:-1]])
    return int((bottoms > below + PIXEL_MM / 4).sum())


def floating_starts(moves: Moves) -> np.ndarray:
    """Starts of lines with plastic neither just below nor beside them: (n, 3) plate points, mm.

    Below is up to the line's own underside, not the layer before: supports of one part have layers of their own height,
    at which the others on the plate print nothing.
    Infill between walls is left out: it bridges over sparse infill, inside the part. In layers without walls the infill
    is the part, and is included.
    """
    points, move = moves.points(PIXEL_MM)
    layer = moves.layer[move]
    order = np.argsort(layer, kind="stable")
    points, move, layer = points[order], move[order], layer[order]
    bounds = np.searchsorted(layer, np.arange(int(moves.layer.max()) + 2))
    _, first = np.unique(moves.path, return_index=True)
    first = first[moves.is_part[first]]
    walls = np.isin(moves.kind, [index for index, name in enumerate(moves.kinds) if "erimeter" in name])
    has_walls = np.isin(moves.layer[first], np.unique(moves.layer[walls]))
    first = first[walls[first] | ~has_walls]
    size = _limit_px(moves) + 2 * _MARGIN_PX
    tops, found = np.full((size, size), -np.inf), []
    underside = moves.top_mm - moves.height_mm - _SAME_HEIGHT_MM
    for number in range(len(bounds) - 1):
        here, at = points[bounds[number] : bounds[number + 1]], move[bounds[number] : bounds[number + 1]]
        starts = first[moves.layer[first] == number]
        if number and len(starts):
            spots = _pixels(moves.start[starts], size)
            held = np.zeros(len(starts), dtype=bool)
            for dx, dy in _DISC:
                held |= tops[spots[:, 0] + dx, spots[:, 1] + dy] >= underside[starts]
            for start in starts[~held]:
                earlier = here[at < start]
                near = len(earlier) and np.linalg.norm(earlier - moves.start[start], axis=1).min() <= REACH_MM
                if not near:
                    found.append((*moves.start[start], moves.top_mm[start]))
        spots = _pixels(here, size)
        tops[spots[:, 0], spots[:, 1]] = moves.top_mm[at]
    return np.array(found).reshape(-1, 3)


def zone_figures(moves: Moves, params: EndcapParams, where: Printer | None = None) -> ZoneFigures:
    """Figures of the interlock zone of a printed interface that stands on its mating plane.

    Args:
        moves: of the print, the axis on the middle of the bed.
        params: the design.
        where: the printer; by default any with a 256 mm bed.
    """
    middle_mm = np.array((where or printer()).middle_mm)
    above = moves.is_part & (moves.top_mm - moves.height_mm / 2 > params.flange_thickness_mm)
    zone = moves.pick(above)
    fraction = float(zone.volume_mm3.sum()) / zone_volume_mm3(params)
    points, move = zone.points(BOUNDARY_STEP_MM / 2)
    points = points - middle_mm
    layer = zone.layer[move]
    clear, total, worst, side = 0.0, 0.0, 1.0, 1.0
    layers = np.unique(layer)
    for number in layers:
        here = layer == number
        tree, width = cKDTree(points[here]), zone.width_mm[move[here]]
        index = int(np.argmax(zone.layer == number))
        height = float(zone.top_mm[index] - zone.height_mm[index] / 2)
        inner, outer = _zone_section(params, height)
        boundary = [_ring(radius) for radius in (inner + INSET_MM, outer - INSET_MM)]
        for ring in boundary:
            free = _free_share(tree, width, ring)
            length = float(zone.height_mm[index]) * 2 * math.pi * float(np.linalg.norm(ring[0]))
            clear, total, worst = clear + free * length, total + length, min(worst, free)
        side = clear / total
        if number == layers[-1]:
            rings = [_ring(radius) for radius in np.arange(inner + INSET_MM, outer, 2 * INSET_MM)]
            area = math.pi * (outer**2 - inner**2)
            clear, total = clear + _free_share(tree, width, np.concatenate(rings)) * area, total + area
    return ZoneFigures(fraction, clear / total, side, worst)


_MARGIN_PX = 16
_DISC = [
    (dx, dy) for dx in range(-3, 4) for dy in range(-3, 4) if math.hypot(dx, dy) * PIXEL_MM <= REACH_MM + PIXEL_MM / 2
]


def _limit_px(moves: Moves) -> int:
    """The farthest move from the plate's origin, in pixels."""
    return math.ceil(max(float(moves.start.max()), float(moves.end.max()), 0.0) / PIXEL_MM)


def _pixels(points: np.ndarray, size: int) -> np.ndarray:
    """Pixels (n, 2) of plate points in a square picture; what lies beyond it is counted at its edge."""
    return np.clip(np.round(points / PIXEL_MM).astype(int) + _MARGIN_PX, _MARGIN_PX // 2, size - _MARGIN_PX // 2)


def _zone_section(params: EndcapParams, height_mm: float) -> tuple[float, float]:
    """Inner and outer radius of the zone at a height."""
    inner, outer = zone_radii_mm(params)
    offset = height_mm - params.centre_height_mm
    section = [math.sqrt(max(0.0, radius**2 - offset**2)) for radius in (inner, outer)]
    return max(section[0], zone_clip_radius_mm(params)), section[1]


def _ring(radius_mm: float) -> np.ndarray:
    """Points (n, 2) of a circle."""
    angle = np.linspace(0.0, 2 * math.pi, max(8, round(2 * math.pi * radius_mm / BOUNDARY_STEP_MM)), endpoint=False)
    return radius_mm * np.column_stack([np.cos(angle), np.sin(angle)])


def _free_share(tree: cKDTree, width_mm: np.ndarray, places: np.ndarray) -> float:
    """Share of places that no line covers."""
    distance, nearest = tree.query(places)
    return float(np.mean(distance >= width_mm[nearest] / 2))
