"""A camera or lens that moved, and a touch, of rendered and drawn pictures."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from live_stand_in import PUSH, frames, pipeline

from cad.params import EndcapParams
from sensing.calibration.dots import pattern_points
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.records import DotTracks, Frame
from sensing.sources.drawn import Drawing, draw_dots
from sensing.sources.warp import Displacement, warp_image
from sensing.tracking.camera_motions import CameraMotions, third_largest
from sensing.tracking.mounting import (
    LEAST_DOTS,
    CommonMotion,
    MotionKind,
    MountingWatch,
    beyond_noise_px,
    common_motion,
    without_motion,
)
from sensing.tracking.zero import ZeroError, measure_drift, single_zero, take_zero

SIZE = (640, 480)
REST, _ = draw_dots(Drawing())


def tracks(move, noise_px: float = 0.01, lost: int = 0) -> DotTracks:
    """Dots on a grid, moved by ``move`` of their places from the picture's centre."""
    rng = np.random.default_rng(7)
    places = np.stack(np.meshgrid(np.linspace(60, 580, 10), np.linspace(40, 440, 8)), axis=-1).reshape(-1, 2)
    centre = (np.array(SIZE) - 1) / 2
    moved = move(places - centre) + centre + rng.normal(0, noise_px, places.shape)
    gone = np.arange(len(places)) < lost
    return DotTracks(0.0, np.arange(len(places)), places, moved, np.ones(len(places)), gone, SIZE)


def similarity(shift=(0.0, 0.0), turn: float = 0.0, scale: float = 1.0):
    rotation = scale * np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    return lambda arm: arm @ rotation + np.array(shift)


@pytest.mark.parametrize(
    "motion",
    [
        similarity((0.1, 0.0)),
        similarity((-1.0, 2.0)),
        similarity(scale=1.0004),
        similarity(scale=0.99),
        similarity(turn=0.001),
        similarity((4.0, -3.0), 0.02, 1.01),
    ],
)
def test_a_similarity_of_all_dots_is_the_mounting_and_can_be_taken_out(motion):
    given = tracks(motion)
    found = common_motion(given)
    assert found is not None and found.kind is MotionKind.MOUNTING
    assert np.abs(without_motion(given, found).displacement_px).max() < 0.05


def test_noise_is_none_and_a_touch_is_a_touch():
    still, local = common_motion(tracks(similarity())), common_motion(tracks(bump(0.4)))
    assert still is not None and still.kind is MotionKind.NONE
    assert local is not None and local.kind is MotionKind.CONTACT
    assert common_motion(tracks(similarity(), lost=80 - LEAST_DOTS + 1)) is None


def bump(high_px: float):
    """Dots within a few spacings of one place move outward."""

    def move(arm):
        away = arm - np.array([120.0, 60.0])
        return arm + high_px * np.exp(-(np.linalg.norm(away, axis=1, keepdims=True) ** 2) / 2 / 70**2) * [1.0, 0.5]

    return move


def test_a_camera_that_has_moved_counts_until_an_untouched_picture_shows_otherwise():
    watch = MountingWatch()
    for given, moved in (
        (similarity(), False),
        (bump(1.0), False),
        (similarity((0.5, 0.0)), True),
        (lambda arm: bump(1.0)(arm) + np.array([0.5, 0.0]), True),
        (similarity(), False),
    ):
        watch.update(tracks(given))
        assert bool(watch.reason) is moved
    watch.update(tracks(similarity((0.5, 0.0))))
    assert "by 0.50 px" in watch.reason or "by 0.51 px" in watch.reason or "by 0.49 px" in watch.reason


