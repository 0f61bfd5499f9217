"""ROS 2 topics without a ROS installation: the authors' names and the standard types, over Cyclone DDS.

    /endcap_N/wrench/wrench_pred      geometry_msgs/WrenchStamped    filtered; on the endcap, at its origin (N, N m)
    /endcap_N/wrench/with_covariance  endcap_msgs/EndcapWrench       the same with covariance, valid, contact, flags
    /endcap_N/wrench/force_norm       std_msgs/Float64               N
    /endcap_N/array/shear_vector      std_msgs/Float32MultiArray     (channel, row, column), px of the 200 x 200 crop
    /endcap_N/contact                 std_msgs/Bool                  only while it is known
    /endcap_N/contact_place           geometry_msgs/PoseWithCovarianceStamped, of a plane that touches; only while known
    /endcap_N/valid                   std_msgs/Bool                  whether the numbers of this frame count
    /endcap_N/flags                   std_msgs/String                warnings, separated by commas
    /endcap_N/image/compressed        sensor_msgs/CompressedImage    JPEG as it came; while somebody subscribes
    /endcap_N/camera_info             sensor_msgs/CameraInfo         fisheye, ROS's equidistant model; not with pictures
                                                                     of another size than the reference's
    /diagnostics                      diagnostic_msgs/DiagnosticArray levels of all endcaps, twice a second
    /tf_static                        tf2_msgs/TFMessage             endcap_N to endcap_N_camera, robot to endcap_N
    /endcap_N/zero                    std_srvs/Trigger               (:mod:`sensing.live.outputs.ros.zero_service`)

A frame without a valid number (a black picture, say) publishes NaN, as REP 117 has it for measurements that failed:
a subscriber sees that the sensor lives and that there is no number. While no frame comes (unplugged, silent, no
reference) /diagnostics comes, and valid says false, twice a second.

``ros2 topic echo /endcap_0/wrench/wrench_pred`` on any machine of the same ``ROS_DOMAIN_ID`` sees them. Unlike the
authors' node, stamps are capture times, torques are about the origin of the endcap frame instead of the sphere's
centre, and nothing is set to zero below a threshold.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from cad.errors import ParameterError
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.reading import EndcapReading
from sensing.live.core.sink import QueuedSink, reason_of
from sensing.live.core.state import WITHOUT_FRAMES
from sensing.live.core.stats import EndcapHealth
from sensing.live.outputs.beat import Beat
from sensing.live.outputs.diagnosis import diagnosis
from sensing.live.outputs.ros import dds, messages
from sensing.live.outputs.ros import types as ros
from sensing.live.outputs.ros.environment import dds_configuration, domain_id
from sensing.live.outputs.ros.frames import CamerasInUse
from sensing.live.outputs.ros.wall_clock import WallClock
from sensing.live.outputs.ros.zero_service import ZeroServices

if TYPE_CHECKING:
    from sensing.tracking.zero import Zero

ROOM = 64
BEAT_S = 0.5
IMAGE_TOPIC = "image/compressed"
TOPICS: dict[str, str] = {  # below an endcap's name
    **messages.NUMBERS,
    "array/shear_vector": ros.ARRAY,
    IMAGE_TOPIC: ros.IMAGE,
    "camera_info": messages.CAMERA_INFO,
}


class RosTopics(QueuedSink):
    """Publishes every reading.

    Args:
        pipelines: of the endcaps, whose names begin the topics.
        domain: None for ``ROS_DOMAIN_ID`` or 0.
        health: for the diagnostics.

    Raises:
        ParameterError: a domain outside 0..232, or DDS is not installed or finds no network.
    """

    def __init__(
        self,
        pipelines: Sequence[EndcapPipeline],
        domain: int | None = None,
        health: Callable[[], Sequence[EndcapHealth]] = list,
    ) -> None:
        super().__init__(ROOM)
        self._pipelines = {pipeline.endcap.name: pipeline for pipeline in pipelines}
        self._health, self._beat = health, Beat(BEAT_S, self._look, partial(self._note_error, "/diagnostics"))
        self._errors: dict[str, str] = {}  # the first of each part; the other parts go on
        self._domain = domain_id(domain)
        self._clock = WallClock()
        self._cameras = CamerasInUse(pipelines, partial(self._note_error, "camera_info"))
        self._zeros: dict[str, Zero] = {}  # references whose frames were published
        self._writers: dict[str, dict[str, Any]] = {}
        self._diagnostics: Any = None
        self._transforms: Any = None
        self._participant, self._owner = open_participant(self._domain)
        self._open()

    @property
    def note(self) -> str:
        """State in one line."""
        return f"ROS 2 topics in domain {self._domain}" + (f": {self.loss}" if self.loss else "")

    @property
    def loss(self) -> str:
        """What went wrong, in one line; empty if nothing did."""
        if self.failed:
            return f"stopped ({self.failed})"
        said = [f"an error in {part} ({reason})" for part, reason in sorted(self._errors.items())]
        if self.dropped:
            said.append(f"{self.dropped} readings not published: this computer has too little time for them")
        return "; ".join(said)

    def start(self) -> None:
        """Begin to publish and to answer."""
        super().start()
        self._beat.start()
        self._services.start()

    def write(self, reading: EndcapReading) -> None:
        """All messages of one reading."""
        writers = self._writers[reading.endcap]
        for name, cdr in self._encoded(reading, self._clock.stamp_ns(reading.captured_s)):
            writers[name].write(dds.encoded(TOPICS[name], cdr))

    def finish(self) -> None:
        """Take the topics away."""
        self._beat.stop()
        self._services.stop()
        self._writers, self._diagnostics, self._transforms = {}, None, None
        self._participant, self._owner = None, None

    def _open(self) -> None:
        """Writers of all topics; transforms are written once, and when a reference shows another camera."""
        self._writers = {
            endcap: {name: dds.publisher(self._participant, f"{endcap}/{name}", kind) for name, kind in TOPICS.items()}
            for endcap in self._pipelines
        }
        self._looked_at = dict.fromkeys(self._pipelines, False)
        self._diagnostics = dds.publisher(self._participant, "diagnostics", ros.DIAGNOSTICS)
        self._transforms = dds.publisher(self._participant, "tf_static", messages.TRANSFORMS, latched=True)
        self._write_transforms()
        self._services = ZeroServices(
            self._participant, list(self._pipelines.values()), partial(self._note_error, "zero")
        )

    def _note_error(self, part: str, error: Exception) -> None:
        self._errors.setdefault(part, reason_of(error))

    def _encoded(self, reading: EndcapReading, stamp: int) -> Iterator[tuple[str, bytes]]:
        """(topic, bytes) of a reading."""
        name = reading.endcap
        yield from messages.numbers_of(reading, stamp)
        yield "array/shear_vector", ros.shear_vector(reading.field)
        pictured = reading.frame.jpeg is not None or reading.frame.image is not None  # not so of dots alone
        if self._looked_at[name] and pictured:
            picture, form = ros.picture_bytes(reading.frame)
            yield IMAGE_TOPIC, ros.compressed_image(picture, form, stamp, ros.camera_frame(name))
        if (camera := self._cameras.of(reading)) is not None:
            yield "camera_info", messages.camera_info(camera, stamp, ros.camera_frame(name))
        if self._zeros.get(name) is not reading.zero:
            self._zeros[name] = reading.zero
            self._write_transforms()

    def _write_transforms(self) -> None:
        children = self._cameras.transforms()
        self._transforms.write(dds.encoded(messages.TRANSFORMS, messages.transforms(children, time.time_ns())))

    def _look(self) -> None:
        """Publish the state of all endcaps, also without frames; note whether the pictures have subscribers."""
        writer = self._diagnostics
        if writer is None:
            return
        stamp = self._clock.stamp_ns(time.monotonic())
        healths = self._health()
        cdr = ros.diagnostic_array([diagnosis(health) for health in healths], stamp)
        writer.write(dds.encoded(ros.DIAGNOSTICS, cdr))
        for health in healths:
            if health.status in WITHOUT_FRAMES:  # or the last true would stand
                self._writers[health.endcap]["valid"].write(dds.encoded(ros.BOOL, ros.boolean(False)))
        for endcap, writers in self._writers.items():
            self._looked_at[endcap] = bool(writers[IMAGE_TOPIC].get_matched_subscriptions())


def open_participant(domain: int | None = None) -> tuple[Any, Any]:
    """(participant of the domain, owner of its configuration), on the network that ROS's variables name.

    Raises:
        ParameterError: a domain outside 0..232, or DDS is not installed or finds no network.
    """
    number = domain_id(domain)
    try:
        from cyclonedds.core import DDSException
    except ImportError:
        raise ParameterError("--ros needs Cyclone DDS: run pip install 'endcap-toolkit[ros]'", name="ros") from None
    try:
        return _participant(number)
    except DDSException as error:
        raise ParameterError(
            f"--ros: DDS cannot start in domain {number} ({error}): is there a network interface?", name="ros"
        ) from None


def _participant(domain: int) -> tuple[Any, Any]:
    from cyclonedds.core import DDSException
    from cyclonedds.domain import Domain, DomainParticipant

    configuration, owner = dds_configuration(), None
    if configuration is not None:
        try:
            owner = Domain(domain, configuration)
        except DDSException as error:
            if error.code != DDSException.DDS_RETCODE_PRECONDITION_NOT_MET:  # the process is in that domain already
                raise
    return DomainParticipant(domain), owner
