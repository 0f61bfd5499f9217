"""The unit cell against laminates (exact), the bounds of Hashin and Shtrikman, and the gyroid's volume."""

from __future__ import annotations

import numpy as np
import pytest

from cad.materials import silicone
from sensing.simulator.verification.unit_cell import (
    Phase,
    effective,
    gyroid_share,
    hashin_shtrikman,
    mean_stress,
    voxels,
)

LAW = silicone().neo_hooke()
SOFT, STIFF = Phase(LAW.bulk_mpa, LAW.shear_mpa), Phase.of(26.0, 0.48)
UNITS = dict(zip(("11", "22", "33", "23", "13", "12"), np.eye(6), strict=True))


def test_a_laminate_is_exact():
    """Layers across axis 1: stretch and shear across add compliances, shear along adds stiffnesses (Backus 1962)."""
    share = np.zeros((9, 9, 9))
    share[:2] = 1.0
    cell, part = voxels(share, SOFT, STIFF), 2 / 9

    def series(soft: float, stiff: float) -> float:
        return 1 / ((1 - part) / soft + part / stiff)

    confined = series(*(float(phase.bulk_mpa) + 4 / 3 * float(phase.shear_mpa) for phase in (SOFT, STIFF)))
    across = series(float(SOFT.shear_mpa), float(STIFF.shear_mpa))
    along = (1 - part) * float(SOFT.shear_mpa) + part * float(STIFF.shear_mpa)
    for name, row, wanted in (("11", 0, confined), ("12", 5, 2 * across), ("13", 4, 2 * across), ("23", 3, 2 * along)):
        assert mean_stress(cell, UNITS[name])[0][row] == pytest.approx(wanted, rel=1e-6)


def test_one_material_is_itself_though_nearly_incompressible():
    found = effective(voxels(np.zeros((5, 5, 5)), SOFT, STIFF))
    assert (found.bulk_mpa, found.shear_mpa) == pytest.approx((LAW.bulk_mpa, LAW.shear_mpa), rel=1e-9)
    assert found.young_mpa == pytest.approx(LAW.young_mpa, rel=1e-9)


def test_the_gyroid_fills_what_is_asked_and_lies_between_the_bounds():
    share = gyroid_share(27, 0.3)
    assert share.mean() == pytest.approx(0.3, abs=1e-4)
    low, high = hashin_shtrikman(0.3, SOFT, STIFF)
    soft, stiff = (effective(voxels(share, SOFT, STIFF, series)) for series in (True, False))
    for name in ("bulk_mpa", "shear_mpa"):
        assert getattr(low, name) < getattr(stiff, name)
        assert getattr(soft, name) < getattr(stiff, name)
    assert low.shear_mpa < soft.shear_mpa and stiff.shear_mpa < high.shear_mpa
    assert stiff.anisotropy == pytest.approx(1.0, abs=0.1)


def test_both_ways_of_sharing_a_voxel_meet_as_voxels_get_smaller():
    def apart(count: int) -> float:
        share = gyroid_share(count, 0.3)
        soft, stiff = (effective(voxels(share, SOFT, STIFF, series)).young_mpa for series in (True, False))
        return stiff / soft - 1

    assert apart(33) < 0.62 * apart(15)
