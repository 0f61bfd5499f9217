"""Live streams as a source: wrenches of this computer's endcaps, or of ROS 2 topics; the other sensors from topics.

    /imu/NAME                       sensor_msgs/Imu             NAME as the robot's description has it
    /cable_lengths                  sensor_msgs/JointState      ``position`` in m, by the cables' names, NaN for none
    /NAME/wrench/with_covariance    endcap_msgs/EndcapWrench    as ``sensing.live --ros`` publishes them
    /NAME/wrench                    geometry_msgs/WrenchStamped any other sensor's: on the endcap, in its frame

A plain wrench has no covariance and no contact bit: standard deviations are stated (``wrench_sd``) or those of
:mod:`sensing.robot.contact`, and the force determines the contact. Plain wrenches are used until one with
covariance has come. Stamps are wall time of clocks that agree (NTP, PTP); they become times of this process's monotonic
clock, which also times pictures. A topic with another clock is reported; stamps far from now are left out. Topics are
volatile, and reliable unless a publisher offers best effort alone, as drivers of inertial sensors do.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cad.errors import printable
from cad.messages import LOG
from sensing.live.outputs.ros import dds
from sensing.live.outputs.ros import types as ros
from sensing.live.outputs.ros.topics import open_participant
from sensing.live.outputs.ros.wall_clock import WallClock
from sensing.robot.node import messages
from sensing.robot.node.clock_watch import ClockWatch
from sensing.robot.node.recorder import LENGTHS
from sensing.robot.node.ros_topics import ros_names
from sensing.tensegrity.description import Array, TensegrityRobot
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample, Sample

if TYPE_CHECKING:
    from sensing.robot.node.endcaps_here import EndcapsHere

WAITING = 2000  # messages of a topic that wait while this process is held up: seconds at any usual rate
IDLE_S = 0.002  # s, pause between looks for messages
PATIENCE_S = 3.0  # s, after which topics without any message are reported, once
SLOW_S = 1.0  # s, processing time of samples that waited together, from which lateness is reported
OFFERS_S = 0.5  # s, interval at which the publishers' offers are read


class LiveRobot:
    """Samples as they arrive, until the run is stopped.

    Args:
        robot: robot with its sensors.
        endcaps: endcaps.toml of this computer's cameras; None where topics bring the wrenches.
        domain: number of the DDS domain; None for ``ROS_DOMAIN_ID`` or 0.
        wrench_sd: standard deviations (N, N m) of wrenches that come without covariance.

    Raises:
        ParameterError: DDS does not start; an endcap of the file that the robot does not have; a name that is no part
            of a topic.
        FileError: no such file.
    """

    def __init__(
        self, robot: TensegrityRobot, endcaps: Path | None = None, domain: int | None = None,
        wrench_sd: tuple[float, float] | None = None,
    ) -> None:  # fmt: skip
        self.robot = robot
        self._clock = WallClock()
        self._cables = [cable.name for cable in robot.cables if cable.measured]
        self._covariance = None if wrench_sd is None else np.diag(np.repeat(np.square(wrench_sd), 3))
        self._with_covariance: set[str] = set()
        self._here = None if endcaps is None else _endcaps_here(endcaps, robot)
        sensors = ros_names((sensor.name for sensor in robot.sensors), "inertial sensor")
        topics = [(f"imu/{part}", messages.IMU, name) for name, part in sensors.items()]
        topics.append((LENGTHS.strip("/"), messages.JOINTS, ""))
        wrenches = ros_names((endcap.name for endcap in robot.endcaps) if endcaps is None else (), "endcap")
        for name, part in wrenches.items():
            topic = f"{part}/wrench"
            topics += [(f"{topic}/with_covariance", ros.ENDCAP_WRENCH, name), (topic, ros.WRENCH, name)]
        self._participant, self._owner = open_participant(domain)
        self._readers = [(topic, kind, name, self._reader(topic, kind)) for topic, kind, name in topics]
        self._silent = [topic for topic, _, _ in topics]
        self._clocks, self._slow, self._lengths_named = ClockWatch(LOG.warning), False, False

    def arrivals(self) -> Iterator[tuple[float, Sample] | None]:
        """(time of arrival, sample); None while none comes, or while endcaps here have given no wrench yet."""
        if self._here is not None:
            self._here.start()
        named_s, offers_s = time.monotonic() + PATIENCE_S, 0.0
        try:
            while True:
                if time.monotonic() > offers_s:
                    offers_s = time.monotonic() + OFFERS_S
                    self._take_best_effort()
                if time.monotonic() > named_s:
                    named_s = math.inf
                    self._name_silent()
                ready = self._here is None or self._here.ready()
                waiting = self._waiting()
                if not ready:  # samples before the first wrenches are dropped
                    waiting = []
                at_s = time.monotonic()
                for sample in waiting:
                    yield _paced(at_s, sample.time_s - waiting[0].time_s), sample
                self._name_slowness(time.monotonic() - at_s)
                if not waiting:
                    time.sleep(IDLE_S)
                    yield None
        finally:
            if self._here is not None:
                self._here.close()

    def truth(self, _: float) -> Array | None:
        """None: the true pose of a real robot is unknown."""
        return None

    def _take_best_effort(self) -> None:
        """Request best effort where a publisher offers no more, since DDS connects no reliable reader to it."""
        for place, (topic, kind, name, reader) in enumerate(self._readers):
            if reader.get_requested_incompatible_qos_status().total_count:
                self._readers[place] = topic, kind, name, self._reader(topic, kind, reliable=False)

    def _reader(self, topic: str, kind: str, reliable: bool = True) -> Any:
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        of_topic = Topic(self._participant, f"rt/{topic}", dds.idl_type(kind), qos=dds.quality())
        return DataReader(self._participant, of_topic, qos=dds.quality(kept=WAITING, reliable=reliable))

    def _name_silent(self) -> None:
        """Print a line with the topics without any message; one of an endcap's two topics suffices."""
        plain = [topic.removesuffix("/with_covariance") for topic in self._silent]
        silent = [topic for topic in dict.fromkeys(plain) if "/wrench" not in topic or plain.count(topic) > 1]
        if silent:
            LOG.warning(f"nothing for {PATIENCE_S:g} s on {', '.join(f'/{topic}' for topic in silent)}: waiting")

    def _name_strangers(self, names: Iterable[str]) -> None:
        """Print a line, once, if no length has the name of a cable: without one there would never be an estimate."""
        if not self._lengths_named and set(self._cables).isdisjoint(names):
            has = f"the description has {', '.join(self._cables)}: use its names"
            LOG.warning(printable(f"{LENGTHS}: {', '.join(names)[:80]}: no cables of the robot; {has}"))
        self._lengths_named = True

    def _name_slowness(self, took_s: float) -> None:
        """Print a line, once, if waiting samples took so long that estimates are old."""
        if took_s > SLOW_S and not self._slow:
            self._slow = True
            LOG.warning(f"estimates come {took_s:.1f} s late: this computer has too little time for them")

    def _waiting(self) -> list[Sample]:
        """Samples since the last call, sorted by time: in topic order, the newest of one would make others late."""
        self._follow_clock()
        waiting: list[Sample] = [] if self._here is None else list(self._here.samples())
        for topic, kind, name, reader in self._readers:
            for message in reader.take(WAITING):
                if getattr(message, "header", None) is None:  # the notice that a publisher has left
                    continue
                if topic in self._silent:
                    self._silent.remove(topic)
                sample = self._sample(kind, name, message)
                if sample is not None and self._clocks.take(topic, sample.time_s, time.monotonic()):
                    waiting.append(sample)
        return sorted(waiting, key=lambda sample: sample.time_s if math.isfinite(sample.time_s) else math.inf)

    def _follow_clock(self) -> None:
        """Follow changes of the wall clock (by NTP, after a start without network) in the conversion of stamps."""
        moved_s = self._clock.follow()
        if moved_s:
            LOG.warning(f"this computer's clock was set by {moved_s:+.2f} s: stamps are read by the new time")

    def _sample(self, kind: str, name: str, message: Any) -> Sample | None:
        """The sample of a message; None for a plain wrench beside one with covariance.

        The topic determines the sensor: ``frame_id`` is the driver's name of its axes.

        Args:
            kind: type of the message.
            name: name of the sensor or endcap, from the topic.
            message: message of the topic.
        """
        sample = messages.sample_from(kind, message, self._clock.offset_ns)
        if isinstance(sample, LengthSample) and message.name:  # sorted into the order of the description
            by_name = dict(zip(message.name, message.position, strict=False))
            self._name_strangers(by_name.keys())
            return replace(sample, lengths_m=np.array([by_name.get(cable, np.nan) for cable in self._cables], float))
        if isinstance(sample, InertialSample):
            return replace(sample, sensor=name)
        if not isinstance(sample, FootSample):
            return sample
        if kind == ros.ENDCAP_WRENCH:
            self._with_covariance.add(name)
            return replace(sample, endcap=name)
        if name in self._with_covariance:
            return None
        covariance = sample.covariance if self._covariance is None else self._covariance
        return replace(sample, endcap=name, covariance=covariance)


def _paced(taken_s: float, later_s: float) -> float:
    """Time of arrival of a sample that waited beside others, s.

    If processing takes longer than the time that the samples span, that time counts instead; otherwise reports, which
    cost more than samples, would come at ever shorter intervals.

    Args:
        taken_s: time at which all were taken, s.
        later_s: difference of its capture time to that of the first, s; NaN without.
    """
    return min(time.monotonic(), taken_s + later_s) if later_s > 0 else taken_s


def _endcaps_here(path: Path, robot: TensegrityRobot) -> EndcapsHere:
    from sensing.robot.node.endcaps_here import EndcapsHere

    return EndcapsHere(path, robot)
