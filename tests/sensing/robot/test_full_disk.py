"""A recording of the robot on a disk that fills up: what is said of it is what it holds."""

import errno
import sys
import tempfile
from types import SimpleNamespace

import pytest
from mcap.records import Channel, Message
from standing_robot import standing_samples

from cad.errors import FileError
from sensing.live.mcap_records import CutError, read_records
from sensing.live.outputs.ros.messages import STATIC
from sensing.robot.estimator import RobotEstimator
from sensing.robot.node import recorder as recorder_module
from sensing.robot.node.cli import main
from sensing.robot.node.recorder import RobotRecorder
from sensing.robot.node.run import run_robot
from sensing.tensegrity.robot_file import SHIPPED, load_robot

ROBOT = load_robot()


def full(*_, **__):
    raise OSError(errno.ENOSPC, "No space left on device")


def held(path):
    """How many samples a file that has no end holds."""
    topics, count = {}, 0
    with pytest.raises(CutError):
        for record in read_records(path):
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            count += isinstance(record, Message) and topics[record.channel_id] != STATIC
    return count


@pytest.mark.parametrize(("flush_s", "written"), [(0.0, 3), (1e9, 0)])
def test_it_counts_the_samples_that_are_in_the_file(flush_s, written, tmp_path, monkeypatch):
    """Those of the last second, which waited in memory, were counted though they are lost."""
    monkeypatch.setattr(recorder_module, "FLUSH_S", flush_s)
    said = []
    recorder = RobotRecorder(tmp_path / "run.mcap", ROBOT, SHIPPED.read_bytes(), lost=said.append)
    samples = standing_samples(ROBOT, 0.1)[1]
    for sample in samples[:3]:
        recorder.sample(sample)
    monkeypatch.setattr(recorder._writer, "add_message", full)
    for sample in samples[3:]:
        recorder.sample(sample)
    assert said == [f"{recorder.path}: nothing more is recorded (No space left on device)"]  # while the robot walks on
    recorder.close()
    assert len(said) == 1
    assert recorder.samples == held(recorder.path) == written
    assert f"{written} samples and 0 estimates recorded, then stopped (No space left" in recorder.note


def test_an_index_that_cannot_be_written_any_more_is_let_go(tmp_path, monkeypatch):
    """Closing its file writes what waits: on a full disk the program ended with a traceback, without its last line."""
    recorder = RobotRecorder(tmp_path / "run.mcap", ROBOT, SHIPPED.read_bytes())
    monkeypatch.setattr(recorder._writer, "add_message", full)
    with open("/dev/full", "wb") as nowhere:
        monkeypatch.setattr(recorder._index, "_file", nowhere)
        nowhere.write(b"waits")
        recorder.sample(standing_samples(ROBOT, 0.1)[1][0])
        recorder.close()
        assert nowhere.closed and "No space left" in recorder.note


def test_where_the_index_cannot_be_kept_no_recording_is_left(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "TemporaryFile", full)
    with pytest.raises(FileError, match="No space left on device"):
        RobotRecorder(tmp_path / "run.mcap", ROBOT, SHIPPED.read_bytes())
    assert not list(tmp_path.iterdir())


def test_lines_that_cannot_be_written_are_named(tmp_path, monkeypatch, capsys):
    """A run ended with status 1 and no word, a replay with status 0."""
    path = tmp_path / "run.mcap"
    recorder = RobotRecorder(path, ROBOT, SHIPPED.read_bytes())
    source = SimpleNamespace(robot=ROBOT, truth=lambda _: None)
    source.arrivals = lambda: ((sample.time_s, sample) for sample in standing_samples(ROBOT, 1.2, rate_hz=100.0)[1])
    run_robot(source, RobotEstimator(ROBOT), [recorder], lambda: False)
    recorder.close()
    monkeypatch.setattr("sensing.robot.node.warm_up.warm_up", lambda *_: None)
    monkeypatch.setattr("sensing.robot.demo.simulated.SimulatedRobot", lambda *_, **__: source)
    for words in (["--json", "--no-page"], ["--replay", str(path), "--json"]):
        with open("/dev/full", "w", encoding="utf-8") as nowhere, monkeypatch.context() as patched:
            patched.setattr(sys, "stdout", nowhere)
            assert main(words) == 1
        assert capsys.readouterr().err.count("sensing.robot: standard output: No space left on device\n") == 1
