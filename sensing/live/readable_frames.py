"""Frames of a recording up to where it is cut or damaged, for those who use what can be read."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from cad.messages import LOG
from sensing.live.mcap_records import CutError, DamagedError
from sensing.live.replay import Recorded, recorded_frames


def readable_frames(path: Path, endcap: str) -> Iterator[Recorded]:
    """Pictures of an endcap in the order of recording; where they end early, a warning says so.

    Raises:
        FileError: missing, or no MCAP.
    """
    try:
        yield from recorded_frames(path, endcap)
    except (CutError, DamagedError) as error:
        LOG.warning(f"{error}")
