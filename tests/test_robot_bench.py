"""The bench of the robot's estimate judges rightly: an estimate that is perfect, moved, or off by a known amount."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bench"))

from bench_robot import read, run, table, table_plan
from bench_robot_tune import FACTORS, NOISES, choices
from robot_runs import FIRST_SEED, Errors, Score, errors, held_out, known_contacts, score, tuning_run

from sensing.robot.estimate import BarEstimate, Health, RobotEstimate
from sensing.robot.settings import DEFAULTS, Contacts
from sensing.simulator.walk.simulate import simulate_walk
from sensing.simulator.walk.terrain import Terrain
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.shape import rotation_of

ROOT = Path(__file__).resolve().parent.parent
ROBOT = load_robot()
HEALTH = Health(1.0, 1.0, 1.0, 0, 0, ())


@pytest.fixture(scope="module")
def walk():
    return simulate_walk(ROBOT, Terrain.DROP, seed=1, duration_s=0.5)


def estimates(walk, move=None, off=None) -> list[RobotEstimate]:
    """The truth as estimates, in another world frame, and off by a motion from the second one on."""
    found = []
    for row in range(0, len(walk.time_s), 10):
        bars = []
        for bar, pose in zip(ROBOT.bars, walk.T_world_bar[row], strict=True):
            seen = (np.eye(4) if move is None else move) @ pose
            if off is not None and row:
                seen = off @ seen
            none, unknown = np.zeros(3), np.eye(3)
            bars.append(BarEstimate(bar.name, seen, none, none, np.diag([1e-4] * 9), unknown, unknown))
        found.append(
            RobotEstimate(
                float(walk.time_s[row]),
                0.0,
                tuple(bars),
                (),
                np.zeros(3),
                np.eye(3),
                0.5,
                0.1,
                0.0,
                0.1,
                0.0,
                0.005,
                HEALTH,
            )
        )
    return found


def turned(yaw_rad: float, place: tuple[float, float, float]) -> np.ndarray:
    move = np.eye(4)
    move[:3, :3], move[:3, 3] = rotation_of(np.array([0.0, 0.0, yaw_rad])), place
    return move


def worst(found: Errors) -> float:
    return max(np.abs(found.centre_m).max(), np.abs(found.turn_rad).max(), np.abs(found.endcap_m).max())


def test_a_perfect_estimate_in_any_world_frame_has_no_error(walk):
    found = errors(walk, ROBOT, estimates(walk, turned(2.0, (3.0, -1.0, 0.5))))
    assert worst(found) < 1e-6
    assert found.nees_place.max() < 1e-6


def test_a_shift_and_a_turn_come_out_as_such(walk, monkeypatch):
    monkeypatch.setattr(type(walk), "path_m", lambda self: 2.0)
    found = errors(walk, ROBOT, estimates(walk, off=turned(0.0, (0.03, 0.0, 0.04))))
    np.testing.assert_allclose(found.centre_m[-1], [0.03, 0.0, 0.04], atol=1e-9)
    np.testing.assert_allclose(found.nees_place[1:], 0.05**2 / 1e-4, rtol=1e-6)
    result = score(walk, found, (100, 0.01, np.ones(100)), ("wrench", "", 0.0))
    assert result.drift_percent == pytest.approx(100 * 0.05 / 2.0, rel=1e-6)
    assert result.height_percent == pytest.approx(100 * 0.04 / 2.0, rel=1e-6)
    found = errors(walk, ROBOT, estimates(walk, off=turned(0.01, (0.0, 0.0, 0.0))))
    np.testing.assert_allclose(
        found.leader_rad[1:], np.tile([0.0, 0.0, 0.01], (len(found.leader_rad) - 1, 1)), atol=1e-9
    )
    assert np.abs(found.endcap_m).max() < 1e-9  # heading is no part of the shape


def test_the_log_score_of_a_known_error_and_covariance(walk):
    """e' P^-1 e + log det P, of place and turn, with diag(1e-4), 5 cm, no turn. Too wide and too narrow lose."""
    off = turned(0.0, (0.03, 0.0, 0.04))
    found = errors(walk, ROBOT, estimates(walk, off=off))
    np.testing.assert_allclose(found.log_score[1:], 25.0 + 6 * np.log(1e-4), rtol=1e-6)
    scores = [errors(walk, ROBOT, scaled(estimates(walk, off=off), factor)).log_score.mean() for factor in (1, 8, 99)]
    assert scores[1] < min(scores[0], scores[2])


