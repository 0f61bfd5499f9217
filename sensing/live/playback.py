"""A recording played: to its end, over and over, paused, or sent to a moment; what page and command ask for.

    playback = Playback(path, speed=1.0)
    for endcap in replay_endcaps(path, config, playback): ...      # as sensing.live.open_endcaps.open_endcaps
    playback.seek(12.0)                                           # s since the first message, from any thread

Played from its begin a recording gives its own bits. Sent to a moment, every endcap starts anew (tracker, filter,
contact) one second before it, with the reference in use there, and works through that second at once: what follows
agrees with the recording as closely as ``python -m sensing.live --replay FILE --check --from S`` says.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Any

from cad.errors import FileError, ParameterError
from sensing.live.core.config import LiveConfig
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import ROOM, Captured, FileFeed
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.mcap_records import CutError, DamagedError
from sensing.live.open_endcaps import Models, configured_models
from sensing.live.replay import RUN_UP_S, Recorded, recorded_frames, recorded_pictures
from sensing.live.timeline import Timeline
from sensing.tracking.zero import Zero

SPEEDS = (0.0, 1000.0)


class AtEnd(StrEnum):
    """What a replay does behind its last picture."""

    STOP = "stop"  # the run ends
    LOOP = "loop"  # it begins again
    STAY = "stay"  # it waits to be sent elsewhere


@dataclass(frozen=True)
class Turn:
    """One way through the recording.

    Attributes:
        number: counts up. from_s: moment from which pictures are shown. since: pictures of turns before this one are no
            longer wanted; a turn that follows the end of another lets it finish.
    """

    number: int
    from_s: float
    since: int


class Playback:
    """Where a replay stands, shared by the feeds of its endcaps; everything may be called from any thread.

    Args:
        path: of the recording. speed: 1 is its own pace, 0 as fast as it can be computed. at_end: behind the last
            picture. from_s: moment to begin at. paused: show the first picture and wait.

    Attributes:
        timeline, pictures: of the recording. at_end, paused: as asked for.

    Raises:
        FileError: no recording. ParameterError: a speed or moment out of range.
    """

    def __init__(
        self,
        path: Path,
        speed: float = 1.0,
        at_end: AtEnd = AtEnd.STOP,
        from_s: float = 0.0,
        paused: bool = False,
    ) -> None:
        self.timeline, self.pictures = Timeline(path), recorded_pictures(path)
        if not SPEEDS[0] <= speed <= SPEEDS[1]:
            raise ParameterError(f"speed={speed:g} outside 0..1000: 1 is the file's own pace", name="speed")
        if not 0 <= from_s <= self.timeline.span_s:
            raise ParameterError(
                f"--from {from_s:g} s: {path} is {self.timeline.span_s:.1f} s long: give a moment in it", name="from"
            )
        self.at_end, self.paused = at_end, paused
        self._speed = speed
        self._turn = Turn(0, from_s, 0)
        self._position_s = from_s
        self._anchor: tuple[float, float] | None = None  # (time now, moment of the recording)
        self._feeds, self._done, self._over = 0, 0, False
        self._changed = threading.Condition()

    # --- asked for --------------------------------------------------------------------------------------------------
    @property
    def turn(self) -> Turn:
        """The way through the recording that counts."""
        return self._turn

    def state(self) -> dict[str, Any]:
        """For the page: moment and length in s, what it does, whether the recording's own bits are shown."""
        return {
            "position_s": round(self._position_s, 2), "span_s": round(self.timeline.span_s, 2), "paused": self.paused,
            "loop": self.at_end is AtEnd.LOOP, "speed": self._speed, "whole": self._turn.from_s == 0,
        }  # fmt: skip

    def seek(self, moment_s: float) -> None:
        """Go to a moment; one outside the recording is its nearest end."""
        with self._changed:
            self._go(min(max(moment_s, 0.0), self.timeline.span_s))

    def pause(self, paused: bool = True) -> None:
        """Stop at what is shown, or go on; behind the last picture, from the begin."""
        with self._changed:
            self.paused, self._anchor = paused, None
            if not paused and self._feeds and self._done == self._feeds:
                self._go(0.0)
            self._changed.notify_all()

    def loop(self, over_and_over: bool) -> None:
        """Begin again behind the last picture, or stay there."""
        self.at_end = AtEnd.LOOP if over_and_over else AtEnd.STAY

    def pace(self, speed: float) -> None:
        """Another speed; see the class."""
        with self._changed:
            self._speed, self._anchor = min(max(speed, SPEEDS[0]), SPEEDS[1]), None
            self._changed.notify_all()

    def stop(self) -> None:
        """No feed waits any more."""
        with self._changed:
            self._over = True
            self._changed.notify_all()

    # --- for the feeds ----------------------------------------------------------------------------------------------
    def join(self) -> None:
        """One more feed."""
        self._feeds += 1

    def leave(self) -> None:
        """One feed less: its file cannot be read on."""
        with self._changed:
            self._feeds -= 1
            self._conclude()

    def due_s(self, moment_s: float, turn: Turn, at_once: bool) -> float | None:
        """Wait until a picture is due; None when it is no longer wanted.

        Args:
            moment_s: of the picture. turn: that it was read for. at_once: even while paused.
        """
        with self._changed:
            while not self._over and turn is self._turn:
                now_s = time.monotonic()
                if moment_s < turn.from_s or (at_once and self.paused):
                    return now_s
                due_s = None if self.paused else self._due_s(moment_s, now_s)
                if due_s is not None and due_s <= now_s:
                    self._position_s = max(self._position_s, moment_s)
                    return due_s
                self._changed.wait(None if due_s is None else due_s - now_s)
        return None

    def finished(self, turn: Turn) -> bool:
        """A feed has shown its last picture: waits for the others, then says whether that was the end."""
        with self._changed:
            if turn is self._turn:
                self._done += 1
                self._conclude()
            self._changed.wait_for(lambda: self._over or turn is not self._turn)
            return self._over

    def _due_s(self, moment_s: float, now_s: float) -> float:
        if self._speed == 0:
            return now_s
        self._anchor = self._anchor or (now_s, self._position_s)
        return self._anchor[0] + (moment_s - self._anchor[1]) / self._speed

    def _conclude(self) -> None:
        if self._done < self._feeds or not self._feeds:
            return
        if self.at_end is AtEnd.LOOP:
            self._go(0.0)
        elif self.at_end is AtEnd.STAY:
            self.paused = True
        else:
            self._over = True
        self._changed.notify_all()

    def _go(self, moment_s: float) -> None:
        number, followed = self._turn.number + 1, self._feeds > 0 and self._done == self._feeds
        self._turn = Turn(number, moment_s, self._turn.since if followed else number)
        self._position_s, self._anchor, self._done = moment_s, None, 0
        self._changed.notify_all()


