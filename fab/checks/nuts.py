"""Checks of the captured nuts, measured by rays on the interface's mesh (endcap frame, mm).

A DIN 562 nut must be insertable from the bore, stay in place, not turn with the screw, and not be pulled through the
floor.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import manifold3d
import numpy as np
import trimesh

from cad.bought import bought_mm
from cad.interface import POCKET_FLOOR_MM, POCKET_HEIGHT_MM
from cad.params import EndcapParams
from fab.checks.check import Check
from fab.meshing.mesh import to_manifold

FLOOR_MIN_MM = 2.0  # E: sheared area 4 x 5.5 x 2.0 = 44 mm2; at 15 MPa that is 660 N, twice a hand-tight M3
ROOF_MIN_MM = 0.6  # E: three printed layers between screw tip and silicone
TURN_MAX_DEG = 5.0  # E: largest play of rotation of the nut
SQUEEZE_MAX_MM = 0.3  # E: interference that the TPU yields to an inserted nut
SEAT_MAX_MM = 0.25  # E: offset at which a 3 mm screw in a 3.4 mm hole still enters the thread
_FAR = 100.0  # mm, beyond the interface


def nut_checks(params: EndcapParams, mesh: trimesh.Trimesh) -> list[Check]:
    """Checks of the worst value of the ten nuts in each respect.

    Args:
        params: design of the endcap.
        mesh: mesh of the whole interface, mm.
    """
    body = to_manifold(mesh)
    pockets = [NutPocket(params, body, azimuth) for azimuth in params.screw_azimuths_deg]
    return [
        Check("nut.pull_through_mm", min(pocket.floor_mm() for pocket in pockets), low=FLOOR_MIN_MM),
        Check("nut.roof_mm", min(pocket.roof_mm() for pocket in pockets), low=ROOF_MIN_MM),
        Check("nut.turn_deg", max(pocket.turn_deg() for pocket in pockets), high=TURN_MAX_DEG),
        Check("nut.squeeze_mm", max(pocket.squeeze_mm() for pocket in pockets), high=SQUEEZE_MAX_MM),
        Check("nut.seat_play_mm", max(pocket.seat_play_mm() for pocket in pockets), 0.0, SEAT_MAX_MM),
    ]


class NutPocket:
    """One pocket in the frame of its screw's axis: x outward along the radius, y along the circle, z up.

    Args:
        params: design of the endcap.
        body: part with the pocket, endcap frame, mm.
        azimuth_deg: azimuth of the screw, degrees.
    """

    def __init__(self, params: EndcapParams, body: manifold3d.Manifold, azimuth_deg: float) -> None:
        self._params = params
        self._body = body
        angle = math.radians(azimuth_deg)
        self._axes = np.array(
            [[math.cos(angle), math.sin(angle), 0], [-math.sin(angle), math.cos(angle), 0], [0, 0, 1]]
        )
        self._half = bought_mm("nut_m3", "across_flats") / 2
        self._thickness = bought_mm("nut_m3", "thickness")
        self._middle = POCKET_FLOOR_MM + POCKET_HEIGHT_MM / 2

    def floor_mm(self) -> float:
        """Least thickness of TPU under the nut's bearing face, outside the screw hole."""
        ring = (bought_mm("screw_m3", "clearance_hole") / 2 + self._half) / 2
        angles = np.radians(np.arange(0, 360, 30))
        return min(self._first_wall(ring * math.cos(a), ring * math.sin(a), -1.0) for a in angles)

    def roof_mm(self) -> float:
        """Thickness of TPU between the screw's tip and the silicone."""
        return self._first_wall(0.0, 0.0, -1.0)

    def turn_deg(self) -> float:
        """Angle t of rotation until two of the nut's corners touch: a (sin t + cos t) = width; 45 where it is free."""
        width = max(self._width(x) for x in self._stations(-self._half, self._half))
        ratio = width / (2 * self._half * math.sqrt(2))
        return 45.0 if ratio >= 1 else max(0.0, math.degrees(math.asin(ratio)) - 45.0)

    def squeeze_mm(self) -> float:
        """Largest interference of width or height on the nut's path from the bore to its seat."""
        mouth = self._params.bore_radius_mm - self._params.screw_circle_radius_mm + 0.15
        stations = self._stations(mouth, self._half)
        narrow = 2 * self._half - min(self._width(x) for x in stations)
        low = self._thickness - min(self._height(x, y) for x in stations for y in (-0.9 * self._half, 0.9 * self._half))
        return max(0.0, narrow, low)

    def seat_play_mm(self) -> float:
        """Largest radial offset of the seated nut from its screw's axis; negative where the seat is too short."""
        outward = self._reach((0, 0, self._middle), (1, 0, 0)) - self._half
        inward = self._reach((0, 0, POCKET_FLOOR_MM + 0.1), (-1, 0, 0)) - self._half
        return max(outward, inward) if min(outward, inward) >= 0 else min(outward, inward)

    def _stations(self, start: float, end: float) -> Iterable[float]:
        return [float(x) for x in np.linspace(start + 0.02, end - 0.02, 12)]

    def _width(self, x: float) -> float:
        return sum(self._reach((x, 0, self._middle), (0, side, 0)) for side in (-1, 1))

    def _height(self, x: float, y: float) -> float:
        return sum(self._reach((x, y, self._middle), (0, 0, side)) for side in (-1, 1))

    def _point(self, place: tuple[float, float, float]) -> np.ndarray:
        local = np.add(place, (self._params.screw_circle_radius_mm, 0.0, 0.0))
        return local @ self._axes

    def _hits(
        self, place: tuple[float, float, float], direction: tuple[float, float, float]
    ) -> list[tuple[float, bool]]:
        """Intersections of a ray with the part: distance, mm, and whether the ray enters TPU there."""
        start, way = self._point(place), np.array(direction, dtype=float) @ self._axes
        hits = self._body.ray_cast(start.tolist(), (start + _FAR * way).tolist())
        return [
            (float(way @ (np.asarray(hit.position) - start)), float(way @ np.asarray(hit.normal)) < 0) for hit in hits
        ]

    def _reach(self, place: tuple[float, float, float], direction: tuple[float, float, float]) -> float:
        """Distance to the first wall, mm; 0 where the start lies in TPU."""
        hits = self._hits(place, direction)
        if not hits:
            return _FAR
        return hits[0][0] if hits[0][1] else 0.0

    def _first_wall(self, x: float, y: float, start: float) -> float:
        """Thickness of the first wall above ``start``, counted up to the flange's top, mm."""
        heights = [start + way for way, _ in self._hits((x, y, start), (0, 0, 1))]
        if len(heights) < 2:
            return 0.0
        return max(0.0, min(heights[1], self._params.flange_thickness_mm) - heights[0])
