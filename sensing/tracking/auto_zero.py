"""A reference that renews itself: after a long time without any contact, when lamp or mounting have drifted.

Not from pictures in which dots are hidden, that are white or dark, or that are one and the same picture.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sensing.camera.light import light_of
from sensing.records import DotTracks, Frame
from sensing.tracking.zero import STILL_PX, Drift, Zero, ZeroError, measure_drift, take_zero

MOST_UNSEEN_ANEW = 0.04  # E: share of the dots that a new reference may lack of those that the last one has
MOST_GAP = 0.5  # of the time to wait, between two pictures: what happened meanwhile is not known


class AutoZero:
    """Decides when a new reference may be taken automatically: after a long time without contact, and with drift.

    Args:
        zero: the reference in use.
        still_s: untouched and still for this long.
        frames: frames kept for the new reference.

    Attributes:
        zero: the reference in use.
        drift: since then, of the last frame; None before the first.
    """

    def __init__(self, zero: Zero, still_s: float = 30.0, frames: int = 10) -> None:
        self.zero, self._still_s, self._keep = zero, still_s, frames
        self.drift: Drift | None = None
        self._since_s: float | None = None
        self._last: DotTracks | None = None
        self._frames: list[Frame] = []

    def update(self, frame: Frame, tracks: DotTracks) -> Zero | None:
        """A new reference when it is surely time for one, else None."""
        drift = self.drift = measure_drift(self.zero, frame, tracks)
        moved = self._last is not None and _step_px(self._last, tracks) > STILL_PX * min(tracks.size) / 480.0
        if self._last is not None and not 0.0 <= frame.time_s - self._last.time_s <= MOST_GAP * self._still_s:
            self.begin_anew()
        self._last = tracks
        if drift.cause in ("contact", "hidden") or drift.unseen > MOST_UNSEEN_ANEW or moved:
            self.begin_anew()
            return None
        self._since_s = frame.time_s if self._since_s is None else self._since_s
        self._frames = [*self._frames, frame][-self._keep :]
        waited = frame.time_s - self._since_s >= self._still_s and len(self._frames) == self._keep
        if drift.cause == "none" or not waited or self._stands_still():
            return None
        try:
            zero = replace(take_zero(self._frames, self.zero.sensor, self.zero.params), made_of=self.zero.made_of)
        except ZeroError:  # it was not still, or dots are missing
            self.begin_anew()
            return None
        light = light_of(zero.image)
        if light.too_bright or light.too_dark:
            return None
        self.zero = zero
        self._since_s, self._frames, self._last = None, [], None
        return self.zero

    def begin_anew(self) -> None:
        """Wait for the whole time again: something touched it, or a picture could not be seen."""
        self._since_s, self._frames = None, []

    def _stands_still(self) -> bool:
        """Whether all pictures kept are one: a camera that hangs shows nothing of now."""
        return all(frame.shows_same(self._frames[0]) for frame in self._frames[1:])


def _step_px(before: DotTracks, now: DotTracks) -> float:
    live = ~(before.lost | now.lost)
    if not live.any():
        return float("inf")
    return float(np.percentile(np.linalg.norm((now.position_px - before.position_px)[live], axis=1), 95))
