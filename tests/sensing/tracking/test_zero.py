import contextlib
import json
import tracemalloc
from dataclasses import replace

import cv2
import numpy as np
import pytest

from cad.errors import FileError
from cad.params import EndcapParams
from sensing.calibration.dots import pattern_points
from sensing.camera.nominal import nominal_mount
from sensing.decode import decode_bgr
from sensing.field import main as field_main
from sensing.records import Frame
from sensing.sources.degrade import Degradation, degrade
from sensing.sources.drawn import Drawing, draw_dots
from sensing.sources.warp import Bump, Displacement, warp_image
from sensing.tracking.auto_zero import AutoZero
from sensing.tracking.mounting import MotionKind, common_motion, without_motion
from sensing.tracking.tracker import DotTracker
from sensing.tracking.zero import ZeroError, load_zero, measure_drift, save_zero, take_zero
from sensing.zero import main

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
    return take_zero(still(), "endcap 3")


def test_average_has_less_noise_than_a_frame(zero):
    clean = IMAGE.astype(float)
    one = decode_bgr(still(1)[0])
    assert np.abs(zero.image - clean).mean() < 0.75 * np.abs(one - clean).mean()
    assert zero.sensor == "endcap 3" and zero.frames == 4 and zero.noise_px.max() < 0.3


def test_the_average_is_that_of_all_pictures_without_holding_them():
    """A minute of 30 frames a second took 8 GB: every picture twice, once as float."""
    interval = still(4) * 12
    tracemalloc.start()
    try:
        image = take_zero(interval).image
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    pictures = np.stack([decode_bgr(frame) for frame in interval]).astype(np.float32)
    assert np.array_equal(image, np.rint(pictures.mean(axis=0)).astype(np.uint8))
    assert peak < pictures.nbytes / 2


def test_round_trip_through_a_file(zero, tmp_path):
    save_zero(zero, tmp_path / "endcap3.npz")
    back = load_zero(tmp_path / "endcap3.npz")
    assert back.digest == zero.digest and back.date == zero.date and back.brightness == zero.brightness
    assert [p.name for p in tmp_path.iterdir()] == ["endcap3.npz"]


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
def test_drift_is_reported_apart_from_contact(zero, motion, gain, cause):
    frame = still(1, gain, motion)[0]
    tracks = DotTracker(zero.frame()).update(frame)
    assert measure_drift(zero, frame, tracks).cause == cause


def test_mounting_is_measured_and_taken_out(zero):
    frame = still(1, 1.0, SHIFTED)[0]
    tracks = DotTracker(zero.frame()).update(frame)
    motion = common_motion(tracks)
    assert motion is not None and motion.kind is MotionKind.MOUNTING
    assert np.abs(motion.shift_px - [1.2, -0.9]).max() < 0.05 and abs(motion.turn_rad - 0.004) < 3e-4
    assert np.linalg.norm(without_motion(tracks, motion).displacement_px, axis=1).mean() < 0.15


@pytest.mark.parametrize(
    ("touch", "after_s"), [(TOUCH, 1.0), (None, 3600.0), (None, -3600.0)], ids=["touch", "an hour unseen", "set back"]
)
def test_auto_zero_waits_until_surely_untouched(zero, touch, after_s):
    """A time without pictures is none at rest: the first one after it was averaged with those before it."""
    auto, tracker = AutoZero(zero, still_s=1.0, frames=4), DotTracker(zero.frame())
    assert not any(auto.update(f, tracker.update(f)) for f in still(5, 1.0, touch))
    given = [auto.update(f, tracker.update(f)) for f in still(35, 0.7, None, start_s=after_s)]
    first = next(i for i, z in enumerate(given) if z is not None)
    assert 29 <= first <= 33 and abs(given[first].brightness / zero.brightness - 0.7) < 0.05


# --- command line --------------------------------------------------------------------------------------------
def folder_of(tmp_path, name: str, frames: list[Frame]) -> str:
    (tmp_path / name).mkdir()
    for frame in frames:
        (tmp_path / name / f"{frame.sequence:04d}.jpg").write_bytes(frame.jpeg)
    return str(tmp_path / name)


