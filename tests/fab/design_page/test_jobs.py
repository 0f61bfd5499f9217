"""The run behind the page's button: its commands, its end, and a stop at any moment."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

from fab.design_page.jobs import STOPPED, Jobs, program_commands

LABEL = "D130_T8"
WAITS = "import signal; signal.pause()"


def follow_to_the_end(jobs: Jobs):
    number = 0
    while (state := jobs.seen(number, 60.0))["running"]:
        number = state["number"]
    return state


def test_stop_before_the_first_command_lets_none_begin(tmp_path):
    def commands(*_: object):
        jobs.stop()  # the run is on, its first process is not
        return [[sys.executable, "-c", "print()"]]

    jobs = Jobs(tmp_path, commands)
    assert jobs.start((), "mk4", LABEL, True)
    state = follow_to_the_end(jobs)
    assert (state["status"], state["lines"], state["stopped"]) == (STOPPED, [], True)


def test_stop_between_two_commands_lets_the_next_one_not_begin(tmp_path):
    class StoppedBetween(Jobs):
        def _one(self, run):
            status = super()._one(run)
            self.stop()
            return status

    commands = [[sys.executable, "-c", f"print({name!r})"] for name in ("molds", "slice")]
    jobs = StoppedBetween(tmp_path, lambda *_: commands)
    for _ in range(2):  # the stop of one run is not that of the next
        assert jobs.start((), "mk4", LABEL, True)
        state = follow_to_the_end(jobs)
        assert (state["status"], state["lines"]) == (STOPPED, ["molds"])


@pytest.mark.parametrize(("ends", "made"), [((0, 0), True), ((0, 2), True), ((2, 0), False)])
def test_the_page_knows_whether_the_folder_was_made_before_a_later_command_failed(tmp_path, ends, made):
    commands = [[sys.executable, "-c", f"raise SystemExit({status})"] for status in ends]
    jobs = Jobs(tmp_path, lambda *_: commands)
    for _ in range(2):  # of each run anew
        assert jobs.start((), "mk4", LABEL, True)
        state = follow_to_the_end(jobs)
        assert (state["made"], state["status"]) == (made, max(ends))


def test_stop_while_a_command_is_being_started_ends_it(tmp_path, monkeypatch):
    jobs, begin = Jobs(tmp_path, lambda *_: [[sys.executable, "-c", WAITS]]), subprocess.Popen

    def popen(*words, **options):
        process = begin(*words, **options)
        jobs.stop()
        return process

    monkeypatch.setattr("fab.design_page.jobs.subprocess.Popen", popen)
    assert jobs.start((), "mk4", LABEL, False)
    assert follow_to_the_end(jobs)["status"] == -signal.SIGTERM


def test_the_button_runs_the_very_commands(tmp_path):
    words = ("D=150", "T=9", "joint_clearance=0.15", "material=Dragon Skin 30")
    (molds,) = program_commands(words, "mk4", False, tmp_path)
    assert molds == [sys.executable, "-m", "fab.molds", *words, "printer=mk4", f"exports={tmp_path}"]
    assert all("printer=mk4" in run for run in program_commands(words, "mk4", True, tmp_path))
    assert [run[2] for run in program_commands(words, "mk4", True, tmp_path)] == [
        "fab.molds", "fab.slice", "fab.build_sheet",
    ]  # fmt: skip
