"""The tracker on drawn dots with exact truth. Tolerances are in full-size pixels."""

import cv2
import numpy as np
import pytest

from cad.params import EndcapParams
from sensing.decode import FrameError
from sensing.records import DotTracks, Frame
from sensing.sources.degrade import Degradation, degrade
from sensing.sources.drawn import Drawing, draw_dots
from sensing.sources.warp import Bump, Displacement, cell_truth, warp_image
from sensing.tracking.dots import Dots, NoDotsError, find_dots
from sensing.tracking.methods import DotField
from sensing.tracking.model_input import ModelInput
from sensing.tracking.patch_kernels import SATURATED, smoothed
from sensing.tracking.patches import align, cut_patches
from sensing.tracking.tracker import DotTracker

PARAMS = EndcapParams(130, 8)
IMAGE, _ = draw_dots(Drawing())
REST = Frame(0.0, 0, "rest", jpeg=degrade(IMAGE, Degradation(), np.random.default_rng(9)), size=(640, 480))
PRESS = Displacement((1.5, -1.0), 0.01, bumps=(Bump((420.0, 300.0), (10.0, 7.0), 45.0),))


def frame(displacement: Displacement, damage: Degradation | None = None, seed: int = 0) -> Frame:
    picture = warp_image(IMAGE, displacement)
    if damage is None:
        return Frame(0.0, 1, "test", image=picture)
    return Frame(0.0, 1, "test", jpeg=degrade(picture, damage, np.random.default_rng(seed)), size=(640, 480))


def errors(tracks: DotTracks, displacement: Displacement) -> np.ndarray:
    """(live,) distance of live dots from their truth."""
    truth = np.stack(displacement.at(tracks.reference_px[:, 0], tracks.reference_px[:, 1]), axis=1)
    return np.linalg.norm(tracks.displacement_px - truth, axis=1)[~tracks.lost]


def inner(tracks: DotTracks) -> np.ndarray:
    place = tracks.reference_px
    return ((place > 30) & (place < np.array([610, 450]))).all(axis=1)


def test_rest_gives_zero():
    tracks = DotTracker(REST).update(REST)
    assert np.abs(tracks.displacement_px).max() < 0.02 and not tracks.lost.any() and tracks.quality.min() > 0.99


@pytest.mark.parametrize("shift", [0.25, 0.5, 1.3])
def test_subpixel_shift_is_measured(shift):
    motion = Displacement((shift, -shift / 2))
    tracks = DotTracker(REST).update(frame(motion))
    assert np.median(errors(tracks, motion)) < 0.05  # the target for clean pictures


@pytest.mark.parametrize(
    ("damage", "limit"),
    [
        (Degradation(), 0.06),
        (Degradation(gain=0.5), 0.10),
        (Degradation(gain=1.35), 0.10),
        (Degradation(gradient=0.35, gradient_rad=1.0), 0.10),
        (Degradation(noise=5.0, jpeg_quality=60), 0.25),
        (Degradation(blur_px=1.3), 0.12),
        (Degradation(defocus_px=2.5), 0.20),
    ],
    ids=["clean", "dark", "bright", "gradient", "noise", "blur", "defocus"],
)
def test_press_under_every_disturbance(damage, limit):
    tracker = DotTracker(REST)
    for share in (0.5, 1.0):
        tracks = tracker.update(frame(PRESS.scaled(share), damage))
    assert tracks.lost.mean() < 0.05
    assert errors(tracks, PRESS).mean() < limit and errors(tracks, PRESS).max() < 3


def test_field_matches_the_truth_and_beats_a_shuffled_one():
    field = DotField(REST).update(frame(PRESS))
    truth = cell_truth(PRESS, (640, 480))
    assert np.linalg.norm(field.channels - truth, axis=0).mean() < 0.06
    assert np.linalg.norm(field.channels[::-1] - truth, axis=0).mean() > 0.3


@pytest.mark.parametrize("turn", np.arange(0, 6.28, 1.05))
def test_one_frame_jumps_of_25_px_swap_no_identity(turn):
    motion = Displacement((25 * np.cos(turn), 25 * np.sin(turn)))
    tracker = DotTracker(REST)
    tracker.update(REST)
    tracks = tracker.update(frame(motion))
    assert errors(tracks, motion).max() < 5 and tracks.lost[inner(tracks)].mean() < 0.1


