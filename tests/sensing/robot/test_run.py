"""The running estimator: samples in, lines, JSON and a recording out, and the recording's bits again."""

import gc
import json
import shutil
import socket
import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import ChunkIndex, Message
from standing_robot import standing_samples

from cad.errors import FileError
from sensing.live.mcap_records import read_records
from sensing.live.outputs.lines import ROOM, Lines
from sensing.live.outputs.ros import types as ros
from sensing.robot.estimator import RobotEstimator
from sensing.robot.node import cli, messages
from sensing.robot.node import recorder as recorder_module
from sensing.robot.node.cli import JsonOutput, main
from sensing.robot.node.page import RobotPage
from sensing.robot.node.record import Report, estimate_record, report_text
from sensing.robot.node.recorder import RobotRecorder
from sensing.robot.node.replay import Recording
from sensing.robot.node.run import run_robot
from sensing.robot.node.terminal import line
from sensing.robot.settings import DEFAULTS
from sensing.tensegrity.robot_file import SHIPPED, load_robot
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample

ROBOT = load_robot()
PATIENCE_S = 60.0
WALL_NS = 1_700_000_000_123_456_789


class Standing:
    """A source that knows where the bars truly are, in a world turned by a right angle."""

    robot = ROBOT

    def __init__(self, kinds: tuple[type, ...] = (InertialSample, LengthSample, FootSample), seconds: float = 2.0):
        self.poses, samples = standing_samples(ROBOT, seconds)
        self.samples = [sample for sample in samples if isinstance(sample, kinds)]

    def arrivals(self):
        for sample in self.samples:
            yield sample.time_s + 0.01, sample
            yield None

    def truth(self, _):
        turn = np.array([[0.0, -1, 0, 3], [1, 0, 0, 4], [0, 0, 1, 0], [0, 0, 0, 1]])
        return turn @ self.poses


class Kept:
    def __init__(self):
        self.reports: list[Report] = []

    def sample(self, _):
        pass

    def report(self, report):
        self.reports.append(report)


def recorded(path, source):
    """(path, reports) of a run into a file."""
    recorder, kept = RobotRecorder(path, ROBOT, SHIPPED.read_bytes()), Kept()
    run_robot(source, RobotEstimator(ROBOT), [kept, recorder], lambda: False)
    recorder.close()
    assert recorder.failed == ""
    return path, kept.reports


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp("run") / "run.mcap", Standing())


def test_a_replay_gives_the_same_bits(run):
    path, reports = run
    kept = Kept()
    found = Recording(path).replay([kept])
    assert found.compared == len(reports) >= 15 and found.different == 0 and found.end is None
    assert found.samples == len(Standing().samples) and not found.notes
    assert [estimate_record(a.estimate) for a in kept.reports] == [estimate_record(b.estimate) for b in reports]


def test_a_replay_sees_one_bit(run):
    assert Recording(run[0]).replay(settings=replace(DEFAULTS, length_sd_m=2e-3 * (1 + 1e-12))).different > 0


def test_truth_stands_in_the_world_of_the_estimate(run):
    report = run[1][-1]
    assert report.drift_m(ROBOT) < 0.03 and "off by" in line(report, ROBOT)
    reported = json.loads(report_text(report, ROBOT))
    assert reported["drift_m"] == report.drift_m(ROBOT) and len(reported["bars"]) == 3


def test_topics_say_what_the_estimate_says(run):
    path, reports = run
    topics, found = {}, {}
    for record in read_records(path):
        if hasattr(record, "topic"):
            topics[record.id] = record.topic
        elif hasattr(record, "channel_id"):
            found[topics[record.channel_id]] = record.data
    estimate = reports[-1].estimate
    poses = ros.decode(messages.POSES, found["/robot/endcaps"]).poses
    assert [[p.position.x, p.position.y, p.position.z] for p in poses] == [
        e.centre_m.tolist() for e in estimate.endcaps
    ]
    bar = estimate.bars[1]
    odometry = ros.decode(messages.ODOMETRY, found["/robot/bar/green/odometry"])
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("world", "bar_green")
    assert odometry.pose.covariance == pytest.approx(bar.covariance[:6, :6].ravel())
    linear = odometry.twist.twist.linear
    assert bar.T_world_bar[:3, :3] @ [linear.x, linear.y, linear.z] == pytest.approx(bar.velocity_m_s)
    place = ros.decode("tf2_msgs/msg/TFMessage", found["/tf"]).transforms[1].transform.translation
    assert [place.x, place.y, place.z] == pytest.approx(bar.T_world_bar[:3, 3].tolist(), abs=1e-12)


