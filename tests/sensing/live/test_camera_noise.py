"""A noisy camera states a larger covariance; the reference says how noisy it is, also in a recording."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from live_stand_in import PATIENCE_S

from cad.errors import FileError
from cad.params import EndcapParams
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.model import load_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.seen import Pictures, SeenFrame
from sensing.live.outputs.mcap.recorder import Recorder
from sensing.live.outputs.ros import types as ros
from sensing.live.recorded_messages import with_error
from sensing.live.replay import read_config, recorded_frames, verify
from sensing.live.timeline import Timeline
from sensing.records import Frame
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.settings import RenderSettings
from sensing.tracking.zero import Zero, load_zero, save_zero, single_zero, take_zero
from sensing.wrench.dot_noise import LEVELS_PX, STILL_PX, DotNoise

PARAMS = EndcapParams(130, 8)
ENDCAP = EndcapConfig("endcap_0", "test")


@pytest.fixture(scope="module")
def picture() -> np.ndarray:
    renderer = DomeRenderer(PARAMS, settings=RenderSettings(seed=8).at_level("draft"))
    return single_zero(Frame(0.0, 0, "rest", jpeg=renderer.render().jpeg)).image


@pytest.fixture(scope="module")
def zero(picture) -> Zero:
    return single_zero(Frame(0.0, 0, "endcap_0", image=picture))


def pipeline_of(zero: Zero) -> EndcapPipeline:
    return EndcapPipeline(ENDCAP, load_model("default", PARAMS), zero)


def readings(pipeline: EndcapPipeline, noise_px: float, count: int) -> list:
    """Of an untouched endcap whose dots scatter by as much; windows do not show it."""
    rng, rest = np.random.default_rng(4), pipeline._used.method.tracker.reference_px
    found = []
    for k in range(count):
        moved = rest + noise_px * rng.standard_normal(rest.shape)
        rows = np.column_stack([moved, np.full(len(rest), 0.9999), np.zeros(len(rest))])
        frame = SeenFrame(k / 30, k, "test", size=(640, 480), rows=rows, likeness=0.99)
        found.append(pipeline.update(frame))
    return found


def squared_error(wrench) -> float:
    """6 on the mean where the covariance is honest."""
    error = np.concatenate([wrench.force_n, wrench.torque_nm])
    return float(error @ np.linalg.solve(wrench.covariance, error))


@pytest.mark.parametrize("noise_px", [0.006, 0.015, 0.03, 0.1])
def test_the_covariance_of_an_untouched_endcap_follows_the_cameras_noise(zero, noise_px):
    pipeline = pipeline_of(replace(zero, error_px=noise_px))
    assert 1.5 < np.mean([squared_error(reading.estimate) for reading in readings(pipeline, noise_px, 150)]) < 8


def noisy(picture: np.ndarray, gray_levels: float, rng: np.random.Generator) -> np.ndarray:
    """The picture as a camera with such noise gives it."""
    return np.clip(np.rint(picture + gray_levels * rng.standard_normal(picture.shape[:2])[..., None]), 0, 255).astype(
        np.uint8
    )


def compressed(picture: np.ndarray, quality: int) -> np.ndarray:
    """The picture after JPEG."""
    return cv2.imdecode(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1], cv2.IMREAD_COLOR)


DEGRADED = {
    "4 gray levels": lambda picture, rng: noisy(picture, 4, rng),
    "12 gray levels": lambda picture, rng: noisy(picture, 12, rng),
    "4 gray levels, JPEG of quality 40": lambda picture, rng: compressed(noisy(picture, 4, rng), 40),
}


@pytest.mark.parametrize("degraded", DEGRADED)
def test_pictures_say_how_noisy_they_are_where_the_reference_is_a_single_one(picture, degraded):
    rng = np.random.default_rng(3)
    pictures = [DEGRADED[degraded](picture, rng) for _ in range(31)]
    pipeline = pipeline_of(single_zero(Frame(0.0, 0, "film", image=pictures[0])))
    seen = [pipeline.update(Frame(k / 30, k, "film", image=image)) for k, image in enumerate(pictures[1:], 1)]
    scatter_px = np.sqrt(np.mean([np.square(reading.tracks.displacement_px) for reading in seen]))
    stated_px = [pipeline._check._noise.excess_px(reading.tracks) for reading in seen]
    assert np.mean(stated_px) == pytest.approx(scatter_px, rel=0.25) and np.std(stated_px) < 0.1 * scatter_px
    assert 1.0 < np.mean([squared_error(reading.estimate) for reading in seen]) < 14  # its reference's error stays


def test_light_that_fails_after_the_reference_widens_the_covariance(picture):
    rng, pipeline = np.random.default_rng(4), pipeline_of(single_zero(Frame(0.0, 0, "lamp", image=picture)))
    light = [0, 1, 2], [1.0, 1.0, 0.35]
    bright, same, dim = (
        pipeline.update(Frame(k / 30 + 1, k, "lamp", image=noisy(picture * part, 1.5, rng)))
        for k, part in zip(*light, strict=True)
    )
    assert np.trace(same.estimate.covariance) == pytest.approx(np.trace(bright.estimate.covariance), rel=0.3)
    assert np.trace(dim.estimate.covariance[:3, :3]) > 4 * np.trace(same.estimate.covariance[:3, :3])


def test_clean_pictures_add_nothing(picture, zero):
    pipeline = pipeline_of(zero)
    reading = pipeline.update(Frame(1.0, 1, "clean", image=noisy(picture, 0.5, np.random.default_rng(5))))
    assert pipeline._check._noise.excess_px(reading.tracks) == 0.0
    assert not pipeline._check._noise.covariance(reading.tracks).any()


def test_noise_that_the_training_had_is_not_counted_twice(zero):
    known, unknown = (
        readings(pipeline_of(replace(zero, error_px=error_px)), 0.01, 3)[-1] for error_px in (STILL_PX, 0.0)
    )
    assert np.array_equal(known.estimate.covariance, unknown.estimate.covariance)


def test_the_reference_knows_how_far_a_dot_is_off_at_rest(picture, tmp_path):
    rng = np.random.default_rng(2)

    def frame(k: int) -> Frame:
        noisy = np.clip(np.rint(picture + 4 * rng.standard_normal(picture.shape[:2])[..., None]), 0, 255)
        return Frame(k / 30, k, "test", image=noisy.astype(np.uint8))

    zero = take_zero([frame(k) for k in range(5)], params=PARAMS)
    pipeline = pipeline_of(zero)
    moved = [pipeline.update(frame(k)).tracks.displacement_px for k in range(5, 25)]
    assert zero.error_px == pytest.approx(np.sqrt(np.mean(np.square(moved))), rel=0.15)
    save_zero(zero, tmp_path / "zero.npz")
    assert load_zero(tmp_path / "zero.npz").error_px == zero.error_px
    for wrong in (np.nan, -1.0, 1e9):
        save_zero(replace(zero, noise_px=np.full(5, wrong)), tmp_path / "zero.npz")
        with pytest.raises(FileError, match="dots that scatter by no number of pixels"):
            load_zero(tmp_path / "zero.npz")


def test_a_recording_holds_the_noise_and_gives_the_same_bits(zero, tmp_path):
    pipeline, path = pipeline_of(replace(zero, error_px=0.1)), tmp_path / "run.mcap"
    recorder = Recorder(path, LiveConfig((ENDCAP,)), {"endcap_0": -1}, lambda _: None, pictures=Pictures.NONE)
    recorder.start()
    for reading in readings(pipeline, 0.1, 60):
        recorder.put(reading)
    recorder.close(PATIENCE_S)
    check = verify(path, read_config(path))
    assert (check.frames, check.different, check.end) == (60, 0, None)
    middle = next(recorded_frames(path, "endcap_0", Timeline(path).start("endcap_0", 1.0)))
    assert middle.zero is not None and middle.zero.error_px == 0.1


@pytest.mark.parametrize("error_px", [np.nan, np.inf, -0.1, 1e5])
def test_noise_that_is_no_number_of_pixels_is_damage(zero, error_px, tmp_path):
    class Message:
        data, sequence, log_time = ros.float64(error_px), 1, 0

    with pytest.raises(FileError, match="dots that scatter by"):
        with_error(tmp_path / "run.mcap", zero, Message)


@pytest.mark.parametrize("excess_px", [0.0, 0.003, 0.005, 0.1, 0.32, 0.5])
def test_between_the_drawn_levels_and_beyond_them_the_covariance_goes_with_the_square(excess_px, monkeypatch):
    noise = object.__new__(DotNoise)  # without its draws
    noise._squares = np.square(LEVELS_PX)
    noise._drawn = noise._squares[:, None, None] * np.diag(np.arange(1.0, 7.0))
    monkeypatch.setattr(DotNoise, "excess_px", lambda *_: excess_px)
    assert noise.covariance(None) == pytest.approx(excess_px**2 * np.diag(np.arange(1.0, 7.0)))
