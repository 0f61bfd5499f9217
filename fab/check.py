"""The record of one check.

A check is a number with limits; it gates the export. Nothing is loosened to pass: limits are stated where the check is
made, with their reason.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


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
