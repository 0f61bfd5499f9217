"""robot.toml: what is read, and what is refused in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cad.errors import EndcapError
from sensing.tensegrity.robot_file import SHIPPED, load_robot
from sensing.tensegrity.shape import balanced_shape, cable_lengths, moved, standing_poses

TEXT = SHIPPED.read_text(encoding="utf-8")
DIGITS = "9" * 400
FAULTS = {  # what is replaced once, by what, a word of the message
    "an endcap's name twice": ('name = "endcap_1"', 'name = "endcap_0"', 'named "endcap_0"'),
    "two endcaps on one end": ('end = "second"', 'end = "first"', "carries one"),
    "a cable to nowhere": ('bars = ["red", "green"]', 'bars = ["red", "grey"]', "nowhere"),
    "a cable to its own bar": ('bars = ["red", "green"]', 'bars = ["red", "red"]', "joins two bars"),
    "a cable that no shape makes taut": ("rest_m = 0.54", "rest_m = 1.9", "never pull"),
    "a cable far too short": ("rest_m = 0.54", "rest_m = 0.01", "stretched"),
    "a bar longer than its ends": ("length_m = 0.82", "length_m = 8.2", "ends_m"),
    "negative mass": ("mass_kg = 4.0", "mass_kg = -4.0", "above 0"),
    "no body's inertia": ("[0.46, 0.46, 0.008]", "[0.46, 0.46, 1.0]", "no body"),
    "unknown bar": ('bar = "red"', 'bar = "rod"', "unknown"),
    "missing key": ("mass_kg = 4.0", "", "mass_kg is missing"),
    "unknown key": ("mass_kg = 4.0", "mass_kg = 4.0\nmas_kg = 3", "unknown key mas_kg"),
    "a text for a number": ("mass_kg = 4.0", 'mass_kg = "heavy"', "not a finite number"),
    "not a number": ("mass_kg = 4.0", "mass_kg = nan", "not a finite number"),
    "true for a number": ("mass_kg = 4.0", "mass_kg = true", "not a finite number"),
    "400 digits": ("mass_kg = 4.0", f"mass_kg = {DIGITS}", "not a finite number"),
    "5000 digits": ("mass_kg = 4.0", f"mass_kg = {'9' * 5000}", "no TOML"),
    "a point of two numbers": ("[0.0, 0.0, -0.41]", "[0.0, -0.41]", "2 lists of 3"),
    "a point beside the bar": ("[0.0, 0.0, -0.41]", "[0.0, 0.9, -0.41]", "off the bar"),
    "an endcap that cannot be made": ("turn_deg = 0.0", "turn_deg = 0.0\nwall_mm = 60", 'endcap "endcap_0": wall_mm'),
    "a dome in mm": ("turn_deg = 0.0", "turn_deg = 0.0\ncompliance_m_n = 0.25", "above 1e-05, at most 0.01"),
    "a dome in ms": ("turn_deg = 0.0", "turn_deg = 0.0\nyield_delay_s = 10", "above 0, at most 0.1"),
    "no text for a name": ('name = "imu_red"', "name = 3", "no text"),
    "no TOML": ("[[bar]]", "[[bar", "no TOML"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_refused_in_one_line(fault: str, tmp_path: Path):
    before, after, word = FAULTS[fault]
    path = tmp_path / "robot.toml"
    assert before in TEXT
    path.write_text(TEXT.replace(before, after, 1), encoding="utf-8")
    with pytest.raises(EndcapError) as refused:
        load_robot(path)
    message = str(refused.value)
    assert word in message and "\n" not in message and len(message) < 400


def test_a_robot_whose_cables_are_all_slack_is_refused(tmp_path: Path):
    path = tmp_path / "robot.toml"
    path.write_text(TEXT.replace("rest_m = 0.54", "rest_m = 0.7"), encoding="utf-8")
    with pytest.raises(EndcapError, match="every cable is slack"):
        load_robot(path)


def test_missing_file_and_other_bytes(tmp_path: Path):
    with pytest.raises(EndcapError):
        load_robot(tmp_path / "none.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(EndcapError):
        load_robot(tmp_path / "bytes.toml")


def test_the_robot_that_ships():
    robot = load_robot()
    assert robot.mass_kg == pytest.approx(12.0)
    assert len(robot.endcaps) == 6 and len(robot.cables) == 9
    assert [sensor.accelerometer for sensor in robot.sensors] == [True, False, False]
    assert {(endcap.compliance_m_n, endcap.yield_delay_s) for endcap in robot.endcaps} == {(None, None)}
    for endcap in robot.endcaps:
        place, axis = endcap.T_bar_endcap[:3, 3], endcap.T_bar_endcap[:3, 2]
        assert place @ axis == pytest.approx(0.41)  # z toward the tip, away from the bar
        assert np.linalg.det(endcap.T_bar_endcap[:3, :3]) == pytest.approx(1)


def test_cables_of_the_balanced_shape_pull_every_bar_to_rest():
    robot = load_robot()
    shape = balanced_shape(robot)
    _, jacobian = cable_lengths(robot, shape.T_world_bar)
    assert np.abs(jacobian.T @ shape.tension_n).max() < 1e-3  # N and N m, against tensions of 50 to 100 N


def test_derivative_of_the_lengths_against_differences():
    robot, rng = load_robot(), np.random.default_rng(1)
    poses = moved(standing_poses(robot), rng.normal(0, 0.1, 18))
    _, jacobian = cable_lengths(robot, poses)
    step = 1e-6
    for column in range(18):
        change = step * np.eye(18)[column]
        ends = [cable_lengths(robot, moved(poses, sign * change))[0] for sign in (1, -1)]
        np.testing.assert_allclose(jacobian[:, column], (ends[0] - ends[1]) / (2 * step), atol=1e-8)


def test_a_stated_dome_is_read(tmp_path: Path):
    path = tmp_path / "robot.toml"
    stated = "turn_deg = 0.0\ncompliance_m_n = 0.0004\nyield_delay_s = 0.0003"
    path.write_text(TEXT.replace("turn_deg = 0.0", stated, 1), encoding="utf-8")
    first, second = load_robot(path).endcaps[:2]
    assert (first.compliance_m_n, first.yield_delay_s, second.compliance_m_n) == (4e-4, 3e-4, None)
