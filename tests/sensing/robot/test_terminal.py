"""Faults in the terminal: once each time they come, whatever number they carry."""

from __future__ import annotations

from dataclasses import replace

import pytest
from standing_robot import feed, standing_samples

from sensing.robot.estimator import RobotEstimator
from sensing.robot.node.record import Report
from sensing.robot.node.terminal import RobotTerminal
from sensing.tensegrity.robot_file import load_robot

ROBOT = load_robot()


class Written:
    """Lines that are kept."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def write(self, text: str) -> bool:
        """Keep a line."""
        self.lines.append(text)
        return True


@pytest.fixture(scope="module")
def standing():
    """An estimate of a robot in good health."""
    estimator = RobotEstimator(ROBOT)
    feed(estimator, standing_samples(ROBOT, 1.2)[1])
    return estimator.state()


def written(standing, notes_at) -> list[str]:
    """The lines of a run of 60 s whose health has the notes of each time."""
    out = Written()
    terminal = RobotTerminal(out, ROBOT, quiet=True)
    for tenth in range(600):
        time_s = tenth / 10
        health = replace(standing.health, notes=tuple(notes_at(time_s)))
        terminal.report(Report(replace(standing, time_s=time_s, health=health), None, 0.0))
    return out.lines


def test_a_fault_that_comes_again_is_written_again(standing):
    silent = ((5.0, 8.0), (40.0, 50.0))
    lines = written(
        standing,
        lambda t: [f"imu_red: no sample for {t - a:.1f} s: bar red is less sure" for a, b in silent if a < t < b],
    )
    assert [line.split()[0] for line in lines] == ["5.1", "40.1"]


def test_a_fault_that_goes_on_or_flickers_is_written_once_though_its_number_changes(standing):
    lines = written(
        standing, lambda t: [f"domes seem to yield by {0.3 + t / 100:.2f} of Settings"] if int(t) % 3 else []
    )
    assert len(lines) == 1 and "domes seem to yield" in lines[0]


def test_faults_of_two_endcaps_are_two(standing):
    lines = written(standing, lambda t: ["endcap_0: no reading yet", "endcap_1: no reading yet"])
    assert len(lines) == 2
