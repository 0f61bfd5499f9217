"""Finding: whether each picture holds a part of those before it, as after noise reduction over time (3DNR, DNR).

Such a camera shows dots late, and a fast press is read too low; at rest its pictures only look cleaner. The noise shows
it: let z(t) be the picture of an untouched dome less its slow parts, and E(L) the mean of (z(t + L) - z(t))². Noise of
independent pictures has no memory, so E is the same for all L. Where a picture holds a part a of the one before,

    E(L) ~ 1 - a^L        E(4) / E(1) = (1 - a⁴) / (1 - a)        1.9 at a = 1/2, 2.7 at 3/4

and 2 where pictures are blended in pairs. Rounding to whole gray values and JPEG bring it nearer to 1 (docs/doctor.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cad.errors import EndcapError
from sensing.decode import decode_gray
from sensing.doctor.finding import Finding, below, finding
from sensing.records import Frame

Array = NDArray[np.float32]
NEAR, FAR = 1, 4  # pictures apart
FEWEST, MOST = 20, 32  # pictures in a row
ROWS = 480  # of larger pictures every other row or fewer are enough
INDEPENDENT, MIXED = 1.13, np.inf  # M: ratio of independent pictures is 0.99 to 1.01, 1.11 beside a drift
LEAST_NOISE = 0.02  # mean square, gray values²; drawn pictures and those of a strong compression have less
LOUDEST = 0.01  # of the pixels, left out: those whose own noise jumps (random telegraph noise)


def mixing_findings(frames: Sequence[Frame]) -> list[Finding]:
    """Nothing where it cannot be seen: few pictures, a video that codes changes alone, or no noise.

    Args:
        frames: of an untouched endcap, in order.
    """
    if any(frame.coding for frame in frames):
        return []
    noise = _noise(_in_a_row(frames))
    if noise is None:
        return []
    near = _change(noise, NEAR)
    if near < LEAST_NOISE:
        return []
    ratio = _change(noise, FAR) / near
    return [
        finding(
            "mixing", below(ratio, INDEPENDENT, MIXED),
            f"noise changes over {FAR} pictures {ratio:.2f} times as much as over one, 1 where each stands alone",
            "hold the endcap still and look again; then switch noise reduction over time off (3DNR, DNR): "
            "it shows fast presses late",
            {"noise_ratio": ratio},
        )
    ]  # fmt: skip


def _in_a_row(frames: Sequence[Frame]) -> list[Array]:
    """Gray pictures of the size of the first, without those that came twice; none is decoded beyond :data:`MOST`."""
    pictures: list[Array] = []
    for before, frame in pairwise([None, *frames]):
        if len(pictures) == MOST:
            break
        if frame is None or (before is not None and frame.shows_same(before)):
            continue
        try:
            picture = decode_gray(frame)
        except EndcapError:
            continue  # named by another finding
        picture = picture[:: max(1, len(picture) // ROWS)].astype(np.float32)
        if not pictures or picture.shape == pictures[0].shape:
            pictures.append(picture)
    return pictures


def _noise(pictures: Sequence[Array]) -> Array | None:
    """(n, pixels) second differences along the rows, which neither a flickering lamp nor its bands change.

    Those of the flatter half of the picture, which a small motion of the picture hardly changes.
    """
    if len(pictures) < FEWEST:
        return None
    mean = np.mean(pictures, axis=0)
    slope = np.abs(mean[:, 3:] - mean[:, :-3])[:, :-1]
    flat = slope <= np.median(slope)
    return np.array([(2 * one[:, 2:-2] - one[:, 1:-3] - one[:, 3:-1])[flat] for one in pictures])


def _change(noise: Array, lag: int) -> float:
    """E(lag): mean square over all pairs so far apart, without the loudest pixels."""
    pixels = ((noise[lag:] - noise[:-lag]) ** 2).mean(axis=0)
    loud = noise.var(axis=0)
    return float(pixels[loud <= np.quantile(loud, 1 - LOUDEST)].mean(dtype=np.float64))
