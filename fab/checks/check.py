"""The record of one check.

A check is a number with limits; it gates the export. Nothing is loosened to pass: limits are stated where the check is
made, with their reason.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from cad.errors import EndcapError


@dataclass(frozen=True)
class Check:
    """One gate.

    Attributes:
        name: what was checked, ``subject.quantity_unit``.
        value: the measured number.
        low: smallest accepted value.
        high: largest accepted value.
    """

    name: str
    value: float
    low: float = -math.inf
    high: float = math.inf

    @property
    def ok(self) -> bool:
        """Whether the value lies within the limits (a NaN never does)."""
        return bool(self.low <= self.value <= self.high)

    @property
    def limit(self) -> str:
        """The limits in words, for reports."""
        if self.low == self.high:
            return f"= {self.low:g}"
        if math.isinf(self.low):
            return f"<= {self.high:g}"
        if math.isinf(self.high):
            return f">= {self.low:g}"
        return f"{self.low:g} .. {self.high:g}"

    def record(self, figures: int) -> dict[str, object]:
        """The check as written to JSON, its value to so many figures."""
        return {"name": self.name, "value": float(f"{self.value:.{figures}g}"), "limit": self.limit, "ok": self.ok}


class ChecksFailedError(EndcapError):
    """A check did not hold, so nothing was written.

    Attributes:
        lines: name, value and limit of every check that failed.
    """

    def __init__(self, message: str, lines: tuple[str, ...]) -> None:
        super().__init__(message)
        self.lines = lines


def require_passed(checks: Sequence[Check], where: str) -> None:
    """Stop where a check failed.

    Raises:
        ChecksFailedError: it names each one, its value and limit.
    """
    failed = tuple(f"{check.name} = {check.value:.6g}, wanted {check.limit}" for check in checks if not check.ok)
    if failed:
        raise ChecksFailedError(f"{len(failed)} of {len(checks)} checks failed {where}; nothing was written", failed)
