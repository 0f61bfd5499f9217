"""The record of one check.

A check is a number with limits; the export is written only if all checks pass. The limits and their reasons stand in
the module that makes the check, and are not loosened to make an export pass.
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
        name: name of the check, ``subject.quantity_unit``.
        value: measured number, in the unit of the name.
        low: smallest accepted value.
        high: largest accepted value.
    """

    name: str
    value: float
    low: float = -math.inf
    high: float = math.inf

    @property
    def ok(self) -> bool:
        """Whether the value lies within the limits (NaN never does)."""
        return bool(self.low <= self.value <= self.high)

    @property
    def limit(self) -> str:
        """The limits as text, for reports."""
        if self.low == self.high:
            return f"= {self.low:g}"
        if math.isinf(self.low):
            return f"<= {self.high:g}"
        if math.isinf(self.high):
            return f">= {self.low:g}"
        return f"{self.low:g} .. {self.high:g}"

    def record(self, figures: int) -> dict[str, object]:
        """The check as plain JSON, its value rounded to ``figures`` significant figures."""
        return {"name": self.name, "value": float(f"{self.value:.{figures}g}"), "limit": self.limit, "ok": self.ok}


class ChecksFailedError(EndcapError):
    """A check failed, so that nothing was written.

    Attributes:
        lines: name, value and limit of every check that failed.
    """

    def __init__(self, message: str, lines: tuple[str, ...]) -> None:
        super().__init__(message)
        self.lines = lines


def require_passed(checks: Sequence[Check], where: str) -> None:
    """Raise an error if a check failed.

    Raises:
        ChecksFailedError: a check failed; the error lists name, value and limit of each failed check.
    """
    failed = tuple(f"{check.name} = {check.value:.6g}, wanted {check.limit}" for check in checks if not check.ok)
    if failed:
        raise ChecksFailedError(f"{len(failed)} of {len(checks)} checks failed {where}; nothing was written", failed)
