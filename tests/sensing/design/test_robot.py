"""The simulated robot of another size: a scaled copy, whose endcaps carry its weight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cad import materials
from cad.materials import DEFAULT_SILICONE, silicones
from cad.params import EndcapParams
from sensing.simulator.robot.frames import RobotDesign
from sensing.simulator.robot.scene import load_scene
from sensing.simulator.robot.statics import WEIGHT_N
from sensing.simulator.similarity.stands import robot_of
from sensing.wrench.load_scale import load_scale


def test_three_endcaps_carry_the_weight_and_its_loads_stay_in_the_range():
    scene, weight_n = robot_of(EndcapParams(180, 12), DEFAULT_SILICONE)
    rotation = scene.R_world_robot[2] @ scene.T_robot_endcap[:, :3, :3]
    forces = np.array([scene.state(2, endcap, 1.0)[1][:3] for endcap in range(6)])
    world = np.einsum("kij,kj->ki", rotation, forces)
    assert np.linalg.norm(world.sum(axis=0)) == pytest.approx(weight_n, rel=5e-3)
    assert np.linalg.norm(forces, axis=1).max() < 35.1 * (12 / 8) ** 2
    assert scene.touching.sum(axis=1).tolist() == [1, 2, 3]


def test_a_robot_of_the_released_size_from_the_library_is_the_one_that_was_solved():
    solved, (again, _) = load_scene(), robot_of(EndcapParams(130, 8), DEFAULT_SILICONE)
    assert again.T_robot_endcap == pytest.approx(solved.T_robot_endcap, abs=1e-9)
    assert again.azimuth_deg[2] == pytest.approx(solved.azimuth_deg[2])
    share = 35 / max(np.linalg.norm(solved.wrench[..., :3], axis=-1).max(), 1)
    field, wrench = again.state(0, int(np.flatnonzero(again.touching[0])[0]), 1.0)
    exact, exact_wrench = solved.state(0, int(np.flatnonzero(solved.touching[0])[0]), share)
    assert np.linalg.norm(field - exact) < 0.1 * np.linalg.norm(exact)  # loads between solved ones are interpolated
    assert np.linalg.norm(wrench - exact_wrench) < 0.05 * np.linalg.norm(exact_wrench)


def test_only_the_released_robot_takes_the_states_that_ship():
    assert RobotDesign().released and not RobotDesign(EndcapParams(180, 10)).released
    assert not RobotDesign(silicone="Ecoflex 00-30").released
    assert RobotDesign().label != RobotDesign(silicone="Ecoflex 00-30").label


def test_the_states_that_ship_are_not_those_of_a_silicone_that_was_measured_since(monkeypatch):
    """The simulated robot pressed with the forces of the old C10, and its weights read those of the new one."""
    solved = load_scene()
    rows = dict(silicones())
    rows[DEFAULT_SILICONE] = replace(rows[DEFAULT_SILICONE], neo_hooke_c10_mpa=0.17)
    monkeypatch.setattr(materials, "silicones", lambda: rows)
    assert not RobotDesign().released
    scene, weight_n = RobotDesign().scene()
    assert np.abs(scene.wrench).max() < 0.6 * np.abs(solved.wrench).max() and weight_n < 0.6 * WEIGHT_N
    assert load_scale(8.0, 2 * 0.17) == pytest.approx(0.5)  # newtons of limits are those of the released silicone


def test_the_pictures_of_two_camera_modules_lie_in_two_files(monkeypatch):
    """Each run with one of them removed those of the other."""
    before = RobotDesign().label
    monkeypatch.setenv("ENDCAP_CAMERA", "ELP-USBFHD01M-L180")
    assert RobotDesign().label == before
    monkeypatch.setenv("ENDCAP_CAMERA", "ELP-USBFHD01M-L170")
    assert RobotDesign().label != before
