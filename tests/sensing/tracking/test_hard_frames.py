"""Hard cases of the field: what is not in the other tests. Frames no camera should send, and rendered presses."""

import cv2
import numpy as np
import pytest

from cad.params import EndcapParams
from sensing.decode import FrameError, decode_gray
from sensing.records import Frame, ShearField
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.frame_source import RenderedSource
from sensing.simulator.render.settings import Paint, RenderSettings
from sensing.sources.degrade import Degradation, degrade
from sensing.sources.drawn import Drawing, draw_dots
from sensing.sources.warp import Displacement, warp_image
from sensing.tracking.dots import Dots, NoDotsError, find_dots
from sensing.tracking.field.kernels import find_inliers
from sensing.tracking.field.operator import field_operator
from sensing.tracking.field.picture import draw_field
from sensing.tracking.gelslim import derived_channels
from sensing.tracking.methods import DotField
from sensing.tracking.model_input import ModelInput
from sensing.tracking.patch_kernels import smoothed
from sensing.tracking.patches import cut_patches
from sensing.tracking.tracker import DotTracker
from sensing.tracking.windows import steady as steady_dots

IMAGE, _ = draw_dots(Drawing())
REST = Frame(0.0, 0, "rest", image=IMAGE)
PARAMS = EndcapParams(diameter_mm=130.0, wall_mm=8.0)


@pytest.mark.parametrize("shape", [(1, 1), (1, 1, 3), (2, 3), (1, 480), (5, 5, 3)])
def test_tiny_pictures_are_no_reference_and_no_frame(shape):
    tiny = Frame(0.0, 1, "tiny", image=np.full(shape, 90, np.uint8))
    with pytest.raises(NoDotsError, match="tiny: 0 dots found"):
        DotTracker(tiny)
    with pytest.raises(FrameError, match="the reference has 640x480"):
        DotTracker(REST).update(tiny)


def test_huge_picture_is_reduced_to_the_working_size():
    huge = cv2.resize(cv2.cvtColor(IMAGE, cv2.COLOR_BGR2GRAY), (5120, 3840), interpolation=cv2.INTER_CUBIC)
    tracker = DotTracker(Frame(0, 0, "r", image=huge))
    tracks = tracker.update(Frame(0, 1, "f", image=np.roll(huge, (16, -24), (0, 1))))
    assert tracker.reduction == 8 and len(tracks.ids) > 80
    assert np.abs(np.median(tracks.displacement_px, axis=0) - [-24, 16]).max() < 0.4  # 0.05 px at 480


def test_overexposed_picture_loses_dots_but_invents_none():
    burnt = np.clip(IMAGE.astype(float) * 2.2, 0, 255).astype(np.uint8)
    tracker = DotTracker(REST)
    tracks = tracker.update(Frame(0, 1, "burnt", image=burnt))
    assert (burnt >= 252).mean() > 0.3
    assert np.isfinite(tracks.position_px).all() and np.linalg.norm(tracks.displacement_px, axis=1).max() < 3


@pytest.mark.parametrize("content", ["noise", "stripes", "other dome"])
def test_picture_of_something_else_gives_no_nan_and_no_confident_field(content):
    rng = np.random.default_rng(0)
    picture = {
        "noise": rng.integers(0, 255, (480, 640), dtype=np.uint8),
        "stripes": np.tile(np.uint8(127 + 100 * np.sin(np.arange(640) / 7)), (480, 1)),
        "other dome": draw_dots(Drawing(turn_rad=0.75, painted=0.5, seed=5))[0],
    }[content]
    tracker = DotTracker(REST)
    tracks = tracker.update(Frame(0, 1, content, image=picture))
    for seen in (ModelInput(tracker, (16, 16), PARAMS), DotField(REST)):
        assert np.isfinite(seen.field(tracks).channels).all()
    assert tracks.lost.mean() > 0.4


def test_extra_dots_and_a_digit_in_the_reference_do_no_harm():
    marked = IMAGE.copy()
    cv2.putText(marked, "8", (345, 215), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (40, 40, 40), 3)
    for place in [(300, 150), (410, 330), (200, 260)]:
        cv2.circle(marked, place, 8, (50, 50, 60), -1)
    motion = Displacement((6.0, -4.0), 0.02)
    tracker = DotTracker(Frame(0, 0, "marked", image=marked))
    tracks = tracker.update(Frame(0, 1, "f", image=warp_image(marked, motion)))
    truth = np.stack(motion.at(*tracks.reference_px.T), axis=1)
    assert np.linalg.norm(tracks.displacement_px - truth, axis=1)[~tracks.lost].max() < 1.0