def scaled(given: list[RobotEstimate], factor: float) -> list[RobotEstimate]:
    """With covariances that many times as wide."""
    return [
        replace(one, bars=tuple(replace(bar, covariance=factor * bar.covariance) for bar in one.bars)) for one in given
    ]


def test_tuning_tries_one_noise_at_a_time():
    found = choices(argparse.Namespace(set=None))
    assert found[0] == ("", 1.0, DEFAULTS) and len(found) == 1 + len(NOISES) * len(FACTORS)
    for name, factor, settings in found[1:]:
        assert settings == replace(DEFAULTS, **{name: factor * getattr(DEFAULTS, name)}) != DEFAULTS
    assert choices(argparse.Namespace(set=["slip_share=0.5"]))[0][2].slip_share == 0.5


def test_tuning_runs_are_not_the_held_out_ones(tmp_path: Path):
    tuning = tuning_run(ROBOT, Terrain.FLAT, 1, 3.0, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"three_bar_tuning_flat_1_3s.npz"}
    assert max(range(1, 9)) < FIRST_SEED
    other = held_out(ROBOT, Terrain.FLAT, 1, 3.0, tmp_path)
    assert np.abs(tuning.T_world_bar[-1] - other.T_world_bar[-1]).max() > 1e-3  # another gait


def test_known_contacts_look_out_of_the_endcap_to_the_ground():
    walk = simulate_walk(ROBOT, Terrain.FLAT, seed=1, duration_s=0.05)
    known = known_contacts(walk, ROBOT)
    for endcap, pressed in zip(ROBOT.endcaps, np.linalg.norm(walk.force_n[-1], axis=1) > 5, strict=True):
        one = known[endcap.name, float(walk.time_s[-1])]
        assert one.holds == pressed
        pose = walk.T_world_bar[-1, ROBOT.bar_number(endcap.bar)] @ endcap.T_bar_endcap
        if pressed:
            np.testing.assert_allclose(pose[:3, :3] @ one.normal, [0, 0, -1], atol=1e-9)


def test_a_run_goes_on_where_it_was(tmp_path: Path, monkeypatch):
    names = [entry.name for entry in fields(Score)][5:]
    monkeypatch.setattr(
        "bench_robot.judge",
        lambda walk, robot, sensors, settings, knob, level: Score(
            walk.terrain, walk.seed, settings.contacts.value, knob, level, **dict.fromkeys(names, 1.5)
        ),
    )
    plans = list(table_plan([Terrain.FLAT], 1, [Contacts.NONE, Contacts.WRENCH]))
    run(plans[:1], tmp_path / "robot.csv", tmp_path, 0.05)
    before = (tmp_path / "robot.csv").read_text()
    run(plans, tmp_path / "robot.csv", tmp_path, 0.05)
    rows = read(tmp_path / "robot.csv")
    assert (tmp_path / "robot.csv").read_text().startswith(before)
    assert [row.contacts for row in rows] == ["none", "wrench"] and rows[0].seed == rows[1].seed == FIRST_SEED
    assert "| flat | wrench | 1 |" in table(rows)


def test_the_comparison_without_gtsam_says_what_to_install():
    code = "import sys; sys.modules['gtsam'] = None; import bench_robot_gtsam"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (ROOT, ROOT / "bench")))}
    found = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert found.returncode == 2
    assert found.stderr == "bench_robot_gtsam: gtsam is not installed: run pip install 'gtsam>=4.3'\n"


def test_gtsams_filter_stays_where_the_robot_stands():
    """Begun with the truth and held by contacts alone: nothing but noise moves it in a second."""
    pytest.importorskip("gtsam")
    from bench_robot_gtsam import judged

    walk = simulate_walk(ROBOT, Terrain.FLAT, seed=1, duration_s=2.0)  # it rocks, and takes no step yet
    found = judged(walk, ROBOT)
    assert found.drift_percent * found.path_m / 100 < 0.01 and found.tilt_deg < 0.1 and found.yaw_deg < 0.1
