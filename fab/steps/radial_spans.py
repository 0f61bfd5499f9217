"""Radial extent of bodies at each height; bodies whose extents are disjoint share no volume.

A boolean of two bodies, one of which encloses the other at a distance, takes as long as one of two touching bodies.
Most pairs of the mold are of this kind: core and cup, or cup and cast once they are some millimetres apart. Slabs of
height :data:`SLAB_MM` normal to the axis of the endcap frame prove cheaply that they are disjoint. Millimetres.

In a slab, a body lies between the least and the largest distance of its facets from the axis, unless it contains the
axis itself. It can contain the axis only between the lowest and the highest facet that the axis crosses, and its least
distance is taken as 0 there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import manifold3d
import numpy as np

SLAB_MM = 1.0  # height of a slab
ROUNDING_MM = 1e-3  # well above the rounding of float32 coordinates and of their rotation at 250 mm


@dataclass(frozen=True)
class RadialSpans:
    """Range of distances from the axis of a body, slab by slab.

    Attributes:
        first: number of the lowest slab; slab k reaches from ``k * SLAB_MM`` to the next.
        near: (n,) least distance in each slab, mm; infinite where the body is absent.
        far: (n,) largest distance in each slab, mm; minus infinite where the body is absent.
    """

    first: int
    near: np.ndarray
    far: np.ndarray

    def raised(self, height_mm: float) -> RadialSpans:
        """Spans that enclose the body after a move along the axis, by which a slab may cover parts of two slabs, mm."""
        whole = math.floor(height_mm / SLAB_MM)
        near = np.minimum(np.append(self.near, np.inf), np.append(np.inf, self.near))
        far = np.maximum(np.append(self.far, -np.inf), np.append(-np.inf, self.far))
        return RadialSpans(self.first + whole, near, far)

    def clear_of(self, other: RadialSpans) -> bool:
        """Whether the spans prove that two bodies share no volume."""
        start = max(self.first, other.first)
        end = min(self.first + len(self.near), other.first + len(other.near))
        if end <= start:
            return True
        mine, theirs = slice(start - self.first, end - self.first), slice(start - other.first, end - other.first)
        inside = self.far[mine] + ROUNDING_MM < other.near[theirs]
        outside = other.far[theirs] + ROUNDING_MM < self.near[mine]
        return bool((inside | outside).all())


class BodySpans:
    """Spans of one body in place and after shifts normal to the axis, each made once.

    Args:
        body: closed body, endcap frame, mm.
    """

    def __init__(self, body: manifold3d.Manifold) -> None:
        self._body = body
        self._corners: np.ndarray | None = None
        self._found: dict[tuple[float, float], RadialSpans] = {}

    def at(self, shift: np.ndarray) -> RadialSpans:
        """Spans of the body moved by a shift (3,), mm."""
        across = (float(shift[0]), float(shift[1]))
        if across not in self._found:
            if self._corners is None:
                mesh = self._body.to_mesh()
                points = np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3]
                self._corners = points[np.asarray(mesh.tri_verts)]
            self._found[across] = radial_spans(self._corners + np.array([*across, 0.0]))
        spans = self._found[across]
        return spans.raised(float(shift[2])) if shift[2] else spans


def radial_spans(corners: np.ndarray) -> RadialSpans:
    """Spans of a closed body.

    Args:
        corners: (n, 3, 3) of its facets, mm; the axis is x = y = 0.
    """
    if len(corners) == 0:
        return RadialSpans(0, np.empty(0), np.empty(0))
    flat, heights = corners[:, :, :2], corners[:, :, 2]
    far = np.hypot(flat[..., 0], flat[..., 1]).max(axis=1)
    near = axis_distances_mm(flat)
    low = np.floor((heights.min(axis=1) - ROUNDING_MM) / SLAB_MM).astype(np.int64)
    high = np.floor((heights.max(axis=1) + ROUNDING_MM) / SLAB_MM).astype(np.int64)
    first, counts = int(low.min()), high - low + 1
    facet = np.repeat(np.arange(len(corners)), counts)
    slab = low[facet] - first + np.arange(len(facet)) - np.repeat(np.cumsum(counts) - counts, counts)
    least, largest = (np.full(int(high.max()) - first + 1, fill) for fill in (np.inf, -np.inf))
    np.minimum.at(least, slab, near[facet])
    np.maximum.at(largest, slab, far[facet])
    crossed = near <= ROUNDING_MM
    if crossed.any():
        least[low[crossed].min() - first : high[crossed].max() - first + 1] = 0.0
    return RadialSpans(first, least, largest)


def axis_distances_mm(triangles: np.ndarray) -> np.ndarray:
    """Distances (n,) of the origin from plane triangles (n, 3, 2), mm; 0 inside a triangle."""
    starts, ends = triangles, np.roll(triangles, -1, axis=1)
    edges = ends - starts
    squared = np.einsum("nij,nij->ni", edges, edges)
    along = -np.einsum("nij,nij->ni", starts, edges) / np.where(squared > 0, squared, 1.0)
    nearest = starts + np.clip(along, 0.0, 1.0)[..., None] * edges
    distances = np.hypot(nearest[..., 0], nearest[..., 1]).min(axis=1)
    sides = starts[..., 0] * ends[..., 1] - starts[..., 1] * ends[..., 0]  # sign: side of the origin
    inside = (sides > 0).all(axis=1) | (sides < 0).all(axis=1)
    return np.where(inside, 0.0, distances)
