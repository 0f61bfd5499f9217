"""Air under the flat flange: the closed form against a grid, and what fewer vents would hold."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.checks.cavity import FLANGE_AIR_MM3, flange_air_check, flange_air_mm3


def trapped_by_grid(outer: float, vents: int, vent: float, tilt_deg: float, step: float = 0.05) -> float:
    """Volume above the highest point of any vent's mouth, on a grid: mouths are arcs of the edge."""
    ticks = np.arange(-outer, outer, step) + step / 2
    x, y = np.meshgrid(ticks, ticks)
    half_mouth = vent / (2 * outer)
    middles = (np.arange(vents) + 0.5) * 2 * math.pi / vents
    arcs = np.concatenate([np.linspace(a - half_mouth, a + half_mouth, 2001) for a in middles])
    level = (outer * np.cos(arcs)).max()
    height = np.where(np.hypot(x, y) < outer, x - level, 0.0)
    return float(np.maximum(height, 0.0).sum() * step**2 * math.tan(math.radians(tilt_deg)))


@pytest.mark.parametrize(("outer", "vents"), [(56.2, 10), (103.5, 10), (56.2, 5)])
def test_the_closed_form_is_the_volume_of_a_grid(outer, vents):
    assert flange_air_mm3(outer, vents, 3.0, 1.0) == pytest.approx(trapped_by_grid(outer, vents, 3.0, 1.0), rel=2e-3)


@pytest.mark.parametrize("size", [(98.86, 6.5), (130.0, 8.0), (250.0, 25.0)])
def test_ten_vents_are_enough_at_every_size_and_five_are_not(size, monkeypatch):
    layout = MoldLayout(EndcapParams(*size))
    assert flange_air_check(layout).ok
    monkeypatch.setattr("fab.checks.cavity.vent_azimuths_deg", lambda: (0.0, 90.0, 180.0, 270.0))
    assert flange_air_check(layout).value > 3 * FLANGE_AIR_MM3
