"""Feed of a recording's frames and references for the loop, as its playback requests them.

for endcap in replay_endcaps(path, config, playback): ...      # as sensing.live.open_endcaps.open_endcaps
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path

from cad.errors import FileError
from sensing.live.core.config import LiveConfig
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import Captured, FileFeed
from sensing.live.core.kept import Kept
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.mcap_records import CutError, DamagedError
from sensing.live.open_endcaps import Models, configured_models
from sensing.live.playback import Playback, Turn
from sensing.live.replay import RUN_UP_S, Recorded, recorded_frames
from sensing.tracking.zero import Zero


@dataclass(frozen=True)
class _Item:
    turn: Turn
    recorded: Recorded
    due_s: float


class ReplayFeed(FileFeed):
    """Frames of one endcap of a recording; sets references when they are due.

    Args:
        path: recording.
        endcap: name.
        playback: shared.
        set_zero: takes a reference and what the frames before have left, and starts anew, in the thread that takes the
            frames.
    """

    def __init__(self, path: Path, endcap: str, set_zero: Callable[[Zero, Kept], None], playback: Playback) -> None:
        super().__init__(lambda: iter(()))
        self._path, self._endcap, self._set_zero, self._playback = path, endcap, set_zero, playback
        self._damage = ""
        playback.join()

    @property
    def damage(self) -> str:
        """Where the recording is cut or damaged; empty where it is not, so far."""
        return self._damage

    def take(self) -> Captured | None:
        """The next frame that is due, after the reference it begins with."""
        item: _Item | None = self._next()
        while item is not None and item.turn.number < self._playback.turn.since:
            item = self._next()
        if item is None:
            return None
        if item.recorded.zero is not None:
            self._set_zero(item.recorded.zero, item.recorded.kept)
        return Captured(item.recorded.frame, item.due_s)

    def stop(self) -> None:
        """Ask its thread to end; does not wait."""
        super().stop()
        self._playback.stop()

    def _pump(self) -> str:
        problem: FileError | None = None
        try:
            while True:
                turn = self._playback.turn
                try:
                    self._play(turn)
                except (CutError, DamagedError) as error:  # that far it can be read, again and again
                    problem, self._damage = error, str(error)
                if self._playback.finished(turn):
                    break
        except Exception:
            self._playback.leave()
            raise
        if problem is not None:
            raise problem
        return ""

    def _play(self, turn: Turn) -> None:
        timeline, shown = self._playback.timeline, False
        for recorded in recorded_frames(self._path, self._endcap, timeline.start(self._endcap, turn.from_s - RUN_UP_S)):
            moment_s = timeline.at_s(recorded.stamp_ns)
            counts = moment_s >= turn.from_s
            due_s = self._playback.due_s(moment_s, turn, at_once=counts and not shown)
            if due_s is None or not self._put(_Item(turn, recorded, due_s), lambda: turn is self._playback.turn):
                return
            shown |= counts
            self._running()


def replay_endcaps(
    path: Path, config: LiveConfig, playback: Playback, models: Models | None = None
) -> list[LiveEndcap]:
    """Endcaps that read from a recording, keeping step with one another.

    Args:
        path: of the recording.
        config: what is to run.
        playback: of that file, for these endcaps alone.
        models: model of an endcap; None for those of the configuration.

    Raises:
        EndcapError: a model or recording that cannot be used, or a camera of another size than its pictures.
    """
    models, endcaps = models or configured_models(config), []
    for number, endcap in enumerate(config.endcaps):
        pipeline = EndcapPipeline(endcap, models(endcap), None, number, zero_frames=0)
        if endcap.camera is not None:
            _require_camera(pipeline, path)
        feed = ReplayFeed(path, endcap.name, partial(_begin, pipeline), playback)
        endcaps.append(LiveEndcap(feed, pipeline))
    return endcaps


def _require_camera(pipeline: EndcapPipeline, path: Path) -> None:
    """Refuse a recording whose camera file is of another size than its pictures."""
    with suppress(CutError, DamagedError):  # said when it is played
        for recorded in islice(recorded_frames(path, pipeline.endcap.name), 1):
            if recorded.zero is not None:
                pipeline.require_camera_of(recorded.zero.frame())


def _begin(pipeline: EndcapPipeline, zero: Zero, kept: Kept) -> None:
    """Start anew with a reference; one that is in use already need not be made ready again, which takes a second."""
    if pipeline.zero is not None and pipeline.zero.digest == zero.digest:
        pipeline.restart(kept)
    else:
        pipeline.set_zero(zero, kept)
