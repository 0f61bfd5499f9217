"""The rolling robot obeys mechanics, and its sensors report what happened."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco")

from cad.errors import FileError, ParameterError
from sensing.simulator.walk import terrain as terrain_module
from sensing.simulator.walk.gait import TippingGait
from sensing.simulator.walk.simulate import Simulation, simulate_walk
from sensing.simulator.walk.stream import (
    SensorSet,
    inertial_samples,
    rotation_matrices,
    sensor_stream,
    shell_scale,
    true_wrenches,
    wrench_sigma,
)
from sensing.simulator.walk.terrain import Terrain, ground
from sensing.simulator.walk.tips import load_tips
from sensing.simulator.walk.truth import load_walk, save_walk
from sensing.tensegrity.description import GRAVITY_M_S2, Cable, MountedEndcap, TensegrityRobot
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample
from sensing.tensegrity.shape import balanced_shape

ROBOT = load_robot()
QUIET = SensorSet(
    gyro_rad_s_rthz=0, acceleration_m_s2_rthz=0, gyro_zero_rad_s=0, acceleration_zero_m_s2=0, gyro_walk=0,
    acceleration_walk=0, length_m=0, wrench_noise=0,
)  # fmt: skip


@pytest.fixture(scope="module")
def walk():
    return simulate_walk(ROBOT, Terrain.FLAT, TippingGait(speed_m_s=0.2), seed=3, duration_s=6.0)


@pytest.fixture(scope="module")
def rolled(walk):
    moved = np.linalg.norm(walk.centre_m[-1, :2] - walk.centre_m[0, :2])
    assert moved > 0.3  # else the tests below would look at a robot that lies still
    return walk


def test_at_rest_the_ground_carries_the_weight(walk):
    standing = (walk.time_s > 1.0) & (walk.time_s < 2.0)
    carried = walk.force_n[standing].sum(axis=1).mean(axis=0)
    np.testing.assert_allclose(carried, [0, 0, ROBOT.mass_kg * GRAVITY_M_S2], atol=0.6)


def test_impulse_of_the_ground_is_the_change_of_momentum(rolled):
    """All bars weigh the same and are balanced: the momentum is the mass times their mean velocity (but for shells)."""
    step = np.diff(rolled.time_s)[:, None]
    impulse = (rolled.force_n[1:].sum(axis=1) * step).sum(axis=0)
    change = ROBOT.mass_kg * (rolled.velocity[-1, :, :3] - rolled.velocity[0, :, :3]).mean(axis=0)
    weight = ROBOT.mass_kg * GRAVITY_M_S2 * (rolled.time_s[-1] - rolled.time_s[0])
    np.testing.assert_allclose(impulse - [0, 0, weight], change, atol=0.003 * weight)


def test_friction_stays_within_its_cone(rolled):
    loaded = rolled.force_n[..., 2] > 5
    side = np.linalg.norm(rolled.force_n[..., :2], axis=-1)
    assert (side[loaded] < rolled.friction * 1.02 * rolled.force_n[..., 2][loaded] + 0.5).all()
    slipping = np.linalg.norm(rolled.slip_m_s, axis=-1) > 0.05
    assert np.median(side[slipping & loaded] / rolled.force_n[..., 2][slipping & loaded]) > 0.5 * rolled.friction


def test_the_normal_is_that_of_the_ground():
    walk = simulate_walk(ROBOT, Terrain.SLOPE, seed=2, duration_s=0.1)
    pushed = np.linalg.norm(walk.force_n, axis=-1) > 5
    np.testing.assert_allclose(walk.normal[pushed], np.tile(ground(Terrain.SLOPE, 2).up, (pushed.sum(), 1)), atol=1e-9)
    assert (np.einsum("ni,ni->n", walk.normal[pushed], walk.force_n[pushed]) > 0).all()


def test_a_robot_in_the_air_falls_freely():
    walk = simulate_walk(ROBOT, Terrain.DROP, seed=1, duration_s=0.15)
    assert not walk.force_n.any()
    fallen = walk.centre_m[-1, 2] - walk.centre_m[0, 2]
    time_s = walk.time_s[-1]
    assert fallen == pytest.approx(-GRAVITY_M_S2 * time_s**2 / 2, abs=2e-3)


def test_cables_never_push_whatever_their_damping():
    simulation = Simulation(ROBOT, ground(Terrain.FLAT), balanced_shape(ROBOT).T_world_bar + _lifted(2.0))
    simulation.data.qvel[:] = np.random.default_rng(1).normal(0, 0.5, simulation.model.nv)
    simulation.rest_m = simulation.rest_m + np.linspace(-0.05, 0.15, 9)
    least = []
    for _ in range(100):
        simulation.step()
        least.append(simulation.tension_n.min())
    assert min(least) >= 0
    assert (simulation.tension_n == 0).any() and (simulation.tension_n > 0).any()


def test_the_compiled_cables_pull_as_their_law():
    """MuJoCo's own tendon force, taken from the acceleration of two bars in the void."""
    robot, length = _two_bars(), 1.0
    for rest, expected in ((0.9, 4000 * 0.1), (1.1, 0.0)):
        poses = np.tile(np.eye(4), (2, 1, 1))
        poses[1, 0, 3], poses[:, 2, 3] = length, 5.0
        simulation = Simulation(robot, ground(Terrain.FLAT), poses)
        simulation.rest_m = np.array([rest])
        simulation.step()
        mass = robot.bars[0].mass_kg
        assert simulation.data.qvel[0] / 0.001 * mass == pytest.approx(expected, rel=0.02, abs=1e-6)


