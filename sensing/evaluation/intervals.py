"""Widths of intervals that hold on other sensors: from pictures of several sensors on paths of their own.

    model = with_intervals(model, ["exports/interval_71", "exports/interval_72"])

Notes:
    For a calibration frame in contact and without a flag, with error e of an axis, variance M of the network and C of
    the camera, the interval is 1.96 sqrt(s^2 M + g^2 t^2 + C) with g = |F| / (F0 + |F|); t is the error that tracking
    adds from a light touch on. Dots that have moved by a third of a pixel have the same error as dots moved by
    three, which for small motions is most of the answer's error. A network that learned less error for them is
    overconfident there, and no single factor suits light and heavy loads. So s is the smallest that covers 95 % of the
    frames from a light load on, t the smallest that covers 95 % of those below, and each is found with the other fixed,
    in turn, until both converge: a larger one never needs a larger other, so from t = 0 the s decrease and the t
    increase. Frames of one path are not independent, but paths are: each has the same weight in both quantiles. That
    estimates the level; the guarantee of conformal prediction on groups (Dunn, Wasserman, Ramdas 2023,
    doi:10.1080/01621459.2022.2060112) takes the 0.95 (n + 1) / n quantile of n paths, far too wide for tens of paths.
    Motions and sensors must not be among those of training or of the choice of a setting; one motion with several
    sensors counts as several, although these are not quite independent.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cad.errors import FileError, ParameterError
from cad.identity import MUST_AGREE, Identity, require_same
from sensing.evaluation.live_answers import LiveAnswers, live_answers
from sensing.learning.found_camera import camera_of_set
from sensing.learning.path_quantile import path_quantile
from sensing.learning.samples import Samples
from sensing.live.core.model import live_model
from sensing.records_labelled import LabelledSet
from sensing.wrench.model import WrenchModel
from sensing.wrench.range import NORMAL_95
from sensing.wrench.tensors import TRACKING, onset_n_of
from sensing.wrench.weight_files import SIMULATED

Array = NDArray[np.float64]
LEVEL = 0.95  # part of the errors that an interval covers
SCALES = 1e-6, 1e6  # limits of the squared factors, so that the covariance stays positive
LIGHT_N = 5.0  # E: at D=130 T=8: below it the error of tracking dominates, well above it it is negligible
ROUNDS = 50  # alternating updates of s and t
FEWEST_PATHS = 19  # fewer do not determine a 95 % level


def with_intervals(model: WrenchModel, folders: Sequence[str | Path], tilt_to_deg: float = 90.0) -> WrenchModel:
    """A model whose covariance is scaled, axis by axis, to the errors of the live pipeline.

    Args:
        model: trained model.
        folders: folders of rendered or recorded frames of several sensors, each with the camera that a user finds.
        tilt_to_deg: contacts further from the tip are left out, degrees: where a model fails, no width is right.

    Raises:
        ParameterError: fewer than 19 paths, or one that the model was trained on.
        FileError: an incomplete set, or one of another endcap than the model's.
    """
    answers = [a.take(~(a.tilt_deg > tilt_to_deg)) for a in (_judged(model, LabelledSet(folder)) for folder in folders)]
    path = np.concatenate([np.char.add(f"{k} ", a.path) for k, a in enumerate(answers)])
    names = sorted({str(name) for a in answers for name in a.path})
    _require_paths(names, len(np.unique(path)), model.about["training"]["paths"])
    scale, tracking = widths(_joined(answers, path), onset_n_of(model.weights), LIGHT_N * model.load_scale)
    weights = {
        **model.weights,
        "calibration": (model.weights["calibration"] * scale).astype(np.float32),
        "tracking": (tracking / model.weights["units"]).astype(np.float32),
    }
    record = {
        "paths": names,
        "sensors": len(answers),
        "tilt_to_deg": tilt_to_deg,
        "scale": [round(float(s), 4) for s in scale],
        "tracking": [round(float(t), 5) for t in tracking],
    }
    # The limit applies to the network's own spread: frames flagged under the previous scale stay flagged.
    limits = replace(model.range, interval_n=model.range.interval_n * float(scale[:3].min()))
    return replace(model, weights=weights, range=limits, about={**model.about, "intervals": record})


def require_intervals(
    folders: Sequence[str | Path], seen: Sequence[Samples], start: WrenchModel | None, tilt_to_deg: float = 90.0
) -> None:
    """Refuse interval data before the training that they would be refused after, which can take hours.

    Args:
        folders: folders of rendered or recorded frames.
        seen: samples of the training to come.
        start: weights that are fine-tuned, or None.
        tilt_to_deg: contacts further from the tip do not count, degrees.

    Raises:
        ParameterError, FileError: those of :func:`with_intervals` that need no answers.
    """
    named: list[str] = []
    for folder in folders:
        data = LabelledSet(folder)
        _require_usable(data, seen[0].identity)
        counts = data.column("contact").astype(bool) & ~(data.column("tilt_deg") > tilt_to_deg)
        named += [data.path_name(int(number)) for number in np.unique(data.column("path")[counts])]
    known = () if start is None else start.about.get("training", {}).get("paths", ())
    _require_paths(named, len(named), {*known, *(str(name) for part in seen for name in part.path)})


def _require_paths(names: Sequence[str], count: int, known: Collection[str]) -> None:
    """Refuse paths of the training, and fewer paths than determine the level."""
    shared = sorted(set(names) & set(known))
    if shared:
        raise ParameterError(
            f"path {shared[0]} of the interval data is one of training: intervals would be too narrow; make the set "
            "with another --seed",
            name="intervals",
            value=shared[0],
        )
    if count < FEWEST_PATHS:
        raise ParameterError(
            f"{count} loading paths to calibrate intervals on: give {FEWEST_PATHS} or more",
            name="intervals",
            value=count,
        )


def _require_usable(data: LabelledSet, made_for: Identity | None) -> None:
    """Refuse a set that is not whole, has no pictures, or is of another endcap than the weights."""
    data.require_whole()
    fix = "make frames of the endcap that the weights are for"
    require_same(data.folder, "interval data", data.identity, made_for, fix, MUST_AGREE)
    if not data.has_pictures:
        raise FileError(f"{data.folder}: holds no pictures (written with --render off): intervals need a set with them")


def widths(answers: LiveAnswers, onset_n: float, light_n: float = LIGHT_N) -> tuple[Array, Array]:
    """(6,) factors s on the network's standard deviations, and (6,) standard deviations t, N and N m, beside them.

    Args:
        answers: answers of a model without t; ``path`` groups them by loading path.
        onset_n: F0, force at which half of t is reached, N.
        light_n: force below which a load is light, N.
    """
    error, path = (answers.value - answers.truth) / NORMAL_95, answers.path
    own, total = (np.diagonal(c, axis1=1, axis2=2) for c in (answers.model_covariance, answers.covariance))
    left, force = error**2 - (total - own), np.linalg.norm(answers.value[:, :3], axis=1)
    light, share = force < light_n, ((force / (force + onset_n)) ** 2)[:, None]
    if not light.any() or light.all():  # with one kind of load alone, one factor suffices
        return np.sqrt(np.clip(path_quantile(np.maximum(left, 0.0) / own, path, LEVEL), *SCALES)), np.zeros(6)
    tracking = np.zeros(6)  # squares, as scale is
    for _ in range(ROUNDS):
        needed = np.maximum(left - share * tracking, 0.0) / own
        scale = np.clip(path_quantile(needed[~light], path[~light], LEVEL), *SCALES)
        before, needed = tracking, np.maximum(left - scale * own, 0.0) / share
        tracking = path_quantile(needed[light], path[light], LEVEL)
        if np.allclose(tracking, before, rtol=1e-6, atol=0.0):
            break
    return np.sqrt(scale), np.sqrt(tracking)


def _joined(answers: Sequence[LiveAnswers], path: NDArray[np.str_]) -> LiveAnswers:
    """All answers joined, with names of paths that differ between sensors."""
    columns = {name: np.concatenate([getattr(a, name) for a in answers]) for name in LiveAnswers.__dataclass_fields__}
    return LiveAnswers(**{**columns, "path": path})


def _judged(model: WrenchModel, data: LabelledSet) -> LiveAnswers:
    """Answers in contact within the model's range, whatever the width of their intervals before the scaling, without
    the additional variance for errors that simulated frames lack."""
    _require_usable(data, model.identity)
    weights = {name: value for name, value in model.weights.items() if name not in TRACKING}
    limits = replace(model.range, interval_n=math.inf)
    model = replace(model, weights=weights, range=limits, about={**model.about, SIMULATED: False})
    live = live_model("calibrated", model, model.shape, model.method)
    camera = camera_of_set(data)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "camera.json"
        if camera is not None:
            camera.save(path, data.identity)
        found = live_answers(data, live, None if camera is None else path)
    return found.take(found.contact & ~found.flagged)
