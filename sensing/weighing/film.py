"""Readings of one endcap from a recording, a video or a folder of pictures, without a gain; computed one by one.

    for reading in film_readings(endcap, "press.mp4", model): ...

A recording (``python -m sensing.live --record``) carries its references. The first picture of a video or folder is the
untouched endcap.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from cad.errors import FileError
from cad.identity import require_same
from cad.messages import transient
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.model import LiveModel
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.reading import EndcapReading
from sensing.live.readable_frames import readable_frames
from sensing.live.replay import Recorded, read_config
from sensing.sources.choose import is_camera_number, open_frames
from sensing.sources.files import DEFAULT_RATE_HZ, FolderSource

RECORDING = ".mcap"  # suffix of a recording


def film_readings(endcap: EndcapConfig, source: str, model: LiveModel) -> Iterator[EndcapReading]:
    """Readings of all pictures, in order; a cut or damaged recording ends with a warning.

    Args:
        endcap: endcap with its name, design and camera.
        source: path of the file or folder.
        model: model that estimates the wrench.

    Raises:
        FileError: no such file, a camera or an address, no such endcap in a recording, or a recording of
            another design.
        ParameterError: a camera file of another picture size.
    """
    if is_camera_number(source) or not os.path.exists(source) or Path(source).is_char_device():  # a camera in /dev
        raise FileError(f"{source}: no such file or folder: give a recording, a video or a folder of pictures")
    recorded = source.lower().endswith(RECORDING)
    if recorded:
        require_design(Path(source), endcap)
    pipeline = EndcapPipeline(as_trained(endcap), model, zero_frames=0 if recorded else 1)
    count, frames = -1, readable_frames(Path(source), endcap.name) if recorded else _pictures(source)
    for count, item in enumerate(frames):
        if not count and not recorded:  # of a recording, the reference comes first
            pipeline.require_camera_of(item.frame)
        if item.zero is not None:
            pipeline.set_zero(item.zero, item.kept)
        reading = pipeline.update(item.frame)
        if count % 20 == 0:
            transient(f"{Path(source).name}: picture {count}")
        if reading is not None:
            yield reading
    transient()
    if count < 0:
        raise FileError(f"{source}: no picture of {endcap.name} in it: is it the recording of another endcap?")


def require_even(source: str) -> None:
    """Refuse a folder in whose numbers pictures are missing: its pictures are given times as if there were none.

    Args:
        source: as of :func:`film_readings`; all but a folder is let pass, because it has times of its own.

    Raises:
        FileError: pictures are missing, or the folder cannot be read.
    """
    gaps = FolderSource(source).gaps if os.path.isdir(source) else []
    if gaps:
        more = f" and in {len(gaps) - 1} more places" if len(gaps) > 1 else ""
        raise FileError(
            f"{source}: by their numbers pictures are missing between {gaps[0][0]} and {gaps[0][1]}{more}, so times "
            f"would be wrong (a folder has {DEFAULT_RATE_HZ:g} pictures a second): give all pictures, a recording or a "
            "video"
        )


def require_design(recording: Path, endcap: EndcapConfig) -> None:
    """Refuse a recording that was made with another design under the same name.

    Raises:
        FileError: a recording of another design or dot pattern, or no recording.
    """
    for held in read_config(recording).endcaps:
        if held.name != endcap.name:
            continue
        if held.params.digest != endcap.params.digest:
            raise FileError(
                f"{recording}: {endcap.name} was recorded from {held.params.label}, this endcap is "
                f"{endcap.params.label}: give a recording of this endcap, or set diameter_mm, wall_mm, dots and dot_mm "
                "of its [[endcap]] to those of the recording"
            )
        require_same(recording, "a recording", held.identity, endcap.identity, "record this endcap anew", ("dots",))


def _pictures(source: str) -> Iterator[Recorded]:
    """Pictures of a video or folder."""
    with open_frames(source, warn_of_coding=False) as frames:
        for frame in frames:
            yield Recorded(frame, None)


def as_trained(endcap: EndcapConfig) -> EndcapConfig:
    """The endcap with the silicone of the training data, without rate effects."""
    return replace(
        endcap, gain=1.0, gain_sd=0.0, gain_date="", gain_weights="", relaxation=(),
        contact_on_n=endcap.contact_on_n / endcap.gain, contact_off_n=endcap.contact_off_n / endcap.gain,
    )  # fmt: skip
