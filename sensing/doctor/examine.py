"""All findings on one source: a camera, a video, a folder, one endcap of a recording."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cad.errors import EndcapError
from cad.params import EndcapParams
from sensing.decode import decode_bgr
from sensing.doctor.finding import Finding, Verdict, below, finding
from sensing.doctor.mixing import mixing_findings
from sensing.doctor.picture import picture_findings
from sensing.doctor.stream import stream_findings
from sensing.records import Frame, Image
from sensing.sources.coding import RECORD, coding_fault
from sensing.sources.newest import FrameSource, LiveSource

DECODED, AVERAGED = 20, 5  # frames that are decoded, and of these the ones that make the picture that is judged
WAIT_S = 6.0  # for one frame of a camera
WORST = (Verdict.BAD, Verdict.LOOK, Verdict.GOOD)


@dataclass(frozen=True)
class Report:
    """Findings on one camera or file.

    Attributes:
        source: its name.
        frames: taken.
        size: of the pictures, px; None if there is none.
        findings: in order.
    """

    source: str
    frames: int
    size: tuple[int, int] | None
    findings: tuple[Finding, ...]

    @property
    def verdict(self) -> Verdict:
        """The worst of all."""
        return next((v for v in WORST if any(each.verdict is v for each in self.findings)), Verdict.GOOD)


def examine(
    source: str, frames: Sequence[Frame], params: EndcapParams, timed: bool, asked_hz: float | None = None
) -> Report:
    """Look at frames of an untouched endcap.

    Args:
        source: name for the report.
        frames: in order.
        params: the design.
        timed: whether the frames' times are those of their capture (not of a video or folder).
        asked_hz: rate that was asked for, frames/s.
    """
    if not frames:
        none = finding("frames", Verdict.BAD, "no frame came", "check cable, address and permissions")
        return Report(source, 0, None, (none,))
    found = stream_findings(frames, asked_hz) if timed else []
    if coding := next((frame.coding for frame in frames if frame.coding), ""):
        found.append(finding("coding", Verdict.LOOK, coding_fault(coding), RECORD))
    found += mixing_findings(frames)
    pictures, damaged = _decoded(frames)
    if damaged or not pictures:
        looked = len(damaged) + len(pictures)
        text = f"{len(damaged)} of {looked} pictures cannot be decoded" + (f" ({damaged[0]})" if damaged else "")
        fix = "a shorter cable, no hub, a lower rate: the transfer loses data"
        found.append(finding("pictures", below(len(damaged) / looked, 0.0, 0.0), text, fix))
    if not pictures:
        return Report(source, len(frames), None, tuple(found))
    picture = np.median(pictures[:: max(1, len(pictures) // AVERAGED)], axis=0).astype(np.uint8)
    found += picture_findings(picture, params)
    return Report(source, len(frames), (picture.shape[1], picture.shape[0]), tuple(found))


def take_live(open_source: Callable[[], FrameSource], count: int) -> tuple[list[Frame], str]:
    """Frames of a camera, and why there are no more; none is left out because this program is slow.

    Args:
        open_source: opens the camera.
        count: frames wanted.
    """
    frames: list[Frame] = []
    with LiveSource(open_source, length=count) as live:
        end_s = time.monotonic() + WAIT_S
        while len(frames) < count and time.monotonic() < end_s:
            frame = live.get(0.1)
            if frame is not None:
                frames.append(frame)
                end_s = time.monotonic() + WAIT_S
            elif live.health.status == "unplugged":
                break
        return frames, live.health.message


def _decoded(frames: Sequence[Frame]) -> tuple[list[Image], list[str]]:
    """(pictures of the size of the first, reasons of those that cannot be decoded) of frames spread over all."""
    pictures: list[Image] = []
    damaged: list[str] = []
    for frame in frames[:: max(1, len(frames) // DECODED)]:
        try:
            picture = decode_bgr(frame)
        except EndcapError as error:
            damaged.append(str(error))
            continue
        if not pictures or picture.shape == pictures[0].shape:
            pictures.append(picture)
    return pictures, damaged
