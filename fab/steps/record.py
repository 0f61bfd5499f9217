"""Records of the steps of work: the parts that move, their paths, and the parts in place that they pass.

Sweeps (:mod:`fab.steps.sweep`), instructions and pictures (:mod:`fab.build_sheet`) are made from the same records.
Endcap frame, millimetres.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from fab.checks.extraction import Leg

Stage = Literal["upper half", "bowl", "cast", "demold", "assemble"]
Look = Literal["from above", "from the side", "dome down", "dome down, from the side", "into the dome"]


@dataclass(frozen=True)
class Move:
    """Move of parts that form one rigid body.

    Attributes:
        parts: names of the parts that move together.
        way_out: legs of the path from their place outward; parts that enter follow it in reverse.
        past: names of the parts in place during the move.
    """

    parts: tuple[str, ...]
    way_out: tuple[Leg, ...]
    past: tuple[str, ...]


@dataclass(frozen=True)
class Step:
    """One step of work.

    Attributes:
        key: stable name of its picture and of its entry in the manifest.
        stage: stage of the work.
        title: its action, as a heading.
        lines: its instructions, as sentences; the build sheet replaces names in braces.
        moves: moves in their order; empty where no part moves.
        enters: whether the parts are inserted (or else removed).
        screws: beginnings of the names of the joints whose screws are driven or loosened.
        look: view of the picture.
        shown: parts in the picture that do not move; None for those that the moves pass.
        cut: parts that the picture shows in half.
        extras: objects in the picture that are not parts (``nuts``, ``inserts``, ``silicone``, ``dots``).
        drawn_mm: distance from its place at which the last part to enter, or the first to leave, is drawn, mm.
    """

    key: str
    stage: Stage
    title: str
    lines: tuple[str, ...]
    moves: tuple[Move, ...] = ()
    enters: bool = True
    screws: tuple[str, ...] = ()
    look: Look = "from the side"
    shown: tuple[str, ...] | None = None
    cut: tuple[str, ...] = ()
    extras: tuple[str, ...] = ()
    drawn_mm: float = 60.0

    @property
    def in_place(self) -> tuple[str, ...]:
        """Names of the parts that the picture shows in place."""
        if self.shown is not None:
            return self.shown
        moving = {name for move in self.moves for name in move.parts}
        return tuple(dict.fromkeys(name for move in self.moves for name in move.past if name not in moving))


def one_by_one(
    names: Iterable[str], way_out: tuple[Leg, ...] | dict[str, tuple[Leg, ...]], past: Iterable[str], enters: bool
) -> tuple[Move, ...]:
    """Moves of parts that are inserted or removed one at a time.

    Args:
        names: names of the parts in the order of their moves.
        way_out: removal path of all parts, or of each by its name.
        past: names of the other parts in place.
        enters: whether they are inserted: inserted parts are in place for those that follow, removed ones are not.
    """
    names, past = tuple(names), tuple(past)
    moves = []
    for k, name in enumerate(names):
        others = names[:k] if enters else names[k + 1 :]
        legs = way_out[name] if isinstance(way_out, dict) else way_out
        moves.append(Move((name,), legs, (*past, *others)))
    return tuple(moves)
