"""Products of single 3-vectors against numpy's."""

from __future__ import annotations

import numpy as np

from sensing.tensegrity.vectors import cross, minus_cross


def test_products_have_the_bits_of_numpy():
    rng = np.random.default_rng(3)
    for scale in (1e-12, 1.0, 1e9):
        a, b = scale * rng.normal(size=3), rng.normal(size=3)
        assert cross(a, b).tobytes() == np.cross(a, b).tobytes()
        assert np.allclose(minus_cross(a) @ b, np.cross(b, a), rtol=1e-12, atol=0)
    assert cross(np.array([1.0, 0, 0]), [0.0, 1.0, 0.0]).tolist() == [0.0, 0.0, 1.0]
