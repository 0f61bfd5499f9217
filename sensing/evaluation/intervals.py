"""How wide intervals must be to hold on a sensor never seen: from pictures of other sensors on paths of their own.

    model = with_intervals(model, ["exports/interval_71", "exports/interval_72"])

Notes:
    On a calibration frame in contact and without a flag, with error e of an axis, variance M that the model gives and C
    that the camera adds, the interval 1.96 sqrt(s^2 M + C) covers e from s = sqrt(max(e^2 / 1.96^2 - C, 0) / M) on.
    Frames of one path are not independent, paths are: each has the same weight, and s is the 0.95 quantile under these
    weights. This estimates the level; the guarantee of conformal prediction on groups (Dunn, Wasserman, Ramdas 2023,
    doi:10.1080/01621459.2022.2060112) takes the 0.95 (n + 1) / n quantile of n paths, far too wide for tens of paths.
    Motions and sensors must be none that training or the choice of a setting has seen; one motion seen by several
    sensors counts as several, though it is not quite.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from sensing.evaluation.live_answers import LiveAnswers, live_answers
from sensing.learning.found_camera import camera_of_set
from sensing.learning.path_quantile import path_quantile
from sensing.live.core.model import live_model
from sensing.records_labelled import LabelledSet
from sensing.wrench.model import WrenchModel
from sensing.wrench.range import NORMAL_95
from sensing.wrench.simulation_spread import SIMULATED

Array = NDArray[np.float64]
LEVEL = 0.95
SCALES = 1e-3, 1e3  # the covariance stays positive
FEWEST_PATHS = 19  # fewer say nothing of one path in twenty


def with_intervals(model: WrenchModel, folders: Sequence[str | Path], tilt_to_deg: float = 90.0) -> WrenchModel:
    """A model whose covariance is scaled, axis by axis, on what the live pipeline answers.

    Args:
        model: as trained.
        folders: rendered or recorded frames of several sensors, each with the camera that a user finds.
        tilt_to_deg: contacts further from the tip are left out: where a model fails, no width is right.

    Raises:
        ParameterError: fewer than 19 paths, or one that the model was trained on. FileError: a set that is not whole.
    """
    answers = [a.take(~(a.tilt_deg > tilt_to_deg)) for a in (_judged(model, LabelledSet(folder)) for folder in folders)]
    path = np.concatenate([np.char.add(f"{k} ", a.path) for k, a in enumerate(answers)])
    names = sorted({str(name) for a in answers for name in a.path})
    known = sorted(set(names) & set(model.about["training"]["paths"]))
    if known:
        raise ParameterError(
            f"path {known[0]} of the interval data is one of training: intervals would be too narrow; make the set "
            "with another --seed",
            name="intervals",
            value=known[0],
        )
    count = len(np.unique(path))
    if count < FEWEST_PATHS:
        raise ParameterError(
            f"{count} loading paths to calibrate intervals on: give {FEWEST_PATHS} or more",
            name="intervals",
            value=count,
        )
    factor = np.concatenate([needed(a) for a in answers])
    scale = np.clip(path_quantile(factor, path, LEVEL), *SCALES)
    weights = {**model.weights, "calibration": (model.weights["calibration"] * scale).astype(np.float32)}
    record = {
        "paths": names,
        "sensors": len(answers),
        "tilt_to_deg": tilt_to_deg,
        "scale": [round(float(s), 4) for s in scale],
    }
    return replace(model, weights=weights, about={**model.about, "intervals": record})


def needed(answers: LiveAnswers) -> Array:
    """(N, 6) factor on the model's standard deviations from which each error is covered."""
    error = answers.value - answers.truth
    own, total = (np.diagonal(c, axis1=1, axis2=2) for c in (answers.model_covariance, answers.covariance))
    return np.sqrt(np.maximum((error / NORMAL_95) ** 2 - (total - own), 0.0) / own)


def _judged(model: WrenchModel, data: LabelledSet) -> LiveAnswers:
    """Answers in contact for which the model vouches, however wide their intervals are before they are scaled, and
    without what is added for all that simulated frames do not show."""
    data.require_whole()
    limits = replace(model.range, interval_n=math.inf)
    model = replace(model, range=limits, about={**model.about, SIMULATED: False})
    live = live_model("calibrated", model, model.shape)
    camera = camera_of_set(data)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "camera.json"
        if camera is not None:
            camera.save(path)
        found = live_answers(data, live, None if camera is None else path)
    return found.take(found.contact & ~found.flagged)
