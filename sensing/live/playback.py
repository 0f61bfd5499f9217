"""Playback of a recording: once, repeated, paused or from a moment on, as page and command request.

    playback = Playback(path, speed=1.0)              # shared by the feeds of sensing.live.recorded_feed
    playback.seek(12.0)                               # s since the first message, from any thread

Played from its begin a recording gives its own bits. Sent to a moment, every endcap starts anew (tracker, filter,
contact) one second before it, with the reference in use there, and works through that second at once: what follows
agrees with the recording as closely as ``python -m sensing.live --replay FILE --check --from S`` says.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from cad.errors import ParameterError
from sensing.live.core.feed import SPEEDS, require_speed
from sensing.live.replay import recorded_pictures
from sensing.live.timeline import Timeline


class AtEnd(StrEnum):
    """Action of a replay after its last picture."""

    STOP = "stop"  # the run ends
    LOOP = "loop"  # it begins again
    STAY = "stay"  # it waits to be sent elsewhere


@dataclass(frozen=True)
class Turn:
    """One way through the recording.

    Attributes:
        number: counts up.
        from_s: moment from which pictures are shown.
        since: pictures of turns before this one are no longer wanted; a turn that follows the end of another lets it
            finish.
    """

    number: int
    from_s: float
    since: int


class Playback:
    """Where a replay stands, shared by the feeds of its endcaps; everything may be called from any thread.

    Args:
        path: of the recording.
        speed: 1 is its own pace, 0 as fast as it can be computed.
        at_end: behind the last picture.
        from_s: moment to begin at.
        paused: show the first picture and wait.

    Attributes:
        timeline, pictures: of the recording.
        at_end, paused: as asked for.

    Raises:
        FileError: no recording.
        ParameterError: a speed or moment out of range.
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
        require_speed(speed)
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
        """State for the page: moment and length in s, action, whether results equal the recorded ones bit for bit."""
        return {
            "position_s": round(self._position_s, 2), "span_s": round(self.timeline.span_s, 2), "paused": self.paused,
            "loop": self.at_end is AtEnd.LOOP, "speed": self._speed, "whole": self._turn.from_s == 0,
        }  # fmt: skip

    def seek(self, moment_s: float) -> None:
        """Go to a moment; one outside the recording is its nearest end."""
        with self._changed:
            self._go(min(max(moment_s, 0.0), self.timeline.span_s))

    def pause(self, paused: bool = True) -> None:
        """Pause or continue; after the last picture, continue from the beginning."""
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
            moment_s: of the picture.
            turn: that it was read for.
            at_once: even while paused.
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
        """Wait, at a feed's last picture, for the other feeds; returns whether the replay ends."""
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
