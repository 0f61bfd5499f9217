"""The ROS 2 packages of the endcaps, to be built where ROS 2 is installed.

    python -m sensing.live.ros_package --out ~/ros2_ws/src/endcap

``endcap_msgs`` has the message with covariance, ``endcap_bringup`` a launch file; README.md beside them has the calls.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from cad.errors import EndcapError, FileError
from cad.extras import program
from cad.messages import LOG
from cad.whole_file import new_folder
from sensing.live.outputs.ros_types import PACKAGES


def export_packages(folder: Path) -> list[str]:
    """Copy the packages; the folder appears when all of it is there. Returns the names of the packages.

    Raises:
        FileError: the folder is not empty, or cannot be written.
    """
    try:
        with new_folder(folder) as place:
            shutil.copytree(PACKAGES, place, dirs_exist_ok=True, copy_function=shutil.copyfile)
    except OSError as error:
        raise FileError(f"{folder}: cannot be written ({error.strerror}): choose another folder") from error
    return sorted(path.parent.name for path in folder.glob("*/package.xml"))


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.live.ros_package"),
        description="Write the ROS 2 packages endcap_msgs and endcap_bringup, to be built with colcon.",
        epilog="exit status: 0 written, 2 no place to write",
    )
    parser.add_argument("--out", type=Path, required=True, help="folder to write; must be new or empty")
    options = parser.parse_args(arguments)
    try:
        names = export_packages(options.out)
    except EndcapError as error:
        LOG.error(error)
        return 2
    print(f"{options.out}: {', '.join(names)}; README.md says how to build them")
    return 0


if __name__ == "__main__":
    sys.exit(main())