def test_take_check_and_take_again(tmp_path, capsys):
    rest, touched = folder_of(tmp_path, "rest", still(4)), folder_of(tmp_path, "touched", still(3, 1.0, TOUCH))
    file = str(tmp_path / "endcap3.npz")
    assert main(["take", "--source", rest, "--sensor", "endcap 3", "--out", file, "--frames", "4"]) == 0
    assert "endcap 3" in capsys.readouterr().out and load_zero(file).sensor == "endcap 3"
    assert main(["check", "--zero", file, "--source", touched]) == 0
    assert capsys.readouterr().out.startswith("contact: something touches")
    assert main(["check", "--zero", file, "--source", folder_of(tmp_path, "dim", still(3, 0.7))]) == 0
    assert capsys.readouterr().out.startswith("lamp: ")
    before = load_zero(file).digest
    assert main(["take", "--source", folder_of(tmp_path, "dim2", still(3, 0.8)), "--out", file]) == 0
    assert load_zero(file).digest != before
    out = tmp_path / "f.npy"
    assert field_main(["--reference", file, "--frame", f"{touched}/0000.jpg", "--out", str(out)]) == 0
    assert np.load(out).shape == (2, 30, 30)


def test_a_picture_of_another_design_is_named(tmp_path, capsys):
    """The released pattern seen by the nominal camera, as seven rings of the drawn picture."""
    params = EndcapParams(130, 8)
    dots = nominal_mount(params).project(pattern_points(params)[0])
    picture = np.full((480, 640, 3), 230, np.uint8)
    for x, y in dots:
        cv2.circle(picture, (round(16 * x), round(16 * y)), 16 * 7, (30, 30, 30), -1, cv2.LINE_AA, 4)
    jpegs = []
    for _ in range(4):  # no two are equal
        picture[0] -= 8
        jpegs.append(cv2.imencode(".jpg", picture)[1].tobytes())
    rest = folder_of(
        tmp_path, "rest", [Frame(k / 30, k, "cam", jpeg=jpeg, size=(640, 480)) for k, jpeg in enumerate(jpegs)]
    )
    take = ["take", "--source", rest, "--frames", "4", "--out", str(tmp_path / "z.npz")]
    assert main([*take, "--diameter", "130", "--wall", "8"]) == 0
    assert capsys.readouterr().err == ""
    assert main([*take, "--diameter", "99", "--wall", "8"]) == 0
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "does not fit --diameter 99 --wall 8 (" in said


@pytest.mark.long
def test_watch_renews_only_when_untouched_for_long(tmp_path, capsys):
    file = str(tmp_path / "endcap3.npz")
    save_zero(take_zero(still(), "endcap 3"), file)
    before = load_zero(file).digest
    touched = folder_of(tmp_path, "touched", still(16, 1.0, TOUCH))
    assert main(["watch", "--zero", file, "--source", touched, "--still", "0.2"]) == 0
    assert load_zero(file).digest == before and "zeroed again" not in capsys.readouterr().out
    dim = folder_of(tmp_path, "dim", still(16, 0.7))
    assert main(["watch", "--zero", file, "--source", dim, "--still", "0.2"]) == 0
    assert load_zero(file).digest != before and "zeroed again" in capsys.readouterr().out


def test_watch_passes_over_a_picture_that_cannot_be_read(tmp_path, capsys, monkeypatch):
    file = str(tmp_path / "endcap3.npz")
    save_zero(take_zero(still(), "endcap 3"), file)
    given = still(12, 0.7)
    given[2:4] = [replace(frame, jpeg=frame.jpeg[:9000]) for frame in given[2:4]]
    monkeypatch.setattr("sensing.zero.open_frames", lambda _: contextlib.nullcontext(given))
    assert main(["watch", "--zero", file, "--source", "0", "--still", "0.2"]) == 0
    said = capsys.readouterr().out
    assert said.count("passed over") == 1 and said.count("lamp: ") == 2 and "zeroed again" not in said


def test_an_interval_that_cannot_be_a_reference_is_waited_for_anew(zero, monkeypatch):
    def refused(*_):
        raise ZeroError("moved")

    auto, tracker = AutoZero(zero, still_s=0.2, frames=4), DotTracker(zero.frame())
    monkeypatch.setattr("sensing.tracking.auto_zero.take_zero", refused)
    assert [auto.update(frame, tracker.update(frame)) for frame in still(12, 0.7)] == [None] * 12


