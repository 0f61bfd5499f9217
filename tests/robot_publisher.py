"""A standing robot whose samples are published over DDS, and an output that keeps reports."""

from __future__ import annotations

import threading
import time
from dataclasses import replace

import numpy as np
from standing_robot import standing_samples

from sensing.live.outputs.ros import dds
from sensing.live.outputs.ros import types as ros
from sensing.robot.node import messages
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample

ROBOT, PATIENCE_S = load_robot(), 120.0
CABLES = tuple(cable.name for cable in ROBOT.cables)


class Publisher:
    """Publishes a robot that stands, until it is stopped; one stream may be of another clock, and a stamp far off.

    ``shift_s``: of the lengths. ``odd_s``: of every fiftieth inertial stamp. ``wrenches``: "with_covariance", "plain"
    (geometry_msgs/WrenchStamped), or none. ``reliable``: False for best effort.
    """

    def __init__(
        self, participant, shift_s: float = 0.0, wrenches: str = "with_covariance", odd_s: float = 0.0, reliable=True
    ) -> None:
        self._participant, self._shift_s, self._writers = participant, shift_s, {}
        self._wrenches, self._odd_s, self._reliable = wrenches, odd_s, reliable
        self.stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        samples = standing_samples(ROBOT, 60.0, rate_hz=100.0)[1]
        for sample in samples[:13]:
            self._write(sample, time.time_ns(), warm=True)
        begin_ns = time.time_ns()
        for number, sample in enumerate(samples):
            if self.stopped.wait(max(0.0, sample.time_s - (time.time_ns() - begin_ns) / 1e9)):
                return
            off = self._shift_s if isinstance(sample, LengthSample) else 0.0
            off += self._odd_s if isinstance(sample, InertialSample) and number % 50 == 0 else 0.0
            self._write(replace(sample, time_s=sample.time_s + off), begin_ns)

    def _write(self, sample, wall_ns, warm=False):
        topic = "cable_lengths"
        kind, cdr = messages.sample_message(sample, CABLES[::-1], wall_ns)
        if isinstance(sample, InertialSample):
            topic = f"imu/{sample.sensor}"
        elif isinstance(sample, FootSample) and self._wrenches == "plain":
            topic, kind, cdr = f"{sample.endcap}/wrench", ros.WRENCH, plain_wrench(cdr)
        elif isinstance(sample, FootSample):
            topic = f"{sample.endcap}/wrench/{self._wrenches}"
        if isinstance(sample, LengthSample):  # another order than the description's, with its names
            turned = replace(sample, lengths_m=np.asarray(sample.lengths_m)[::-1])
            kind, cdr = messages.sample_message(turned, CABLES[::-1], wall_ns)
        if isinstance(sample, FootSample) and not self._wrenches:
            return
        if topic not in self._writers:
            self._writers[topic] = self._writer(topic, kind)
        if not warm:
            self._writers[topic].write(dds.encoded(kind, cdr))

    def _writer(self, topic, kind):
        if self._reliable:
            return dds.publisher(self._participant, topic, kind)
        from cyclonedds.pub import DataWriter
        from cyclonedds.topic import Topic

        of_topic = Topic(self._participant, f"rt/{topic}", dds.idl_type(kind), qos=dds.quality())
        return DataWriter(self._participant, of_topic, qos=dds.quality(reliable=False))

    def close(self):
        self.stopped.set()
        self._thread.join(PATIENCE_S)


def plain_wrench(cdr):
    """The WrenchStamped of an EndcapWrench, of a sensor whose frame has a name of its own."""
    full, types = ros.decode(ros.ENDCAP_WRENCH, cdr), ros.typestore().types
    header = replace(full.header, frame_id="mini45")
    return ros.encode(ros.WRENCH, types[ros.WRENCH](header=header, wrench=full.wrench))


class Kept:
    def __init__(self, enough: int):
        self.reports, self._enough, self._end = [], enough, time.monotonic() + PATIENCE_S

    def sample(self, _):
        pass

    def report(self, report):
        self.reports.append(report)

    def done(self):
        return len(self.reports) >= self._enough or time.monotonic() > self._end
