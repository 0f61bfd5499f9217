"""One thing that was looked at: a number, a verdict on it, and the fix in one line."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Verdict(StrEnum):
    """How a finding is to be taken."""

    GOOD = "good"
    LOOK = "look"
    BAD = "bad"


@dataclass(frozen=True)
class Finding:
    """One finding.

    Attributes:
        name: what was looked at.
        verdict: good, look at it, or bad.
        text: the numbers, in words and units.
        fix: what to do, one line; empty where nothing is to be done.
        values: the numbers by name, each with its unit in it.
    """

    name: str
    verdict: Verdict
    text: str
    fix: str
    values: dict[str, float | list[str]]


def finding(
    name: str, verdict: Verdict, text: str, fix: str, values: dict[str, float | list[str]] | None = None
) -> Finding:
    """A finding, which has a fix only where something is to be done.

    Args:
        name, verdict, text, fix, values: see :class:`Finding`.
    """
    return Finding(name, verdict, text, "" if verdict is Verdict.GOOD else fix, values or {})


def above(value: float, good: float, look: float) -> Verdict:
    """Verdict on a number that should be large.

    Args:
        value: the number.
        good, look: from here on good, and worth a look; bad below.
    """
    return Verdict.GOOD if value >= good else Verdict.LOOK if value >= look else Verdict.BAD


def below(value: float, good: float, look: float) -> Verdict:
    """Verdict on a number that should be small.

    Args:
        value: the number.
        good, look: up to here good, and worth a look; bad beyond.
    """
    return above(-value, -good, -look)
