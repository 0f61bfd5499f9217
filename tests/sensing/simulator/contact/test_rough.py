"""Rough ground: its distance against a search over the surface, its derivatives against differences, a press on it."""

import math

import numpy as np
import pytest

from cad.materials import silicone
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.contact.kernels import _distance
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Target
from sensing.simulator.scene import Scene
from sensing.simulator.solid.geometry import shell_geometry

R = 11.0
GEOMETRY = shell_geometry(130, 8)
INDENTER = Indenter(25.0, "rough", R, 30.0)
BODY = INDENTER.body(GEOMETRY)
N, E = np.array(BODY.axis), np.array(BODY.along)
C = np.cross(N, E)
CREST = np.array(BODY.point_mm)


def surface(s, t):
    """Points of the ground."""
    height = R / math.pi**2 * (np.cos(math.pi * s / R) + np.cos(math.pi * t / R) - 2)
    return CREST + s[..., None] * E + t[..., None] * C + height[..., None] * N


def distance(y):
    gradient, hessian = np.zeros(3), np.zeros((3, 3))
    return _distance(BODY, np.asarray(y, float), gradient, hessian), gradient, hessian


def test_crests_touch_first_and_have_the_stated_radius():
    value, gradient, hessian = distance(CREST)
    assert value == 0.0 and np.allclose(gradient, N)
    assert np.sort(np.linalg.eigvalsh(hessian)) == pytest.approx([0.0, 1 / R, 1 / R], abs=1e-12)
    for step in (E, C):  # the next crests, and the hollow between
        assert distance(CREST + 2 * R * step)[0] == pytest.approx(0.0, abs=1e-9)
        assert distance(CREST + R * step)[0] > 0.15 * R
    out = np.random.default_rng(0).normal(size=(500, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    dome = np.array(GEOMETRY.centre_mm) + GEOMETRY.outer_radius_mm * out
    assert min(distance(point)[0] for point in dome) > 0.0


def test_the_distance_is_that_to_the_nearest_point_and_has_these_derivatives():
    rng, step = np.random.default_rng(1), 1e-5
    grid = np.linspace(-0.8, 0.8, 401)
    for _ in range(20):
        s, t = rng.uniform(-R, R, 2)
        y = surface(np.array(s), np.array(t)) + rng.uniform(-0.2, 0.5) * N
        value, gradient, hessian = distance(y)
        near = surface(*np.meshgrid(s + grid, t + grid, indexing="ij"))
        assert abs(value) == pytest.approx(np.linalg.norm(near - y, axis=-1).min(), abs=1e-4)
        assert np.linalg.norm(gradient) == pytest.approx(1.0, abs=1e-12)
        ahead = [(distance(y + step * axis), distance(y - step * axis)) for axis in np.eye(3)]
        assert gradient == pytest.approx([(a[0] - b[0]) / (2 * step) for a, b in ahead], abs=1e-7)
        slopes = np.array([(a[1] - b[1]) / (2 * step) for a, b in ahead])
        assert np.abs(hessian - slopes).max() < 2 * value**2 / R**3 + 1e-6  # exact to first order in the distance


def test_a_shell_pressed_on_it_touches_less_and_yields_more_than_on_a_plane():
    simulator, found = Simulator(shell_geometry(130, 8), silicone().neo_hooke(), "draft", level=1), {}
    for kind, radius in (("plane", 1.0), ("rough", 12.0), ("rough", 2000.0)):
        scene = Scene(Indenter(20.0, kind, radius, 0.0), 0.6)
        found[kind, radius] = list(simulator.follow(scene, [Target(normal_n=force) for force in (3.0, 8.0)]))[-1]
    plane, rough, nearly_flat = found.values()
    assert rough.depth_mm > 1.2 * plane.depth_mm and rough.patch_mm2 < 0.8 * plane.patch_mm2
    assert nearly_flat.depth_mm == pytest.approx(plane.depth_mm, rel=0.05)


@pytest.mark.parametrize(("axis_deg", "mirrored"), [(0.0, True), (45.0, True), (30.0, False)])
def test_its_mirror_image_in_the_meridian(axis_deg, mirrored):
    assert Indenter(25.0, "rough", R, axis_deg).keeps_mirror == mirrored
