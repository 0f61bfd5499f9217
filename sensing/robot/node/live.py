"""Live streams as a source: wrenches of this computer's endcaps, or of ROS 2 topics; the other sensors from topics.

    /imu/NAME                       sensor_msgs/Imu             NAME as the robot's description has it
    /cable_lengths                  sensor_msgs/JointState      ``position`` in m, by the cables' names, NaN for none
    /NAME/wrench/with_covariance    endcap_msgs/EndcapWrench    as ``sensing.live --ros`` publishes them

Stamps are wall time of clocks that agree (NTP, PTP); they become times of this process's monotonic clock, on which
pictures are captured. Topics are reliable and volatile.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sensing.live.core.engine import Engine
from sensing.live.core.reading import EndcapReading
from sensing.live.outputs import ros_types as ros
from sensing.live.outputs.ros import dds
from sensing.live.outputs.ros.topics import open_participant
from sensing.robot.node import messages
from sensing.robot.node.recorder import LENGTHS
from sensing.robot.node.ros_topics import ros_name
from sensing.robot.readings import foot_sample
from sensing.tensegrity.description import Array, TensegrityRobot
from sensing.tensegrity.samples import LengthSample, Sample

AT_ONCE = 64  # messages of a topic in one look
IDLE_S = 0.002
ROOM = 256  # readings that may wait


class LiveRobot:
    """Samples as they come, until the run is stopped.

    Args:
        robot: whose sensors. endcaps: endcaps.toml of the cameras here; None where topics bring the wrenches.
        domain: None for ``ROS_DOMAIN_ID`` or 0.

    Raises:
        ParameterError: DDS does not start; an endcap of the file that the robot does not have. FileError: no such file.
    """

    def __init__(self, robot: TensegrityRobot, endcaps: Path | None = None, domain: int | None = None) -> None:
        self.robot = robot
        self._wall_ns = time.time_ns() - time.monotonic_ns()
        self._cables = [cable.name for cable in robot.cables if cable.measured]
        self._readings: queue.Queue[EndcapReading] = queue.Queue(ROOM)
        self._engine = None if endcaps is None else _engine(endcaps, robot)
        self._participant, self._owner = open_participant(domain)
        kinds = {f"imu/{ros_name(sensor.name)}": messages.IMU for sensor in robot.sensors}
        kinds[LENGTHS.strip("/")] = messages.JOINTS
        if endcaps is None:
            names = [endcap.name for endcap in robot.endcaps]
            kinds |= {f"{ros_name(name)}/wrench/with_covariance": ros.ENDCAP_WRENCH for name in names}
        self._readers = [(kind, _reader(self._participant, topic, kind)) for topic, kind in kinds.items()]

    def arrivals(self) -> Iterator[tuple[float, Sample] | None]:
        """(time of arrival, sample); None while none comes."""
        if self._engine is not None:
            self._engine.add_sink(self)
            self._engine.start()
        try:
            while True:
                found = False
                for sample in self._waiting():
                    found = True
                    yield time.monotonic(), sample
                if not found:
                    time.sleep(IDLE_S)
                    yield None
        finally:
            if self._engine is not None:
                self._engine.close(1.0)

    def put(self, reading: EndcapReading) -> None:
        """A reading of the endcaps here; what nobody takes in time is left out."""
        if not self._readings.full():
            self._readings.put_nowait(reading)

    def truth(self, _: float) -> Array | None:
        """Nobody knows."""
        return None

    def _waiting(self) -> Iterator[Sample]:
        for kind, reader in self._readers:
            for message in reader.take(AT_ONCE):
                if getattr(message, "header", None) is not None:  # the others: a publisher has gone
                    yield self._named(kind, message)
        while not self._readings.empty():
            yield foot_sample(self._readings.get_nowait())

    def _named(self, kind: str, message: Any) -> Sample:
        """The sample of a message; lengths in the order of the description, whatever theirs is."""
        sample = messages.sample_from(kind, message, self._wall_ns)
        if not isinstance(sample, LengthSample) or not message.name:
            return sample
        by_name = dict(zip(message.name, message.position, strict=False))
        return replace(sample, lengths_m=np.array([by_name.get(name, np.nan) for name in self._cables], float))


def _engine(path: Path, robot: TensegrityRobot) -> Engine:
    from cad.errors import ParameterError
    from sensing.live.core.endcaps_file import load_config
    from sensing.live.open_endcaps import open_endcaps

    config = load_config(path)
    unknown = {endcap.name for endcap in config.endcaps} - {endcap.name for endcap in robot.endcaps}
    if unknown:
        known = ", ".join(endcap.name for endcap in robot.endcaps)
        raise ParameterError(
            f"{path}: {', '.join(sorted(unknown))}: the robot's description has {known}: use the same names in both",
            name="endcaps",
        )
    return Engine(open_endcaps(config))


def _reader(participant: Any, topic: str, kind: str) -> Any:
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic

    qos = dds.quality()
    return DataReader(participant, Topic(participant, f"rt/{topic}", dds.idl_type(kind), qos=qos), qos=qos)