def test_blob_hides_dots_that_come_back():
    tracker = DotTracker(REST)
    hidden = tracker.update(frame(PRESS.scaled(0.5), Degradation(blob_px=(320.0, 240.0, 60.0))))
    assert 3 <= hidden.lost.sum() <= 15 and (hidden.quality[hidden.lost] == 0).all()
    predicted = np.stack(PRESS.scaled(0.5).at(*hidden.reference_px.T), axis=1)[hidden.lost]
    assert np.abs(hidden.displacement_px[hidden.lost] - predicted).max() < 3
    back = tracker.update(frame(PRESS))
    assert back.lost.sum() == 0 and errors(back, PRESS).max() < 2


def test_black_frame_loses_all_and_the_next_finds_them_again():
    tracker = DotTracker(REST)
    tracker.update(frame(PRESS))
    dark = tracker.update(Frame(0, 0, "dark", image=np.zeros((480, 640), np.uint8)))
    assert dark.lost.all()
    for field in (ModelInput(tracker, (16, 16), PARAMS).field(dark), DotField(REST).field(dark)):
        assert not field.valid.any() and np.isfinite(field.channels).all()
    again = tracker.update(frame(PRESS))
    assert again.lost.mean() < 0.03 and errors(again, PRESS).max() < 2


@pytest.mark.parametrize("level", [0, 255])
def test_flat_picture_gives_no_dots_and_no_nan(level):
    tracks = DotTracker(REST).update(Frame(0, 0, "flat", image=np.full((480, 640, 3), level, np.uint8)))
    assert tracks.lost.all() and np.isfinite(tracks.position_px).all()


@pytest.mark.parametrize(
    "convert",
    [
        lambda i: i.astype(np.float32) / 255,
        lambda i: i.astype(np.uint16) * 256,
        lambda i: np.asfortranarray(i),
        lambda i: np.ascontiguousarray(i[:, ::-1])[:, ::-1],
        lambda i: cv2.cvtColor(i, cv2.COLOR_BGR2GRAY),
    ],
    ids=["float", "16 bit", "fortran", "negative stride", "gray"],
)
def test_any_pixel_type_gives_the_same_tracks(convert):
    motion = Displacement((1.0, 0.5))
    tracks = DotTracker(REST).update(Frame(0, 0, "typed", image=convert(warp_image(IMAGE, motion))))
    assert np.median(errors(tracks, motion)) < 0.05


@pytest.mark.parametrize("size", [(641, 479), (333, 251), (1280, 960)])
def test_odd_and_large_sizes(size):
    image = cv2.resize(IMAGE, size, interpolation=cv2.INTER_AREA if size[0] < 700 else cv2.INTER_CUBIC)
    motion = Displacement((2.0, -1.0))
    tracks = DotTracker(Frame(0, 0, "r", image=image)).update(Frame(0, 1, "f", image=warp_image(image, motion)))
    assert len(tracks.ids) > 80 and np.median(errors(tracks, motion)) < 0.1


def test_frame_of_another_size_is_refused():
    with pytest.raises(FrameError, match="320x240 px, the reference has 640x480"):
        DotTracker(REST).update(Frame(0, 0, "small", image=IMAGE[::2, ::2]))


def test_corrupt_jpeg_is_refused():
    with pytest.raises(FrameError, match="frame 3 is damaged"):
        DotTracker(REST).update(Frame(0, 3, "cable", jpeg=b"\xff\xd8 nothing"))


def test_nan_picture_is_refused():
    with pytest.raises(FrameError, match="NaN"):
        DotTracker(REST).update(Frame(0, 0, "nan", image=np.full((480, 640), np.nan)))


def test_reference_without_dots_is_refused():
    with pytest.raises(NoDotsError, match="0 dots found"):
        DotTracker(Frame(0, 0, "blank", image=np.full((480, 640, 3), 128, np.uint8)))


@pytest.mark.parametrize("wide", [False, True], ids=["windows as before", "other windows"])
def test_a_tracker_of_some_of_the_dots_is_that_made_with_them(wide):
    """To the bit: also where the median of their diameters, and so the windows, are others."""
    tracker = DotTracker(REST)
    large = np.argsort(tracker.dots.diameter_px)[-9:]
    if wide:
        tracker.dots.diameter_px[large] *= 1.3
    which = np.sort(large) if wide else np.flatnonzero(np.arange(len(tracker.dots)) % 7)
    some, made = tracker.only(which), DotTracker(REST, dots=tracker.dots.only(which))
    assert (some._half != tracker._half) == wide and some._half == made._half
    for moved in (frame(Displacement((1.3, -0.6))), frame(Displacement((22.0, 0.0)))):
        one, other = some.update(moved), made.update(moved)
        assert np.array_equal(one.position_px, other.position_px) and np.array_equal(one.quality, other.quality)
    assert np.array_equal(some.wide._patches.rows, made.wide._patches.rows)
    assert not np.array_equal(some._image, tracker._image)  # each has its own picture


