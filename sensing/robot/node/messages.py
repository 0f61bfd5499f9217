"""Samples and estimates as ROS 2 messages, and samples from messages (m, s, N, rad, as in ROS).

Stamps are wall time; ``wall_ns`` is added to the samples' clock. A stamp holds whole nanoseconds, as the times
of samples do, and numbers are doubles: a sample is restored to the bit.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sensing.live.outputs.ros import types as ros
from sensing.live.outputs.ros.messages import (
    CONTACT_FREE,
    CONTACT_TOUCHING,
    CONTACT_UNKNOWN,
    transforms,
    unit_quaternion,
)
from sensing.robot.estimate import BarEstimate, RobotEstimate
from sensing.robot.node.run import NS, whole_ns
from sensing.tensegrity.description import Array, TensegrityRobot
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample, Sample
from sensing.tensegrity.vectors import minus_cross

IMU, JOINTS = "sensor_msgs/msg/Imu", "sensor_msgs/msg/JointState"  # ROS types of samples
ODOMETRY, POSES = "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseArray"  # ROS types of estimates
WORLD = "world"  # ``frame_id`` of the world
TO_MM = np.where(np.arange(16).reshape(4, 4) % 4 == 3, 1000.0, 1.0)  # on a pose: translations from m to mm
TO_MM[3] = 1.0
NOT_MEASURED = -1.0  # first number of the covariance in sensor_msgs/Imu for a quantity that is not measured


def sample_message(sample: Sample, cables: tuple[str, ...], wall_ns: int) -> tuple[str, bytes]:
    """(type, bytes) of a sample.

    Args:
        sample: sample of any kind.
        cables: names of the measured cables, in order.
        wall_ns: offset that is added to its time, ns.
    """
    types = ros.typestore().types
    stamp = wall_ns + (whole_ns(sample.time_s) if math.isfinite(sample.time_s) else 0)
    if isinstance(sample, InertialSample):
        force = sample.acceleration_m_s2
        message = types[IMU](
            header=ros.header(stamp, sample.sensor), orientation=_quaternion(np.eye(3)),
            orientation_covariance=np.full(9, NOT_MEASURED), angular_velocity=_vector(sample.rate_rad_s),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=_vector(np.zeros(3) if force is None else force),
            linear_acceleration_covariance=np.full(9, NOT_MEASURED if force is None else 0.0),
        )  # fmt: skip
        return IMU, ros.encode(IMU, message)
    if isinstance(sample, LengthSample):
        none = np.zeros(0)
        lengths = np.ascontiguousarray(sample.lengths_m, float)
        message = types[JOINTS](
            header=ros.header(stamp, "cables"), name=list(cables), position=lengths, velocity=none, effort=none
        )
        return JOINTS, ros.encode(JOINTS, message)
    seen = CONTACT_TOUCHING if sample.touching else CONTACT_FREE
    force, torque = (_vector(part) for part in (sample.force_n, sample.torque_nm))
    message = types[ros.ENDCAP_WRENCH](
        header=ros.header(stamp, sample.endcap), wrench=types["geometry_msgs/msg/Wrench"](force=force, torque=torque),
        covariance=np.ascontiguousarray(sample.covariance, float).ravel(),
        valid=bool(np.isfinite(sample.force_n).all()), contact=CONTACT_UNKNOWN if sample.touching is None else seen,
        state="", reason="", flags=sorted(sample.flags),
    )  # fmt: skip
    return ros.ENDCAP_WRENCH, ros.encode(ros.ENDCAP_WRENCH, message)


def sample_of(kind: str, data: bytes, wall_ns: int) -> Sample:
    """The sample of a message in CDR.

    Args:
        kind: type of the message.
        data: CDR bytes.
        wall_ns: offset that is subtracted from its stamp, ns.

    Raises:
        ValueError: bytes that are no such message.
    """
    return sample_from(kind, ros.decode(kind, data), wall_ns)


def sample_from(kind: str, message: Any, wall_ns: int) -> Sample:
    """The sample of a decoded message, also of one that a DDS reader has taken.

    Args:
        kind: type of the message.
        message: any object with the fields of that type.
        wall_ns: offset that is subtracted from its stamp, ns.
    """
    stamp = message.header.stamp
    time_s = (stamp.sec * NS + stamp.nanosec - wall_ns) / NS
    if kind == IMU:
        without = message.linear_acceleration_covariance[0] == NOT_MEASURED
        force = None if without else _three(message.linear_acceleration)
        turns = message.angular_velocity_covariance[0] != NOT_MEASURED  # its zeros would mean a bar at rest
        rate = _three(message.angular_velocity) if turns else np.full(3, np.nan)
        return InertialSample(time_s, message.header.frame_id, rate, force)
    if kind == JOINTS:
        return LengthSample(time_s, np.array(message.position, float))
    if kind == ros.WRENCH:
        return FootSample(time_s, message.header.frame_id, _three(message.wrench.force), _three(message.wrench.torque))
    touching = None if message.contact == CONTACT_UNKNOWN else message.contact == CONTACT_TOUCHING
    counts = 1.0 if message.valid else np.nan  # zeros of one that is not valid would mean that the endcap is free
    return FootSample(
        time_s, message.header.frame_id, counts * _three(message.wrench.force), _three(message.wrench.torque),
        np.array(message.covariance, float).reshape(6, 6), touching, frozenset(message.flags),
    )  # fmt: skip


def odometry(bar: BarEstimate, stamp_ns: int) -> bytes:
    """nav_msgs/Odometry of a bar: pose in the world, twist in the bar's axes, as the message defines them.

    The twist holds the covariances of velocity and angular velocity; their cross covariance is left zero.

    Args:
        bar: estimate of the bar.
        stamp_ns: wall time, ns.
    """
    types, R = ros.typestore().types, bar.T_world_bar[:3, :3]
    slopes = np.hstack([R.T @ minus_cross(-bar.velocity_m_s), R.T])  # a rotation error changes these axes
    twist_covariance = np.zeros((6, 6))
    twist_covariance[:3, :3] = slopes @ bar.covariance[3:, 3:] @ slopes.T
    twist_covariance[3:, 3:] = bar.bar_rate_covariance
    message = types[ODOMETRY](
        header=ros.header(stamp_ns, WORLD), child_frame_id=f"bar_{bar.name}",
        pose=types["geometry_msgs/msg/PoseWithCovariance"](
            pose=_pose(bar.T_world_bar), covariance=np.ascontiguousarray(bar.covariance[:6, :6]).ravel()
        ),
        twist=types["geometry_msgs/msg/TwistWithCovariance"](
            twist=types["geometry_msgs/msg/Twist"](
                linear=_vector(R.T @ bar.velocity_m_s), angular=_vector(R.T @ bar.rate_rad_s)
            ),
            covariance=twist_covariance.ravel(),
        ),
    )  # fmt: skip
    return ros.encode(ODOMETRY, message)


def endcap_poses(estimate: RobotEstimate, stamp_ns: int) -> bytes:
    """geometry_msgs/PoseArray: centres of the endcaps' spheres, in the order of the description, world axes."""
    poses = []
    for endcap in estimate.endcaps:
        pose = np.eye(4)
        pose[:3, 3] = endcap.centre_m
        poses.append(pose)
    return pose_array(np.array(poses), stamp_ns)


