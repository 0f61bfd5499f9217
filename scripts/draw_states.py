"""Draws docs/live_states.png, the states of an endcap, from the table in sensing/live/core/state.py.

python scripts/draw_states.py
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
from sensing.live.core.state import TRANSITIONS, VALID, Event, State  # noqa: E402

OUT = ROOT / "docs" / "live_states.png"
GOOD, BAD, END = "#dcefdc", "#f6e6cf", "#e9e9e9"


def entering(state: State) -> str:
    """Events that lead to a state from most others."""
    others = [row for row in TRANSITIONS if row not in (state, State.ENDED)]
    return ", ".join(e.value for e in Event if sum(TRANSITIONS[row][e] is state for row in others) > len(others) / 2)


def exceptions() -> list[str]:
    """Transitions that differ from those of most states."""
    rows = [row for row in TRANSITIONS if row is not State.ENDED]
    found = []
    for event in Event:
        usual = max(set(State), key=lambda state: sum(TRANSITIONS[row][event] is state for row in rows))
        found += [
            f"{row.value}, {event.value}: {TRANSITIONS[row][event].value}"
            for row in rows
            if TRANSITIONS[row][event] is not usual
        ]
    return found


def box(axes: Axes, left: float, bottom: float, width: float, height: float, colour: str) -> None:
    """A rounded box."""
    shape = FancyBboxPatch(
        (left, bottom), width, height, boxstyle="round,pad=0,rounding_size=0.8", fc=colour, ec="#555"
    )
    axes.add_patch(shape)


def group(axes: Axes, left: float, width: float, title: str, states: list[State], colour: str) -> None:
    """States of one kind, each with the events that lead to it."""
    box(axes, left, 2, width, 54, "#fafafa")
    axes.text(left + width / 2, 53.5, title, ha="center", va="top", weight="bold", size=10)
    for number, state in enumerate(states):
        bottom = 46.2 - 4.75 * number
        box(axes, left + 2, bottom, width - 4, 4, colour)
        axes.text(left + 3, bottom + 2.1, state.value, va="center", size=9)
        axes.text(left + width - 3, bottom + 2.1, entering(state), va="center", ha="right", size=8, style="italic")


def main() -> None:
    """Write the picture."""
    figure, axes = plt.subplots(figsize=(9, 5.4), layout="constrained")
    axes.set(xlim=(0, 100), ylim=(0, 58))
    axes.axis("off")
    none = [state for state in State if state not in VALID]
    group(axes, 1, 42, "no number", none, BAD)
    group(axes, 57, 42, "numbers", [state for state in State if state in VALID and state is not State.ENDED], GOOD)
    box(axes, 59, 22, 38, 4.2, END)
    axes.text(60, 24.1, State.ENDED.value, va="center", size=9)
    axes.text(96, 24.1, entering(State.ENDED), va="center", ha="right", size=8, style="italic")
    for start, end, height, text in ((43, 57, 44, "good, flagged"), (57, 43, 38, "all others")):
        axes.annotate("", (end, height), (start, height), arrowprops={"arrowstyle": "-|>", "lw": 1.2})
        axes.text(50, height + 0.8, text, ha="center", size=8, style="italic")
    axes.text(59, 33, "Italic: the event that leads there from any state\nthat has not ended.", size=8, va="top")
    axes.text(59, 14.5, "\n".join(["But:", *exceptions()]), size=8, va="top")
    figure.savefig(OUT, dpi=90, pil_kwargs={"optimize": True})


if __name__ == "__main__":
    main()
