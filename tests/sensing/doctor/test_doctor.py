"""The camera doctor: faults planted in rendered pictures and in streams, and the command on every kind of source."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from live_stand_in import pipeline, stand_in
from long_cases import others_long

from cad.params import EndcapParams
from sensing.camera.nominal import nominal_mount
from sensing.doctor.examine import examine, take_live
from sensing.doctor.finding import Verdict
from sensing.doctor.picture import picture_findings
from sensing.doctor.stream import stream_findings
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.outputs.mcap.recorder import Recorder
from sensing.live.outputs.ros.types import picture_bytes
from sensing.records import Frame
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.settings import Lamp, Optics, RenderSettings, Sensor
from sensing.sources.__main__ import main
from sensing.sources.drawn import Drawing, draw_dots
from sensing.sources.newest import SourceError

GOOD, LOOK, BAD = Verdict.GOOD, Verdict.LOOK, Verdict.BAD
PARAMS = EndcapParams(130, 8)
SETTINGS = RenderSettings(seed=31).at_level("draft")
PHOTOS = Path(__file__).resolve().parents[4] / "shared" / "reference" / "photos"


def rendered(**changes) -> np.ndarray:
    return DomeRenderer(PARAMS, nominal_mount(PARAMS), replace(SETTINGS, **changes)).render().image_bgr


@pytest.fixture(scope="module")
def nominal() -> np.ndarray:
    return rendered()


def verdicts(picture: np.ndarray) -> dict[str, Verdict]:
    return {each.name: each.verdict for each in picture_findings(picture, PARAMS)}


NAMES = ("size", "exposure", "light", "focus", "dot size", "dots", "shape", "design")
ALL_GOOD = dict.fromkeys(NAMES, GOOD)


# --- pictures --------------------------------------------------------------------------------------------------
def test_a_good_picture_has_no_complaint_at_any_size(nominal):
    for picture in (nominal, cv2.resize(nominal, (1280, 960), interpolation=cv2.INTER_CUBIC)):
        found = picture_findings(picture, PARAMS)
        assert {each.name: each.verdict for each in found} == ALL_GOOD and not any(each.fix for each in found)


OTHERS = others_long([(100.0, 8.0, 4.0), (250.0, 8.0, 2.9), (250.0, 10.0, 4.0), (130.0, 8.0, 6.0)], unpack=True)


@pytest.mark.parametrize(("diameter_mm", "wall_mm", "dot_mm"), OTHERS)
def test_other_sizes_are_judged_alike_sharp_and_out_of_focus(diameter_mm, wall_mm, dot_mm):
    params = EndcapParams(diameter_mm, wall_mm, dot_mm=dot_mm)
    picture = DomeRenderer(params, nominal_mount(params), SETTINGS.at_level("data")).render()
    sharp = picture_findings(picture.image_bgr, params)
    assert {each.name: each.verdict for each in sharp} == ALL_GOOD
    soft = cv2.GaussianBlur(picture.image_bgr, (0, 0), 2.2)
    found = {each.name: each.verdict for each in picture_findings(soft, params)}
    smallest = dot_mm < 3  # dots of 6 px are lost before their rims are wide
    assert found["dots" if smallest else "focus"] is not GOOD


@pytest.mark.parametrize(
    ("changes", "name", "verdict", "fix"),
    [
        ({"sensor": Sensor(exposure=0.05)}, "exposure", BAD, "expose longer"),
        ({"sensor": Sensor(exposure=0.15)}, "exposure", LOOK, "expose longer"),
        ({"lamp": Lamp(brightness=0.001)}, "exposure", BAD, "plug the lamp in"),
        ({"sensor": Sensor(exposure=4.0)}, "exposure", BAD, "shorter exposure"),
        ({"lamp": Lamp(dead=(0, 1, 2))}, "light", LOOK, "LED that is off or covered at 4 o'clock"),
        ({"lamp": Lamp(dead=(0, 1, 2, 3, 4))}, "light", BAD, "o'clock"),
        ({"optics": Optics(defocus_px=2.2, defocus_edge_px=2.2)}, "focus", LOOK, "turn the lens"),
        ({"optics": Optics(defocus_px=4.0, defocus_edge_px=4.0)}, "focus", BAD, "turn the lens"),
    ],
)
def test_a_planted_fault_of_light_or_lens_is_named_with_its_fix(changes, name, verdict, fix):
    found = {each.name: each for each in picture_findings(rendered(**changes), PARAMS)}
    assert found[name].verdict is verdict and fix in found[name].fix, found[name]
    assert all(each.verdict is GOOD for each in found.values() if each.name not in (name, "dots", "dot size"))


def test_covered_dots_are_listed_where_they_are(nominal):
    covered = nominal.copy()
    cv2.circle(covered, (420, 180), 60, (10, 10, 10), -1)
    dots = next(each for each in picture_findings(covered, PARAMS) if each.name == "dots")
    assert dots.verdict is LOOK and dots.values["missing"] == len(dots.values["missing_dots"]) >= 5
    places = np.array(
        [[float(v) for v in text.split(" at ")[1][:-3].split(",")] for text in dots.values["missing_dots"]]
    )
    assert (np.linalg.norm(places - [420, 180], axis=1) < 80).all()
    cv2.rectangle(covered, (320, 0), (640, 480), (10, 10, 10), -1)
    assert verdicts(covered)["dots"] is BAD


def test_a_covered_third_is_bad_though_the_lens_might_end_there(nominal):
    covered = nominal.copy()
    cv2.rectangle(covered, (0, 0), (230, 480), (0, 0, 0), -1)
    assert verdicts(nominal)["dots"] is GOOD and verdicts(covered)["dots"] is BAD


def test_another_design_shows_in_the_size_of_the_dots():
    large = EndcapParams(180, 8)
    image = DomeRenderer(large, nominal_mount(large), SETTINGS).render().image_bgr
    assert verdicts(image)["dot size"] is not GOOD
    assert {each.name: each.verdict for each in picture_findings(image, large)}["dot size"] is GOOD


def test_a_design_with_too_few_dots_is_named_and_not_the_focus():
    blank = np.full((480, 640, 3), 140, np.uint8)
    for params, fix in ((EndcapParams(99.46, 9.94, (1, 3, 4)), "this lens sees 4 of"), (EndcapParams(130, 8), "focus")):
        assert fix in {each.name: each.fix for each in picture_findings(blank, params)}["dots"]


@pytest.mark.skipif(not PHOTOS.is_dir(), reason="the released photos are not on this computer")
def test_the_released_photos_have_nothing_bad_but_the_wide_one_that_lacks_dots_above_and_below():
    for path in sorted(PHOTOS.iterdir()):
        bad = {name for name, verdict in verdicts(cv2.imread(str(path))).items() if verdict is not GOOD}
        assert bad == ({"dots"} if "wide" in path.name else set()), path


# --- streams ---------------------------------------------------------------------------------------------------
def stream(times: np.ndarray, sizes: int = 40_000) -> dict:
    frames = [Frame(float(t), k, "test", jpeg=bytes([k % 251]) * sizes, size=(640, 480)) for k, t in enumerate(times)]
    return {each.name: each for each in stream_findings(frames, 30.0)}


def test_a_steady_stream_is_good_and_six_of_it_are_added_up():
    found = stream(np.arange(90) / 30)
    assert {each.verdict for each in found.values()} == {GOOD}
    assert found["rate"].values["rate_hz"] == pytest.approx(30) and found["USB"].values["six_mb_s"] == pytest.approx(
        7.2
    )


def test_a_slow_a_jumpy_a_lossy_and_a_heavy_stream_are_named():
    steady = np.arange(90) / 30
    assert stream(np.arange(90) / 15)["rate"].verdict is BAD and stream(np.arange(90) / 27)["rate"].verdict is LOOK
    late = steady + np.where(np.arange(90) % 7 == 3, 0.008, 0.0)
    assert stream(late)["jitter"].verdict is LOOK
    assert stream(late)["jitter"].values["jitter_ms"] == pytest.approx(8.0)
    lossy = stream(np.delete(steady, [7, 30, 31, 32, 60]))
    assert lossy["dropped"].values["missing"] == 5 and lossy["dropped"].verdict is BAD
    assert stream(np.delete(steady, 7))["dropped"].verdict is LOOK
    assert stream(steady, 140_000)["USB"].verdict is LOOK and stream(steady, 220_000)["USB"].verdict is BAD


def test_the_size_of_pictures_that_a_recorder_wrote_as_png_says_nothing_of_usb():
    """Those of a video or a raw camera; the camera sent other bytes."""
    pictures = [np.random.default_rng(k).integers(0, 256, (480, 640, 3), np.uint8) for k in range(12)]
    written = [picture_bytes(Frame(0.0, 0, "raw", image=each)) for each in pictures]
    assert {form for _, form in written} == {"png"}
    frames = [Frame(k / 30, k, "raw", jpeg=data, size=(640, 480)) for k, (data, _) in enumerate(written)]
    assert {each.name for each in stream_findings(frames, 30.0)} == {"rate", "jitter", "dropped"}
    sent = [replace(frame, jpeg=None, image=each) for frame, each in zip(frames, pictures, strict=True)]
    assert "USB" in {each.name for each in stream_findings(sent, 30.0)}


def test_repeated_and_damaged_pictures_are_counted(nominal):
    jpeg = cv2.imencode(".jpg", nominal)[1].tobytes()
    frames = [Frame(k / 30, k, "test", jpeg=jpeg[:9000] if k == 4 else jpeg, size=(640, 480)) for k in range(20)]
    found = {each.name: each for each in examine("test", frames, PARAMS, timed=True).findings}
    assert found["dropped"].values["repeated"] == 17 and found["dropped"].verdict is BAD
    assert found["pictures"].verdict is BAD and found["pictures"].text.startswith("1 of 20 pictures cannot be decoded")
    assert found["dots"].verdict is GOOD  # the others are judged


def test_a_camera_that_is_absent_or_gives_nothing_is_reported_and_not_waited_for_ever():
    def absent():
        raise SourceError("/dev/video9: no such camera")

    frames, message = take_live(absent, 5)
    assert frames == [] and "no such camera" in message
    report = examine("test", frames, PARAMS, timed=True)
    assert report.verdict is BAD and report.findings[0].text == "no frame came"


# --- the command -----------------------------------------------------------------------------------------------
def test_folder_video_and_recording_are_checked(nominal, tmp_path, capsys):
    folder, video, recording = tmp_path / "photos", tmp_path / "rest.avi", tmp_path / "run.mcap"
    folder.mkdir()
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 25, (640, 480))
    recorder = Recorder(recording, LiveConfig((EndcapConfig("endcap_0", "test"),)), {"endcap_0": 0}, lambda _: None)
    recorder.start()
    pipe = pipeline()
    for k in range(15):
        picture = nominal.copy()
        picture[-4:, : k + 1] ^= 8
        cv2.imwrite(str(folder / f"{k:02d}.jpg"), picture)
        writer.write(picture)
        jpeg = (folder / f"{k:02d}.jpg").read_bytes()
        reading = pipe.update(Frame(100 + k / 30, k, "test", jpeg=jpeg, size=(640, 480)))
        if reading is not None:
            recorder.put(reading)
    writer.release()
    recorder.close(60)
    assert main(["check", str(folder), str(video), str(recording)]) == 0
    said = capsys.readouterr().out
    assert said.count(": good; ") == 3 and "run.mcap: endcap_0: good" in said
    assert said.count("frames/s") == 1  # a folder and a video have no capture times
    assert main(["check", str(recording), "--json"]) == 0
    (report,) = json.loads(capsys.readouterr().out)
    assert report["verdict"] == "good" and report["size"] == [640, 480] and report["frames"] == 15
    rate = next(each for each in report["findings"] if each["name"] == "rate")
    assert rate["values"]["rate_hz"] == pytest.approx(30, abs=0.01) and rate["fix"] == ""


def test_what_is_bad_gives_status_1_and_its_fix_in_the_next_line(tmp_path, capsys):
    path = tmp_path / "black.png"
    cv2.imwrite(str(path), np.zeros((480, 640, 3), np.uint8))
    assert main(["check", str(path)]) == 1
    lines = capsys.readouterr().out.splitlines()
    at = next(k for k, line in enumerate(lines) if line.startswith("  bad   exposure"))
    assert "-> plug the lamp in" in lines[at + 1] and lines[0].endswith("bad; 1 frames, 640 x 480 px")


def test_a_recording_is_judged_by_its_own_design_and_options_must_agree(tmp_path, capsys):
    design, path = EndcapParams(200, 10), tmp_path / "d200.mcap"
    endcap = EndcapConfig("endcap_0", "test", diameter_mm=200.0, wall_mm=10.0)
    image = draw_dots(Drawing(specks=0, digit=""), design)[0]
    recorder = Recorder(path, LiveConfig((endcap,)), {"endcap_0": 0}, lambda _: None)
    recorder.start()
    pipe = EndcapPipeline(endcap, stand_in("dis"), None, 0, 1)
    for k in range(4):
        image[-4:, : k + 1] ^= 8
        jpeg = cv2.imencode(".jpg", image)[1].tobytes()
        recorder.put(pipe.update(Frame(100 + k / 30, k, "test", jpeg=jpeg, size=(640, 480))))
    recorder.close(60)
    assert main(["check", str(path), "--json"]) == 0
    (report,) = json.loads(capsys.readouterr().out)
    assert next(each for each in report["findings"] if each["name"] == "dot size")["verdict"] == "good"
    assert main(["check", str(path), "--diameter", "130", "--wall", "8"]) == 2
    error = capsys.readouterr().err
    assert "--diameter 130 --wall 8: " in error and "was taken of D200_T10" in error and error.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [(["nowhere"], "nowhere"), (["--frames", "0", "x"], "--frames 0 outside"), (["x.mcap"], "x.mcap"),
     (["x", "--diameter", "5"], "diameter_mm=5")],
)  # fmt: skip
def test_bad_input_is_one_line(words, said, capsys):
    assert main(["check", *words]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


# --- what looks healthy and is not -----------------------------------------------------------------------------
def test_a_pressed_dome_is_no_untouched_one():
    renderer = DomeRenderer(PARAMS, nominal_mount(PARAMS), SETTINGS)
    polar = np.hypot(*renderer.surface_mm[:, :2].T) / 30.0
    dent = np.column_stack(
        [1.2 * np.exp(-(polar**2))[:, None] * renderer.surface_mm[:, :2] / 10, -8 * np.exp(-(polar**2))]
    )
    found = {each.name: each for each in picture_findings(renderer.render(dent).image_bgr, PARAMS)}
    assert found["shape"].verdict is BAD and "is it pressed?" in found["shape"].fix


def test_raw_pictures_that_repeat_are_counted(nominal):
    rng = np.random.default_rng(0)
    noisy = [
        np.clip(nominal.astype(int) + rng.integers(-2, 3, nominal.shape), 0, 255).astype(np.uint8) for _ in range(3)
    ]
    frames = [Frame(k / 30, k, "raw", image=noisy[min(k, 2)]) for k in range(12)]
    dropped = next(each for each in stream_findings(frames, 30.0) if each.name == "dropped")
    assert dropped.values["repeated"] == 9 and dropped.verdict is BAD