def pose_array(poses: Array, stamp_ns: int) -> bytes:
    """geometry_msgs/PoseArray of (N, 4, 4) poses, m."""
    message = ros.typestore().types[POSES](header=ros.header(stamp_ns, WORLD), poses=[_pose(pose) for pose in poses])
    return ros.encode(POSES, message)


def bar_transforms(estimate: RobotEstimate, stamp_ns: int) -> bytes:
    """tf2_msgs/TFMessage with the transform from world to every bar."""
    children = {f"bar_{bar.name}": (WORLD, bar.T_world_bar * TO_MM) for bar in estimate.bars}
    return transforms(children, stamp_ns)


def endcap_transforms(robot: TensegrityRobot, stamp_ns: int) -> bytes:
    """tf2_msgs/TFMessage with the transform from each bar to its endcaps, as the description states them.

    Args:
        robot: robot with its endcaps, whose names are the frames of their wrenches.
        stamp_ns: wall time, ns.
    """
    children = {each.name: (f"bar_{each.bar}", each.T_bar_endcap * TO_MM) for each in robot.endcaps}
    return transforms(children, stamp_ns)


def _three(vector: Any) -> Array:
    return np.array([vector.x, vector.y, vector.z], float)


def _vector(values: Array) -> Any:
    return ros.typestore().types["geometry_msgs/msg/Vector3"](*(float(value) for value in values))


def _pose(T: Array) -> Any:
    types = ros.typestore().types
    place = types["geometry_msgs/msg/Point"](*(float(value) for value in T[:3, 3]))
    return types["geometry_msgs/msg/Pose"](position=place, orientation=_quaternion(T[:3, :3]))


def _quaternion(R: Array) -> Any:
    return ros.typestore().types["geometry_msgs/msg/Quaternion"](*(float(value) for value in unit_quaternion(R)))
