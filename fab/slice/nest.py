"""Greedy nesting of parts on plates: outlines as pixels, largest part first, lowest free place.

Millimetres. The outline of a part is its shadow on the bed, holes and hollows included, widened by brim and gap, so a
small part may lie inside a ring or in the hollow of an arc. The same parts give the same plates.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from PIL import Image, ImageDraw
from scipy.ndimage import binary_dilation
from scipy.signal import fftconvolve

from fab.meshing.mesh import to_manifold
from fab.slice.printers import Printer, fitting_turn_deg, turned

PIXEL_MM = 1.0
GAP_MM = 3.0  # between two parts, brims included
EDGE_MM = 2.0  # from a brim to the edge of the bed, and to what the printer excludes of it
_EDGE_MM = EDGE_MM - GAP_MM / 2  # distance of a widened outline from the edge
TURN_STEP_DEG = 15.0


@dataclass(frozen=True)
class Place:
    """Pose of a part on its plate.

    Attributes:
        name: of the part.
        turn_deg: about the vertical, from its printing pose.
        place_mm: of its pose's origin, from the middle of the bed.
    """

    name: str
    turn_deg: float
    place_mm: tuple[float, float]


@dataclass(frozen=True)
class Standing:
    """A part in its printing pose.

    Attributes:
        mesh: closed mesh, anywhere over the bed.
        brim_mm: width of its brim.
        seam: (n,) code of each triangle, where walls may begin and end; ``None``: anywhere.
    """

    mesh: trimesh.Trimesh
    brim_mm: float
    seam: np.ndarray | None = None


def nested(parts: Mapping[str, Standing], where: Printer) -> list[list[Place]]:
    """Plates, each with its parts.

    Args:
        parts: by name; every one of them fits the bed.
        where: the printer.
    """
    shadows = {name: shadow(part.mesh) for name, part in parts.items()}
    order = sorted(parts, key=lambda name: (-_area(shadows[name]), name))
    plates: list[tuple[np.ndarray, list[Place]]] = []
    for name in order:
        brim = parts[name].brim_mm
        for taken, places in plates:
            found = _first_place(shadows[name], brim, taken)
            if found is not None:
                places.append(_put(name, found, shadows[name], brim, taken))
                break
        else:
            taken = _empty_bed(where)
            found = _first_place(shadows[name], brim, taken) or _alone(shadows[name], where)
            plates.append((taken, [_put(name, found, shadows[name], brim, taken)]))
    return [[_centred(place, where) for place in places] for _, places in plates]


def _empty_bed(where: Printer) -> np.ndarray:
    """Pixels of a bed, row along y: taken is what the printer excludes, with as much room round it as at the edges."""
    taken = np.zeros((round(where.depth_mm / PIXEL_MM), round(where.width_mm / PIXEL_MM)), dtype=bool)
    if where.exclude_mm is not None:
        low, high = np.array(where.exclude_mm[:2]) - _EDGE_MM, np.array(where.exclude_mm[2:]) + _EDGE_MM
        left, bottom = np.maximum(np.floor(low / PIXEL_MM), 0).astype(int)
        right, top = np.ceil(high / PIXEL_MM).astype(int)
        taken[bottom:top, left:right] = True
    return taken


def shadow(mesh: trimesh.Trimesh) -> list[np.ndarray]:
    """Outlines (n, 2) of a part seen from above, outer ones counter-clockwise, holes clockwise."""
    return [np.asarray(ring) for ring in to_manifold(mesh).project().to_polygons() if abs(_signed_area(ring)) > 0.5]


def _signed_area(ring: np.ndarray) -> float:
    x, y = np.asarray(ring).T
    return 0.5 * float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))


def _area(rings: Sequence[np.ndarray]) -> float:
    return sum(_signed_area(ring) for ring in rings)


def _turned_mask(rings: Sequence[np.ndarray], degrees: float, widen_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Pixels of a turned and widened shadow, row along y, and the place (mm) of their corner."""
    rings = [turned(ring, degrees) for ring in rings]
    border = math.ceil(widen_mm / PIXEL_MM) + 1
    low = np.floor(np.min([ring.min(axis=0) for ring in rings], axis=0) / PIXEL_MM) - border
    high = np.ceil(np.max([ring.max(axis=0) for ring in rings], axis=0) / PIXEL_MM) + border
    width, height = (high - low).astype(int)
    picture = Image.new("1", (int(width), int(height)))
    pen = ImageDraw.Draw(picture)
    for ring in sorted(rings, key=lambda r: -abs(_signed_area(r))):
        points = [(float(x), float(y)) for x, y in ring / PIXEL_MM - low]
        pen.polygon(points, fill=int(_signed_area(ring) > 0), outline=1)
    radius = widen_mm / PIXEL_MM
    reach = np.arange(-math.ceil(radius), math.ceil(radius) + 1)
    disc = reach[:, None] ** 2 + reach[None, :] ** 2 <= radius**2
    return binary_dilation(np.asarray(picture), disc), low * PIXEL_MM


