"""ROS 2 messages as bytes (CDR) and their definitions as text, without a ROS installation.

The standard types are those of ROS 2 Humble, as the library ``rosbags`` has them; the topics are the authors' own
(``/endcap_N/wrench/wrench_pred`` and so on), with the units of ROS: N, N m, s.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sensing.records import Frame, ShearField, Wrench

if TYPE_CHECKING:
    from sensing.wrench.plane_contact import PlaneContact

IMAGE, FLOAT64, BOOL = "sensor_msgs/msg/CompressedImage", "std_msgs/msg/Float64", "std_msgs/msg/Bool"
WRENCH, ARRAY = "geometry_msgs/msg/WrenchStamped", "std_msgs/msg/Float32MultiArray"
POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
STRING = "std_msgs/msg/String"
FAULT = "fault"  # format of a picture that could not be read: its bytes say why
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
PACKAGES = Path(__file__).resolve().parent / "packages"  # sources of the ROS packages
ENDCAP_WRENCH = "endcap_msgs/msg/EndcapWrench"


@lru_cache(maxsize=1)
def typestore() -> Any:
    """The message types, with our own; loaded when first needed."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    text = (PACKAGES / "endcap_msgs" / "msg" / "EndcapWrench.msg").read_text(encoding="utf-8")
    store.register(get_types_from_msg(text, ENDCAP_WRENCH))
    return store


@lru_cache(maxsize=64)
def definition(name: str) -> str:
    """Text of a message type with all that it contains, as MCAP schemas of encoding ros2msg have it."""
    return str(typestore().generate_msgdef(name, ros_version=2)[0])


@lru_cache(maxsize=64)
def type_hash(name: str) -> str:
    """Hash of a message type (RIHS01), by which ROS 2 from Iron on knows two definitions of one name."""
    return str(typestore().hash_rihs01(name))


def encode(name: str, message: Any) -> bytes:
    """CDR of a message."""
    return bytes(typestore().serialize_cdr(message, name))


def decode(name: str, data: bytes) -> Any:
    """Message from CDR."""
    return typestore().deserialize_cdr(data, name)


def camera_frame(endcap: str) -> str:
    """Name of the frame that pictures and camera_info are in: x right, y down, z along the optical axis."""
    return f"{endcap}_camera"


def header(stamp_ns: int, frame_id: str) -> Any:
    """std_msgs/Header; the stamp is wall time."""
    types = typestore().types
    stamp = types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame_id)


def wrench_stamped(wrench: Wrench, stamp_ns: int, frame_id: str) -> bytes:
    """geometry_msgs/WrenchStamped.

    Args:
        wrench: N and N m.
        stamp_ns: wall time.
        frame_id: name of the endcap.
    """
    return encode(WRENCH, typestore().types[WRENCH](header=header(stamp_ns, frame_id), wrench=wrench_message(wrench)))


def wrench_message(wrench: Wrench) -> Any:
    """geometry_msgs/Wrench."""
    types = typestore().types
    vector = types["geometry_msgs/msg/Vector3"]
    force, torque = (vector(*(float(x) for x in part)) for part in (wrench.force_n, wrench.torque_nm))
    return types["geometry_msgs/msg/Wrench"](force=force, torque=torque)


def pose_stamped(place: PlaneContact, stamp_ns: int, frame_id: str) -> bytes:
    """geometry_msgs/PoseWithCovarianceStamped: where a plane touches, z along its normal.

    Args:
        place: of the contact.
        stamp_ns: wall time.
        frame_id: name of the endcap.
    """
    types = typestore().types
    position, quaternion, covariance = place.pose()
    pose = types["geometry_msgs/msg/Pose"](
        position=types["geometry_msgs/msg/Point"](*position.tolist()),
        orientation=types["geometry_msgs/msg/Quaternion"](*quaternion.tolist()),
    )
    content = types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=covariance.ravel())
    return encode(POSE, types[POSE](header=header(stamp_ns, frame_id), pose=content))


def compressed_image(data: bytes, form: str, stamp_ns: int, frame_id: str) -> bytes:
    """sensor_msgs/CompressedImage from the bytes of a picture file.

    Args:
        data: the file.
        form: ``jpeg`` or ``png``.
        stamp_ns: wall time.
        frame_id: :func:`camera_frame` of the endcap.
    """
    content = np.frombuffer(data, np.uint8)
    return encode(IMAGE, typestore().types[IMAGE](header=header(stamp_ns, frame_id), format=form, data=content))


def float64(value: float) -> bytes:
    """std_msgs/Float64."""
    return encode(FLOAT64, typestore().types[FLOAT64](data=float(value)))


def boolean(value: bool) -> bytes:
    """std_msgs/Bool."""
    return encode(BOOL, typestore().types[BOOL](data=bool(value)))


def string(value: str) -> bytes:
    """std_msgs/String."""
    return encode(STRING, typestore().types[STRING](data=value))


def shear_vector(field: ShearField) -> bytes:
    """std_msgs/Float32MultiArray (channel, row, column); cells without support are NaN."""
    types = typestore().types
    dimension = types["std_msgs/msg/MultiArrayDimension"]
    channels, rows, columns = field.channels.shape
    sizes = (
        ("channel", channels, channels * rows * columns),
        ("row", rows, rows * columns),
        ("column", columns, columns),
    )
    layout = types["std_msgs/msg/MultiArrayLayout"](
        dim=[dimension(label=name, size=size, stride=stride) for name, size, stride in sizes], data_offset=0
    )
    data = np.where(field.valid, field.channels, np.float32(np.nan)).ravel()
    return encode(ARRAY, types[ARRAY](layout=layout, data=data))


def diagnostic_array(states: Sequence[tuple[str, int, str, dict[str, str]]], stamp_ns: int) -> bytes:
    """diagnostic_msgs/DiagnosticArray from (name, level 0..2, message, values)."""
    types = typestore().types
    pair = types["diagnostic_msgs/msg/KeyValue"]
    status = [
        types["diagnostic_msgs/msg/DiagnosticStatus"](
            level=level, name=name, message=message, hardware_id=name,
            values=[pair(key=key, value=value) for key, value in values.items()],
        )
        for name, level, message, values in states
    ]  # fmt: skip
    return encode(DIAGNOSTICS, types[DIAGNOSTICS](header=header(stamp_ns, ""), status=status))


def picture_bytes(frame: Frame) -> tuple[bytes, str]:
    """(file bytes, "jpeg" or "png") of a frame without loss: JPEG as it came, raw pictures as PNG, faults as text."""
    if frame.fault:
        return frame.fault.encode(), FAULT
    if frame.jpeg is not None:
        return frame.jpeg, "jpeg"
    import cv2

    return cv2.imencode(".png", frame.image, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1].tobytes(), "png"  # type: ignore[arg-type]