@pytest.mark.parametrize("load_kg", [1.0, 8.0])
def test_force_of_a_dome_at_a_depth_does_not_depend_on_what_it_carries(load_kg):
    """Depth is the dome's own travel; a contact that gives (solref) would add one in proportion to the mass."""
    robot = _standing_bar(load_kg)
    pose = np.diag([1.0, -1.0, -1.0, 1.0])[None].copy()  # its only endcap points down
    pose[0, 2, 3] = 0.5 + 0.03837 + 0.065
    simulation = Simulation(robot, ground(Terrain.FLAT), pose)
    for _ in range(2000):
        simulation.data.qvel[3:6] = 0  # upright
        simulation.step()
    centre = 0.065 - (simulation.data.xpos[simulation.bodies[0], 2] - 0.5 - 0.03837)
    force = simulation.ground_force_n[0, 2]
    assert force == pytest.approx(load_kg * GRAVITY_M_S2, rel=0.02)
    shell_n = 0.09 * GRAVITY_M_S2  # which the ground carries directly
    assert (force - shell_n) / centre == pytest.approx(3920, rel=0.01)  # 2 % is the contact itself


def test_wrench_on_the_mating_plane_is_what_the_ground_does_to_the_endcap(rolled):
    endcap = ROBOT.endcaps[3]
    rows = np.flatnonzero(np.linalg.norm(rolled.force_n[:, 3], axis=1) > 10)
    wrench, tilt = true_wrenches(rolled, ROBOT, endcap, rows)
    assert (wrench[:, 2][tilt < 50] < 0).all()  # pressed on the tip's side: against z
    pose = rolled.T_world_bar[rows, 1] @ endcap.T_bar_endcap
    back = np.einsum("nij,nj->ni", pose[:, :3, :3], wrench[:, :3])
    np.testing.assert_allclose(back, rolled.force_n[rows, 3], atol=1e-9)
    arm = rolled.point_m[rows, 3] - pose[:, :3, 3]
    torque = np.einsum("nij,nj->ni", pose[:, :3, :3], wrench[:, 3:])
    np.testing.assert_allclose(torque - np.cross(arm, back), rolled.torque_nm[rows, 3], atol=1e-9)