def _first_place(rings: Sequence[np.ndarray], brim_mm: float, taken: np.ndarray) -> tuple[float, float, float] | None:
    """(turn, x, y) of the lowest free place over all turns; ``None`` where there is none."""
    best: tuple[float, tuple[float, float, float]] | None = None
    for degrees in np.arange(0.0, 360.0, TURN_STEP_DEG):
        mask, low = _turned_mask(rings, degrees, brim_mm + GAP_MM / 2)
        rows, columns = _trimmed(mask)
        mask, low = mask[rows, columns], low + PIXEL_MM * np.array([columns.start, rows.start])
        edge = math.ceil(_EDGE_MM / PIXEL_MM)
        if mask.shape[0] + 2 * edge > taken.shape[0] or mask.shape[1] + 2 * edge > taken.shape[1]:
            continue
        hits = fftconvolve(taken.astype(np.float32), mask[::-1, ::-1].astype(np.float32), mode="valid")
        free = hits < 0.5
        free[:edge], free[:, :edge] = False, False
        free[free.shape[0] - edge :], free[:, free.shape[1] - edge :] = False, False
        spots = np.argwhere(free)
        if not len(spots):
            continue
        tops = spots[:, 0] + mask.shape[0] + 1e-3 * (spots[:, 1] + mask.shape[1])
        row, column = spots[int(np.argmin(tops))]
        if best is None or tops.min() < best[0] - 1e-9:
            x, y = PIXEL_MM * column - low[0], PIXEL_MM * row - low[1]
            best = (float(tops.min()), (float(degrees), float(x), float(y)))
    return best[1] if best else None


def _alone(rings: Sequence[np.ndarray], where: Printer) -> tuple[float, float, float]:
    """(turn, x, y) of a part in the middle of a bed that just takes it."""
    points = np.concatenate(rings)
    flat = np.column_stack([points, np.zeros(len(points))])
    degrees = fitting_turn_deg(flat, where) or 0.0
    spun = turned(points, degrees)
    x, y = np.array(where.middle_mm) - (spun.min(axis=0) + spun.max(axis=0)) / 2
    return degrees, float(x), float(y)


def _put(
    name: str, found: tuple[float, float, float], rings: Sequence[np.ndarray], brim_mm: float, taken: np.ndarray
) -> Place:
    """Mark the pixels of a part as taken, and return its place."""
    degrees, x, y = found
    mask, low = _turned_mask(rings, degrees, brim_mm + GAP_MM / 2)
    left, bottom = (round(float(v)) for v in (low + np.array([x, y])) / PIXEL_MM)
    for row, column in np.argwhere(mask):
        if 0 <= row + bottom < taken.shape[0] and 0 <= column + left < taken.shape[1]:
            taken[row + bottom, column + left] = True
    return Place(name, degrees, (x, y))


def _trimmed(mask: np.ndarray) -> tuple[slice, slice]:
    """Ranges of rows and columns that contain a pixel of the part."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def _centred(place: Place, where: Printer) -> Place:
    """Place relative to the middle of the bed."""
    x, y = where.middle_mm
    return Place(place.name, place.turn_deg, (place.place_mm[0] - x, place.place_mm[1] - y))
