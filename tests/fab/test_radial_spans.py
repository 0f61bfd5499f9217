"""What distances from the axis prove to be apart is apart; what touches or may touch is never called so."""

from __future__ import annotations

import manifold3d
import numpy as np
import pytest

from fab.steps.radial_spans import BodySpans, axis_distances_mm

HERE = np.zeros(3)


def _tube(outer: float, inner: float, height: float) -> manifold3d.Manifold:
    whole = manifold3d.Manifold.cylinder(height, outer, circular_segments=180)
    return whole - manifold3d.Manifold.cylinder(height, inner, circular_segments=180)


@pytest.mark.parametrize(("radius", "apart"), [(9.9, True), (9.999, False), (10.5, False)])
def test_a_rod_in_a_tube_is_apart_from_it_as_long_as_it_is_thinner(radius, apart):
    tube = _tube(14.0, 10.0, 20.0)
    rod = manifold3d.Manifold.cylinder(20.0, radius, circular_segments=180)
    assert BodySpans(rod).at(HERE).clear_of(BodySpans(tube).at(HERE)) is apart
    assert BodySpans(tube).at(HERE).clear_of(BodySpans(rod).at(HERE)) is apart


def test_a_body_that_holds_the_axis_fills_it_between_its_ends():
    rod = BodySpans(manifold3d.Manifold.cylinder(40.0, 10.0, circular_segments=90)).at(HERE)
    needle = manifold3d.Manifold.cylinder(10.0, 1.0).translate([2.0, 0.0, 15.0])
    above = manifold3d.Manifold.cylinder(10.0, 1.0).translate([2.0, 0.0, 45.0])
    assert not rod.clear_of(BodySpans(needle).at(HERE))
    assert rod.clear_of(BodySpans(above).at(HERE))


@pytest.mark.parametrize("raised", [5.5, -4.5])
def test_a_body_between_two_slabs_is_in_both(raised):
    thin = manifold3d.Manifold.cylinder(0.4, 5.0)
    moved = BodySpans(thin.translate([0.0, 0.0, 0.3])).at(
        np.array([0.0, 0.0, raised])
    )  # 0.2 mm either side of a border
    border = raised + 0.5
    for low in (border - 0.15, border + 0.05):
        met = manifold3d.Manifold.cylinder(0.1, 5.0).translate([0.0, 0.0, low])
        assert not moved.clear_of(BodySpans(met).at(HERE))


def test_distance_of_the_axis_from_triangles():
    triangles = np.array(
        [
            [[3.0, -5.0], [3.0, 5.0], [9.0, 0.0]],  # nearest on an edge
            [[2.0, 2.0], [5.0, 2.0], [5.0, 5.0]],  # at a corner
            [[-1.0, -1.0], [2.0, -1.0], [0.0, 3.0]],  # round it
            [[0.0, 4.0], [0.0, 4.0], [3.0, 4.0]],  # seen edge on
        ]
    )
    assert axis_distances_mm(triangles) == pytest.approx([3.0, 8**0.5, 0.0, 4.0], abs=1e-12)


@pytest.mark.long
def test_bodies_called_apart_share_nothing():
    rng = np.random.default_rng(3)
    apart = shared = 0
    for _ in range(300):
        bodies, shift = [], rng.uniform(-12.0, 12.0, 3) * rng.integers(0, 2, 3)
        for outer in rng.uniform(4.0, 30.0, 2):
            body = _tube(outer, rng.uniform(0.3, 0.95) * outer, rng.uniform(0.5, 20.0))
            body = body.rotate(rng.uniform(-40.0, 40.0, 3).tolist() if rng.random() < 0.5 else [0.0, 0.0, 0.0])
            bodies.append(body.translate([*rng.uniform(-3.0, 3.0, 2), rng.uniform(-9.0, 9.0)]))
        volume = (bodies[0].translate(shift.tolist()) ^ bodies[1]).volume()
        clear = BodySpans(bodies[0]).at(shift).clear_of(BodySpans(bodies[1]).at(HERE))
        apart, shared = apart + clear, shared + (volume > 0)
        assert not (clear and volume > 0)
    assert apart > 30 and shared > 100  # both kinds were met