@pytest.mark.parametrize(
    "sample",
    [
        InertialSample(1.234567891, "imu_red", np.array([1e-300, -0.1, np.pi]), np.array([0.1, 9.8, np.nan])),
        InertialSample(0.0, "imu_blue", np.array([0.1, 0.2, 0.3])),
        LengthSample(3.000000001, np.array([0.5, np.nan, 1 / 3])),
        FootSample(7.5, "3", np.full(3, np.nan), np.ones(3) / 3, np.eye(6) / 7, None, frozenset({"out_of_range"})),
        FootSample(7.5, "3", np.ones(3), np.ones(3), np.eye(6), False),
    ],
)
def test_a_sample_comes_back_to_the_bit(sample):
    back = messages.sample_of(*messages.sample_message(sample, ("a", "b", "c"), WALL_NS), WALL_NS)
    assert type(back) is type(sample)
    for name, value in vars(sample).items():
        found = getattr(back, name)
        same = np.array_equal(found, value, equal_nan=True) if isinstance(value, np.ndarray) else found == value
        assert same, name


def test_without_inertial_sensors_it_says_what_is_left(tmp_path):
    path, reports = recorded(tmp_path / "a.mcap", Standing((LengthSample, FootSample)))
    (note,) = Recording(path).replay().notes
    assert note.startswith("no inertial sample in it: the first shape from the cables, held, which endcaps touch")
    assert any(
        "which way is up is not measured" in each or "no sample" in each for each in reports[-1].estimate.health.notes
    )


def test_without_lengths_there_is_no_estimate(tmp_path):
    path, _ = recorded(tmp_path / "b.mcap", Standing((InertialSample, FootSample)))
    with pytest.raises(FileError, match=r"no estimate in it .* without the lengths of the cables"):
        Recording(path).replay()


