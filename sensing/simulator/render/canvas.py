"""The texture that the paint is laid on: the disc of :mod:`sensing.simulator.render.mesh` (mm, endcap frame)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cad.params import EndcapParams
from sensing.simulator.render.mesh import rim_polar, sphere_points

Array = NDArray[np.float64]
Floats = NDArray[np.float32]


class Patch(NamedTuple):
    """A window of the texture round a point, with tangent coordinates of its texels.

    Attributes:
        window: (h, w, 4) view of the texture.
        away_mm: (h, w) coordinates away from the tip.
        around_mm: (h, w) coordinates round the axis.
        texel_mm: size of a texel.
    """

    window: Floats
    away_mm: Array
    around_mm: Array
    texel_mm: float


@dataclass(frozen=True)
class Canvas:
    """A texture and the positions of its texels on the sphere.

    Attributes:
        texture: (n, n, 4) float32 reflectance blue, green, red and ink.
        points: (n, n, 3) positions of the texels on the sphere, mm.
        extent: disc coordinate of the texture's edge.
        centre: (3,) centre of the sphere, mm.
        radius: radius of the sphere, mm.
    """

    texture: Floats
    points: Floats
    extent: float
    centre: Array
    radius: float

    @classmethod
    def blank(cls, params: EndcapParams, texels: int) -> Canvas:
        """A canvas without paint."""
        extent = rim_polar(params) * 1.02
        axis = ((np.arange(texels) + 0.5) / texels * 2 - 1) * extent
        disc = np.stack(np.meshgrid(axis, axis), -1)
        centre = np.array([0, 0, params.centre_height_mm])
        points = sphere_points(params, disc).astype(np.float32)
        return cls(np.zeros((texels, texels, 4), np.float32), points, extent, centre, params.inner_radius_mm)

    def frame(self, at: Array) -> tuple[Array, Array]:
        """Unit tangents at a point: away from the tip, and round the axis."""
        unit = (at - self.centre) / self.radius
        around = np.array([-unit[1], unit[0], 0.0])
        length = np.linalg.norm(around)
        around = np.array([0, 1.0, 0]) if length < 1e-9 else around / length
        return np.cross(around, unit), around

    def shifted(self, at: Array, shift_mm: Array) -> Array:
        """A point moved along the sphere by a shift (away from the tip, round the axis), mm."""
        away, around = self.frame(at)
        moved = at - self.centre + shift_mm[0] * away + shift_mm[1] * around
        return self.centre + moved / np.linalg.norm(moved) * self.radius

    def patch(self, at: Array, reach_mm: float) -> Patch:
        """The patch that reaches a distance round a point (3,), mm."""
        n = len(self.texture)
        unit = (at - self.centre) / self.radius
        polar = np.arccos(np.clip(unit[2], -1, 1))
        azimuth = np.arctan2(unit[1], unit[0])
        texel = 2 * self.extent * self.radius / n
        column, row = ((polar * f(azimuth) / self.extent + 1) * n / 2 - 0.5 for f in (np.cos, np.sin))
        half = int(np.ceil(reach_mm / texel * max(1.0, polar / max(np.sin(polar), 0.3)))) + 1
        rows = slice(max(0, int(row) - half), max(0, int(row) + half + 2))
        columns = slice(max(0, int(column) - half), max(0, int(column) + half + 2))
        offset = self.points[rows, columns] - at
        away, around = self.frame(at)
        return Patch(self.texture[rows, columns], offset @ away, offset @ around, texel)


def mix(window: Floats, color: ArrayLike, cover: ArrayLike, glossy: ArrayLike) -> None:
    """Lay a colour over a texture window by coverage.

    Args:
        window: (h, w, 4) part of the texture, changed in place.
        color: blue, green, red reflectance, (3,) or (h, w, 3).
        cover: coverage 0..1 (h, w).
        glossy: share of the colour that reflects like ink, a number or (h, w).
    """
    cover = np.asarray(cover)[..., None]
    window[..., :3] += cover * (np.asarray(color) - window[..., :3])
    window[..., 3:] += cover * (np.broadcast_to(np.asarray(glossy), cover.shape[:2])[..., None] - window[..., 3:])
