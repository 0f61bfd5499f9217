"""Noise reduction over time, blended frames, and what must not be taken for them, in rendered pictures of a dome."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
import pytest

from cad.params import EndcapParams
from sensing.camera.nominal import nominal_mount
from sensing.doctor.examine import examine
from sensing.doctor.finding import Finding, Verdict
from sensing.doctor.mixing import FEWEST, mixing_findings
from sensing.records import Frame
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.settings import RenderSettings

PARAMS = EndcapParams(130, 8)
COUNT, BEGINNING = 30, 5  # pictures; those left out, in which a filter has not met its own past yet
Pictures = Sequence[np.ndarray]
QUALITIES = (None, 95, 85, 60)  # of JPEG; None for raw pictures


@pytest.fixture(scope="module")
def dome() -> Pictures:
    settings = replace(RenderSettings(seed=77).at_level("draft"), fresh_noise=True)
    renderer = DomeRenderer(PARAMS, nominal_mount(PARAMS), settings)
    return [renderer.render(frame=k).image_bgr for k in range(COUNT)]


def held(part: float, whole: bool) -> Callable[[Pictures], Pictures]:
    """Each picture with a part of the one before, kept in whole gray values or finer."""

    def mixed(pictures: Pictures) -> Pictures:
        found = [pictures[0].astype(float)]
        for picture in pictures[1:]:
            value = part * found[-1] + (1 - part) * picture
            found.append(np.rint(value) if whole else value)
        return [np.rint(picture).astype(np.uint8) for picture in found[BEGINNING:]]

    return mixed


def blended(pictures: Pictures) -> Pictures:
    return [((a.astype(int) + b) // 2).astype(np.uint8) for a, b in pairwise(pictures)]


def shifted(pictures: Pictures, pixels: Sequence[float]) -> Pictures:
    rows, columns = pictures[0].shape[:2]
    return [
        cv2.warpAffine(picture, np.array([[1.0, 0.0, shift], [0.0, 1.0, 0.0]]), (columns, rows))
        for picture, shift in zip(pictures, pixels, strict=True)
    ]


def lamp_bands(pictures: Pictures) -> Pictures:
    rows = np.arange(len(pictures[0]))[:, None, None]
    bright = [1 + 0.03 * np.sin(rows / 60 + 0.4 * k) for k in range(len(pictures))]
    return [np.clip(each * factor, 0, 255).astype(np.uint8) for each, factor in zip(pictures, bright, strict=True)]


def brighter(pictures: Pictures) -> Pictures:
    return [np.clip(picture + 0.1 * k, 0, 255).astype(np.uint8) for k, picture in enumerate(pictures)]


def frames(pictures: Pictures, quality: int | None = None, **known: str) -> list[Frame]:
    size = (pictures[0].shape[1], pictures[0].shape[0])
    if quality is None:
        return [Frame(k / 30, k, "camera", image=picture, **known) for k, picture in enumerate(pictures)]
    coded = [cv2.imencode(".jpg", each, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes() for each in pictures]
    return [Frame(k / 30, k, "camera", jpeg=data, size=size, **known) for k, data in enumerate(coded)]


def found(pictures: Pictures, quality: int | None = None, **known: str) -> Finding | None:
    return next(iter(mixing_findings(frames(pictures, quality, **known))), None)


@pytest.mark.parametrize("quality", QUALITIES)
@pytest.mark.parametrize("mix", [held(0.5, True), held(0.5, False), held(0.75, True), held(0.75, False), blended])
def test_pictures_that_hold_half_of_the_one_before_are_seen(dome, mix, quality):
    """They read a press 4 to 8 N late (docs/live_faults.md), and nothing said so."""
    finding = found(mix(dome), quality)
    assert finding.verdict is Verdict.LOOK and "3DNR" in finding.fix and finding.values["noise_ratio"] > 1.13


def test_the_ratio_is_that_of_the_closed_form_where_nothing_is_rounded():
    """E(4) / E(1) = (1 - a^4) / (1 - a) of noise that is large beside a gray value."""
    rng = np.random.default_rng(5)
    noise = [np.clip(128 + 30 * rng.standard_normal((240, 320)), 31, 244) for _ in range(COUNT)]
    for part in (0.25, 0.5, 0.75):
        ratio = found(held(part, True)(noise)).values["noise_ratio"]
        assert ratio == pytest.approx((1 - part**4) / (1 - part), rel=0.05)
    assert found([each.astype(np.uint8) for each in noise]).values["noise_ratio"] == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("quality", QUALITIES)
def test_independent_pictures_are_good_whatever_the_lamp_does(dome, quality):
    for change in (list, lamp_bands, brighter, lambda pictures: pictures[:FEWEST]):
        finding = found(change(dome), quality)
        assert finding is None or finding.verdict is Verdict.GOOD


@pytest.mark.parametrize("quality", QUALITIES)
def test_a_picture_that_moves_is_not_taken_for_a_mixed_one(dome, quality):
    """A steady motion of 0.02 px a picture, and one to and fro by 0.2 px, as of a table."""
    for pixels in (0.02 * np.arange(COUNT), 0.2 * np.sin(0.3 * np.arange(COUNT))):
        finding = found(shifted(dome, pixels), quality)
        assert finding is None or finding.verdict is Verdict.GOOD


def test_pictures_that_came_twice_count_once(dome):
    """A camera that sends 15 pictures a second as 30 looked like one that blends them."""
    assert found([dome[k // 2] for k in range(2 * COUNT)]).verdict is Verdict.GOOD


def test_where_it_cannot_be_seen_nothing_is_said(dome):
    assert found(dome[: FEWEST - 1]) is None  # too few
    assert found([dome[0]] * COUNT) is None  # one picture, again and again
    assert found([np.zeros_like(dome[0])] * COUNT) is None
    assert found([(dome[0] + k % 2).astype(np.uint8) for k in range(COUNT)]) is None  # no noise
    assert found(dome, coding="h264 at 0.5 bits a pixel") is None  # named already
    broken = [replace(frame, jpeg=frame.jpeg[:900]) for frame in frames(dome, 85)]
    assert mixing_findings(broken) == []


def test_the_doctor_says_it_among_its_findings(dome):
    for pictures, verdict in ((dome, Verdict.GOOD), (blended(dome), Verdict.LOOK)):
        report = examine("camera", frames(pictures, 90), PARAMS, timed=True)
        assert {each.name: each.verdict for each in report.findings}["mixing"] is verdict