def test_a_cut_or_damaged_recording_is_read_up_to_there(run, tmp_path, capsys):
    data = run[0].read_bytes()
    (cut := tmp_path / "cut.mcap").write_bytes(data[: len(data) * 2 // 3])
    assert main(["--replay", str(cut)]) == 1
    assert "cut at byte" in capsys.readouterr().err
    broken = bytearray(data)
    broken[len(data) // 2] ^= 1
    (damaged := tmp_path / "damaged.mcap").write_bytes(broken)
    assert main(["--replay", str(damaged)]) == 1
    assert "damaged at byte" in capsys.readouterr().err


def test_the_command_replays(run, capsys):
    assert main(["--replay", str(run[0])]) == 0
    said = capsys.readouterr().out
    assert "0 differ" in said and "0 holds" in said
    assert main(["--replay", str(run[0]), "--json"]) == 0
    lines = [json.loads(each) for each in capsys.readouterr().out.splitlines()]
    assert len(lines) == len(run[1]) and lines[-1]["endcaps"][0]["state"] == "holds"


@pytest.mark.parametrize("words", [[], ["--replay", "RUN"]])
def test_the_estimator_is_compiled_before_the_run(words, run, tmp_path, monkeypatch):
    """Compiled between two samples, on a new computer, nothing is said for half a minute, nor is Ctrl-C heard."""

    def interrupted(*_):
        raise KeyboardInterrupt

    shutil.copy(run[0], tmp_path / "RUN")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sensing.robot.demo.simulated.SimulatedRobot", lambda *_, **__: Standing())
    monkeypatch.setattr("sensing.robot.node.warm_up.warm_up", interrupted)
    assert main([*words, "--no-page"]) == 130


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--terrain", "moon"], "terrain='moon': choose flat"),
        (["--seconds", "1"], "outside 3..600"),
        (["--seed", "-1"], "seed=-1 is negative"),
        (["--speed", "-1"], "speed=-1 outside"),
        (["--config", "none.toml"], "none.toml: No such file"),
        (["--replay", "none.mcap"], "none.mcap: No such file"),
        (["--replay", "RUN", "--seed", "2"], "--seed has no effect with --replay"),
        (["--replay", "RUN", "--ros"], "--ros has no effect with --replay"),
        (["--replay", "RUN", "--live"], "--live has no effect with --replay"),
        (["--replay", "RUN", "--port", "0"], "--port has no effect with --replay"),
        (["--no-page", "--port", "9000"], "--port has no effect with --no-page"),
        (["--replay", "TEXT"], "no MCAP file"),
    ],
)
def test_bad_input_gets_one_line(words, said, run, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shutil.copy(run[0], tmp_path / "RUN")
    (tmp_path / "TEXT").write_text("nothing of the kind, in some more than a few bytes\n" * 9)
    assert main(words) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


def test_a_file_that_is_there_stays(run):
    with pytest.raises(FileError, match="is there already"):
        RobotRecorder(run[0], ROBOT, b"")


def test_where_the_page_cannot_begin_no_recording_is_left(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cli, "_source", lambda *_: Standing())
    with socket.create_server(("127.0.0.1", 0)) as taken:
        words = ["--record", str(tmp_path / "run.mcap"), "--port", str(taken.getsockname()[1])]
        assert main(words) == 2
    assert "choose another port" in capsys.readouterr().err and not list(tmp_path.iterdir())


def test_a_reader_that_takes_no_line_does_not_keep_the_run_from_its_end(run, monkeypatch):
    """Ctrl-C is a request that the loop looks at between two samples: an output that waits for ever would hide it."""
    reads, asked = threading.Event(), threading.Event()
    stream = SimpleNamespace(isatty=lambda: False, write=lambda _: reads.wait(PATIENCE_S), flush=lambda: None)
    lines = Lines(stream)
    output = JsonOutput(lines, ROBOT, asked.is_set)
    writer = threading.Thread(target=lambda: [output.report(run[1][0]) for _ in range(ROOM + 3)], daemon=True)
    writer.start()
    writer.join(0.5)
    assert writer.is_alive()  # nothing is left out for one that reads
    asked.set()
    writer.join(PATIENCE_S)
    assert not writer.is_alive()
    reads.set()
    lines.close()


def test_a_live_robot_does_not_wait_for_a_slow_reader(run):
    """Recording, page and topics are in the same loop: they would stand still, and nothing would say so."""
    reads, said = threading.Event(), []
    stream = SimpleNamespace(isatty=lambda: False, write=lambda _: reads.wait(PATIENCE_S), flush=lambda: None)
    lines = Lines(stream)
    output = JsonOutput(lines, ROBOT, lost=said.append)
    writer = threading.Thread(target=lambda: [output.report(run[1][0]) for _ in range(ROOM + 9)], daemon=True)
    writer.start()
    writer.join(PATIENCE_S)
    assert not writer.is_alive() and said == ["--json: the reader is too slow, estimates are left out"]
    reads.set()
    lines.close()


def test_the_index_of_a_recording_does_not_grow_in_memory(run, tmp_path, monkeypatch):
    monkeypatch.setattr(recorder_module, "FLUSH_S", 0.0)
    recorder = RobotRecorder(tmp_path / "run.mcap", ROBOT, SHIPPED.read_bytes())
    for sample in Standing(seconds=0.2).samples:
        recorder.sample(sample)
    assert not [each for each in gc.get_objects() if type(each) is ChunkIndex]
    recorder.report(run[1][0])
    recorder.close()
    assert recorder.failed == "" and sum(isinstance(each, Message) for each in read_records(recorder.path)) > 50
    with recorder.path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert len(summary.chunk_indexes) == summary.statistics.chunk_count > 50


def test_an_output_that_raises_is_named_and_the_estimate_goes_on(tmp_path, monkeypatch, capsys):
    def broken(*_):
        raise RuntimeError("out of\nresources")

    monkeypatch.setattr(cli, "_source", lambda *_: Standing())
    monkeypatch.setattr(RobotPage, "report", broken)
    assert main(["--record", str(tmp_path / "run.mcap"), "--json"]) == 1
    said = capsys.readouterr()
    assert "sensing.robot: RobotPage: stopped (RuntimeError: out of" in said.err and said.err.count("stopped (") == 1
    assert len(said.out.splitlines()) > 10
    replayed = Recording(tmp_path / "run.mcap").replay()
    assert replayed.compared > 10 and replayed.different == 0 and replayed.end is None