def test_inertial_samples_add_up_to_the_motion(rolled):
    """Without noise: turns and velocities, summed, end where the bar does."""
    sensor = ROBOT.sensors[0]
    samples = inertial_samples(rolled, ROBOT, sensor, QUIET, np.random.default_rng(0))
    rotation = rolled.T_world_bar[0, 0, :3, :3] @ sensor.T_bar_imu[:3, :3]
    velocity = rolled.velocity[0, 0, :3] + rotation @ np.zeros(3)
    spin = rolled.T_world_bar[0, 0, :3, :3] @ rolled.velocity[0, 0, 3:]
    lever = rolled.T_world_bar[0, 0, :3, :3] @ sensor.T_bar_imu[:3, 3]
    place = rolled.T_world_bar[0, 0, :3, 3] + lever
    velocity = velocity + np.cross(spin, lever)
    for sample in samples:
        turn = rotation_matrices(sample.rate_rad_s[None] * 0.005)[0]
        half = rotation @ rotation_matrices(sample.rate_rad_s[None] * 0.0025)[0]
        before = velocity
        velocity = velocity + 0.005 * (half @ sample.acceleration_m_s2 - [0, 0, GRAVITY_M_S2])
        place = place + 0.005 * (before + velocity) / 2
        rotation = rotation @ turn
    T = rolled.T_world_bar[-1, 0] @ sensor.T_bar_imu
    np.testing.assert_allclose(rotation, T[:3, :3], atol=1e-6)
    np.testing.assert_allclose(place, T[:3, 3], atol=0.01)


def test_stream_rates_order_and_same_seed(rolled):
    arrivals = sensor_stream(rolled, ROBOT, seed=5)
    assert all(a.at_s <= b.at_s for a, b in pairwise(arrivals))
    counts = [sum(isinstance(a.sample, kind) for a in arrivals) for kind in (InertialSample, LengthSample, FootSample)]
    assert counts == pytest.approx([3 * 200 * 6, 50 * 6, 6 * 30 * 6], rel=0.02)
    again = sensor_stream(rolled, ROBOT, seed=5)
    assert [a.at_s for a in again] == [a.at_s for a in arrivals]
    few = sensor_stream(rolled, ROBOT, SensorSet(gyroscopes=1), seed=5)
    names = {a.sample.sensor for a in few if isinstance(a.sample, InertialSample)}
    assert names == {"imu_red"}


def test_length_and_wrench_errors_are_of_the_stated_size(rolled):
    truth, both = sensor_stream(rolled, ROBOT, QUIET, seed=1), sensor_stream(rolled, ROBOT, seed=1)
    lengths = [
        np.array([a.sample.lengths_m for a in run if isinstance(a.sample, LengthSample)]) for run in (truth, both)
    ]
    assert (lengths[1] - lengths[0]).std() == pytest.approx(0.002, rel=0.1)
    pairs = [
        {(a.sample.time_s, a.sample.endcap): a.sample for a in run if isinstance(a.sample, FootSample)}
        for run in (truth, both)
    ]
    ratio = [
        (pairs[1][key].force_n - pairs[0][key].force_n) / np.sqrt(np.diag(pairs[1][key].covariance)[:3])
        for key in pairs[0]
    ]
    assert np.std(ratio) == pytest.approx(1.0, rel=0.15)


def test_errors_of_wrenches_are_in_proportion_to_the_shell():
    """A wall of twice 8 mm bears four times the force as deep; at twice the radius its torques have twice the lever."""
    small, large = (
        MountedEndcap("a", "b", np.eye(4), diameter_mm, wall_mm) for diameter_mm, wall_mm in ((130, 8), (260, 16))
    )
    tilts, loads = np.array([0.0, 35.0, 70.0]), np.array([1.0, 30.0, 80.0])
    released = wrench_sigma(tilts, loads, shell_scale(small))
    np.testing.assert_allclose(
        wrench_sigma(tilts, 4 * loads, shell_scale(large))[:, :3], 4 * released[:, :3], rtol=1e-12
    )
    np.testing.assert_allclose(
        wrench_sigma(tilts, 4 * loads, shell_scale(large))[:, 3:], 8 * released[:, 3:], rtol=1e-12
    )


@pytest.mark.parametrize("terrain", list(Terrain))
def test_the_robot_comes_to_rest_on_every_terrain(terrain):
    walk = simulate_walk(ROBOT, terrain, seed=2, duration_s=1.9 if terrain is Terrain.DROP else 0.2)
    assert np.linalg.norm(walk.velocity[-1, :, :3], axis=1).max() < (0.3 if terrain is Terrain.DROP else 0.1)
    assert (np.linalg.norm(walk.force_n[-1], axis=-1) > 1).sum() >= 3