def test_a_camera_that_hangs_while_its_reference_is_taken_is_named(tmp_path, capsys):
    hung = folder_of(tmp_path, "hung", [replace(still(1)[0], sequence=number) for number in range(3)])
    assert main(["take", "--source", hung, "--out", str(tmp_path / "z.npz")]) == 0
    assert "all 3 pictures are one and the same" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["take", "--source", "@none", "--out", "@z.npz"], "no camera number, address, folder or file"),
        (["check", "--source", "@rest", "--zero", "@none.npz"], "none.npz: No such file"),
        (["take", "--source", "@rest", "--out", "@none/z.npz"], "folder that exists"),
        (["take", "--source", "@moving", "--out", "@z.npz"], r"moved by"),
        (["take", "--source", "@upright", "--out", "@z.npz"], "480x640 px stands upright"),
        (["take", "--source", "@upright", "--out", "@z.npz", "--diameter", "130", "--wall", "8"], "stands upright"),
    ],
)
def test_bad_input_gets_one_line_and_status_2(tmp_path, capsys, arguments, words):
    folder_of(tmp_path, "rest", still(3))
    moving = [*still(3), replace(still(1, motion=TOUCH)[0], sequence=3)]
    folder_of(tmp_path, "moving", moving)
    turned = [cv2.imencode(".jpg", cv2.rotate(decode_bgr(f), cv2.ROTATE_90_CLOCKWISE))[1].tobytes() for f in still(3)]
    folder_of(tmp_path, "upright", [replace(f, jpeg=jpeg) for f, jpeg in zip(still(3), turned, strict=True)])
    assert main([str(tmp_path / a[1:]) if a.startswith("@") else a for a in arguments]) == 2
    message = capsys.readouterr().err
    assert words in message and message.count("\n") == 1 and not (tmp_path / "z.npz").exists()


# --- pictures that show too little -----------------------------------------------------------------------------
def seen_as(frames: list[Frame], fault) -> list[Frame]:
    return [replace(f, jpeg=None, image=fault(decode_bgr(f))) for f in frames]


def half_covered(image: np.ndarray) -> np.ndarray:
    image[:, :320] = image.reshape(-1, 3).mean(0)
    return image


def some_covered(image: np.ndarray) -> np.ndarray:
    """A fourteenth of the dots, under a lamp that has changed: few enough to be no hidden sensor."""
    image[:, :100] = image.reshape(-1, 3).mean(0)
    return (0.7 * image).astype(np.uint8)


def white(image: np.ndarray) -> np.ndarray:
    return np.maximum(image, 252) - (image < 140).astype(np.uint8) * 120


FAULTS = [half_covered, np.zeros_like, lambda image: np.full_like(image, 255)]


@pytest.mark.parametrize("fault", FAULTS, ids=["half covered", "black", "white"])
def test_hidden_dots_are_no_healthy_sensor(zero, fault):
    frame = seen_as(still(1), fault)[0]
    drift = measure_drift(zero, frame, DotTracker(zero.frame()).update(frame))
    assert drift.cause == "hidden" and drift.unseen > 0.3


@pytest.mark.parametrize(("fault", "renewed"), [
    (lambda image: (0.7 * image).astype(np.uint8), True),
    (half_covered, False),
    (some_covered, False),
    (white, False),
    (lambda image: (0.15 * image).astype(np.uint8), False),
], ids=["dimmer", "half covered", "some covered", "white", "dark"])  # fmt: skip
def test_a_reference_renews_itself_from_good_pictures_only(zero, fault, renewed):
    auto, tracker = AutoZero(zero, still_s=0.2, frames=4), DotTracker(zero.frame())
    given = [auto.update(f, tracker.update(f)) for f in seen_as(still(12), fault)]
    assert any(z is not None for z in given) is renewed


def test_a_camera_that_hangs_renews_no_reference(zero):
    auto, tracker = AutoZero(zero, still_s=0.2, frames=4), DotTracker(zero.frame())
    frames = [replace(still(1, 0.7)[0], time_s=k / 30, sequence=k) for k in range(12)]
    assert not any(auto.update(f, tracker.update(f)) for f in frames)


@pytest.mark.parametrize("change", [{"frames": float("inf")}, {"brightness": 10**400}])
def test_a_number_that_no_field_holds_is_a_damaged_file(zero, tmp_path, change):
    save_zero(zero, tmp_path / "z.npz")
    held = dict(np.load(tmp_path / "z.npz"))
    held["about"] = np.array(json.dumps(json.loads(str(held["about"])) | change))
    np.savez(tmp_path / "z.npz", **held)
    with pytest.raises(FileError, match="no reference file"):
        load_zero(tmp_path / "z.npz")


def test_a_reference_has_a_name_by_which_it_is_read(tmp_path, capsys):
    assert main(["take", "--source", str(tmp_path), "--out", str(tmp_path / "zero.txt")]) == 2
    assert "give a name that ends in .npz" in capsys.readouterr().err and list(tmp_path.iterdir()) == []
