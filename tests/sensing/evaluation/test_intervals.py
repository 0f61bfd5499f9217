"""Intervals scaled on loading paths: the level they reach on paths and sensors that differ, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cad.errors import ParameterError
from sensing.evaluation import intervals
from sensing.evaluation.live_answers import LiveAnswers
from sensing.learning.path_quantile import path_quantile
from sensing.wrench.model import load_wrench_model

PATHS, FRAMES = 60, 30
CAMERA = 0.3  # variance that the camera adds


def made_answers(rng: np.random.Generator, paths: int = PATHS, name: str = "p") -> LiveAnswers:
    """Errors of which most repeats within a path: gains differ from path to path, long paths are worse ones."""
    frames = np.where(np.arange(paths) % 3 == 0, 3 * FRAMES, FRAMES)
    path = np.repeat([f"{name}-{k}" for k in range(paths)], frames)
    spread = np.repeat(np.where(np.arange(paths) % 3 == 0, 2.0, 1.0), frames)
    bias = np.repeat(rng.standard_normal((paths, 6)), frames, axis=0)
    error = spread[:, None] * (0.8 * bias + 0.6 * rng.standard_normal(bias.shape))
    count, eye = len(path), np.eye(6)
    own = np.tile(0.1 * eye, (count, 1, 1))
    return LiveAnswers(
        error, np.zeros((count, 6)), own + CAMERA * eye, own, np.zeros(count, bool), np.zeros(count),
        np.full((count, 4), np.nan), np.ones(count, bool), path,
    )  # fmt: skip


def covered(answers: LiveAnswers, scale: np.ndarray) -> float:
    """Fraction of the axes covered, every path with the same weight."""
    sigma = np.sqrt(scale**2 * 0.1 + CAMERA)
    inside = (np.abs(answers.value) <= intervals.NORMAL_95 * sigma).mean(axis=1)
    names = np.unique(answers.path)
    return float(np.mean([inside[answers.path == name].mean() for name in names]))


def test_the_scale_covers_new_paths_at_the_level_and_counting_frames_does_not() -> None:
    by_path, by_frame, rng = [], [], np.random.default_rng(0)
    for _ in range(12):
        known, fresh = made_answers(rng), made_answers(rng, 300)
        factor = intervals.needed(known)
        by_path.append(covered(fresh, path_quantile(factor, known.path, 0.95)))
        alone = known.take(np.char.find(known.path, "-") > 0)
        by_frame.append(covered(fresh, np.quantile(intervals.needed(alone), 0.95, axis=0)))
    assert 0.925 < np.mean(by_path) < 0.965
    assert np.mean(by_frame) > np.mean(by_path) + 0.005  # long, bad paths count three times


def test_needed_factor_is_the_one_from_which_the_error_is_inside() -> None:
    answers = made_answers(np.random.default_rng(1), 4)
    factor = intervals.needed(answers)
    edge = intervals.NORMAL_95 * np.sqrt(factor**2 * 0.1 + CAMERA)
    inside = np.abs(answers.value) < intervals.NORMAL_95 * np.sqrt(CAMERA)
    assert inside.any() and (factor[inside] == 0).all() and (~inside).any()
    assert np.allclose(edge[~inside], np.abs(answers.value)[~inside])


def test_quantile_of_equal_paths_is_that_of_their_rows() -> None:
    rng = np.random.default_rng(2)
    values, path = rng.standard_normal((400, 2)), np.repeat([f"{k}" for k in range(40)], 10)
    assert np.allclose(path_quantile(values, path, 0.9), np.quantile(values, 0.9, axis=0, method="inverted_cdf"))
    assert np.array_equal(path_quantile(values, path, 1.0), values.max(axis=0))


def test_a_model_gets_the_scale_and_says_from_what(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    manifest = {"format": 2, "phases": [], "request": {"protocol": "wide", "seed": 1}}
    rng = np.random.default_rng(3)
    known = {f"sensor{k}": made_answers(rng, 20, f"wide-1{k}") for k in range(2)}
    for name in known:
        (tmp_path / name).mkdir()
        (tmp_path / name / "manifest.json").write_text(json.dumps(manifest))
    monkeypatch.setattr(intervals, "_judged", lambda model, data: known[data.folder.name])
    model = load_wrench_model()
    scaled = intervals.with_intervals(model, [tmp_path / name for name in known])
    ratio = scaled.weights["calibration"] / model.weights["calibration"]
    factor, path = (np.concatenate([f(a) for a in known.values()]) for f in (intervals.needed, lambda a: a.path))
    assert np.allclose(ratio, path_quantile(factor, path, 0.95), rtol=1e-6)
    assert len(scaled.about["intervals"]["paths"]) == 40 and scaled.about["intervals"]["sensors"] == 2
    scaled.save(tmp_path / "w")
    assert load_wrench_model(path=tmp_path / "w").about["intervals"] == scaled.about["intervals"]
    with pytest.raises(ParameterError, match="18 loading paths to calibrate intervals on: give 19 or more"):
        few = known["sensor0"]
        monkeypatch.setitem(known, "sensor0", few.take(np.isin(few.path, np.unique(few.path)[:18])))
        intervals.with_intervals(model, [tmp_path / "sensor0"])
    trained = {**model.about, "training": {**model.about["training"], "paths": ["wide-11-3"]}}
    with pytest.raises(ParameterError, match="path wide-11-3 of the interval data is one of training"):
        intervals.with_intervals(replace(model, about=trained), [tmp_path / "sensor1"])
