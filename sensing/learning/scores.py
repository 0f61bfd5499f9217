"""Errors of a model: of each axis in its own unit, of direction, contact, rest, and coverage.

Wrenches on the endcap about the sphere's centre, N and N m. ``mixed_mse`` averages N^2 and (N m)^2 like the paper, for
comparison only.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from sensing.wrench.range import NORMAL_95

Array = NDArray[np.float64]
AXES = ("fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm")  # names of the axes, with units
CONTACT_N = 0.3  # true force from which contact counts, at D=130 T=8
DIRECTION_N = 1.0  # true force from which the direction is scored, at D=130 T=8


@dataclass(frozen=True)
class Score:
    """Errors over N samples; NaN where there are none.

    Attributes:
        count: N.
        rmse, mae: (6,) root mean squared and mean absolute error by axis, N and N m.
        mixed_mse: mean squared error over samples and axes.
        direction_deg: median angle between true and reported force, from ``DIRECTION_N`` on.
        precision, recall: precision and recall of contact at ``CONTACT_N``, which applies to truth and answer.
        rest_n: largest force norm without contact, N.
        coverage: part of the axes within 1.96 standard deviations.
        flagged: part of the samples out of range.
        lag_s: delay of the answers behind the truth, s, if it was computed.
    """

    count: int
    rmse: tuple[float, ...]
    mae: tuple[float, ...]
    mixed_mse: float
    direction_deg: float
    precision: float
    recall: float
    rest_n: float
    coverage: float
    flagged: float
    lag_s: float = float("nan")

    def row(self) -> dict[str, float]:
        """The errors as flat numbers, for CSV."""
        flat = {f"rmse_{axis}": value for axis, value in zip(AXES, self.rmse, strict=True)}
        flat |= {f"mae_{axis}": value for axis, value in zip(AXES, self.mae, strict=True)}
        return flat | {k: v for k, v in asdict(self).items() if k not in ("rmse", "mae")}


def score(
    reported: Array,
    truth: Array,
    contact: NDArray[np.bool_],
    covariance: Array | None = None,
    flagged: NDArray[np.bool_] | None = None,
    load_scale: float = 1.0,
) -> Score:
    """Errors of answers (N, 6) against the truth (N, 6).

    Args:
        reported, truth: wrenches, N and N m.
        contact: (N,) whether anything touches.
        covariance: (N, 6, 6) covariances of the answers.
        flagged: (N,) whether the answer is out of range.
        load_scale: scale of the endcap's forces (:mod:`sensing.wrench.load_scale`).

    Raises:
        ParameterError: shapes that do not fit, or answers that are not finite.
    """
    if reported.shape != truth.shape or reported.shape[1:] != (6,) or not len(reported):
        raise ParameterError(
            f"reported {reported.shape}, truth {truth.shape}: need (N, 6) of both, N at least 1", name="reported"
        )
    if not np.isfinite(reported).all():
        raise ParameterError(
            "reported holds numbers that are not finite: a model must never give them", name="reported"
        )
    error = reported - truth
    force, true_force = np.linalg.norm(reported[:, :3], axis=1), np.linalg.norm(truth[:, :3], axis=1)
    clear = (true_force >= DIRECTION_N * load_scale) & (force > 0)
    cosine = (reported[clear, :3] * truth[clear, :3]).sum(axis=1) / (force * true_force)[clear]
    said, real = (norm >= CONTACT_N * load_scale for norm in (force, true_force))
    hits = float((said & real).sum())
    coverage = float("nan")
    if covariance is not None:
        sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        coverage = float((np.abs(error) <= NORMAL_95 * sigma)[contact].mean()) if contact.any() else float("nan")
    return Score(
        count=len(reported),
        rmse=tuple(np.sqrt((error**2).mean(axis=0)).tolist()),
        mae=tuple(np.abs(error).mean(axis=0).tolist()),
        mixed_mse=float((error**2).mean()),
        direction_deg=float(np.degrees(np.median(np.arccos(np.clip(cosine, -1, 1))))) if clear.any() else float("nan"),
        precision=hits / said.sum() if said.any() else float("nan"),
        recall=hits / real.sum() if real.any() else float("nan"),
        rest_n=float(force[~contact].max()) if (~contact).any() else float("nan"),
        coverage=coverage,
        flagged=float(flagged.mean()) if flagged is not None else float("nan"),
    )


def table(scores: dict[str, Score]) -> str:
    """Errors as plain text, a line for each name."""
    width = max(10, *(len(name) for name in scores))
    head = "".join(f"{axis:>9}" for axis in AXES)
    lines = [f"{'RMSE':<{width}}{head}   mixed  direction  precision  recall  rest N  coverage  flagged  lag ms"]
    for name, s in scores.items():
        errors = "".join(f"{value:9.4f}" for value in s.rmse)
        lines.append(
            f"{name:<{width}}{errors}{s.mixed_mse:8.4f}{s.direction_deg:9.2f} °{s.precision:11.3f}{s.recall:8.3f}"
            f"{s.rest_n:8.3f}{s.coverage:10.3f}{s.flagged:9.3f}{1000 * s.lag_s:8.1f}"
        )
    return "\n".join(lines)
