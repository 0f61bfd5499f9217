"""ROS 2 topics without a ROS installation: the authors' names and the standard types, over Cyclone DDS.

    /endcap_N/wrench/wrench_pred   geometry_msgs/WrenchStamped     filtered; on the endcap, at its origin (N, N m)
    /endcap_N/wrench/force_norm    std_msgs/Float64                N
    /endcap_N/array/shear_vector   std_msgs/Float32MultiArray      (channel, row, column), px of the 200 x 200 crop
    /endcap_N/contact              std_msgs/Bool                   only while it is known
    /endcap_N/contact_place        geometry_msgs/PoseWithCovarianceStamped, while a plane touches: centre, z its normal
    /endcap_N/valid                std_msgs/Bool                   whether the numbers of this frame count
    /endcap_N/flags                std_msgs/String                 warnings, separated by commas
    /diagnostics                   diagnostic_msgs/DiagnosticArray levels of all endcaps, twice a second

A frame without a valid number (a black picture, say) publishes NaN, as REP 117 has it for measurements that failed:
a subscriber sees that the sensor lives and that there is no number. Nothing but /diagnostics comes while no frame does.

``ros2 topic echo /endcap_0/wrench/wrench_pred`` on any machine of the same ``ROS_DOMAIN_ID`` sees them. Unlike the
authors' node, stamps are capture times, torques are about the origin of the endcap frame instead of the sphere's
centre, and nothing is set to zero below a threshold.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cad.errors import ParameterError
from sensing.live.core.reading import EndcapReading
from sensing.live.core.sink import QueuedSink
from sensing.live.core.stats import EndcapHealth
from sensing.live.outputs.beat import Beat
from sensing.live.outputs.diagnosis import diagnosis

ROOM = 64
BEAT_S = 0.5
MOST_DOMAIN = 232  # DDS: more leaves no ports


class RosTopics(QueuedSink):
    """Publishes every reading.

    Args:
        endcaps: names, which begin the topics. domain: None for ``ROS_DOMAIN_ID`` or 0. health: for the diagnostics.

    Raises:
        ParameterError: a domain outside 0..232, or DDS is not installed or finds no network.
    """

    def __init__(
        self, endcaps: tuple[str, ...], domain: int | None = None, health: Callable[[], Sequence[EndcapHealth]] = list
    ) -> None:
        super().__init__(ROOM)
        self._health, self._beat = health, Beat(BEAT_S, self._diagnose)
        self._domain = _domain(domain)
        try:
            from cyclonedds.core import DDSException
        except ImportError:
            raise ParameterError("--ros needs Cyclone DDS: run pip install 'endcap-toolkit[ros]'", name="ros") from None
        try:
            self._writers, self._diagnostics = _writers(endcaps, self._domain)
        except DDSException as error:
            raise ParameterError(
                f"--ros: DDS cannot start in domain {self._domain} ({error}): is there a network interface?", name="ros"
            ) from None
        self._wall_ns = time.time_ns() - int(time.monotonic() * 1e9)

    @property
    def note(self) -> str:
        """State in one line."""
        return f"ROS 2 topics in domain {self._domain}" + (f": stopped ({self.failed})" if self.failed else "")

    def start(self) -> None:
        """Begin to publish."""
        super().start()
        self._beat.start()

    def write(self, reading: EndcapReading) -> None:
        """All messages of one reading."""
        from sensing.live.outputs import dds_types as dds

        writers = self._writers[reading.endcap]
        stamp = self._wall_ns + int(reading.captured_s * 1e9)
        header = dds.Header(dds.Time(stamp // 10**9, stamp % 10**9), reading.endcap)
        force, torque = (
            dds.Vector3(*(float(x) for x in part)) for part in (reading.wrench.force_n, reading.wrench.torque_nm)
        )
        writers["wrench/wrench_pred"].write(dds.WrenchStamped(header, dds.WrenchBody(force, torque)))
        writers["wrench/force_norm"].write(dds.Float64(float(np.linalg.norm(reading.wrench.force_n))))
        writers["valid"].write(dds.Bool(reading.valid))
        writers["flags"].write(dds.String(", ".join(sorted(reading.wrench.flags))))
        if reading.contact.known:
            writers["contact"].write(dds.Bool(reading.contact.touching))
        if reading.place.known:
            position, quaternion, covariance = (part.ravel().tolist() for part in reading.place.pose())
            pose = dds.Pose(dds.Point(*position), dds.Quaternion(*quaternion))
            stated = dds.PoseWithCovarianceStamped(header, dds.PoseWithCovariance(pose, covariance))
            writers["contact_place"].write(stated)
        channels, rows, columns = reading.field.channels.shape
        sizes = (
            ("channel", channels, channels * rows * columns),
            ("row", rows, rows * columns),
            ("column", columns, columns),
        )
        dimensions: Any = [dds.MultiArrayDimension(*size) for size in sizes]
        layout = dds.MultiArrayLayout(dimensions, 0)
        data: Any = np.where(reading.field.valid, reading.field.channels, np.float32(np.nan)).ravel().tolist()
        writers["array/shear_vector"].write(dds.Float32MultiArray(layout, data))

    def finish(self) -> None:
        """Take the topics away."""
        self._beat.stop()
        self._writers, self._diagnostics = {}, None

    def _diagnose(self) -> None:
        """The state of all endcaps, also while no frame comes."""
        from sensing.live.outputs import dds_types as dds

        writer, stamp = self._diagnostics, self._wall_ns + int(time.monotonic() * 1e9)
        if writer is None:
            return
        status: Any = [
            dds.DiagnosticStatus(level, name, message, name, [dds.KeyValue(k, v) for k, v in values.items()])  # type: ignore[arg-type]
            for name, level, message, values in map(diagnosis, self._health())
        ]
        header = dds.Header(dds.Time(stamp // 10**9, stamp % 10**9), "")
        writer.write(dds.DiagnosticArray(header, status))


def topic_types() -> dict[str, Any]:
    """DDS type of each topic below an endcap's name."""
    from sensing.live.outputs import dds_types as dds

    return {
        "wrench/wrench_pred": dds.WrenchStamped,
        "wrench/force_norm": dds.Float64,
        "array/shear_vector": dds.Float32MultiArray,
        "contact": dds.Bool,
        "contact_place": dds.PoseWithCovarianceStamped,
        "valid": dds.Bool,
        "flags": dds.String,
    }


