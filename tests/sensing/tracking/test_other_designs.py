"""Dots of other sizes and spacings: found by both finders, and followed."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from long_cases import others_long

from cad.params import EndcapParams
from sensing.calibration.dots import find_blobs, pattern_points
from sensing.camera.dot_look import dot_look
from sensing.camera.nominal import nominal_mount
from sensing.field import main as field
from sensing.records import Frame
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.settings import RenderSettings
from sensing.tracking.dots import find_dots
from sensing.tracking.tracker import DotTracker
from sensing.tracking.zero import take_zero

SMALL = EndcapParams(100.0, 8.0)
DESIGNS = {
    "small dome": SMALL,
    "large dome": EndcapParams(250.0, 10.0),
    "smallest dots on a large dome": EndcapParams(250.0, 8.0, dot_mm=2.9),
    "few large dots": EndcapParams(187.3, 12.6, (1, 5, 11, 17), dot_mm=6.3),
    "close together": EndcapParams(203.44, 8.26, (1, 30, 24, 16), dot_mm=3.9),
}


def renderer(params: EndcapParams) -> DomeRenderer:
    return DomeRenderer(params, nominal_mount(params), RenderSettings(seed=7).at_level("data"))


@pytest.mark.parametrize("name", others_long(DESIGNS, 3))
def test_both_finders_find_the_dots_of_the_design_and_nothing_else(name):
    params = DESIGNS[name]
    image = renderer(params).render().image_bgr
    mounted, points = nominal_mount(params), pattern_points(params)[0]
    pixels = mounted.project(points[mounted.sees(points)])
    inside = pixels[((pixels > 10) & (pixels < [629, 469])).all(axis=1)]
    tracked = find_dots(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), params=params)
    reach_px = 3 + 3 * dot_look(params).scale  # dots are hand-painted, and smeared
    for centres in (find_blobs(image, params)[0], tracked.position_px[~tracked.cut]):
        away = np.linalg.norm(inside[:, None] - centres[None], axis=-1)
        assert (away.min(axis=1) < reach_px).mean() >= 0.93
        others = np.linalg.norm(pixels[:, None] - centres[None], axis=-1)
        assert (others.min(axis=0) > max(6.0, reach_px)).sum() <= 1


@pytest.mark.long
def test_windows_grow_with_the_dots():
    """Half a bulge's motion lies under 0.02 px from the truth; windows of 25 px inside dots of 32 doubled that."""
    dome, mounted, points = renderer(SMALL), nominal_mount(SMALL), pattern_points(SMALL)[0]
    tracker = DotTracker(Frame(0.0, 0, "rest", image=dome.render(None, frame=1).image_bgr), params=SMALL)
    rest = mounted.project(points)
    away = np.linalg.norm(tracker.reference_px[:, None] - np.nan_to_num(rest, nan=1e6)[None], axis=-1)
    dots, errors = away.argmin(axis=1), []
    for number, depth in enumerate((0.5, 1.0, 2.0, 3.0)):
        image = dome.render(bulge(dome.surface_mm, depth), frame=2 + number).image_bgr
        tracks = tracker.update(Frame(0.0, 0, "pressed", image=image))
        truth = mounted.project(points[dots] + bulge(points[dots], depth)) - rest[dots]
        errors.append(np.linalg.norm(tracks.displacement_px - truth, axis=1)[~tracks.lost])
    assert np.median(np.concatenate(errors)) < 0.02


def bulge(points_mm: np.ndarray, depth_mm: float) -> np.ndarray:
    """A smooth inward bulge 20 degrees from the tip."""
    axis = np.array([np.sin(0.35), 0.0, np.cos(0.35)])
    top = SMALL.inner_radius_mm * axis + [0, 0, SMALL.centre_height_mm]
    return -depth_mm * np.exp(-((np.linalg.norm(points_mm - top, axis=1) / 14) ** 2))[:, None] * axis


def test_a_reference_is_taken_with_the_dots_of_the_design():
    params = EndcapParams(130.0, 8.0, (1, 5, 10, 12, 14), dot_mm=8.0)
    dome = renderer(params)
    frames = [Frame(0.1 * k, k, "a", image=dome.render(None, frame=k).image_bgr) for k in range(3)]
    quiet, plain = (np.median(take_zero(frames, "a", known).noise_px) for known in (params, None))
    assert quiet < 0.5 * plain  # windows that hold the dots' outlines


@pytest.mark.long
def test_the_field_command_looks_for_the_dots_of_the_design(tmp_path, capsys):
    params = EndcapParams(100.0, 8.0, (1, 5, 10, 12), dot_mm=8.0)
    photo = tmp_path / "a.png"
    cv2.imwrite(str(photo), renderer(params).render().image_bgr)
    words = ["--reference", str(photo), "--frame", str(photo), "--out", str(tmp_path / "a.npz")]
    counts = []
    for design in ([], ["--diameter", "100", "--wall", "8", "--dot-rings", "1-5-10-12", "--dot-mm", "8"]):
        status = field([*words, *design])
        counts.append(len(np.load(tmp_path / "a.npz", allow_pickle=False)["reference_px"]) if status == 0 else 0)
        capsys.readouterr()
    assert counts[1] >= 10 > counts[0]
