"""The similarity law: shells with equal ratios are scaled copies of one another, and only those."""

from __future__ import annotations

import numpy as np
import pytest

from cad.materials import silicone
from cad.params import EndcapParams
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Target
from sensing.simulator.scene import Scene, SceneState
from sensing.simulator.similarity.ratios import LoadScale, ShellRatios, about, common_order, wrench_units
from sensing.simulator.solid.geometry import ShellGeometry, shell_geometry

SHEARS_MPA = {name: silicone(name).neo_hooke().shear_mpa for name in ("Smooth-Sil 950", "Ecoflex 00-30")}


def pressed(geometry: ShellGeometry, material: str) -> tuple[Simulator, SceneState]:
    """A shell after a push and a drag that are the same in its own units."""
    law = silicone(material).neo_hooke()
    simulator = Simulator(geometry, law, "draft", level=1)
    scale = LoadScale.of(geometry, law.shear_mpa)
    targets = [Target(normal_n=15 * scale.force), Target(normal_n=15 * scale.force, shift_mm=(scale.shift, 0.0))]
    return simulator, list(simulator.follow(Scene(Indenter(25.0), 0.5), targets))[-1]


def in_units(simulator: Simulator, state: SceneState) -> tuple[np.ndarray, np.ndarray]:
    """Surface in R and wrench about the sphere's centre in mu R^2 and mu R^3."""
    geometry = simulator.geometry
    units = wrench_units(geometry.outer_radius_mm, simulator.law.shear_mpa)
    order = common_order(geometry, simulator.surface.position)
    surface = state.surface_mm[order] / geometry.outer_radius_mm
    return surface, about(state.wrench, np.array(geometry.centre_mm)) / units


@pytest.fixture(scope="module")
def first() -> tuple[np.ndarray, np.ndarray]:
    return in_units(*pressed(ShellRatios.of(shell_geometry(130, 8)).shell(65.0), "Smooth-Sil 950"))


def test_equal_ratios_are_scaled_copies_whatever_the_size_and_the_silicone(first):
    other = in_units(*pressed(ShellRatios.of(shell_geometry(130, 8)).shell(110.0), "Ecoflex 00-30"))
    for a, b in zip(first, other, strict=True):
        assert np.abs(a - b).max() < 1e-6 * np.abs(a).max()


def test_the_law_ends_where_a_length_does_not_scale_with_d(first):
    """D=195 T=12 has the T/R of D=130 T=8, but its flange is 6 mm, too: the neck is deeper, and the shell softer."""
    smaller, larger = (ShellRatios.of(shell_geometry(*design)) for design in ((130, 8), (195, 12)))
    assert larger.wall == pytest.approx(smaller.wall, rel=1e-12)
    assert larger.clamp - smaller.clamp == pytest.approx(6 / 65 - 6 / 97.5, rel=1e-9)  # the flange alone
    surface, _ = in_units(*pressed(larger.shell(65.0), "Smooth-Sil 950"))
    apart = np.linalg.norm(surface - first[0]) / np.linalg.norm(first[0])
    assert 1e-3 < apart < 0.2


def test_small_designs_keep_the_rim_of_the_led_ring():
    """Below D=120.7 the ring's radius fixes the rim: the neck flattens, so the clamp changes faster than the flange."""
    clamp = [ShellRatios.of(shell_geometry(d, 8)).clamp + 6 / (d / 2) for d in (100, 110, 125, 250)]
    assert clamp[0] < clamp[1] < clamp[2] and clamp[2] == pytest.approx(clamp[3], rel=1e-9)


def test_loads_of_the_released_endcap_are_the_unit():
    scale = LoadScale.of(shell_geometry(130, 8), SHEARS_MPA["Smooth-Sil 950"])
    assert (scale.force, scale.shift, scale.depth) == pytest.approx((1.0, 1.0, 1.0))
    softer = LoadScale.of(shell_geometry(130, 8), SHEARS_MPA["Ecoflex 00-30"])
    assert softer.top_n == pytest.approx(35 * SHEARS_MPA["Ecoflex 00-30"] / SHEARS_MPA["Smooth-Sil 950"])
    assert LoadScale.of(shell_geometry(180, 16), 0.68).force == pytest.approx(4.0)


def test_the_torque_about_a_point_is_that_of_statics():
    wrench = np.array([1.0, 2.0, 3.0, 10.0, 20.0, 30.0])
    assert about(wrench, np.array([0.0, 0.0, 5.0])) == pytest.approx([1, 2, 3, 10 + 5 * 2, 20 - 5 * 1, 30])


@pytest.mark.parametrize("design", [(98.9, 6.5), (120.7, 9.0), (250.0, 25.0)])
def test_common_points_of_all_shells_come_in_one_order(design):
    reference, other = (shell_geometry(*d) for d in ((130.0, 8.0), design))
    places = []
    for geometry in (reference, other):
        surface = Simulator(geometry, silicone().neo_hooke(), "draft").surface
        offset = surface.position[common_order(geometry, surface.position)] - np.array(geometry.centre_mm)
        places.append(np.arctan2(offset[:, 1], offset[:, 0]))
    apart = np.angle(np.exp(1j * (places[0] - places[1])))
    assert np.abs(apart).max() < 1e-3  # the tip has no azimuth, and is the same point in both
    assert EndcapParams(*design)
