"""The estimate as ROS 2 topics, without a ROS installation, over Cyclone DDS.

    /robot/bar/NAME/odometry   nav_msgs/Odometry        pose in ``world``, twist in the bar's axes (docs/robot.md)
    /robot/endcaps             geometry_msgs/PoseArray  centres of the endcaps' spheres, in the description's order
    /robot/estimate            std_msgs/String          the whole estimate as JSON
    /tf                        tf2_msgs/TFMessage       world to ``bar_NAME``
    /tf_static                 tf2_msgs/TFMessage       ``bar_NAME`` to ``endcap_N``, the frame of its wrenches

Stamps are wall time. Names keep letters, digits and underscores, as ROS allows them; others become underscores. A name
that begins with a digit, or that becomes equal to another one, is refused.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterable
from typing import Any

from cad.errors import ParameterError
from sensing.live.outputs.ros import dds
from sensing.live.outputs.ros import types as ros
from sensing.live.outputs.ros.messages import TRANSFORMS
from sensing.live.outputs.ros.topics import open_participant
from sensing.live.outputs.ros.wall_clock import WallClock
from sensing.robot.node import messages
from sensing.robot.node.record import Report, estimate_text
from sensing.robot.node.run import whole_ns
from sensing.tensegrity.description import TensegrityRobot
from sensing.tensegrity.samples import Sample


class RobotTopics:
    """Publishes every report.

    Args:
        robot: robot of the reports.
        domain: number of the DDS domain; None for ``ROS_DOMAIN_ID`` or 0.
        wall_ns: wall time at which the reports' clock was 0; None where that is the monotonic clock of this process.

    Raises:
        ParameterError: a domain outside 0..232, a bar's name that is no part of a topic, or DDS is not installed or
            finds no network.
    """

    def __init__(self, robot: TensegrityRobot, domain: int | None = None, wall_ns: int | None = None) -> None:
        self._clock, self._wall_ns = WallClock(), wall_ns
        self._part_of = ros_names((bar.name for bar in robot.bars), "bar")
        self._participant, self._owner = open_participant(domain)
        kinds = {f"robot/bar/{part}/odometry": messages.ODOMETRY for part in self._part_of.values()}
        kinds |= {"robot/endcaps": messages.POSES, "robot/estimate": ros.STRING, "tf": TRANSFORMS}
        self._kinds = kinds
        self._writers: dict[str, Any] = {
            topic: dds.publisher(self._participant, topic, kind) for topic, kind in kinds.items()
        }
        self._mounted = dds.publisher(self._participant, "tf_static", TRANSFORMS, latched=True)
        self._mounted.write(dds.encoded(TRANSFORMS, messages.endcap_transforms(robot, time.time_ns())))

    def sample(self, sample: Sample) -> None:
        """Do nothing: samples come from topics already."""

    def report(self, report: Report) -> None:
        """Publish all messages of one report."""
        estimate = report.estimate
        wall_ns, time_s = self._wall_ns, estimate.time_s
        stamp = self._clock.stamp_ns(time_s) if wall_ns is None else wall_ns + whole_ns(time_s)
        for bar in estimate.bars:
            self._write(f"robot/bar/{self._part_of[bar.name]}/odometry", messages.odometry(bar, stamp))
        self._write("robot/endcaps", messages.endcap_poses(estimate, stamp))
        self._write("robot/estimate", ros.string(estimate_text(estimate)))
        self._write("tf", messages.bar_transforms(estimate, stamp))

    def close(self) -> None:
        """Remove the topics."""
        self._writers, self._mounted = {}, None
        self._participant, self._owner = None, None

    def _write(self, topic: str, cdr: bytes) -> None:
        self._writers[topic].write(dds.encoded(self._kinds[topic], cdr))


def ros_names(names: Iterable[str], what: str) -> dict[str, str]:
    """The part of a topic for each name, which may not begin with a digit (ROS 2 topic and service names).

    Args:
        names: names in the robot's description.
        what: kind of the named things, for the message.

    Raises:
        ParameterError: a part that ROS does not allow, or that two names share.
    """
    parts: dict[str, str] = {}
    for name in names:
        part = re.sub(r"[^A-Za-z0-9_]", "_", name)
        if part[0].isdigit() or part in parts.values():
            reason = "begins with a digit" if part[0].isdigit() else "stands for another one, too"
            raise ParameterError(
                f'{what} "{name}" of the robot: its part of a ROS topic, {part}, {reason}: give it another name, of '
                "letters, digits and underscores, a letter first",
                name="name",
                value=name,
            )
        parts[name] = part
    return parts
