"""Whether pictures come from a video that keeps parts of a picture and repeats them in the next (H.264, MPEG-4, VP8).

    watch = StillWatch()
    watch.take(frame.coding)            # every frame: a video file says it itself
    watch.update(tracks, likeness)      # every frame; watch.reason says so

Such a video shows a dot late, or a little beside its place, and each window still correlates well, so nothing else
shows it. But a repeated part is the same to the bit, which the noise of a camera never leaves it: a dot in it stays
within a ten-thousandth of a pixel. From frame to frame at rest 40 to 67 % of 87 dots do so in H.264 of 70 to 445 kB
for 4 s, 2 % at most in MJPEG and in lossless files. Not every such video shows it: neither H.264 of 7 MB for 4 s nor
MPEG-4 of ffmpeg at 500 kbit/s does. Frames that show the very picture before do not count, because a camera may send
each picture twice, nor do those in which all dots stand still: those are drawn without noise. Pressed dots all move,
so what was seen once stays until the next reference.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from sensing.records import DotTracks
from sensing.sources.coding import coding_doubt

FLAG = "compressed"
STILL_PX = 1e-4  # at 480 rows; a dot moves by 0.005 px from frame to frame with the noise of the cleanest picture
LEAST_SHARE, MOST_SHARE = 0.2, 0.95  # of the dots that stand still
FRAMES, LEAST_FRAMES = 30, 10  # so many of the last ones must show it


class StillWatch:
    """Of the frames since a reference.

    Args:
        reason: known from frames before a restart; empty for none.

    Attributes:
        reason: says so, and what to do; empty where nothing shows it.
    """

    def __init__(self, reason: str = "") -> None:
        self.reason = reason
        self._before: tuple[DotTracks, float] | None = None
        self._seen: deque[bool] = deque(maxlen=FRAMES)

    def take(self, coding: str) -> None:
        """What a frame's source says of it: the coding of its video (:class:`sensing.records.Frame`), or nothing."""
        if coding and not self.reason:
            self.reason = coding_doubt(coding)

    def update(self, tracks: DotTracks, likeness: float) -> None:
        """One frame.

        Args:
            tracks: its dots.
            likeness: of its picture with the reference: the same number twice is the same picture.
        """
        before, self._before = self._before, (tracks, likeness)
        if self.reason or before is None or before[1] == likeness:
            return
        step_px = np.linalg.norm(tracks.position_px - before[0].position_px, axis=1)
        still = (step_px < STILL_PX * tracks.size[1] / 480) & ~tracks.lost & ~before[0].lost
        self._seen.append(bool(LEAST_SHARE < still.mean() < MOST_SHARE))
        if sum(self._seen) >= LEAST_FRAMES:
            self.reason = (
                f"{int(still.sum())} of {len(still)} dots repeat the picture before to the bit: the video keeps parts "
                "of its pictures (H.264, MPEG-4, VP8), and forces are off by more than their uncertainty says: record "
                "MJPEG or a lossless video"
            )
