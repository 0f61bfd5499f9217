import numpy as np
import pytest

from cad.errors import FileError
from sensing.decode import decode_bgr
from sensing.records import Frame
from sensing.sources.degrade import Degradation, degrade
from sensing.sources.drawn import Drawing, draw_dots
from sensing.sources.warp import Bump, Displacement, warp_image
from sensing.tracker import DotTracker
from sensing.zero import AutoZero, ZeroError, load_zero, measure_drift, save_zero, take_zero, without_mounting

IMAGE, _ = draw_dots(Drawing())
TOUCH = Displacement(bumps=(Bump((430.0, 280.0), (6.0, 4.0), 60.0),))
SHIFTED = Displacement((1.2, -0.9), 0.004)


def still(count: int = 4, gain: float = 1.0, motion: Displacement | None = None, start_s: float = 0.0) -> list[Frame]:
    rng = np.random.default_rng(5)
    picture = warp_image(IMAGE, motion or Displacement())
    damage = Degradation(noise=3, gain=gain)
    return [
        Frame(start_s + i / 30, i, "cam", jpeg=degrade(picture, damage, rng), size=(640, 480)) for i in range(count)
    ]


@pytest.fixture(scope="module")
def zero():
    return take_zero(still(), "cap 3")


def test_average_has_less_noise_than_a_frame(zero):
    clean = IMAGE.astype(float)
    one = decode_bgr(still(1)[0])
    assert np.abs(zero.image - clean).mean() < 0.75 * np.abs(one - clean).mean()
    assert zero.sensor == "cap 3" and zero.frames == 4 and zero.noise_px.max() < 0.3


def test_round_trip_through_a_file(zero, tmp_path):
    save_zero(zero, tmp_path / "cap3.npz")
    back = load_zero(tmp_path / "cap3.npz")
    assert back.digest == zero.digest and back.date == zero.date and back.brightness == zero.brightness
    assert [p.name for p in tmp_path.iterdir()] == ["cap3.npz"]


def test_damaged_or_foreign_files_are_refused(zero, tmp_path):
    (tmp_path / "text.npz").write_text("hello")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    for name, words in [("text.npz", "no reference file"), ("other.npz", "no reference file"), ("none.npz", "No such")]:
        with pytest.raises(FileError, match=words):
            load_zero(tmp_path / name)


def test_moving_interval_is_refused():
    frames = still(3) + still(1, motion=TOUCH)
    with pytest.raises(ZeroError, match=r"moved by \d"):
        take_zero(frames)


def test_too_few_frames_are_refused():
    with pytest.raises(ZeroError, match="2 frames: at least 3"):
        take_zero(still(2))


@pytest.mark.parametrize(
    ("motion", "gain", "cause"),
    [
        (Displacement(), 1.0, "none"),
        (Displacement(), 0.7, "lamp"),
        (SHIFTED, 1.0, "mounting"),
        (SHIFTED, 0.7, "mounting"),
        (TOUCH, 1.0, "contact"),
        (TOUCH, 0.7, "contact"),
    ],
    ids=["none", "lamp", "mounting", "mounting+lamp", "contact", "contact+lamp"],
)
def test_drift_is_told_apart_from_contact(zero, motion, gain, cause):
    frame = still(1, gain, motion)[0]
    tracks = DotTracker(zero.frame()).update(frame)
    assert measure_drift(zero, frame, tracks).cause == cause


def test_mounting_is_measured_and_taken_out(zero):
    frame = still(1, 1.0, SHIFTED)[0]
    tracks = DotTracker(zero.frame()).update(frame)
    drift = measure_drift(zero, frame, tracks)
    assert np.abs(drift.shift_px - [1.2, -0.9]).max() < 0.05 and abs(drift.turn_rad - 0.004) < 3e-4
    assert np.linalg.norm(without_mounting(tracks, drift).displacement_px, axis=1).mean() < 0.15


def test_auto_zero_waits_until_surely_untouched(zero):
    auto = AutoZero(zero, still_s=1.0, frames=4)
    tracker = DotTracker(zero.frame())
    touched = still(1, 1.0, TOUCH)[0]
    assert auto.update(touched, tracker.update(touched)) is None
    given = [auto.update(f, tracker.update(f)) for f in still(35, 0.7, None, start_s=1.0)]
    first = next(i for i, z in enumerate(given) if z is not None)
    assert 29 <= first <= 33 and abs(given[first].brightness / zero.brightness - 0.7) < 0.05
