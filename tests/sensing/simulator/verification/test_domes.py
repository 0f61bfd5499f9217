"""Reissner's domes of the report stand on meshes that are fine enough."""

from __future__ import annotations

from dataclasses import replace

import pytest
from long_cases import others_long

from sensing.simulator.solid.mesh import MeshDensity
from sensing.simulator.verification.contact import DOMES, reissner_ratio


@pytest.mark.parametrize(("wall_mm", "density"), others_long(DOMES, unpack=True))
def test_another_layer_changes_the_ratio_by_under_two_percent(wall_mm: float, density: MeshDensity) -> None:
    finer = replace(density, layers=density.layers + 1)
    assert reissner_ratio(wall_mm, finer) == pytest.approx(reissner_ratio(wall_mm, density), rel=0.02)


@pytest.mark.long
@pytest.mark.parametrize(("wall_mm", "density"), DOMES)
def test_smaller_elements_change_the_ratio_by_under_two_percent(wall_mm: float, density: MeshDensity) -> None:
    finer = replace(density, core=density.core + 6, rings=density.rings + 6)
    assert reissner_ratio(wall_mm, finer) == pytest.approx(reissner_ratio(wall_mm, density), rel=0.02)
