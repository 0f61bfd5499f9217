"""Lists the cameras of this computer and their modes: ``python -m sensing.sources``."""

from __future__ import annotations

import argparse
import sys

from cad.errors import EndcapError
from cad.messages import LOG
from sensing.sources.camera import list_devices, list_modes


def main(arguments: list[str] | None = None) -> int:
    """Prints one line per camera and mode; returns the exit status (2 if a camera cannot be asked)."""
    parser = argparse.ArgumentParser(prog="python -m sensing.sources", description="Cameras and their modes.")
    parser.add_argument("device", nargs="?", type=int, metavar="N", help="only /dev/videoN (default: all that capture)")
    options = parser.parse_args(arguments)
    known = dict(list_devices())
    devices = list(known) if options.device is None else [options.device]
    if not devices:
        print("no camera found: plug one in (a container must be given its /dev/videoN)")
    status = 0
    for device in devices:
        print(f"/dev/video{device}  {known.get(device, '')}".rstrip())
        try:
            for mode in list_modes(device):
                print(f"  {mode}")
        except EndcapError as error:
            LOG.error(f"sensing.sources: {error}")
            status = 2
    return status


if __name__ == "__main__":
    sys.exit(main())
