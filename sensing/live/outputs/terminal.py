"""Numbers in the terminal: one line per endcap, rewritten in place; without a terminal, changes only."""

from __future__ import annotations

import re
import shutil
from collections.abc import Mapping, Sequence
from typing import TextIO

import numpy as np

from cad.errors import printable
from sensing.live.core.reading import EndcapReading
from sensing.live.core.robot import RobotState
from sensing.live.core.stats import EndcapHealth
from sensing.live.outputs.lines import Lines

REFRESH_S = 0.2


class Terminal:
    """Writes the lines.

    Args:
        stream: where.
    """

    def __init__(self, stream: TextIO | Lines) -> None:
        self._stream = stream
        self._tty = self._stream.isatty()
        self._lines = 0
        self._said: dict[str, str] = {}

    def show(
        self,
        healths: Sequence[EndcapHealth],
        readings: Mapping[str, EndcapReading],
        robot: RobotState,
        notes: Sequence[str],
    ) -> None:
        """Rewrite all lines, or print the changes.

        Args:
            healths: of all endcaps.
            readings: the newest, by name of the endcap.
            robot: state of the whole robot.
            notes: further lines.
        """
        if not self._tty:
            self._print_changes(healths)
            return
        width = shutil.get_terminal_size().columns - 1
        lines = [endcap_line(health, readings.get(health.endcap)) for health in healths]
        lines += [robot_line(robot), *notes]
        up = f"\x1b[{self._lines}A" if self._lines else ""
        self._stream.write(up + "".join(f"\r\x1b[2K{printable(line)[:width]}\n" for line in lines) + "\x1b[J")
        self._stream.flush()
        self._lines = len(lines)

    def _print_changes(self, healths: Sequence[EndcapHealth]) -> None:
        for health in healths:
            text = f"{health.status}: {health.message}" if health.message else health.status
            said = re.sub(r"\d+(\.\d+)?", "#", text)  # a count that changes is no news
            if self._said.get(health.endcap) != said:
                self._said[health.endcap] = said
                self._stream.write(printable(f"{health.endcap}: {text}") + "\n")
                self._stream.flush()


def endcap_line(health: EndcapHealth, reading: EndcapReading | None) -> str:
    """One endcap in one line."""
    if reading is None or not reading.valid or not health.valid:
        dots = f"  {health.dots}/{health.dots_known} dots" if health.dots_known else ""
        return f"{health.endcap:<10} F    -  {health.status}{dots}  {health.message}".rstrip()
    force, torque = reading.wrench.force_n, reading.wrench.torque_nm
    spread = np.sqrt(np.clip(np.diagonal(reading.wrench.covariance)[:3], 0, None)).max()
    touch = "touch" if reading.contact.touching else "  -  "
    text = (
        f"{health.endcap:<10} F {force[0]:+6.1f} {force[1]:+6.1f} {force[2]:+6.1f} N ±{spread:3.1f}  "
        f"T {torque[0]:+5.2f} {torque[1]:+5.2f} {torque[2]:+5.2f} N m  {touch}  {health.rate_hz:4.1f} Hz "
        f"{health.p50_ms:4.1f} ms  {health.dropped} dropped"
    )
    if health.dots_known:
        text += f"  {health.dots}/{health.dots_known} dots"
    if health.message or reading.wrench.flags:
        text += "  " + (health.message or ", ".join(sorted(reading.wrench.flags)))
    return text


def robot_line(robot: RobotState) -> str:
    """Contact set and force sum."""
    names = ", ".join(robot.touching) or "none"
    text = f"touching: {names}"
    if np.isfinite(robot.force_n).all():
        text += f"; force sum {np.linalg.norm(robot.force_n):.1f} N" if robot.touching else ""
    elif robot.weight_n > 0:
        text += "; force sum unknown: endcaps.toml lacks T_robot_endcap"
    if robot.consistent is not None:
        text += f" of {robot.weight_n:.1f} N weight: {'consistent' if robot.consistent else 'NOT consistent'}"
    return text


def summary(healths: Sequence[EndcapHealth], seconds: float) -> list[str]:
    """Last words: one line an endcap."""
    lines = [f"{seconds:.1f} s"]
    for health in healths:
        lines.append(
            f"{health.endcap}: {health.frames} frames, {health.dropped} dropped, {health.faults} unusable, "
            f"image to wrench {_ms(health.p50_ms)} median, {_ms(health.p99_ms)} at 99 %"
            + _reopened(health.reopened)
            + (f": {health.status}: {health.message}" if health.message else "")
        )
    return lines


def _reopened(times: int) -> str:
    return "" if not times else ", reopened once" if times == 1 else f", reopened {times} times"


def _ms(value: float) -> str:
    return f"{value:.1f} ms" if value == value else "unknown"
