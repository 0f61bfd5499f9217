"""The state of one endcap: one machine, a table of transitions, nothing sticky. Drawn in docs/live.md.

    state = next_state(State.RUNNING, Event.UNSEEN)          # State.BLIND

Every frame is one event (:class:`Event`, from the pipeline), and so is what the clock and the source show while no
frame comes. The state follows the newest event; only the end of a file is for ever. Numbers count in the states of
:data:`VALID` alone.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from enum import StrEnum

NOTE_S = 10.0  # an answer to a request is shown for this long


class State(StrEnum):
    """State of an endcap; the value is the word that users read."""

    STARTING = "starting"
    WAITING = "waiting for a reference"
    ZEROING = "zeroing"
    RUNNING = "running"
    DEGRADED = "degraded"
    BLIND = "blind"
    DAMAGED = "damaged pictures"
    WRONG_SIZE = "wrong size"
    FROZEN = "frozen"
    SILENT = "silent"
    UNPLUGGED = "unplugged"
    FAILED = "failed"
    ENDED = "ended"


class Event(StrEnum):
    """Event of a frame, the clock or the source, which may change the state."""

    GOOD = "good"  # a wrench without flags
    FLAGGED = "flagged"  # a wrench to be used with care
    UNSEEN = "unseen"  # too few dots, or another picture altogether
    UNDECODED = "undecoded"  # the decoder complains
    RESIZED = "resized"  # another size than the reference
    REPEATED = "repeated"  # the same picture for too long
    COLLECTED = "collected"  # kept for the first reference
    REFUSED = "refused"  # no reference could be made of the frames kept
    ERROR = "error"  # an error of the program
    SILENCE = "silence"  # no frame for too long
    LOST = "lost"  # the source cannot be read; it is opened again
    ENDED = "ended"  # the last frame has been read


VALID = frozenset({State.RUNNING, State.DEGRADED, State.ENDED})  # of a file that has ended, the last ones
WITHOUT_FRAMES = frozenset({State.WAITING, State.SILENT, State.UNPLUGGED, State.FAILED})
MEASURED = frozenset({Event.GOOD, Event.FLAGGED})
LEVEL = {  # of diagnostic_msgs/DiagnosticStatus: 0 OK, 1 WARN, 2 ERROR
    State.RUNNING: 0,
    State.STARTING: 1,
    State.ZEROING: 1,
    State.DEGRADED: 1,
    State.ENDED: 1,
}
ERROR_LEVEL = 2

_USUAL = {
    Event.GOOD: State.RUNNING,
    Event.FLAGGED: State.DEGRADED,
    Event.UNSEEN: State.BLIND,
    Event.UNDECODED: State.DAMAGED,
    Event.RESIZED: State.WRONG_SIZE,
    Event.REPEATED: State.FROZEN,
    Event.COLLECTED: State.ZEROING,
    Event.REFUSED: State.WAITING,
    Event.ERROR: State.FAILED,
    Event.SILENCE: State.SILENT,
    Event.LOST: State.UNPLUGGED,
    Event.ENDED: State.ENDED,
}
TRANSITIONS: dict[State, dict[Event, State]] = {state: dict(_USUAL) for state in State}
TRANSITIONS[State.RUNNING][Event.UNDECODED] = State.DEGRADED  # one damaged picture; the next one decides
TRANSITIONS[State.WAITING][Event.COLLECTED] = State.WAITING  # the reason stays until a reference is taken
TRANSITIONS[State.UNPLUGGED][Event.SILENCE] = State.UNPLUGGED  # the more exact word stays
TRANSITIONS[State.FAILED][Event.ENDED] = State.FAILED  # the reason stays
TRANSITIONS[State.ENDED] = dict.fromkeys(Event, State.ENDED)


def word(event: Event) -> str:
    """The state's word for a single frame with this event."""
    return _USUAL[event].value


def next_state(state: State, event: Event) -> State:
    """State after an event."""
    return TRANSITIONS[state][event]


@dataclass(frozen=True)
class Condition:
    """State at one moment.

    Attributes:
        state: now.
        reason: why, in one line; empty while all is well.
        note: answer to a request ("not zeroed: ..."), empty after :data:`NOTE_S`.
    """

    state: State = State.STARTING
    reason: str = ""
    note: str = ""

    @property
    def valid(self) -> bool:
        """Whether the endcap's numbers count."""
        return self.state in VALID

    @property
    def level(self) -> int:
        """0 good, 1 to be looked at, 2 bad."""
        return LEVEL.get(self.state, ERROR_LEVEL)

    @property
    def message(self) -> str:
        """Reason and note in one line; empty while all is well."""
        return "; ".join(filter(None, (self.reason, self.note)))


class Machine:
    """Holds the condition of one endcap; events may come from any thread."""

    def __init__(self) -> None:
        self._condition = Condition()
        self._lock = threading.Lock()

    @property
    def condition(self) -> Condition:
        """As of the last event."""
        return self._condition

    def happened(self, event: Event, reason: str) -> Condition:
        """Take one event.

        Args:
            event: what has happened.
            reason: why, kept while the state is not a good one.
        """
        with self._lock:
            before = self._condition
            state = next_state(before.state, event)
            stays = event is Event.COLLECTED or (state is State.FAILED and event is Event.ENDED)
            kept = before.reason if stays and state is before.state else reason
            self._condition = Condition(state, "" if state is State.RUNNING else kept)
            return self._condition
