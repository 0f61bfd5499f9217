"""Errors by tilt and load, since one mean hides a region in which a model fails."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sensing.evaluation.live_answers import LiveAnswers
from sensing.learning.scores import AXES
from sensing.wrench.range import NORMAL_95

TILTS_DEG = (0.0, 15.0, 25.0, 35.0, 45.0, 55.0, 90.0)  # edges; the static protocol presses at 10, 20 ... 50
LOADS_N = (0.0, 5.0, 10.0, 20.0, 30.0, 40.0, 60.0)  # edges of the true force's ranges, at D=130 T=8
FAR_N = 1.0  # error of fz from which an answer without a flag is misleading, at D=130 T=8
CSV_COLUMNS = (
    "name", "tilt_from_deg", "tilt_to_deg", "load_from_n", "load_to_n", "frames",
    *(f"{kind}_{axis}" for kind in ("rmse", "bias") for axis in AXES),
    "coverage", "flagged", "far", "far_flagged", "centre_deg", "normal_deg",
)  # fmt: skip
LEAST_WIDTH = 13  # characters of a column of the tables


@dataclass(frozen=True)
class Cell:
    """Errors of the frames in contact within one range of tilt and of load.

    Attributes:
        tilt_deg, load_n: (from, to); NaN tilts where the set does not state them.
        frames: number of frames.
        rmse, bias: (6,) root mean squared error and mean error by axis, N and N m.
        coverage: fraction of axes within 1.96 standard deviations.
        flagged: fraction of frames with a flag.
        far_n: error of fz that counts as far off, N.
        far, far_flagged: numbers of frames that are far off, and of those among them with a flag.
        centre_deg, normal_deg: median errors of contact centre and normal, degrees; NaN where the plane is not known.
    """

    tilt_deg: tuple[float, float]
    load_n: tuple[float, float]
    frames: int
    rmse: NDArray[np.float64]
    bias: NDArray[np.float64]
    coverage: float
    flagged: float
    far_n: float
    far: int
    far_flagged: int
    centre_deg: float
    normal_deg: float

    def row(self) -> dict[str, float]:
        """The errors as flat numbers, for CSV."""
        flat = {"tilt_from_deg": self.tilt_deg[0], "tilt_to_deg": self.tilt_deg[1]}
        flat |= {"load_from_n": self.load_n[0], "load_to_n": self.load_n[1], "frames": self.frames}
        flat |= {f"rmse_{axis}": float(v) for axis, v in zip(AXES, self.rmse, strict=True)}
        flat |= {f"bias_{axis}": float(v) for axis, v in zip(AXES, self.bias, strict=True)}
        flat |= {"coverage": self.coverage, "flagged": self.flagged}
        flat |= {"far": self.far, "far_flagged": self.far_flagged}
        return flat | {"centre_deg": self.centre_deg, "normal_deg": self.normal_deg}


def cells(answers: LiveAnswers, load_scale: float = 1.0) -> list[Cell]:
    """All cells with frames in contact, by tilt, then load; frames of unknown tilt come last.

    Args:
        answers: answers of one model on one set.
        load_scale: scale of the endcap's forces (:mod:`sensing.wrench.load_scale`); it also scales the ranges of the
            load.
    """
    touching = answers.take(answers.contact)
    load = np.linalg.norm(touching.truth[:, :3], axis=1)
    edges = _edges(load_scale, float(load.max(initial=0.0)))
    found = []
    for tilt, rows in _tilts(touching.tilt_deg):
        for low, high in pairwise(edges):
            inside = rows & (load >= low) & (load < high)
            if inside.any():
                found.append(_cell(touching.take(inside), tilt, (low, high), FAR_N * load_scale))
    return found


def cell_tables(found: list[Cell]) -> str:
    """Plain text: for each quantity a table, tilts down and loads across; a dash for no frames."""
    if not found:
        return "no frame in contact"
    tilts, loads = (list(dict.fromkeys(getattr(c, name) for c in found)) for name in ("tilt_deg", "load_n"))
    loads.sort()
    heads = [f"{low:g} to {high:g} N" for low, high in loads]
    width = max([LEAST_WIDTH, *(len(head) + 1 for head in heads)])
    quantities = {name.format(*(f"{c.far_n:.3g}" for c in found[:1])): value for name, value in QUANTITIES.items()}
    first = max(len(f"{name}, tilt") for name in quantities)
    lines = []
    for name, value in quantities.items():
        lines.append(f"{name + ', tilt':<{first}}" + "".join(f"{head:>{width}}" for head in heads))
        for tilt in tilts:
            values = {c.load_n: value(c) for c in found if c.tilt_deg == tilt}
            label = "unknown" if np.isnan(tilt[0]) else f"{tilt[0]:g} to {tilt[1]:g} deg"
            lines.append(f"{label:>{first - 1}} " + "".join(f"{values.get(n, '-'):>{width}}" for n in loads))
    return "\n".join(lines)


def _rmse(*columns: int) -> Callable[[Cell], str]:
    return lambda cell: f"{np.sqrt((cell.rmse[list(columns)] ** 2).mean()):.4f}"


def _median(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.2f}"


# Quantity in the tables -> text of a cell; root mean square over the axes that are named.
QUANTITIES: dict[str, Callable[[Cell], str]] = {
    "RMSE of fz N": _rmse(2),
    "RMSE of fx, fy N": _rmse(0, 1),
    "RMSE of torque N m": _rmse(3, 4, 5),
    "95 % interval covers": lambda cell: f"{100 * cell.coverage:.1f} %",
    "contact centre off deg": lambda cell: _median(cell.centre_deg),
    "normal off deg": lambda cell: _median(cell.normal_deg),
    "flagged": lambda cell: f"{100 * cell.flagged:.1f} %",
    "off by {} N, flagged": lambda cell: f"{cell.far_flagged} of {cell.far}" if cell.far else "-",
    "frames": lambda cell: f"{cell.frames}",
}


def cells_csv(named: dict[str, list[Cell]]) -> bytes:
    """All cells of several evaluations as CSV; without any frame in contact the titles alone."""
    rows = [{"name": name, **cell.row()} for name, found in named.items() for cell in found]
    stream = io.StringIO()
    writer = csv.DictWriter(stream, CSV_COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)
    return stream.getvalue().encode()


def _edges(load_scale: float, most_n: float) -> list[float]:
    """Edges of the loads, N, to three digits; the last is above the loads of all frames."""
    edges = [float(f"{load_scale * edge:.3g}") for edge in LOADS_N]
    return edges if most_n < edges[-1] else [*edges[:-1], float(f"{1.01 * most_n:.3g}")]


def _tilts(tilt_deg: NDArray[np.float64]) -> Iterator[tuple[tuple[float, float], NDArray[np.bool_]]]:
    for low, high in pairwise(TILTS_DEG):
        yield (low, high), (tilt_deg >= low) & (tilt_deg < high)
    yield (np.nan, np.nan), np.isnan(tilt_deg)


def _cell(answers: LiveAnswers, tilt_deg: tuple[float, float], load_n: tuple[float, float], far_n: float) -> Cell:
    error = answers.value - answers.truth
    sigma = np.sqrt(np.diagonal(answers.covariance, axis1=1, axis2=2))
    far = np.abs(error[:, 2]) > far_n
    known = answers.place[np.isfinite(answers.place).all(axis=1), :2]
    place = np.median(known, axis=0) if len(known) else np.full(2, np.nan)
    return Cell(
        tilt_deg, load_n, len(error), np.sqrt((error**2).mean(axis=0)), error.mean(axis=0),
        float((np.abs(error) <= NORMAL_95 * sigma).mean()), float(answers.flagged.mean()),
        far_n, int(far.sum()), int((far & answers.flagged).sum()), float(place[0]), float(place[1]),
    )  # fmt: skip
