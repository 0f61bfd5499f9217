"""What a reference picture lacks, and that every part of sensing that takes one says so."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from long_cases import others_long
from rendered_dome import rendered

from cad.params import EndcapParams
from sensing.calibrate import main as calibrate_main
from sensing.calibration.dots import find_blobs
from sensing.calibration.from_dots import calibrate_from_dots
from sensing.calibration.rest_camera import most_misplaced_px
from sensing.calibration.rest_picture import picture_doubts
from sensing.camera.nominal import nominal_mount
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.model import load_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.state import Event
from sensing.records import Frame, Image
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.settings import RenderSettings
from sensing.tracking.tracker import DotTracker
from sensing.tracking.zero import single_zero
from sensing.zero import main as zero_main

PARAMS = EndcapParams(130, 8)
Fault = Callable[[Image], Image]


@pytest.fixture(scope="module")
def picture() -> Image:
    return rendered(PARAMS, "draft")


def covered(rows: slice, columns: slice, gray: float | None = None) -> Fault:
    def fault(image: Image) -> Image:
        image[rows, columns] = image.reshape(-1, 3).mean(0) if gray is None else gray
        return image

    return fault


def brighter(gain: float) -> Fault:
    return lambda image: np.clip(image * gain, 0, 255).astype(np.uint8)


ALL = slice(None)
FAULTS = [
    (lambda image: image, set()),
    (covered(slice(0, 160), ALL), {"dots_missing"}),
    (covered(ALL, slice(440, None), 0), {"dots_missing"}),
    (brighter(1.7), {"overexposed"}),
    (brighter(0.25), {"dark"}),
    (lambda image: cv2.resize(image, (280, 210), interpolation=cv2.INTER_AREA), {"low_resolution"}),
    (lambda image: cv2.resize(image[60:420], (1280, 720)), {"dots_missing"}),
]
IDS = ["as it is", "top covered", "right side black", "white", "dark", "small", "rows cut off"]


def frame_of(image: Image) -> Frame:
    return Frame(0.0, 0, "test", image=image)


@pytest.mark.parametrize(("fault", "flags"), FAULTS, ids=IDS)
def test_a_reference_that_shows_too_little_flags_every_wrench(picture, fault, flags) -> None:
    frame = frame_of(fault(picture.copy()))
    endcap = EndcapConfig("endcap_0", "test")
    pipeline = EndcapPipeline(endcap, load_model("default", PARAMS), single_zero(frame))
    reading = pipeline.update(replace(frame, time_s=0.1))
    assert reading is not None and flags <= reading.wrench.flags and flags <= reading.estimate.flags
    assert (reading.event is Event.GOOD) == (not flags) and bool(reading.reason) == bool(flags)
    if not flags:
        assert not reading.wrench.flags


OTHERS = others_long([(100.0, 8.0, 4.0), (250.0, 8.0, 2.9), (250.0, 10.0, 4.0), (160.0, 9.0, 6.0)], unpack=True)


@pytest.mark.parametrize(("diameter_mm", "wall_mm", "dot_mm"), OTHERS)
def test_a_healthy_picture_of_any_design_has_no_doubt(diameter_mm, wall_mm, dot_mm) -> None:
    rings = (1, 6, 10, 14) if dot_mm == 6.0 else EndcapParams.dot_rings
    params = EndcapParams(diameter_mm, wall_mm, dot_rings=rings, dot_mm=dot_mm)
    image = rendered(params, "draft")
    dots = DotTracker(frame_of(image), params=params).reference_px
    assert picture_doubts(image, dots, params, nominal_mount(params)) == {}


@pytest.mark.parametrize(("fault", "words"), [
    (covered(ALL, slice(0, 320)), "dots that the design's camera shows are in the rest picture"),
    (brighter(1.7), "of the rest picture is white"),
], ids=["covered", "white"])  # fmt: skip
def test_taking_a_reference_warns(picture, fault, words, tmp_path, capsys) -> None:
    for index in range(3):
        noise = np.random.default_rng(index).integers(0, 3, picture.shape, np.uint8)
        cv2.imwrite(str(tmp_path / f"{index}.png"), cv2.subtract(fault(picture.copy()), noise))
    take = ["take", "--source", str(tmp_path), "--frames", "3", "--out", str(tmp_path / "z.npz")]
    assert zero_main([*take, "--diameter", "130", "--wall", "8"]) == 0
    assert words in capsys.readouterr().err
    assert zero_main(take) == 0
    assert ("white" in capsys.readouterr().err) == ("white" in words)


def test_an_upright_picture_is_refused_with_its_size(picture) -> None:
    upright = cv2.rotate(picture, cv2.ROTATE_90_CLOCKWISE)
    pipeline = EndcapPipeline(EndcapConfig("endcap_0", "test"), load_model("default", PARAMS), zero_frames=1)
    assert pipeline.update(frame_of(upright)) is None and pipeline.outcome is not None
    event, reason = pipeline.outcome
    assert event is Event.REFUSED and "480x640 px stands upright" in reason


@pytest.mark.parametrize(("fault", "words"), [
    (covered(slice(0, 160), ALL), "dots that the design's camera shows are in the rest picture"),
    (brighter(1.7), "of the rest picture is white"),
], ids=["covered", "white"])  # fmt: skip
def test_calibrating_warns(picture, fault, words, tmp_path, capsys) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), fault(picture.copy()))
    assert calibrate_main(["--photo", str(tmp_path / "a.png"), "--out", str(tmp_path / "c.json")]) == 0
    assert words in capsys.readouterr().err


def test_calibrating_on_a_pressed_dome_warns(tmp_path, capsys) -> None:
    renderer = DomeRenderer(PARAMS, nominal_mount(PARAMS), RenderSettings(seed=31).at_level("draft"))
    across = np.hypot(*renderer.surface_mm[:, :2].T)
    spread = np.exp(-((across / 30) ** 2))[:, None] * np.array([[0.12, 0.12, 0.0]]) * renderer.surface_mm
    dent = spread - 8 * np.exp(-((across / 30) ** 2))[:, None] * np.array([[0.0, 0.0, 1.0]])
    cv2.imwrite(str(tmp_path / "a.png"), renderer.render(dent).image_bgr)
    words = ["--photo", str(tmp_path / "a.png"), "--out", str(tmp_path / "c.json"), "--trust-design"]
    assert calibrate_main(words) == 0
    assert "is it pressed?" in capsys.readouterr().err


@pytest.mark.parametrize("diameter_mm", [99.0, 130.0, 250.0])
def test_paint_by_hand_is_no_press_at_any_diameter(diameter_mm) -> None:
    """The same scatter in mm is 4.3, 2.1 and 1 px."""
    params = EndcapParams(diameter_mm, 6.5 if diameter_mm < 100 else 10.0)
    image = rendered(params, "draft")
    dots = find_blobs(image, params)[0]
    most_px = calibrate_from_dots(dots, params, (640, 480)).most_px
    assert 0.4 < most_px / most_misplaced_px(params) < 0.9
