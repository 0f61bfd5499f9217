"""Numbers without powers of ten on a logarithmic axis: 0.3 for what Matplotlib writes as 3 x 10^-1."""

from __future__ import annotations

from matplotlib.axis import Axis
from matplotlib.ticker import LogFormatter


class PlainFormatter(LogFormatter):
    """Labels the ticks that Matplotlib would label, in plain digits."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        """Text of the tick at x; empty where there is none."""
        return f"{x:g}" if super().__call__(x, pos) else ""


def plain_digits(*axes: Axis) -> None:
    """Give the axes plain digits; call it after the scale is set."""
    for axis in axes:
        axis.set_major_formatter(PlainFormatter())
        axis.set_minor_formatter(PlainFormatter(minor_thresholds=(1, 0.4)))
