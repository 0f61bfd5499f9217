"""The estimate as ROS 2 topics, without a ROS installation, over Cyclone DDS.

    /robot/bar/NAME/odometry   nav_msgs/Odometry        pose in ``world``, twist in the bar's axes, both with covariance
    /robot/endcaps             geometry_msgs/PoseArray  centres of the endcaps' spheres, in the description's order
    /robot/estimate            std_msgs/String          the whole estimate as JSON
    /tf                        tf2_msgs/TFMessage       world to ``bar_NAME``

Stamps are wall time. Names keep letters, digits and underscores, as ROS has them; others become underscores.
"""

from __future__ import annotations

import re
from typing import Any

from sensing.live.outputs import ros_types as ros
from sensing.live.outputs.ros import dds
from sensing.live.outputs.ros.messages import TRANSFORMS
from sensing.live.outputs.ros.topics import open_participant
from sensing.live.outputs.ros.wall_clock import WallClock
from sensing.robot.node import messages
from sensing.robot.node.record import Report, estimate_text
from sensing.tensegrity.description import TensegrityRobot
from sensing.tensegrity.samples import Sample


class RobotTopics:
    """Publishes every report.

    Args:
        robot: of the reports. domain: None for ``ROS_DOMAIN_ID`` or 0.

    Raises:
        ParameterError: a domain outside 0..232, or DDS is not installed or finds no network.
    """

    def __init__(self, robot: TensegrityRobot, domain: int | None = None) -> None:
        self._clock = WallClock()
        self._participant, self._owner = open_participant(domain)
        kinds = {f"robot/bar/{ros_name(bar.name)}/odometry": messages.ODOMETRY for bar in robot.bars}
        kinds |= {"robot/endcaps": messages.POSES, "robot/estimate": ros.STRING, "tf": TRANSFORMS}
        self._kinds = kinds
        self._writers: dict[str, Any] = {
            topic: dds.publisher(self._participant, topic, kind) for topic, kind in kinds.items()
        }

    def sample(self, sample: Sample) -> None:
        """Nothing: who has the samples has published them."""

    def report(self, report: Report) -> None:
        """All messages of one report."""
        estimate = report.estimate
        stamp = self._clock.stamp_ns(estimate.time_s)
        for bar in estimate.bars:
            self._write(f"robot/bar/{ros_name(bar.name)}/odometry", messages.odometry(bar, stamp))
        self._write("robot/endcaps", messages.endcap_poses(estimate, stamp))
        self._write("robot/estimate", ros.string(estimate_text(estimate)))
        self._write("tf", messages.bar_transforms(estimate, stamp))

    def close(self) -> None:
        """Take the topics away."""
        self._writers = {}
        self._participant, self._owner = None, None

    def _write(self, topic: str, cdr: bytes) -> None:
        self._writers[topic].write(dds.encoded(self._kinds[topic], cdr))


def ros_name(name: str) -> str:
    """A name as a part of a topic's."""
    return re.sub(r"[^A-Za-z0-9_]", "_", name)