@dataclass(frozen=True)
class _Item:
    turn: Turn
    recorded: Recorded
    due_s: float


class ReplayFeed(FileFeed):
    """Frames of one endcap of a recording; hands over references when they are due.

    Args:
        path: recording. endcap: name. set_zero: takes a reference and starts anew, in the thread that takes the frames.
        playback: shared.

    Attributes:
        damage: where the file is damaged; empty if it is not, so far.
    """

    def __init__(self, path: Path, endcap: str, set_zero: Callable[[Zero], None], playback: Playback) -> None:
        super().__init__(lambda: iter(()))
        self._path, self._endcap, self._set_zero, self._playback = path, endcap, set_zero, playback
        self._items: queue.Queue[_Item] = queue.Queue(ROOM)
        self.damage = ""
        playback.join()

    @property
    def ended(self) -> bool:
        """Whether the last frame has been taken."""
        return self._health.status in ("ended", "closed") and self._items.empty()

    def take(self) -> Captured | None:
        """The next frame that is due, after the reference it begins with."""
        while True:
            try:
                item = self._items.get_nowait()
            except queue.Empty:
                return None
            if item.turn.number >= self._playback.turn.since:
                break
        if item.recorded.zero is not None:
            self._set_zero(item.recorded.zero)
        return item.recorded.frame, item.due_s

    def stop(self) -> None:
        """Ask its thread to end; does not wait."""
        super().stop()
        self._playback.stop()

    def close(self, wait_s: float = 2.0) -> None:
        """Stop reading."""
        self._playback.stop()
        super().close(wait_s)

    def _pump(self) -> None:
        problem: FileError | None = None
        try:
            while True:
                turn = self._playback.turn
                try:
                    self._play(turn)
                except (CutError, DamagedError) as error:  # that far it can be read, again and again
                    problem, self.damage = error, str(error) if isinstance(error, DamagedError) else ""
                if self._playback.finished(turn):
                    break
        except Exception:
            self._playback.leave()
            raise
        if problem is not None:
            raise problem

    def _play(self, turn: Turn) -> None:
        timeline, shown = self._playback.timeline, False
        for recorded in recorded_frames(self._path, self._endcap, timeline.start(self._endcap, turn.from_s - RUN_UP_S)):
            moment_s = timeline.at_s(recorded.stamp_ns)
            counts = moment_s >= turn.from_s
            due_s = self._playback.due_s(moment_s, turn, at_once=counts and not shown)
            if due_s is None or not self._offer(_Item(turn, recorded, due_s)):
                return
            shown |= counts
            self._running()

    def _offer(self, item: _Item) -> bool:
        while not self._stop.is_set() and item.turn is self._playback.turn:
            try:
                self._items.put(item, timeout=0.1)
                return True
            except queue.Full:
                self._notify()
        return False


def replay_endcaps(
    path: Path, config: LiveConfig, playback: Playback, models: Models | None = None
) -> list[LiveEndcap]:
    """Endcaps that read from a recording, keeping step with one another.

    Args:
        path: of the recording. config: what is to run. playback: of that file, for these endcaps alone. models: model
            of an endcap; None for those of the configuration.
    """
    models, endcaps = models or configured_models(config), []
    for number, endcap in enumerate(config.endcaps):
        pipeline = EndcapPipeline(endcap, models(endcap), None, number, zero_frames=0)
        feed = ReplayFeed(path, endcap.name, partial(_begin, pipeline), playback)
        endcaps.append(LiveEndcap(feed, pipeline))
    return endcaps


def _begin(pipeline: EndcapPipeline, zero: Zero) -> None:
    """Start anew with a reference; one that is in use already need not be made ready again, which takes a second."""
    if pipeline.zero is not None and pipeline.zero.digest == zero.digest:
        pipeline.restart()
    else:
        pipeline.set_zero(zero)