def test_window_that_slides_along_an_edge_is_no_dot():
    gray = decode_gray(REST, 2)
    gray[200:, 250:] = 15  # a straight edge, as the border of the view is
    found = find_dots(decode_gray(REST, 2))
    keep = ~((found.position_px > [235, 185]).all(axis=1))
    position = np.concatenate([found.position_px[keep], [[290.0, 200.0]]])
    dots = Dots(position, np.full(len(position), 9.0), np.zeros(len(position), bool))
    steady = steady_dots(dots, cut_patches(smoothed(gray), position, 7))
    assert steady[:-1].all() and not steady[-1]


def test_nan_in_a_field_is_invalid_and_stays_where_it_is():
    u = np.ones((2, 30, 30), np.float32)
    u[0, 4, 5] = np.nan
    field = ShearField(0.0, u)
    assert not field.valid[4, 5] and field.valid.sum() == 899
    assert draw_field(IMAGE, field).std() > 10
    parts = derived_channels(u[0], u[1], ("div", "sol_u", "irr_v"))
    assert np.isnan(parts["div"]).sum() <= 4 and np.isfinite(parts["sol_u"]).all()


def test_judgement_equals_refitting_without_the_dots_it_drops():
    rng = np.random.default_rng(3)
    place = DotTracker(REST).reference_px
    operator = field_operator(place, (640, 480))
    moved = np.stack(Displacement((3.0, 1.0), 0.02).at(*place.T), axis=1)
    spoiled = moved.copy()
    spoiled[[10, 40, 41]] += [[18, 0], [0, -15], [12, 12]]
    live = rng.random(len(place)) > 0.2
    live[[10, 40, 41]] = True
    expected = live.copy()
    expected[[10, 40, 41]] = False
    judged = spoiled.copy()
    quality = np.where(live, 1.2, 0.3)
    reported = find_inliers(
        operator.precision, judged, quality, np.full(len(place), 10.0), (0.7, 0.9), (0.1, 0.4), 5, 12
    )
    assert (reported == expected).all() and (quality[expected] == 1).all() and not quality[live & ~expected].any()
    assert np.allclose(judged, operator.filled(moved, expected), atol=1e-6)


@pytest.fixture(scope="module")
def dome():
    return DomeRenderer(PARAMS, settings=RenderSettings(seed=3, paint=Paint(digit="4", unpainted=0.1, extra=2)))


def press_mm(surface_mm: np.ndarray, depth_mm: float) -> np.ndarray:
    """A smooth push with drag, for motion only; no mechanics."""
    tilt = np.radians(25.0)
    axis = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    top = PARAMS.inner_radius_mm * axis + [0, 0, PARAMS.centre_height_mm]
    share = np.exp(-((np.linalg.norm(surface_mm - top, axis=1) / 18) ** 2))[:, None]
    return depth_mm * share * (-axis + np.array([0.2, 0.5, -0.1]))


def test_rendered_press_is_followed_to_where_the_renderer_put_the_ink(dome):
    source = RenderedSource(dome, [press_mm(dome.surface_mm, d) for d in (2.5, 5.0)])
    frames = list(source)
    tracker = DotTracker(Frame(0, 0, "rest", image=dome.render(None, frame=99).image_bgr))
    for frame in frames:
        tracks = tracker.update(frame)
    rest, pressed = dome.render(None), dome.render(press_mm(dome.surface_mm, 5.0))
    seen = rest.dots_visible & pressed.dots_visible
    pair = np.linalg.norm(tracks.reference_px[:, None] - rest.dots_px[seen][None], axis=2)
    nearest = pair.argmin(axis=1)
    known = (pair.min(axis=1) < 4) & ~tracks.lost
    truth = (pressed.dots_px - rest.dots_px)[seen][nearest]
    error = np.linalg.norm(tracks.displacement_px - truth, axis=1)[known]
    assert known.sum() > 60 and np.linalg.norm(truth[known], axis=1).max() > 8
    assert np.median(error) < 0.1 and np.percentile(error, 90) < 0.5 and error.max() < 3
    assert frames[1].time_s == pytest.approx(1 / 30) and frames[0].size == (640, 480)


def test_rendered_press_survives_a_bad_camera(dome):
    press = dome.render(press_mm(dome.surface_mm, 2.0))
    tracker = DotTracker(Frame(0, 0, "rest", image=dome.render(None).image_bgr))
    damage = Degradation(gain=0.6, gradient=0.3, noise=4, jpeg_quality=60, blur_px=1.0)
    clean = tracker.update(Frame(0, 1, "clean", image=press.image_bgr))
    jpeg = degrade(press.image_bgr, damage, np.random.default_rng(0))
    hard = tracker.update(Frame(0, 2, "hard", jpeg=jpeg, size=(640, 480)))
    off = np.linalg.norm(hard.position_px - clean.position_px, axis=1)[~hard.lost & ~clean.lost]
    assert hard.lost.mean() < 0.05 and off.mean() < 0.3
