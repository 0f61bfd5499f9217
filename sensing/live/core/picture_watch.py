"""Whether each picture stands alone, as that of a plain camera does; others show dots late, and forces with them.

watch = PictureWatch(kept.compressed, kept.mixed)
watch.take(frame.coding)            # every frame
watch.update(tracks, likeness)      # every frame with dots
watch.reasons                       # by flag
"""

from __future__ import annotations

from sensing.live.core import mixed_watch, still_watch
from sensing.live.core.mixed_watch import MixedWatch
from sensing.live.core.still_watch import StillWatch
from sensing.records import DotTracks


class PictureWatch:
    """Of the frames since a reference.

    Args:
        compressed, mixed: reasons known from frames before a restart; empty for none.
    """

    def __init__(self, compressed: str = "", mixed: str = "") -> None:
        self._still, self._mixed = StillWatch(compressed), MixedWatch(mixed)

    @property
    def compressed(self) -> str:
        """Why the pictures are thought to come from a video that keeps parts of them; empty where nothing shows it."""
        return self._still.reason

    @property
    def mixed(self) -> str:
        """Why they are thought to hold a part of those before; empty where nothing shows it."""
        return self._mixed.reason

    @property
    def reasons(self) -> dict[str, str]:
        """By the flag of a wrench; empty ones included."""
        return {still_watch.FLAG: self.compressed, mixed_watch.FLAG: self.mixed}

    def take(self, coding: str) -> None:
        """What a frame's source says of it (:class:`sensing.records.Frame`)."""
        self._still.take(coding)

    def update(self, tracks: DotTracks, likeness: float) -> None:
        """One frame: its dots, and the likeness of its picture with the reference."""
        self._still.update(tracks, likeness)
        if not self.compressed:  # which mixes, too
            self._mixed.update(tracks, likeness)
