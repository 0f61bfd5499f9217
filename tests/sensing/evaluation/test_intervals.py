"""Intervals scaled on loading paths: the level they reach on paths and sensors that differ, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pictured_set import write_set

from cad.errors import FileError, ParameterError
from cad.identity import identity
from cad.params import EndcapParams
from sensing.evaluation import intervals
from sensing.evaluation.live_answers import LiveAnswers
from sensing.learning.path_quantile import path_quantile
from sensing.wrench.model import load_wrench_model
from sensing.wrench.tensors import onset_n_of, tracking_of

PATHS, FRAMES = 60, 30
CAMERA = 0.3  # variance that the camera adds
OWN, ONSET_N = 0.1, 0.25  # variance that the network gives; force by which half of what tracking adds is there
TRUE_SCALE, TRUE_TRACKING = 1.8, 0.7


def made_answers(rng: np.random.Generator, paths: int = PATHS, name: str = "p") -> LiveAnswers:
    """Errors of which most repeats within a path: gains differ from path to path, long paths are worse ones."""
    frames = np.where(np.arange(paths) % 3 == 0, 3 * FRAMES, FRAMES)
    path = np.repeat([f"{name}-{k}" for k in range(paths)], frames)
    spread = np.repeat(np.where(np.arange(paths) % 3 == 0, 2.0, 1.0), frames)
    bias = np.repeat(rng.standard_normal((paths, 6)), frames, axis=0)
    error = spread[:, None] * (0.8 * bias + 0.6 * rng.standard_normal(bias.shape))
    return _answers(error, np.full(len(path), OWN), rng.uniform(0.0, 10.0, len(path)), path)


def tracked_answers(rng: np.random.Generator) -> LiveAnswers:
    """Independent errors of which the network knows a part that grows with the load, and not what tracking adds."""
    path = np.repeat([f"t-{k}" for k in range(400)], FRAMES)
    load = rng.uniform(0.5, 10.0, len(path))
    own, added = OWN * (load / 5.0) ** 2, TRUE_TRACKING * load / (load + ONSET_N)
    error = np.sqrt(TRUE_SCALE**2 * own + added**2 + CAMERA)[:, None] * rng.standard_normal((len(path), 6))
    return _answers(error, own, load, path)


def _answers(error: np.ndarray, own: np.ndarray, load: np.ndarray, path: np.ndarray) -> LiveAnswers:
    """Answers (N, 6) of ``load`` newtons along z that are off by ``error``, with the variance ``own`` of every axis."""
    count, value = len(path), np.zeros_like(error)
    value[:, 2] = load
    own = own[:, None, None] * np.eye(6)
    return LiveAnswers(
        value, value - error, own + CAMERA * np.eye(6), own, np.zeros(count, bool), np.zeros(count),
        np.full((count, 4), np.nan), np.ones(count, bool), path,
    )  # fmt: skip


def covered(answers: LiveAnswers, scale: np.ndarray, tracking: np.ndarray, rows: np.ndarray) -> float:
    """Fraction of the axes covered on some rows, every path with the same weight."""
    force = np.linalg.norm(answers.value[:, :3], axis=1)
    added = (force / (force + ONSET_N))[:, None] * tracking
    own = np.diagonal(answers.model_covariance, axis1=1, axis2=2)
    sigma = np.sqrt(scale**2 * own + added**2 + CAMERA)
    inside = (np.abs(answers.value - answers.truth) <= intervals.NORMAL_95 * sigma).mean(axis=1)[rows]
    path = answers.path[rows]
    return float(np.mean([inside[path == name].mean() for name in np.unique(path)]))


def test_the_widths_cover_new_paths_at_the_level_and_counting_frames_does_not() -> None:
    found, by_frame, rng = {"light": [], "heavy": []}, [], np.random.default_rng(0)
    for _ in range(12):
        known, fresh = made_answers(rng), made_answers(rng, 300)
        widths = intervals.widths(known, ONSET_N)
        light = np.linalg.norm(fresh.value[:, :3], axis=1) < intervals.LIGHT_N
        for name, rows in (("light", light), ("heavy", ~light)):
            found[name].append(covered(fresh, *widths, rows))
        alone = replace(known, path=np.arange(len(known.path)).astype(str))  # every frame a path of its own
        by_frame.append(covered(fresh, *intervals.widths(alone, ONSET_N), ~light))
    assert np.mean(by_frame) > np.mean(found["heavy"]) + 0.005  # long, bad paths count three times
    assert 0.925 < np.mean(found["light"]) < 0.97 and 0.925 < np.mean(found["heavy"]) < 0.965


def test_what_tracking_adds_is_found_where_no_factor_alone_is_right() -> None:
    known, fresh = (tracked_answers(np.random.default_rng(seed)) for seed in (1, 2))
    scale, tracking = intervals.widths(known, ONSET_N)
    assert np.allclose(scale, TRUE_SCALE, rtol=0.1) and np.allclose(tracking, TRUE_TRACKING, rtol=0.1)
    light = fresh.value[:, 2] < intervals.LIGHT_N
    alone = intervals.widths(known.take(known.value[:, 2] >= intervals.LIGHT_N), ONSET_N)
    for rows in (light, ~light):
        assert covered(fresh, scale, tracking, rows) == pytest.approx(0.95, abs=0.006)
    assert covered(fresh, *alone, light) < 0.93


def test_widths_of_a_soft_endcap_are_those_of_a_hard_one_in_smaller_newtons() -> None:
    hard, scale = tracked_answers(np.random.default_rng(1)), 0.04
    soft = replace(
        hard, value=scale * hard.value, truth=scale * hard.truth, covariance=scale**2 * hard.covariance,
        model_covariance=scale**2 * hard.model_covariance,
    )  # fmt: skip
    factor, tracking = intervals.widths(hard, ONSET_N)
    of_soft, added = intervals.widths(soft, scale * ONSET_N, scale * intervals.LIGHT_N)
    assert np.allclose(of_soft, factor, rtol=1e-5) and np.allclose(added, scale * tracking, rtol=1e-5)


def test_light_or_heavy_loads_alone_are_scaled_by_one_factor() -> None:
    answers = made_answers(np.random.default_rng(2), 30)
    light = np.linalg.norm(answers.value[:, :3], axis=1) < intervals.LIGHT_N
    for rows in (light, ~light):
        scale, tracking = intervals.widths(answers.take(rows), ONSET_N)
        error = (answers.value - answers.truth)[rows] / intervals.NORMAL_95
        needed = np.sqrt(np.maximum(error**2 - CAMERA, 0.0) / OWN)
        assert np.allclose(scale, path_quantile(needed, answers.path[rows], 0.95)) and not tracking.any()
        inside = np.abs(error) < np.sqrt(CAMERA)  # of what the camera alone covers the network needs nothing
        assert inside.any() and (needed[inside] == 0).all() and (~inside).any()
        edge = np.sqrt(needed**2 * OWN + CAMERA)
        assert np.allclose(edge[~inside], np.abs(error)[~inside])


def test_quantile_of_equal_paths_is_that_of_their_rows() -> None:
    rng = np.random.default_rng(2)
    values, path = rng.standard_normal((400, 2)), np.repeat([f"{k}" for k in range(40)], 10)
    assert np.allclose(path_quantile(values, path, 0.9), np.quantile(values, 0.9, axis=0, method="inverted_cdf"))
    assert np.array_equal(path_quantile(values, path, 1.0), values.max(axis=0))


def test_frames_of_another_endcap_are_refused_before_they_are_answered(tmp_path: Path) -> None:
    for name, changed in (("size", {"diameter_mm": 180.0}), ("silicone", {"silicone": "Smooth-Sil 940"})):
        folder = write_set(tmp_path / name, 1, 5)
        manifest = json.loads((folder / "manifest.json").read_text())
        request = manifest["request"] | changed
        design = EndcapParams(request["diameter_mm"], 8)
        here = identity(design, request.get("silicone", "Smooth-Sil 950"))
        (folder / "manifest.json").write_text(json.dumps(manifest | {"request": request, "identity": here.record()}))
        with pytest.raises(FileError, match=f"{name}: interval data for the .*: make frames of the endcap"):
            intervals.with_intervals(load_wrench_model(), [folder])


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
    path = np.concatenate([np.char.add(f"{k} ", a.path) for k, a in enumerate(known.values())])
    scale, tracking = intervals.widths(intervals._joined(list(known.values()), path), onset_n_of(model.weights))
    assert np.allclose(scaled.weights["calibration"] / model.weights["calibration"], scale, rtol=1e-6)
    assert np.allclose(tracking_of(scaled.weights), tracking, rtol=1e-6) and tracking.any()
    assert scaled.range.interval_n == pytest.approx(model.range.interval_n * scale[:3].min()) != model.range.interval_n
    fields = rng.standard_normal((200, model.weights["linear"].shape[1])) * rng.uniform(0, 0.3, (200, 1))
    before, after = (m.range.is_beyond(*m.predict(fields), 65.0) for m in (model, scaled))
    assert before.any() and not before.all() and (after | ~before).all()  # what was flagged stays flagged
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
