"""The ROS 2 packages of the endcaps, to be built where ROS 2 is installed.

    python -m sensing.live.ros_package --out ~/ros2_ws/src/endcap

``endcap_msgs`` has the message with covariance, ``endcap_bringup`` a launch file; README.md beside them has the calls.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from sensing.live.outputs.ros.types import PACKAGES
from sensing.live.package_folder import package_command

DESCRIPTION = "Write the ROS 2 packages endcap_msgs and endcap_bringup, to be built with colcon."


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    return package_command("sensing.live.ros_package", DESCRIPTION, PACKAGES, arguments)


if __name__ == "__main__":
    sys.exit(main())