def topic_qos() -> Any:
    """ROS 2's default: reliable, volatile, keep last; a slow subscriber never holds up the publisher."""
    from cyclonedds.core import Policy, Qos
    from cyclonedds.util import duration

    return Qos(
        Policy.Reliability.Reliable(duration(milliseconds=0)),
        Policy.Durability.Volatile,
        Policy.History.KeepLast(10),
    )


def _writers(endcaps: tuple[str, ...], domain: int) -> tuple[dict[str, dict[str, Any]], Any]:
    """(writers by endcap and topic, writer of /diagnostics)."""
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic

    from sensing.live.outputs import dds_types as dds

    participant, qos = DomainParticipant(domain), topic_qos()
    diagnostics = DataWriter(participant, Topic(participant, "rt/diagnostics", dds.DiagnosticArray, qos=qos), qos=qos)
    writers = {
        endcap: {
            name: DataWriter(participant, Topic(participant, f"rt/{endcap}/{name}", kind, qos=qos), qos=qos)
            for name, kind in topic_types().items()
        }
        for endcap in endcaps
    }
    return writers, diagnostics


def _domain(domain: int | None) -> int:
    text = os.environ.get("ROS_DOMAIN_ID", "0") if domain is None else str(domain)
    if not (text.isascii() and text.isdigit() and len(text) < 5) or int(text) > MOST_DOMAIN:
        raise ParameterError(f"ROS_DOMAIN_ID={text} outside 0..{MOST_DOMAIN}", name="domain", value=text)
    return int(text)
