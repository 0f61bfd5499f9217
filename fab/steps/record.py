"""A step of work as data: which parts move, along which way, past which parts that are in place.

Sweeps (:mod:`fab.steps.sweep`), words and pictures (:mod:`fab.build_sheet`) are made from the same records. Endcap
frame, millimetres.
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
    """One body of parts on its way.

    Attributes:
        parts: what moves as one.
        way_out: legs from its place outward; a part that enters goes the same way in reverse.
        past: parts in place while it moves.
    """

    parts: tuple[str, ...]
    way_out: tuple[Leg, ...]
    past: tuple[str, ...]


@dataclass(frozen=True)
class Step:
    """One step of work.

    Attributes:
        key: stable name: of its picture, and of its entry in the manifest.
        stage: part of the work it belongs to.
        title: what is done.
        lines: how, as sentences; names in braces are filled in by the build sheet.
        moves: in their order; empty where nothing but hands and silicone moves.
        enters: whether the parts come in or go out.
        screws: joints (beginnings of their names) that are driven, or loosened, in this step.
        look: from where the picture is drawn.
        shown: parts in the picture that do not move, if not those that the moves pass.
        cut: parts of the picture that are drawn in half.
        extras: things in the picture that are no parts (``nuts``, ``inserts``, ``silicone``, ``dots``).
        drawn_mm: how far the last part to enter, or the first to leave, is drawn from its place.
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
        """Parts that the picture shows unmoved."""
        if self.shown is not None:
            return self.shown
        moving = {name for move in self.moves for name in move.parts}
        return tuple(dict.fromkeys(name for move in self.moves for name in move.past if name not in moving))


def one_by_one(
    names: Iterable[str], way_out: tuple[Leg, ...] | dict[str, tuple[Leg, ...]], past: Iterable[str], enters: bool
) -> tuple[Move, ...]:
    """Moves of parts that come or go singly.

    Args:
        names: in the order in which they move.
        way_out: of all, or of each.
        past: what is in place besides them.
        enters: parts that have entered stay in the way of those that follow; parts that have left do not.
    """
    names, past = tuple(names), tuple(past)
    moves = []
    for k, name in enumerate(names):
        others = names[:k] if enters else names[k + 1 :]
        legs = way_out[name] if isinstance(way_out, dict) else way_out
        moves.append(Move((name,), legs, (*past, *others)))
    return tuple(moves)
