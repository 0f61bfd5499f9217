"""Messages of topics and recordings as bytes: numbers of a reading, camera, transforms, answers of the service.

Lengths go out in m as ROS has them; in here they are mm.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sensing.live.core.reading import EndcapReading
from sensing.live.core.state import word
from sensing.live.outputs.ros import types as ros

if TYPE_CHECKING:
    from sensing.camera.mount import MountedCamera

CAMERA_INFO, TRANSFORMS = "sensor_msgs/msg/CameraInfo", "tf2_msgs/msg/TFMessage"
STATIC = "/tf_static"
# Its channel in a recording: kept for subscribers that come later, as ``ros2 bag`` writes it; 9223372036.854775807 s is
# for ever, in rosbag2's form.
_EVER = "\n    sec: 9223372036\n    nsec: 854775807\n"
LATCHED = {
    "offered_qos_profiles": "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n"
    f"  deadline:{_EVER}  lifespan:{_EVER}  liveliness: 1\n  liveliness_lease_duration:{_EVER}"
    "  avoid_ros_namespace_conventions: false"
}
TRIGGER_REQUEST, TRIGGER_REPLY = "std_srvs/srv/Trigger_Request", "std_srvs/srv/Trigger_Response"
_ASKER = "uint64 guid\nint64 seq\n"  # Cyclone's ROS layer puts the client's id before each request and reply
CONTACT_UNKNOWN, CONTACT_FREE, CONTACT_TOUCHING = 0, 1, 2
NUMBERS: dict[str, str] = {  # topics of a reading's numbers, below the name of the endcap, with their types
    "wrench/wrench_pred": ros.WRENCH,
    "wrench/with_covariance": ros.ENDCAP_WRENCH,
    "wrench/force_norm": ros.FLOAT64,
    "contact": ros.BOOL,
    "contact_place": ros.POSE,
    "valid": ros.BOOL,
    "flags": ros.STRING,
}


@lru_cache(maxsize=1)
def register_trigger() -> None:
    """Make the two halves of std_srvs/Trigger known, as they are on the wire."""
    from rosbags.typesys import get_types_from_msg

    request, reply = _ASKER + "uint8 structure_needs_at_least_one_member\n", _ASKER + "bool success\nstring message\n"
    for name, text in ((TRIGGER_REQUEST, request), (TRIGGER_REPLY, reply)):
        ros.typestore().register({name: next(iter(get_types_from_msg(text, name).values()))})  # it renames services


def numbers_of(reading: EndcapReading, stamp_ns: int) -> Iterator[tuple[str, bytes]]:
    """(topic of :data:`NUMBERS`, message) of a reading; ``stamp_ns`` is wall time."""
    name, wrench = reading.endcap, reading.wrench
    yield "wrench/wrench_pred", ros.wrench_stamped(wrench, stamp_ns, name)
    yield "wrench/with_covariance", endcap_wrench(reading, stamp_ns)
    yield "wrench/force_norm", ros.float64(float((wrench.force_n**2).sum() ** 0.5))
    yield "valid", ros.boolean(reading.valid)
    yield "flags", ros.string(", ".join(sorted(wrench.flags)))
    if reading.contact.known:
        yield "contact", ros.boolean(reading.contact.touching)
    if reading.place.known:
        yield "contact_place", ros.pose_stamped(reading.place, stamp_ns, name)


def endcap_wrench(reading: EndcapReading, stamp_ns: int) -> bytes:
    """endcap_msgs/EndcapWrench of a reading; ``stamp_ns`` is wall time."""
    contact = reading.contact
    seen = CONTACT_TOUCHING if contact.touching else CONTACT_FREE
    message = ros.typestore().types[ros.ENDCAP_WRENCH](
        header=ros.header(stamp_ns, reading.endcap),
        wrench=ros.wrench_message(reading.wrench),
        covariance=np.ascontiguousarray(reading.wrench.covariance, float).ravel(),
        valid=reading.valid,
        contact=seen if contact.known else CONTACT_UNKNOWN,
        state=word(reading.event),
        reason=reading.reason,
        flags=sorted(reading.wrench.flags),
    )
    return ros.encode(ros.ENDCAP_WRENCH, message)


def camera_info(mounted: MountedCamera, stamp_ns: int, frame_id: str) -> bytes:
    """sensor_msgs/CameraInfo; the fisheye is ROS's ``equidistant``, with the same four coefficients.

    Args:
        mounted: lens and its size.
        stamp_ns: wall time.
        frame_id: of the camera.
    """
    types, camera = ros.typestore().types, mounted.camera
    k = np.array([[camera.fx_px, 0.0, camera.cx_px], [0.0, camera.fy_px, camera.cy_px], [0.0, 0.0, 1.0]])
    message = types[CAMERA_INFO](
        header=ros.header(stamp_ns, frame_id), height=camera.height_px, width=camera.width_px,
        distortion_model="equidistant", d=np.array(camera.k, float), k=k.ravel(), r=np.eye(3).ravel(),
        p=np.hstack([k, np.zeros((3, 1))]).ravel(), binning_x=0, binning_y=0,
        roi=types["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )  # fmt: skip
    return ros.encode(CAMERA_INFO, message)


def transforms(children: Mapping[str, tuple[str, NDArray[np.float64]]], stamp_ns: int) -> bytes:
    """tf2_msgs/TFMessage.

    Args:
        children: (parent, (4, 4) child to parent, mm) by name of the child.
        stamp_ns: wall time.
    """
    types = ros.typestore().types
    vector, quaternion = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
    found = []
    for child, (parent, T) in children.items():
        x, y, z, w = (float(value) for value in unit_quaternion(T[:3, :3]))
        place = types["geometry_msgs/msg/Transform"](
            translation=vector(*(float(mm) / 1e3 for mm in T[:3, 3])), rotation=quaternion(x=x, y=y, z=z, w=w)
        )
        found.append(
            types["geometry_msgs/msg/TransformStamped"](
                header=ros.header(stamp_ns, parent), child_frame_id=child, transform=place
            )
        )
    return ros.encode(TRANSFORMS, types[TRANSFORMS](transforms=found))


def unit_quaternion(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """(x, y, z, w) of a rotation, from the largest of four (Shepperd 1978), so that half turns are exact."""
    m = np.asarray(R, float)
    trace = float(np.trace(m))
    squares = 1.0 - trace + 2.0 * np.diag(m)  # 4 x^2, 4 y^2, 4 z^2
    vector = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    rows = np.zeros((4, 4))
    rows[:3, :3] = m + m.T
    rows[range(3), range(3)] = squares
    rows[:3, 3] = rows[3, :3] = vector
    rows[3, 3] = 1.0 + trace
    row = rows[int(np.argmax(np.diag(rows)))]
    return np.asarray(row / np.linalg.norm(row) * (1.0 if row[3] >= 0 else -1.0))


def trigger_reply(asker: tuple[int, int], success: bool, message: str) -> bytes:
    """Answer of a std_srvs/Trigger service.

    Args:
        asker: guid and number of the request.
        success, message: the answer.
    """
    kind = ros.typestore().types[TRIGGER_REPLY]
    return ros.encode(TRIGGER_REPLY, kind(guid=asker[0], seq=asker[1], success=success, message=message))
