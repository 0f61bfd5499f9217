"""The skin under its own weight: mass, balance of forces, symmetry and scaling."""

from dataclasses import replace

import numpy as np
import pytest

from cad.materials import silicone
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.own_weight import nodal_mass_kg, own_weight_displacement
from sensing.simulator.solid.shell import ShellModel, shell_model
from sensing.simulator.solid.system import factorise

DENSITY = 1.24
G = 9.81


@pytest.fixture(scope="module")
def model() -> ShellModel:
    return shell_model(shell_geometry(130, 8), silicone().neo_hooke(), "draft")


def test_the_mass_is_that_of_the_shells_volume(model):
    """Two spherical caps over the clamp's plane: V = pi h^2 (3 R - h) / 3."""
    above = model.geometry.centre_height_mm - model.geometry.clamp_height_mm
    outer, inner = (
        np.pi * (above + r) ** 2 * (3 * r - above - r) / 3
        for r in (model.geometry.outer_radius_mm, model.geometry.inner_radius_mm)
    )
    assert nodal_mass_kg(model, DENSITY).sum() == pytest.approx((outer - inner) * DENSITY * 1e-6, rel=2e-3)


def test_a_stiffer_interlock_weighs_no_more(model):
    """Its factor scales stiffness alone: node by node the mass is volume times density."""
    stiff = shell_model(model.geometry, silicone().neo_hooke(), "draft", interlock=100.0)
    assert nodal_mass_kg(stiff, DENSITY) == pytest.approx(nodal_mass_kg(model, DENSITY), abs=1e-15)
    plain, held = (own_weight_displacement(each, DENSITY, (G, 0, 0)) for each in (model, stiff))
    assert np.abs(held).max() < np.abs(plain).max()


def test_the_clamp_carries_the_weight(model):
    for gravity in ((G, 0.0, 0.0), (0.0, 0.0, -G)):
        moved = own_weight_displacement(model, DENSITY, gravity)
        small = 1e-3  # the energy is nonlinear: a small share of the sag is linear
        force = model.solid.energy_and_force(small * moved)[1] / small
        weight = nodal_mass_kg(model, DENSITY)
        held = weight[model.clamped].sum() * np.array(gravity)  # what the fixed nodes carry themselves
        reaction = -force[model.clamped].sum(axis=0)
        assert reaction + held == pytest.approx(weight.sum() * np.array(gravity), abs=2e-3 * weight.sum() * G)


def test_sideways_it_sags_sideways_and_more_than_along_its_axis(model):
    side, axial = (own_weight_displacement(model, DENSITY, g) for g in ((G, 0, 0), (0, 0, -G)))
    tip = model.solid.mesh.points[:, 2].argmax()
    assert side[tip, 0] > 0.1 and abs(side[tip, 1]) < 1e-6 and abs(axial[tip, :2]).max() < 1e-6
    assert np.abs(side).max() > 2 * np.abs(axial).max() and axial[tip, 2] < 0
    twice = own_weight_displacement(model, 2 * DENSITY, (G, 0, 0))
    assert twice == pytest.approx(2 * side, abs=1e-9)


def test_half_as_stiff_sags_twice_as_far(model):
    law = silicone().neo_hooke()
    weak = shell_model(model.geometry, replace(law, c10_mpa=law.c10_mpa / 2, bulk_mpa=law.bulk_mpa / 2), "draft")
    side = own_weight_displacement(weak, DENSITY, (G, 0, 0))
    assert side == pytest.approx(2 * own_weight_displacement(model, DENSITY, (G, 0, 0)), abs=1e-9)


def test_a_soft_skin_sags_as_linear_elasticity_says():
    """Newton's method on the neo-Hooke law, where the skin sags by 7 % of its radius."""
    soft = silicone("Ecoflex 00-30")
    half = shell_model(shell_geometry(172, 12.5), soft.neo_hooke(), "draft", half=True)
    linear = own_weight_displacement(half, soft.density_g_cm3, (G, 0.0, 0.0))
    weight = half.solid.gather(nodal_mass_kg(half, soft.density_g_cm3)[:, None] * np.array([G, 0.0, 0.0]))
    moved = np.zeros_like(linear)
    for _ in range(8):
        left = weight - half.solid.gather(half.solid.energy_and_force(moved)[1])
        moved = moved + half.solid.spread(factorise(half.solid, half.solid.tangent(moved)).solve(left))
    assert np.abs(left).max() < 1e-6 * np.abs(weight).max()
    assert np.linalg.norm(linear, axis=1).max() > 0.07 * half.geometry.outer_radius_mm
    assert np.abs(moved - linear).max() < 0.05 * np.abs(linear).max()
