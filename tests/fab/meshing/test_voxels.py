"""Distances of voxels against SciPy's exact transform."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from fab.meshing.voxels import within


@pytest.mark.parametrize("radius", [1.0, 2.5, 4.417, 10.0, 14.9])
def test_voxels_within_a_radius_are_those_of_the_exact_transform(radius):
    solid = np.random.default_rng(0).random((41, 30, 22)) < 0.003
    assert np.array_equal(within(solid, radius), distance_transform_edt(~solid) < radius)
