"""Frames of a run's contacts, rendered and read by the live pipeline, give the run's wrench back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco")

from cad.errors import FileError
from cad.materials import silicone
from sensing.live.core.config import EndcapConfig
from sensing.live.core.model import load_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.simulator.levels import Simulator
from sensing.simulator.reduced.library_level import LIMIT
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.walk.contacts import Contacts, contacts_of
from sensing.simulator.walk.pictures import WalkSensor
from sensing.simulator.walk.pressed import fit_presses, load_presses, save_presses, solve_tilt, states_of
from sensing.simulator.walk.simulate import simulate_walk
from sensing.simulator.walk.stream import true_wrenches
from sensing.simulator.walk.terrain import Terrain
from sensing.tensegrity.robot_file import load_robot
from sensing.tracking.zero import take_zero

TILT_DEG = 50.0
FORCE_N, TORQUE_NM = 0.25, 0.02  # a few times the published errors of the nominal sensor at 10 N and 50 degrees


@pytest.fixture(scope="module")
def simulator():
    return Simulator(shell_geometry(130.0, 8.0), silicone().neo_hooke(), tolerance=1e-2)


@pytest.fixture(scope="module")
def presses(simulator):
    return solve_tilt(simulator, TILT_DEG, states=12, loads_n=(8.0, 40.0))


@pytest.fixture(scope="module")
def library(simulator, presses):
    """Of degree 1 for few states; the change from degree 0, its error estimate, says nothing here and is left out."""
    found = fit_presses(simulator, [presses], degree=1)
    return replace(found, even_below=found.even, odd_below=found.odd)


@pytest.fixture(scope="module")
def episode(presses):
    """A contact that is pressed harder and pulled while the dome turns about its axis."""
    rows = np.linspace(0, len(presses.normal_n) - 1, 5).astype(int)
    loads, pulls = presses.normal_n[rows], presses.tangential_n[rows]
    times, azimuths = np.arange(5) / 30.0, np.linspace(100.0, 130.0, 5)
    return Contacts(times, np.full(5, TILT_DEG), azimuths, loads, pulls)


@pytest.fixture(scope="module")
def pictured(simulator, library):
    """A sensor, and how its frames are read."""
    sensor = WalkSensor(simulator, library, number=0)
    model, zero = load_model("default", sensor.params), take_zero(sensor.rest())

    def read(states, contacts):
        pipeline = EndcapPipeline(EndcapConfig("endcap_0", "simulated"), model, zero)
        return [pipeline.update(frame) for frame in sensor.frames(states, contacts)]

    return read


def off(readings, states) -> tuple[float, float]:
    """Largest errors of force (N) and torque (N m) of the frames alone."""
    found = np.array([np.concatenate([one.estimate.force_n, one.estimate.torque_nm]) for one in readings])
    error = np.abs(found - states.wrench)
    return float(error[:, :3].max()), float(error[:, 3:].max())


def test_the_pictures_of_an_episode_give_its_wrench_back(library, episode, pictured):
    states = states_of(library, episode)
    assert not states.clamped.any()
    readings = pictured(states, episode)
    assert all(reading.valid and reading.contact.touching for reading in readings[1:])
    force, torque = off(readings, states)
    assert force < FORCE_N and torque < TORQUE_NM


def test_pictures_turned_to_another_azimuth_are_found_out(library, episode, pictured):
    states = states_of(library, episode)
    force, _ = off(pictured(states, replace(episode, azimuth_deg=-episode.azimuth_deg)), states)
    assert force > 10 * FORCE_N


def test_without_contact_the_dome_is_untouched(library, episode, pictured):
    free = replace(episode, normal_n=np.zeros(5), tangential_n=np.zeros((5, 2)), tilt_deg=np.zeros(5))
    states = states_of(library, free)
    assert not states.wrench.any() and not states.clamped.any()
    readings = pictured(states, free)
    assert not any(reading.contact.touching for reading in readings)
    assert off(readings, states)[0] < 0.1


def test_the_states_push_as_the_contacts_do(library, episode):
    """Force from load, pull, tilt and azimuth, by the definition of the contact frame."""
    tilt, azimuth = np.radians(episode.tilt_deg), np.radians(episode.azimuth_deg)
    around = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)
    outward = np.column_stack([np.sin(tilt)[:, None] * around, np.cos(tilt)])
    meridian = np.column_stack([np.cos(tilt)[:, None] * around, -np.sin(tilt)])
    lateral = np.cross(outward, meridian)
    push = -episode.normal_n[:, None] * outward
    pull = episode.tangential_n[:, :1] * meridian + episode.tangential_n[:, 1:] * lateral
    np.testing.assert_allclose(states_of(library, episode).wrench[:, :3], push + pull, atol=1e-9)


def test_what_was_not_solved_is_clamped_and_said(library, episode):
    least, most = library.normal_n
    beyond = replace(episode, normal_n=np.array([most, 2 * most, most, most, least / 2]))
    beyond = replace(beyond, tilt_deg=TILT_DEG + np.array([0.0, 0.0, 5.0, 0.0, 0.0]))
    beyond = replace(beyond, tangential_n=np.array([[0, 0], [0, 0], [0, 0], [0, 0.9 * most], [0, 0]]))
    states = states_of(library, beyond)
    assert states.clamped.tolist() == [False, True, True, True, False]
    np.testing.assert_allclose(np.linalg.norm(states.wrench[:3, :3], axis=1), most)
    np.testing.assert_allclose(np.linalg.norm(states.wrench[4, :3]), least / 2)


def test_a_state_that_the_library_doubts_is_replaced_by_a_near_one_and_said(library, episode):
    """A fit that is doubted the more, the harder the pull along the meridian."""
    along = [tuple(power) for power in library.powers.astype(int)].index((0, 1, 0))
    doubt = library.even.copy()
    doubt[:, along, 0] += 0.5 * np.abs(library.even[:, 0]).max()
    doubted, pull = replace(library, even_below=doubt, odd_below=library.odd), np.zeros((5, 2))
    pull[1, 0], pull[2, 0] = 4.0, -4.0
    asked = replace(episode, normal_n=np.full(5, 10.0), tangential_n=pull, azimuth_deg=np.zeros(5))
    trusted, states = states_of(library, asked), states_of(doubted, asked)
    assert not trusted.clamped.any()
    assert states.clamped.tolist() == [False, True, True, False, False]
    assert (states.error_estimate <= LIMIT).all()
    moved = np.linalg.norm(states.wrench[:, :3] - trusted.wrench[:, :3], axis=1)
    assert (moved[1:3] > 0.5).all() and (moved[1:3] <= 4.0).all() and not moved[[0, 3, 4]].any()


def test_contacts_hold_the_force_of_the_run():
    robot = load_robot()
    walk = simulate_walk(robot, Terrain.ROUGH, seed=2, duration_s=0.2)
    rows, pressed = np.arange(len(walk.time_s)), 0
    for endcap in robot.endcaps:
        contacts = contacts_of(walk, robot, endcap, rows)
        ran, _ = true_wrenches(walk, robot, endcap, rows)
        load = np.hypot(contacts.normal_n, np.linalg.norm(contacts.tangential_n, axis=1))
        np.testing.assert_allclose(load, np.linalg.norm(ran[:, :3], axis=1), atol=1e-9)
        tilt = np.radians(contacts.tilt_deg)
        along = -np.cos(tilt) * contacts.normal_n - np.sin(tilt) * contacts.tangential_n[:, 0]
        np.testing.assert_allclose(along, ran[:, 2], atol=1e-9)
        pressed += int((contacts.normal_n > 5).sum())
    assert pressed > 2 * len(rows)  # it stands on three


def test_presses_are_read_back_and_a_damaged_file_is_named(presses, tmp_path: Path):
    save_presses(presses, path := tmp_path / "presses.npz")
    again = load_presses(path)
    np.testing.assert_array_equal(again.surface_mm, presses.surface_mm)
    assert again.tilt_deg == presses.tilt_deg
    path.write_bytes(path.read_bytes()[:-400])
    with pytest.raises(FileError, match="solved anew"):
        load_presses(path)
