"""Lists cameras and their modes: ``python -m sensing.sources``; ``check`` finds faults; ``save`` stores one frame."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

from cad.errors import EndcapError
from cad.extras import program
from cad.messages import LOG, show
from cad.params import EndcapParams
from sensing.arguments import whole
from sensing.records import Frame
from sensing.sources.camera import list_devices, list_modes


def main(arguments: list[str] | None = None) -> int:
    """Prints one line per camera and mode, checks sources, or saves a frame; returns the exit status."""
    words = sys.argv[1:] if arguments is None else arguments
    if words[:1] == ["check"]:
        from sensing.doctor.command import main as check

        return check(words[1:], _recorded)
    if words[:1] == ["save"]:
        from sensing.sources.save import main as save

        return save(words[1:])
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.sources"), description="Cameras and their modes.",
        epilog="python -m sensing.sources check --help: what is wrong with a camera or its picture, and the fix; "
        "python -m sensing.sources save --help: one frame as a picture",
    )  # fmt: skip
    parser.add_argument("device", nargs="?", type=whole, metavar="N", help="only /dev/videoN (default: all)")
    options = parser.parse_args(words)
    known = dict(list_devices())
    devices = list(known) if options.device is None else [options.device]
    if not devices:
        show("no camera found: plug one in (a container must be given its /dev/videoN)")
    status = 0
    for device in devices:
        show(f"/dev/video{device}  {known.get(device, '')}".rstrip())
        try:
            for mode in list_modes(device):
                show(f"  {mode}")
        except EndcapError as error:
            LOG.error(f"sensing.sources: {error}")
            status = 2
    return status


def _recorded(path: Path) -> Iterator[tuple[str, EndcapParams, Iterator[Frame]]]:
    """Design and frames of every endcap of a recording."""
    from sensing.live.readable_frames import readable_frames
    from sensing.live.replay import read_config, require_pictures

    require_pictures(path, "the camera doctor")
    for endcap in read_config(path).endcaps:
        yield endcap.name, endcap.params, (each.frame for each in readable_frames(path, endcap.name))


if __name__ == "__main__":
    from sensing.live.ending import leave

    leave(main())
