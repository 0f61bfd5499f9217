"""The estimate in the terminal: one line a second, with the truth where it is known."""

from __future__ import annotations

import re

import numpy as np

from cad.errors import printable
from sensing.live.outputs.lines import Lines
from sensing.robot.node.record import Report
from sensing.tensegrity.description import TensegrityRobot
from sensing.tensegrity.samples import Sample

SHOW_S = 1.0  # s on the samples' clock, interval of the lines
SETTLE_S = 0.5  # s in which every stream reports at least once
AGAIN_S = 10.0  # E: s for which a fault has to be gone before it is written again
VALUE = re.compile(r"\d+\.\d+")  # in a note; one that changes is no new fault


class RobotTerminal:
    """Writes one line a second, and a line at the start of each fault.

    Args:
        lines: output of the lines.
        robot: robot of the estimates.
        quiet: whether only faults are printed.

    Attributes:
        last: newest report.
    """

    def __init__(self, lines: Lines, robot: TensegrityRobot, quiet: bool = False) -> None:
        self._lines, self._robot, self._quiet = lines, robot, quiet
        self._next_s, self._begin_s = -np.inf, np.inf
        self._seen_s: dict[str, float] = {}  # time at which each fault was last there
        self.last: Report | None = None

    def sample(self, sample: Sample) -> None:
        """Do nothing: the next report shows the effect of the sample."""

    def report(self, report: Report) -> None:
        """Write a line, if one is due."""
        self.last, time_s = report, report.estimate.time_s
        self._begin_s = min(self._begin_s, time_s)
        settled = time_s > self._begin_s + SETTLE_S
        for note in report.estimate.health.notes if settled else ():
            kind = VALUE.sub("", note.split(":")[0])
            if time_s - self._seen_s.get(kind, -np.inf) > AGAIN_S:
                self._lines.write(f"{time_s:7.1f} s  {printable(note)}\n")
            self._seen_s[kind] = time_s
        if time_s >= self._next_s and not self._quiet:
            self._next_s = time_s + SHOW_S
            self._lines.write(line(report, self._robot) + "\n")


def line(report: Report, robot: TensegrityRobot) -> str:
    """One report in one line."""
    estimate = report.estimate
    spread = float(np.sqrt(np.trace(estimate.centre_of_mass_covariance)))
    text = f"{estimate.time_s:7.1f} s  at {_place(estimate.centre_of_mass_m)} m \N{PLUS-MINUS SIGN} {spread:.3f}"
    true, drift = report.true_centre_m(robot), report.drift_m(robot)
    if true is not None and drift is not None:
        share = f", {100 * drift / report.path_m:.1f} % of the path" if report.path_m > 0.5 else ""
        text += f"; truly {_place(true)}, off by {drift:.3f} m{share}"
    text += f"; path {report.path_m:.2f} m; "
    text += ", ".join(f"{endcap.name} {endcap.hold.word}" for endcap in estimate.endcaps)
    text += f"; friction {estimate.friction:.2f} \N{PLUS-MINUS SIGN} {estimate.friction_sd:.2f}"
    return text + f", softness {estimate.softness:+.2f} \N{PLUS-MINUS SIGN} {estimate.softness_sd:.2f}"


def _place(point: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.2f}" for value in point) + ")"