@pytest.mark.parametrize("next_px", [4.1, 9.0])  # the press may go on fast
@pytest.mark.parametrize("size_px", [0.5, 3.0])
def test_a_knock_under_a_touch_is_known_once_the_next_picture_confirms_it(size_px, next_px):
    """It read as up to 5 N, 90 standard deviations, and was no fault until the touch ended."""
    watch, knock = MountingWatch(), size_px * np.array([0.8, 0.6])
    for high_px, knocked in ((0.0, 0), (2.0, 0), (3.0, 1), (3.2, 0), (3.3, 0), (5.0, 0), (4.0, 0), (4.05, 1)):
        watch.update(tracks(lambda arm, high=high_px, at=knocked: bump(high)(arm) + at * knock))
        assert watch.reason == ""  # neither a press nor a picture that is shifted alone
        assert knocked or not watch.doubt
    assert watch.doubt  # the last one, until the next shows that it was not alone
    for high_px in (next_px, 4.3, 2.0):
        watch.update(tracks(lambda arm, high=high_px: bump(high)(arm) + knock))
        assert "moved under the touch" in watch.reason and watch.doubt == ""
    watch.update(tracks(similarity()))
    assert watch.reason == ""


@pytest.mark.parametrize("noise_px", [0.013, 0.035])
def test_noise_that_the_reference_knows_hides_no_moved_camera_and_makes_none_of_a_touch(noise_px):
    """The third largest of the dots' own scatter passed for a touch, and a lens that read 3 N was none."""
    watch = MountingWatch(error_px=noise_px)
    for given, moved in ((similarity(), False), (bump(0.8), False), (similarity((0.2, 0.0)), True), (bump(2.0), True)):
        watch.update(tracks(given, noise_px))
        assert bool(watch.reason) is moved
    watch.update(tracks(similarity(), noise_px))
    watch.update(tracks(similarity(scale=1 + 0.2 / 240), noise_px))
    assert watch.reason


