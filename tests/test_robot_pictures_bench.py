"""The bench of the robot's pictures: readings take the noise model's places, and their errors are what was planted."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bench"))

import bench_robot_pictures
from bench_robot_pictures import noise_readings, reading_errors, robot_of
from robot_pictures import Readings, frame_times, with_pictures

from sensing.simulator.walk.contacts import contacts_of
from sensing.simulator.walk.simulate import simulate_walk
from sensing.simulator.walk.stream import SensorSet, sensor_stream, true_wrenches
from sensing.simulator.walk.terrain import Terrain
from sensing.tensegrity.samples import FootSample
from sensing.tensegrity.shape import balanced_shape

ROBOT = robot_of(0.5)


@pytest.fixture(autouse=True)
def narrow(monkeypatch):
    """A range that contacts of so short a run lie inside and beyond of."""
    monkeypatch.setattr(bench_robot_pictures, "RANGE_DEG", 60.0)


@pytest.fixture(scope="module")
def walk():
    return simulate_walk(ROBOT, Terrain.FLAT, seed=1, duration_s=0.4)


@pytest.fixture(scope="module")
def arrivals(walk):
    return sensor_stream(walk, ROBOT, SensorSet(wrench_noise=0.0), seed=1)


@pytest.fixture(scope="module")
def perfect(walk, arrivals):
    """Readings without error, of a stated deviation of 0.1 N and 0.1 N m."""
    found = {}
    for endcap in ROBOT.endcaps:
        times = frame_times(arrivals)[endcap.name]
        rows = np.round(times / 0.005).astype(int)
        ran, _ = true_wrenches(walk, ROBOT, endcap, rows)
        load, tilt = np.linalg.norm(ran[:, :3], axis=1), contacts_of(walk, ROBOT, endcap, rows).tilt_deg
        found[endcap.name] = Readings(
            times, ran.copy(), np.tile(0.01 * np.eye(6), (len(times), 1, 1)), (load > 0).astype(int),
            np.full(len(times), "out_of_range"), ran, ran, load, tilt, np.zeros(len(times), dtype=bool),
        )  # fmt: skip
    return found


def test_a_lighter_robot_has_the_same_shape_and_half_the_load(walk):
    whole = robot_of(1.0)
    np.testing.assert_allclose(balanced_shape(ROBOT).length_m, balanced_shape(whole).length_m, rtol=1e-6)
    weight_n = 9.81 * sum(bar.mass_kg for bar in ROBOT.bars)
    assert weight_n == pytest.approx(0.5 * 9.81 * 12, rel=1e-6)
    assert walk.force_n[:, :, 2].sum(axis=1).mean() == pytest.approx(weight_n, rel=0.1)


def test_pictures_take_the_places_of_the_noise_model(arrivals, perfect):
    mixed = with_pictures(arrivals, perfect)
    assert [one.at_s for one in mixed] == [one.at_s for one in arrivals]
    foot_samples = [one.sample for one in mixed if isinstance(one.sample, FootSample)]
    assert len(foot_samples) == sum(len(part.time_s) for part in perfect.values())
    assert all(foot.flags == {"out_of_range"} and foot.covariance[0, 0] == 0.01 for foot in foot_samples)
    foot = foot_samples[0]
    part = perfect[foot.endcap]
    np.testing.assert_array_equal(foot.force_n, part.wrench[list(part.time_s).index(foot.time_s), :3])
    others = [one for one in mixed if not isinstance(one.sample, FootSample)]
    assert others == [one for one in arrivals if not isinstance(one.sample, FootSample)]


def test_errors_of_readings_are_those_that_were_planted(perfect):
    by_range = {row.where: row for row in reading_errors(perfect, ("6kg", 1, "pictures"))}
    rows = [by_range["inside"], by_range["beyond"]]
    assert sum(row.readings for row in rows) > 20 and by_range["free"].readings > 20
    assert all(row.rmse_force_n == 0 and row.covered == 1 and row.flagged == 1 for row in rows)
    off = {name: replace(part, wrench=part.wrench + np.array([0.3, 0, 0, 0, 0, 0])) for name, part in perfect.items()}
    worse = next(reading_errors(off, ("6kg", 1, "pictures")))
    assert worse.rmse_force_n == pytest.approx(0.3 / 3**0.5) and worse.rmse_torque_nm == 0
    assert worse.covered == pytest.approx(5 / 6)
    sudden = {}
    for name, part in off.items():
        first = np.arange(len(part.time_s)) < len(part.time_s) // 2
        wrench = np.where(first[:, None], part.wrench, perfect[name].wrench)
        sudden[name] = replace(part, wrench=wrench, flags=np.where(first, "out_of_range unconfirmed", "out_of_range"))
    marked = next(reading_errors(sudden, ("6kg", 1, "pictures")))
    assert 0 < marked.unconfirmed < 1 and marked.rmse_force_n > 0 and marked.confirmed_rmse_n == 0
    blind = {name: replace(part, wrench=np.full_like(part.wrench, np.nan)) for name, part in perfect.items()}
    assert next(reading_errors(blind, ("6kg", 1, "pictures"))).lost == 1


def test_samples_without_noise_are_the_truth(walk, arrivals, perfect):
    found = noise_readings(walk, ROBOT, arrivals, perfect)
    for row in reading_errors(found, ("6kg", 1, "noise")):
        assert row.rmse_force_n == pytest.approx(0, abs=1e-9) and row.wrong_bit < 0.1
