"""One run from start to end: endcaps, outputs, the lines in the terminal, and a clean stop by Ctrl-C or SIGTERM."""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING

from cad.errors import printable
from sensing.live.core.config import LiveConfig
from sensing.live.core.engine import Engine, LiveEndcap
from sensing.live.core.latest import Latest
from sensing.live.core.robot import RobotState, robot_state
from sensing.live.core.sink import Sink
from sensing.live.ending import Stop
from sensing.live.outputs.lines import Lines
from sensing.live.outputs.terminal import REFRESH_S, Terminal, summary

if TYPE_CHECKING:
    from sensing.live.playback import Playback

END_S = 1.5  # from a signal to the summary, whatever hangs; lines and pipes may take what is left of two seconds
HURRY_S = 0.3  # of that for cameras and readings under way, at most
LEAST_S = 0.05  # for an output whose turn comes last
PATIENCE_S = 30.0  # for a slow disk or reader, when all sources end
SWITCH_S = 0.001  # threads hand over this soon: page and outputs must not hold up the loop


class LiveRun:
    """A run: what page and commands may read and request while it lasts.

    Attributes:
        config: what runs.
        engine: the loop.
        latest: newest readings.
        playback: of a replay; None of anything else.
        notes: lines for the terminal beside those of the endcaps.
        losses: what was asked for and is not whole; each says so in a line, or nothing.
    """

    def __init__(
        self,
        config: LiveConfig,
        endcaps: Sequence[LiveEndcap],
        workers: int = 1,
        playback: Playback | None = None,
    ) -> None:
        self.config, self.playback = config, playback
        self.latest = Latest([endcap.name for endcap in config.endcaps])
        self.engine = Engine(endcaps, [self.latest], workers)
        self.notes: list[Callable[[], str]] = [self._failures]
        self.losses: list[Callable[[], str]] = [self._failures]
        self.begin_s = time.monotonic()
        self._reasons: list[Callable[[], bool]] = []
        self._end_s: float | None = None

    def add_output(self, sink: Sink, name: str) -> None:
        """Add an output; if it raises, or sets ``failed``, note and loss name it."""
        self.engine.add_sink(sink, name)
        said = partial(_failed, sink, name)
        self.notes.append(said)
        self.losses.append(said)

    def stop_when(self, reason: Callable[[], bool]) -> None:
        """One more reason to end: a reader of the numbers that has left, for example."""
        self._reasons.append(reason)

    @property
    def done(self) -> bool:
        """Whether there is a reason to end."""
        return any(reason() for reason in self._reasons)

    @property
    def patience_s(self) -> float:
        """Time for which an output may finish, s: the rest of that after a signal; long without a signal."""
        return PATIENCE_S if self._end_s is None else max(LEAST_S, self._end_s - time.monotonic())

    def hurry(self) -> None:
        """A signal came: everything shares :data:`END_S` from now on."""
        self._end_s = time.monotonic() + END_S

    def robot(self) -> RobotState:
        """State of the robot now, from all endcaps."""
        return robot_state(self.config.endcaps, self.latest.all(), self.config.weight_n, time.monotonic())

    def zero(self, endcap: str | None = None, confirmed: bool = False) -> None:
        """Take a new reference of one endcap, or of all; ``confirmed``: also of one that is touched."""
        for each in self.engine.endcaps:
            if endcap is None or each.name == endcap:
                each.zero(confirmed)

    def undo_zero(self, endcap: str) -> None:
        """Go back to the reference before."""
        for each in self.engine.endcaps:
            if each.name == endcap:
                each.pipeline.request_undo()

    def _failures(self) -> str:
        return "; ".join(self.engine.failures)


def reduce_pauses() -> None:
    """Set the process up for a run: short thread switch interval; existing objects are exempt from garbage collection.

    A collection of everything that the libraries have loaded stops all threads for tens of milliseconds.
    """
    sys.setswitchinterval(SWITCH_S)
    gc.collect()
    gc.freeze()


def run_until_stopped(run: LiveRun, lines: Lines, seconds: float | None, outputs: ExitStack, stop: Stop) -> None:
    """Run to the end of all sources, for ``seconds``, or to a signal; then close everything and print a summary.

    Recordings are closed before cameras; all ends within two seconds of a signal, whatever hangs.

    Args:
        run: not yet started.
        lines: for the state and the summary; closed at the end.
        seconds: duration of the run; None runs to the end of the sources.
        outputs: to close before the summary.
        stop: what signals set.
    """
    run.stop_when(lambda: lines.gone)
    terminal, asked = Terminal(lines), stop.asked
    end_s = None if seconds is None else time.monotonic() + seconds
    try:
        run.engine.start()
        while not asked.is_set() and not run.done and not run.engine.wait(0.0):
            terminal.show(run.engine.health(), run.latest.all(), run.robot(), _notes(run))
            if end_s is not None and time.monotonic() >= end_s:
                break
            asked.wait(REFRESH_S if end_s is None else max(0.0, min(REFRESH_S, end_s - time.monotonic())))
    finally:
        if asked.is_set():
            run.hurry()
        run.engine.halt(HURRY_S)
        last = run.engine.health(fresh=True)  # while outputs close no frame comes, which is no fault of a camera
        outputs.close()
        run.engine.close(min(HURRY_S, run.patience_s))
    terminal.show(last, run.latest.all(), run.robot(), [])
    for line in summary(last, time.monotonic() - run.begin_s) + _notes(run):
        lines.write(printable(line) + "\n")
    lines.close()
    if lines.failed and not lines.gone:
        run.losses.append(lambda: f"lines of text: {lines.failed}")


def _failed(sink: Sink, name: str) -> str:
    """Of an output with a thread of its own, which stops by itself."""
    failed = getattr(sink, "failed", "")
    return f"{name}: stopped ({failed})" if failed else ""


def _notes(run: LiveRun) -> list[str]:
    return [said for note in run.notes if (said := note())]