def test_a_bar_may_have_any_name_and_is_no_lighter_than_its_domes():
    poses, flat = balanced_shape(ROBOT).T_world_bar, ground(Terrain.FLAT)
    named = dict(zip((bar.name for bar in ROBOT.bars), ("world", "shell0", "green"), strict=True))
    other = replace(
        ROBOT,
        bars=tuple(replace(bar, name=named[bar.name]) for bar in ROBOT.bars),
        endcaps=tuple(replace(endcap, bar=named[endcap.bar]) for endcap in ROBOT.endcaps),
        cables=tuple(replace(cable, bars=(named[cable.bars[0]], named[cable.bars[1]])) for cable in ROBOT.cables),
    )
    np.testing.assert_array_equal(Simulation(other, flat, poses).poses, Simulation(ROBOT, flat, poses).poses)
    for wrong in ({"mass_kg": 0.15}, {"mass_kg": 0.18}, {"inertia_kg_m2": np.diag([0.46, 0.46, 3e-4])}):
        light = replace(ROBOT, bars=(replace(ROBOT.bars[0], **wrong), *ROBOT.bars[1:]))
        with pytest.raises(ParameterError, match=r'bar "red": its mass_kg = .* 2 simulated domes on it, 0\.18 kg:'):
            Simulation(light, flat, poses)


def test_a_run_that_leaves_the_rough_ground_is_refused(monkeypatch):
    monkeypatch.setattr(terrain_module, "HALF_M", 1.0)
    with pytest.raises(
        ParameterError, match=r"rolls off the ground, which ends 1 m from .*: give at most (\d) s"
    ) as info:
        simulate_walk(ROBOT, Terrain.ROUGH, TippingGait(speed_m_s=0.2), seed=3, duration_s=10.0)
    most_s = float(str(info.value).split("at most ")[1].split()[0])
    walk = simulate_walk(ROBOT, Terrain.ROUGH, TippingGait(speed_m_s=0.2), seed=3, duration_s=most_s)
    assert most_s > 2 and walk.T_world_bar[:, :, 2, 3].min() > 0


def test_a_run_is_its_seed_and_survives_its_file(tmp_path: Path):
    first, second = (simulate_walk(ROBOT, Terrain.ROUGH, seed=4, duration_s=0.3) for _ in range(2))
    np.testing.assert_array_equal(first.T_world_bar, second.T_world_bar)
    save_walk(first, tmp_path / "walk.npz")
    back = load_walk(tmp_path / "walk.npz")
    np.testing.assert_array_equal(back.force_n, first.force_n)
    assert (back.terrain, back.seed) == ("rough", 4)
    whole = (tmp_path / "walk.npz").read_bytes()
    for damaged in (b"PK nothing", whole[:-400], whole[: len(whole) // 2]):
        (tmp_path / "walk.npz").write_bytes(damaged)
        with pytest.raises(FileError, match="simulate it anew"):
            load_walk(tmp_path / "walk.npz")


def test_tips_lift_a_foot_of_their_face_and_symmetric_ones_agree():
    tips = {(tip.face, tip.lifted): tip.change_m for tip in load_tips()}
    assert len(tips) == 24 and all(lifted in face for face, lifted in tips)
    ring = tips[(0, 2, 4), 0].reshape(3, 3)  # a third of a turn takes bar 0 to 1, and each triple of cables along
    np.testing.assert_allclose(np.roll(ring, 1, axis=1).ravel(), tips[(0, 2, 4), 2], atol=2e-3)


def _lifted(height_m: float) -> np.ndarray:
    lift = np.zeros((1, 4, 4))
    lift[0, 2, 3] = height_m
    return lift


def _two_bars() -> TensegrityRobot:
    bars = tuple(replace(bar, inertia_kg_m2=np.eye(3)) for bar in ROBOT.bars[:2])
    cable = Cable("only", (bars[0].name, bars[1].name), np.zeros((2, 3)), 1.0, 4000.0)
    return TensegrityRobot("two", bars, (), (cable,), ())


def _standing_bar(mass_kg: float) -> TensegrityRobot:
    bar = replace(ROBOT.bars[0], mass_kg=mass_kg, length_m=1.0, inertia_kg_m2=np.eye(3))
    pose = np.eye(4)
    pose[2, 3] = 0.5
    return TensegrityRobot("one", (bar,), (MountedEndcap("0", bar.name, pose),), (), ())