@pytest.mark.parametrize("count", [1, 2, 5])
def test_few_and_coincident_dots(count):
    place = np.repeat([[160.0, 118.0]], count, axis=0) if count == 2 else DotTracker(REST).dots.position_px[:count]
    few = Dots(np.array(place, float), np.full(count, 9.0), np.zeros(count, bool))
    motion = Displacement((1.0, 0.0))
    seen = ModelInput(DotTracker(REST, dots=few), (16, 16), PARAMS)
    field = seen.update(frame(motion))
    assert np.isfinite(field.channels).all()


def test_alignment_is_blind_to_gain_offset_and_ramp():
    rng = np.random.default_rng(0)
    gray = cv2.GaussianBlur(rng.integers(60, 160, (80, 80)).astype(np.uint8), (0, 0), 2)
    place = np.array([[40.0, 40.0]])
    patches = cut_patches(smoothed(gray), place, 7)
    y, x = np.mgrid[0:80, 0:80]
    spoiled = np.clip(1.3 * gray + 5 + 0.4 * (x - 40) + 0.3 * (y - 40), 0, SATURATED - 1).astype(np.uint8)
    moved = np.array([[1.2, -0.8]])
    quality = align(smoothed(spoiled), patches, np.array([0]), moved, np.zeros((1, 2, 2)), 20)
    assert np.abs(moved).max() < 0.05 and quality[0] > 0.8


def test_alignment_of_a_window_over_the_frames_edge():
    gray = cv2.cvtColor(IMAGE, cv2.COLOR_BGR2GRAY)
    tracker = DotTracker(REST, dots=find_dots(DotTracker(REST).decode(REST)))
    cut = np.flatnonzero(tracker.dots.cut)
    assert len(cut) > 0 and gray.shape == (480, 640)
    motion = Displacement((0.8, 0.4))
    tracks = tracker.update(frame(motion))
    off = np.linalg.norm(tracks.displacement_px[cut] - [0.8, 0.4], axis=1)
    assert off[~tracks.lost[cut]].max() < 1.0


def test_dots_that_the_frames_edge_cuts_are_left_out_while_there_are_enough_others():
    found = find_dots(cv2.cvtColor(IMAGE, cv2.COLOR_BGR2GRAY))
    whole = DotTracker(REST).dots
    assert found.cut.any() and not whole.cut.any()
    assert len(whole) >= len(found) - np.count_nonzero(found.cut) - 2
    few = IMAGE.copy()
    few[40:] = cv2.medianBlur(IMAGE, 91)[40:]  # the dots of the uppermost rows alone
    left = DotTracker(Frame(0.0, 0, "few", image=few)).dots
    assert left.cut.any() and np.count_nonzero(~left.cut) < 8


@pytest.mark.parametrize("light", ["glint", "drop", "shadow"])
def test_light_on_a_dot(light):
    """A glint within a dot's outline hardly moves it; a drop or a shadow's border over the outline costs quality."""
    shift = np.array([1.5, -1.0])
    motion = Displacement((1.5, -1.0))
    picture = warp_image(IMAGE, motion).astype(float)
    tracker = DotTracker(REST)
    chosen = np.flatnonzero(inner(tracker.update(REST)))[::5]
    y, x = np.mgrid[0:480, 0:640]
    for cx, cy in tracker.reference_px[chosen] + shift:
        if light == "glint":
            picture[(np.hypot(x - cx, y - cy) < 3.5) & (x > cx)] += 90
        elif light == "drop":
            picture[np.hypot(x - cx - 8, y - cy + 3) < 5] += 60
        else:
            picture[(np.hypot(x - cx, y - cy) < 16) & (y - cy > 5)] *= 0.75
    clean = tracker.update(frame(motion))
    tracks = tracker.update(Frame(0.0, 1, light, image=np.clip(picture, 0, 251).astype(np.uint8)))
    off = np.linalg.norm(tracks.displacement_px - shift, axis=1)[chosen]
    assert not tracks.lost[chosen].any()
    if light == "glint":
        assert np.median(off) < 0.06 and off.max() < 0.2
    else:
        assert np.median(off) < 0.4 and off.max() < 1.0
        assert np.median(tracks.quality[chosen]) < np.median(clean.quality[chosen]) - 0.05