def test_few_dots_show_no_motion_of_the_mounting():
    """Any motion of four dots is nearly a similarity: a hand before the lens during a touch was a moved camera."""
    watch, count = MountingWatch(), len(tracks(similarity()).ids)
    for lost in (count - LEAST_DOTS, count // 2 + 1):
        watch.update(tracks(similarity((0.5, 0.0)), lost=lost))
        assert watch.reason == "" and watch.motion is not None
    watch.update(tracks(similarity((0.5, 0.0))))
    said = watch.reason
    watch.update(tracks(similarity(), lost=count // 2 + 1))
    assert said and watch.reason == said


def seen(turn_deg=(0.0, 0.0, 0.0), shift_mm=(0.0, 0.0, 0.0), pressed_mm: float = 0.0, design=(130.0, 8.0)) -> DotTracks:
    """The design's dots, seen by its camera before and after that has moved in the endcap, or the tip was pressed."""
    params, rng = EndcapParams(*design), np.random.default_rng(3)
    still = nominal_mount(params)
    inward = np.exp(-np.square(np.linalg.norm(pattern_points(params)[0][:, :2], axis=1) / 15))[:, None]
    points = pattern_points(params)[0][still.sees(pattern_points(params)[0], 8.0)]
    skin = points + pressed_mm * (inward * [0.3, 0.2, -1.0])[still.sees(pattern_points(params)[0], 8.0)]
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(np.radians(turn_deg))[0], shift_mm
    places = still.project(points)
    moved = MountedCamera(still.camera, pose @ still.T_camera_endcap).project(skin) + rng.normal(0, 0.01, places.shape)
    return DotTracks(
        0.0, np.arange(len(places)), places, moved, np.ones(len(places)), np.zeros(len(places), bool), SIZE
    )


@pytest.mark.parametrize("design", [(130.0, 8.0), (99.0, 6.5), (212.0, 14.5)])
@pytest.mark.parametrize(
    "turn_deg, shift_mm",
    [
        ((0.1, 0.0, 0.0), (0.0, 0.0, 0.0)),
        ((0.7, -0.7, 0.0), (0.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), (0.1, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), (0.5, -0.8, 0.0)),
        ((0.5, -0.3, 1.0), (-0.3, 0.2, 0.4)),
    ],
)
def test_a_camera_that_tilted_or_shifted_in_its_mount_is_the_mounting_and_can_be_taken_out(turn_deg, shift_mm, design):
    given, params = seen(turn_deg, shift_mm, design=design), EndcapParams(*design)
    found = common_motion(given, params)
    assert found is not None and found.kind is MotionKind.MOUNTING
    assert np.abs(without_motion(given, found).displacement_px).max() < 0.1 + 0.02 * found.reach_px
    watch = MountingWatch(params)
    watch.update(given)
    assert "camera or lens have moved" in watch.reason


def test_every_small_motion_of_the_camera_and_a_zoom_are_among_those_that_are_fitted():
    params = EndcapParams(130.0, 8.0)
    still, points = nominal_mount(params), pattern_points(params)[0]
    points = points[still.sees(points, 8.0)]
    places = still.project(points)
    motions = CameraMotions.of(places, SIZE, params)
    zoomed = replace(still.camera, fx_px=1.001 * still.camera.fx_px, fy_px=1.001 * still.camera.fy_px)
    moved = [MountedCamera(zoomed, still.T_camera_endcap)]
    for axis in range(3):
        turn, shift = np.eye(4), np.eye(4)
        turn[:3, :3], shift[axis, 3] = cv2.Rodrigues(1e-3 * np.eye(3)[axis])[0], 0.05
        moved += [MountedCamera(still.camera, pose @ still.T_camera_endcap) for pose in (turn, shift)]
    for camera in moved:
        px = camera.project(points) - places
        for fitted in (motions.of_all(px), motions.of_most(px, np.ones(len(px), bool))):
            assert np.abs(px - fitted).max() < 0.01 * np.abs(px).max()


@pytest.mark.parametrize("turn_deg", [(0.0, 0.0, 0.0), (0.2, 0.0, 0.0)])
def test_a_pressed_tip_is_a_touch_whether_or_not_the_camera_tilted(turn_deg):
    found = common_motion(seen(turn_deg, pressed_mm=3.0))
    assert found is not None and found.kind is MotionKind.CONTACT


def jpegs(*pictures: np.ndarray) -> list[bytes]:
    found = []
    for index, picture in enumerate(pictures):
        marked = picture.copy()
        marked[-4:, : 1 + index] ^= 8  # no two are equal
        found.append(cv2.imencode(".jpg", marked)[1].tobytes())
    return found


def test_live_flags_a_knocked_camera_and_a_warm_lens_and_goes_on_to_under_a_touch():
    knocked = Displacement((0.6, -0.3))
    pressed = Displacement((0.6, -0.3), bumps=PUSH.bumps)
    rest = [REST] * 12
    for moved in (warp_image(REST, knocked), zoomed(1.001)):
        shown = [*rest, moved, moved, warp_image(REST, pressed), REST, REST]
        found = [r for r in map(pipeline().update, frames(jpegs(*shown))) if r is not None]
        flagged = ["moved" in r.wrench.flags for r in found[-5:]]
        assert flagged == [True, True, True, False, False]
        assert not any("moved" in r.wrench.flags for r in found[:-5])
        assert "camera or lens have moved" in found[-4].reason


@pytest.mark.parametrize("stays", [True, False])
def test_the_first_picture_after_a_knock_under_a_touch_waits_for_the_next(stays):
    """It was taken for a step of the force, without a flag; so was a single picture that is shifted."""
    pressed, knocked = (warp_image(REST, Displacement(shift, bumps=PUSH.bumps)) for shift in ((0.0, 0.0), (0.6, -0.3)))
    shown = [*[REST] * 12, *[pressed] * 4, knocked, *([knocked] * 2 if stays else [pressed] * 2)]
    *_, before, first, second, third = [r for r in map(pipeline().update, frames(jpegs(*shown))) if r is not None]
    assert "unconfirmed" in first.wrench.flags and "waiting for the next" in first.reason
    assert (
        np.abs(first.wrench.force_n - before.wrench.force_n).max()
        < 0.1 * np.abs(first.estimate.force_n - before.estimate.force_n).max()
    )
    for reading in (second, third):
        assert ("moved" in reading.wrench.flags) is stays and "unconfirmed" not in reading.wrench.flags
    assert before.wrench.flags.isdisjoint({"unconfirmed", "moved"})


def test_live_does_not_call_a_press_a_moved_camera():
    shown = [*[REST] * 12, *(warp_image(REST, PUSH.scaled(share)) for share in (0.02, 0.05, 0.1, 0.3, 1.0, 0.05))]
    found = [r for r in map(pipeline().update, frames(jpegs(*shown))) if r is not None]
    assert not any("moved" in r.wrench.flags for r in found)


def zoomed(scale: float) -> np.ndarray:
    return cv2.warpAffine(
        REST, cv2.getRotationMatrix2D((319.5, 239.5), 0, scale), SIZE, flags=cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_REPLICATE,
    )  # fmt: skip


@pytest.mark.parametrize(("rows", "cause"), [(480, "contact"), (960, "none")])
def test_a_pixel_of_a_larger_picture_is_less_of_a_touch(rows, cause):
    size, dots = (rows * 4 // 3, rows), np.arange(20)
    place = np.random.default_rng(0).uniform(40, 440, (20, 2))
    motion = CommonMotion(np.zeros(2), 0.0, 1.0, 0.0, 1.0, 0.2, size)  # dots that stand but for 1 px of the third
    tracks = DotTracks(0.0, dots, place, place, np.ones(20), dots < 0, size)
    zero, gray = single_zero(Frame(0.0, 0, "a", image=REST)), np.full((8, 8), round(REST.mean()), np.uint8)
    assert measure_drift(zero, zero.frame(), tracks, gray, motion).cause == cause


def test_a_motion_is_of_the_same_kind_in_a_picture_of_twice_the_size():
    kinds = set()
    for reach in (0.01, 0.04, 0.06, 0.1, 0.16, 0.25, 2.0):
        for left in (0.01, 0.06, 0.1, 0.16, 0.25, 1.0):
            small, large = (
                CommonMotion(np.zeros(2), 0.0, 1.0, s * reach, s * left, 0.2, (640 * s, 480 * s)) for s in (1, 2)
            )
            assert small.kind is large.kind and small.moved is large.moved
            kinds.add((small.kind, small.moved))
    assert len(kinds) == 4  # still, moved as one, touched with and without a motion in common


def test_dots_are_at_rest_by_the_size_of_the_picture():
    """By 0.9 px: more than rest in 480 rows, less in 960."""
    for scale in (1, 2):
        picture = cv2.resize(REST, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
        shift = np.array([[1.0, 0.0, 0.9], [0.0, 1.0, 0.0]])
        moved = cv2.warpAffine(
            picture, shift, picture.shape[1::-1], flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
        )
        interval = [Frame(k / 30, k, "a", image=image) for k, image in enumerate((picture, picture, moved))]
        if scale == 1:
            with pytest.raises(ZeroError, match=r"moved by 0\.[89]\d px, at most 0\.60"):
                take_zero(interval)
        else:
            assert take_zero(interval).frames == 3


def test_of_dots_that_only_scatter_nothing_is_left_beyond_their_noise():
    """The third largest of 90 motions; by Rayleigh's law it is in nine of ten 2.3 to 3.1 deviations of an axis."""
    rng, noise_px = np.random.default_rng(6), 0.05
    left = [beyond_noise_px(third_largest(rng.normal(0, noise_px, (90, 2))), noise_px) for _ in range(300)]
    assert np.mean(np.array(left) == 0) > 0.85
    assert beyond_noise_px(0.5, 0.1) == pytest.approx(0.4) and beyond_noise_px(0.5, 0.0) == 0.5
