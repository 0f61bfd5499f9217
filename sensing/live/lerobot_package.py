"""The camera plug-in for LeRobot, to be installed where lerobot is.

    python -m sensing.live.lerobot_package --out lerobot_endcap

``lerobot_camera_endcap`` registers the camera type ``endcap``; README.md beside it has the calls.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from sensing.live.package_folder import package_command

PACKAGES = Path(__file__).resolve().parent / "outputs" / "lerobot" / "packages"
DESCRIPTION = "Write the LeRobot plug-in lerobot_camera_endcap, to be installed with pip."


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    return package_command("sensing.live.lerobot_package", DESCRIPTION, PACKAGES, arguments)


if __name__ == "__main__":
    sys.exit(main())
