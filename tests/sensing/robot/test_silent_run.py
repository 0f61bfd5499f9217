"""A live robot of which nothing comes any more, its recording, and the stamps of a run whose clock is its own."""

import time
from dataclasses import replace
from types import SimpleNamespace

import pytest
from standing_robot import standing_samples

from sensing.live.mcap_records import read_records
from sensing.live.outputs.ros import types as ros
from sensing.robot.estimator import RobotEstimator
from sensing.robot.node import messages
from sensing.robot.node import run as run_module
from sensing.robot.node.recorder import RobotRecorder
from sensing.robot.node.replay import Recording
from sensing.robot.node.ros_topics import RobotTopics
from sensing.robot.node.run import SILENT_S, run_robot
from sensing.tensegrity.robot_file import SHIPPED, load_robot
from sensing.tensegrity.samples import LengthSample

ROBOT = load_robot()
SAMPLES = standing_samples(ROBOT, 3.0, rate_hz=100.0)[1]


class Paused:
    """Samples as they are taken, after two seconds a pause in which none is; its clock runs with the arrivals."""

    robot = ROBOT

    def __init__(self, samples=SAMPLES, pause_s=4.0, back_s=0.0):
        self.now_s, self._samples, self._pause_s, self._back_s = 0.0, samples, pause_s, back_s

    def arrivals(self):
        for sample in self._samples:
            late_s = self._pause_s if sample.time_s > 2.0 else 0.0
            while self.now_s < sample.time_s + late_s - 0.01:
                self.now_s += 0.002
                yield None
            self.now_s = sample.time_s + late_s
            yield self.now_s, replace(sample, time_s=self.now_s - (self._back_s if sample.time_s > 2.0 else 0.0))

    def truth(self, _):
        return None


class Kept:
    def __init__(self):
        self.reports = []

    def sample(self, _):
        pass

    def report(self, report):
        self.reports.append(report)


@pytest.fixture
def run(tmp_path, monkeypatch):
    source, kept = Paused(), Kept()
    monkeypatch.setattr(run_module, "time", SimpleNamespace(monotonic=lambda: source.now_s))
    recorder = RobotRecorder(tmp_path / "run.mcap", ROBOT, SHIPPED.read_bytes(), wall_ns=10**18)
    run_robot(source, RobotEstimator(ROBOT), [kept, recorder], lambda: False, silent_s=SILENT_S)
    recorder.close()
    return recorder.path, [report.estimate for report in kept.reports]


def test_a_silent_robot_is_not_called_healthy(run):
    _, estimates = run
    times = [estimate.time_s for estimate in estimates]
    assert times == sorted(times)
    silent = [estimate for estimate in estimates if estimate.time_s > estimate.measured_s]
    assert 10 < len(silent) < 20 and silent[-1].time_s > silent[-1].measured_s + 0.9
    for estimate in silent:
        notes = " ".join(estimate.health.notes)
        assert "imu_red: no sample" in notes and "cable lengths: no sample" in notes and "endcap_3: no reading" in notes
        assert {endcap.hold.word for endcap in estimate.endcaps} == {"unknown"}
    before = [estimate for estimate in estimates if 1.5 < estimate.time_s < 2.0]
    assert before and all(estimate.health.good for estimate in before) and estimates[-1].time_s > silent[-1].time_s


def test_a_robot_whose_clock_is_set_back_is_not_called_healthy(monkeypatch):
    """Samples that all come too late kept the last estimate alive, in good health, until the clock had caught up."""
    source, kept = Paused(pause_s=0.0, back_s=5.0), Kept()
    monkeypatch.setattr(run_module, "time", SimpleNamespace(monotonic=lambda: source.now_s))
    run_robot(source, RobotEstimator(ROBOT), [kept], lambda: False, silent_s=SILENT_S)
    times = [report.estimate.time_s for report in kept.reports]
    assert times == sorted(set(times)) and times[-1] > 2.7
    assert not any(report.estimate.health.good for report in kept.reports if report.estimate.time_s > 2.05)


def test_its_recording_gives_the_same_bits(run):
    path, estimates = run
    found = Recording(path).replay()
    assert found.compared == len(estimates) and found.different == 0


def test_stamps_of_a_run_with_a_clock_of_its_own_are_wall_time(run):
    path, _ = run
    topics, written_ns = {}, []
    for record in read_records(path):
        if hasattr(record, "log_time") and hasattr(record, "channel_id"):
            written_ns.append(record.log_time)
        if hasattr(record, "schema_id"):
            topics[record.id] = record.topic
        elif hasattr(record, "channel_id") and topics.get(record.channel_id) == "/imu/imu_red":
            stamp = ros.decode(messages.IMU, record.data).header.stamp
            assert stamp.sec - 10**9 in range(7)
    assert written_ns == sorted(written_ns)  # readers play by these: at the run's own pace, in no time computed
    assert 3 < (written_ns[-1] - written_ns[0]) / 1e9 < 7 and written_ns[0] - 10**18 in range(10**9)
    written, wall_ns = [], time.time_ns()
    topics = RobotTopics(ROBOT, 77, wall_ns)
    topics._write = lambda topic, cdr: written.append((topic, cdr))
    topics.report(SimpleNamespace(estimate=run[1][0]))
    stamp = ros.decode(messages.POSES, dict(written)["robot/endcaps"]).header.stamp
    topics.close()
    assert stamp.sec * 10**9 + stamp.nanosec == wall_ns + round(run[1][0].time_s * 1e9)


def test_its_recording_says_where_the_endcaps_are_on_their_bars_and_keeps_that_for_late_subscribers(run):
    from rosbags.interfaces import QosDurability
    from rosbags.rosbag2 import Reader

    with Reader(run[0]) as reader:
        (static,) = [each for each in reader.connections if each.topic == "/tf_static"]
        ((_, _, data),) = reader.messages([static])
        assert [qos.durability for qos in static.ext.offered_qos_profiles] == [QosDurability.TRANSIENT_LOCAL]
    found = ros.decode(static.msgtype, data).transforms
    assert [(each.header.frame_id, each.child_frame_id) for each in found] == [
        (f"bar_{each.bar}", each.name) for each in ROBOT.endcaps
    ]


def test_what_no_sensor_measures_is_named_though_there_is_no_estimate(capsys):
    samples = [replace(s, lengths_m=1000 * s.lengths_m) if isinstance(s, LengthSample) else s for s in SAMPLES]
    assert run_robot(Paused(samples, 0.0), RobotEstimator(ROBOT), [], lambda: False) == 0
    said = capsys.readouterr().err
    assert said.count("left out: check its unit") == 9 and said.count("\n") == 9 and "0..2.46" in said
