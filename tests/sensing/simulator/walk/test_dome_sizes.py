"""Simulated domes of other sizes: stiffness, damping, mass, where a run begins, and what cannot be simulated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco")

from cad.errors import ParameterError
from sensing.simulator.walk.mjcf import Dome
from sensing.simulator.walk.simulate import Simulation, _lying
from sensing.simulator.walk.stream import shell_scale
from sensing.simulator.walk.terrain import Terrain, ground
from sensing.simulator.walk.tips import endcap_centres
from sensing.tensegrity.robot_file import load_robot

ROBOT = load_robot()


def of_size(diameter_mm: float, wall_mm: float, **stated):
    """The robot with endcaps of a size."""
    return replace(
        ROBOT,
        endcaps=tuple(replace(e, diameter_mm=diameter_mm, wall_mm=wall_mm, **stated) for e in ROBOT.endcaps),
    )


def test_the_dome_of_the_released_size_is_itself():
    assert Dome().of(ROBOT.endcaps[0]) == Dome()


@pytest.mark.parametrize(("diameter_mm", "wall_mm"), [(100, 7), (180, 16), (240, 24)])
def test_domes_are_as_stiff_as_their_shells_in_proportion(diameter_mm, wall_mm):
    endcap = of_size(diameter_mm, wall_mm).endcaps[0]
    dome, scale = Dome().of(endcap), shell_scale(endcap)
    assert dome.stiffness_n_m == pytest.approx(4000 * scale.force / scale.depth)
    assert dome.damping_ns_m / dome.stiffness_n_m == pytest.approx(0.01)
    assert dome.mass_kg == pytest.approx(0.09 * (diameter_mm / 130) ** 2 * wall_mm / 8)


def test_a_stated_dome_is_simulated_and_one_too_stiff_for_the_steps_is_refused():
    robot = of_size(130, 8, compliance_m_n=5e-4, yield_delay_s=3e-4)
    simulation = Simulation(robot, ground(Terrain.FLAT), _lying(robot, ground(Terrain.FLAT), np.random.default_rng(0)))
    joints = simulation.model.jnt_stiffness[simulation.model.body_jntadr[simulation.shells]]
    np.testing.assert_allclose(joints, 2000.0)
    np.testing.assert_allclose(simulation.model.dof_damping[simulation.slides], 0.6)
    with pytest.raises(ParameterError, match=r'endcap "endcap_0".*too stiff for the simulation.*at least 0\.00011 m/N'):
        Dome().of(of_size(130, 8, compliance_m_n=2e-5).endcaps[0])


@pytest.mark.parametrize(("diameter_mm", "wall_mm"), [(100, 7), (130, 8), (180, 12), (240, 16)])
def test_a_run_begins_above_the_ground_with_endcaps_of_any_size(diameter_mm, wall_mm):
    robot, flat = of_size(diameter_mm, wall_mm), ground(Terrain.FLAT)
    for seed in range(5):
        centres = endcap_centres(robot, _lying(robot, flat, np.random.default_rng(seed)))
        assert 0 < centres[:, 2].min() - diameter_mm / 2000 < 0.01
