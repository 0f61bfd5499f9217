import cv2
import numpy as np
import pytest

from cad.params import EndcapParams
from sensing.camera.dot_look import dot_look
from sensing.decode import decode_gray, to_full_px
from sensing.records import Frame
from sensing.sources.degrade import Degradation, degrade
from sensing.sources.drawn import Drawing, draw_dots
from sensing.tracking.dots import DIAMETER_SHARE, NoDotsError, find_dots


def found_px(image: np.ndarray) -> np.ndarray:
    return to_full_px(find_dots(decode_gray(Frame(0, 0, "t", image=image), 2)).position_px, 2)


def matches(found: np.ndarray, truth: np.ndarray) -> tuple[float, float]:
    """(share of true dots that were found, share of finds that are dots), away from the frame's edge."""
    distance = np.linalg.norm(found[:, None] - truth[None], axis=2)
    inner = ((truth > 14) & (truth < np.array([640, 480]) - 14)).all(axis=1)
    found_inner = ((found > 14) & (found < np.array([640, 480]) - 14)).all(axis=1)
    return (distance.min(axis=0) < 3)[inner].mean(), (distance.min(axis=1) < 3)[found_inner].mean()


@pytest.mark.parametrize("painted", [1.0, 0.6, 0.25])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_any_painted_subset_is_found_among_specks_and_digits(painted, seed):
    image, truth = draw_dots(Drawing(seed=seed, painted=painted, turn_rad=seed * 0.7, digit=str(4 + seed)))
    recall, precision = matches(found_px(image), truth)
    assert recall == 1.0 and precision >= 0.95


def test_centres_are_exact_to_a_fraction_of_a_pixel():
    image, truth = draw_dots(Drawing(specks=0, digit=""))
    distance = np.linalg.norm(found_px(image)[:, None] - truth[None], axis=2).min(axis=1)
    assert np.median(distance) < 0.3


@pytest.mark.parametrize(
    "damage",
    [Degradation(gain=0.5), Degradation(gain=1.4), Degradation(gradient=0.35), Degradation(noise=5, jpeg_quality=60)],
    ids=["dark", "bright", "gradient", "noise"],
)
def test_finding_survives_lamp_and_noise(damage):
    image, truth = draw_dots(Drawing())
    spoiled = cv2.imdecode(np.frombuffer(degrade(image, damage, np.random.default_rng(0)), np.uint8), 1)
    recall, precision = matches(found_px(spoiled), truth)
    assert recall > 0.97 and precision > 0.93


@pytest.mark.parametrize(
    "gray",
    [
        np.zeros((240, 320), np.uint8),
        np.full((240, 320), 255, np.uint8),
        np.full((1, 1), 90, np.uint8),
        np.random.default_rng(0).integers(90, 110, (240, 320), dtype=np.uint8),
    ],
    ids=["black", "white", "1x1", "noise"],
)
def test_no_dots_is_said(gray):
    with pytest.raises(NoDotsError, match="0 dots found, at least 1 needed"):
        find_dots(gray)


def test_dots_that_mirror_the_lamp_are_found_where_they_are():
    """Glossy ink shows as a dark ring round a bright middle, in the undeformed picture too."""
    image, _ = draw_dots(Drawing(specks=0, digit=""))
    gray = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    plain = find_dots(gray)
    y, x = np.mgrid[0:480, 0:640]
    big = np.flatnonzero(~plain.cut & (plain.diameter_px > 15))[::3]
    shiny = gray.copy()
    for cx, cy in plain.position_px[big]:
        shiny[np.hypot(x - cx, y - cy) < 4] = 200
    found = find_dots(shiny)
    assert len(big) > 5
    near = np.linalg.norm(found.position_px[:, None] - plain.position_px[big][None], axis=2).min(axis=0)
    assert near.max() < 0.6, near


@pytest.mark.parametrize(
    ("params", "size"),
    [
        (EndcapParams(130, 8), (640, 480)),
        (EndcapParams(130, 8), (960, 540)),  # the working picture of 1920 x 1080
        (EndcapParams(98.9, 7), (640, 480)),
        (EndcapParams(180, 10), (640, 480)),
        (EndcapParams(250, 15), (320, 240)),
    ],
    ids=lambda value: getattr(value, "label", str(value)),
)
def test_centres_are_shifted_to_no_side_at_any_size_of_dot_and_picture(params, size):
    """OpenCV's opening moves a mask by a pixel where its size is even: centres were off by up to 0.3 px."""
    fine, across_px = 8, DIAMETER_SHARE * min(size) * dot_look(params).scale
    rng = np.random.default_rng(0)
    x, y = (np.arange(2.6 * across_px, side - 2.6 * across_px, 2.6 * across_px) for side in size)
    truth = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    truth += rng.uniform(-0.5, 0.5, truth.shape)
    drawn = np.full((size[1] * fine, size[0] * fine), 180, np.uint8)
    for place in np.rint(16 * ((truth + 0.5) * fine - 0.5)).astype(int):
        cv2.circle(drawn, place.tolist(), round(8 * fine * across_px), 40, -1, cv2.LINE_8, 4)
    picture = cv2.resize(drawn, size, interpolation=cv2.INTER_AREA)
    found = find_dots(picture, params=params).position_px
    away = found - truth[np.linalg.norm(found[:, None] - truth, axis=2).argmin(axis=1)]
    assert len(found) == len(truth)
    assert np.abs(away.mean(axis=0)).max() < 0.03, away.mean(axis=0)
