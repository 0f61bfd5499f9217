"""Grid that fits the gyroid zone: azimuth about the axis, height, fraction of the radial width (endcap frame, mm).

The grid ends where the zone ends, so that a surface sampled on it need not be cut. Below the zone an additional layer,
the skirt, overlaps the flange so that the sheet fuses with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cad.interface import vent_reach_mm, zone_clip_radius_mm, zone_radii_mm
from cad.params import EndcapParams

SKIRT_MM = 0.3  # E: overlap of the sheet with the flange, one and a half printed layers
VENT_MARGIN_MM = 0.1  # E: distance of the sheet's foot from the notches of the vents, which it must not cover
FOOT_MM = 0.05  # height of the lowest layer of nodes of the zone above the flange's plane


@dataclass(frozen=True)
class ZoneGrid:
    """Nodes of the zone.

    Attributes:
        step_mm: nominal distance of neighbours, mm.
        turn: number of azimuths about the axis.
        heights: (h,) heights above the mating plane, mm.
        inner: (h,) cylindrical radius at the inner side, mm.
        width: (h,) radial width, mm.
        shares: number of nodes across the width.
    """

    step_mm: float
    turn: int
    heights: np.ndarray
    inner: np.ndarray
    width: np.ndarray
    shares: int

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of nodes in azimuth, height and width; the last azimuth repeats the first."""
        return (self.turn + 1, len(self.heights), self.shares)

    def at(self, numbers: np.ndarray) -> np.ndarray:
        """Points (n, 3), mm, at fractional node numbers (n, 3)."""
        nodes = np.arange(len(self.heights))
        height, inner, width = (np.interp(numbers[:, 1], nodes, row) for row in (self.heights, self.inner, self.width))
        radius = inner + width * numbers[:, 2] / (self.shares - 1)
        angle = (numbers[:, 0] % self.turn) * (2 * math.pi / self.turn)
        return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])

    def points(self) -> np.ndarray:
        """All nodes without the repeated azimuth: (turn, h, shares, 3) float32, mm."""
        radii = self.inner[:, None] + self.width[:, None] * np.linspace(0, 1, self.shares)
        angle = 2 * math.pi * np.arange(self.turn) / self.turn
        nodes = np.empty((self.turn, *radii.shape, 3), dtype=np.float32)
        nodes[..., 0] = np.cos(angle)[:, None, None] * radii
        nodes[..., 1] = np.sin(angle)[:, None, None] * radii
        nodes[..., 2] = self.heights[:, None]
        return nodes


def zone_grid(params: EndcapParams, step_mm: float) -> ZoneGrid:
    """Grid of the zone and its skirt with at most about one step between neighbours."""
    floor, top = params.flange_thickness_mm, params.interlock_top_mm
    rows = np.linspace(floor + FOOT_MM, top, math.ceil((top - floor) / step_mm) + 1)
    radii = zone_radii_mm(params)
    inner, outer = (np.sqrt(radius**2 - (rows - params.centre_height_mm) ** 2) for radius in radii)
    inner = np.maximum(inner, zone_clip_radius_mm(params))
    heights = np.concatenate([[floor - SKIRT_MM], rows])
    inner = np.concatenate([inner[:1] + SKIRT_MM, inner])
    outer = np.concatenate([outer[:1], outer])
    # Skirt and lowest row end before the notches, so that the sheet meets the flange only in its flat top.
    reach = [vent_reach_mm(params, height) - VENT_MARGIN_MM for height in heights[:2]]
    outer[:2] = np.minimum(outer[:2], reach)
    shares = math.ceil(float((outer - inner).max()) / step_mm) + 1
    turn = math.ceil(2 * math.pi * float(outer.max()) / step_mm)
    return ZoneGrid(step_mm, turn, heights, inner, outer - inner, shares)
