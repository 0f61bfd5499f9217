"""The nearest other point, against SciPy's search tree."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from sensing.tracking import nearest
from sensing.tracking.nearest import nearest_other


@pytest.mark.parametrize("count", [2, 3, 92, 700])
def test_agrees_with_a_search_tree(count, monkeypatch):
    points = np.random.default_rng(count).uniform(0, 640, (count, 2))
    monkeypatch.setattr(nearest, "ROWS", 100)
    distance, other = nearest_other(points)
    tree_distance, tree_other = cKDTree(points).query(points, k=2)
    np.testing.assert_array_equal(other, tree_other[:, 1])
    np.testing.assert_allclose(distance, tree_distance[:, 1], rtol=1e-15)


def test_of_coincident_points_each_has_the_other():
    distance, other = nearest_other(np.array([[1.0, 2.0], [5.0, 5.0], [1.0, 2.0]]))
    assert distance[[0, 2]].tolist() == [0.0, 0.0]
    assert other[[0, 2]].tolist() == [2, 0]
