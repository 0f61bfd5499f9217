"""Findings in the stream: rate, jitter, missing and repeated frames, and the USB bandwidth of six such cameras."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from sensing.decode import png_size
from sensing.doctor.finding import Finding, above, below, finding
from sensing.records import Frame

FEWEST = 10  # frames for figures of time
CAMERAS = 6  # of the robot
USB2_MB_S = 35.0  # E: of USB 2's 60 MB/s, what isochronous transfers of one bus reach in practice
RAW_BYTES = 2.0  # a pixel of a picture that came uncompressed (YUYV)


def stream_findings(frames: Sequence[Frame], asked_hz: float | None) -> list[Finding]:
    """Findings on the times and sizes of frames.

    Args:
        frames: in order, with capture times in s.
        asked_hz: rate that was asked for, frames/s; None if unknown.
    """
    times = np.array([frame.time_s for frame in frames])
    if len(times) < FEWEST or not (np.diff(times) > 0).all():
        return []
    steps = np.diff(times)
    step_s = float(np.median(steps))
    missing = int(np.maximum(np.rint(steps / step_s) - 1, 0).sum())
    jitter_ms = 1e3 * float(np.abs(steps - step_s)[steps < 1.5 * step_s].max(initial=0.0))
    rate_hz = len(steps) / float(times[-1] - times[0])
    same = sum(b.shows_same(a) for a, b in pairwise(frames))
    asked = "" if asked_hz is None else f" of {asked_hz:g} asked for"
    fraction = (missing + same) / (len(steps) + missing)
    return [
        finding(
            "rate", above(rate_hz / (asked_hz or rate_hz), 0.95, 0.8), f"{rate_hz:.1f} frames/s{asked}",
            "shorter exposure (--exposure) and more light, MJPEG rather than raw pictures, a USB port of its own",
            {"rate_hz": rate_hz, "largest_step_ms": 1e3 * float(steps.max())},
        ),
        finding(
            "jitter", below(jitter_ms * 1e-3 / step_s, 0.15, 0.4), f"{jitter_ms:.1f} ms at most between frames",
            "fixed exposure (--exposure); another program may use the camera or the processor",
            {"jitter_ms": jitter_ms},
        ),
        finding(
            "dropped", below(fraction, 0.0, 0.02), f"{missing} missing and {same} repeated of {len(frames)} frames",
            "a USB port of its own, a shorter cable, no hub; close other programs",
            {"missing": float(missing), "repeated": float(same)},
        ),
        *_usb(frames, rate_hz),
    ]  # fmt: skip


def _usb(frames: Sequence[Frame], rate_hz: float) -> list[Finding]:
    """Six such cameras on one bus; nothing where pictures are PNG, which a recorder wrote and no camera sends."""
    if any(frame.jpeg is not None and png_size(frame.jpeg) is not None for frame in frames):
        return []
    sizes = [len(frame.jpeg) if frame.jpeg is not None else _raw_bytes(frame) for frame in frames]
    mb_s = float(np.mean(sizes)) * rate_hz / 1e6
    six = CAMERAS * mb_s
    found = finding(
        "USB", below(six / USB2_MB_S, 0.6, 1.0),
        f"{mb_s:.1f} MB/s, six such {six:.0f} of about {USB2_MB_S:g} MB/s of one USB 2 bus",
        "share the cameras out over two USB controllers (lsusb -t), or use MJPEG and a lower rate",
        {"mb_s": mb_s, "six_mb_s": six},
    )  # fmt: skip
    return [found]


def _raw_bytes(frame: Frame) -> float:
    width, height = frame.size or (0, 0)
    return RAW_BYTES * width * height
