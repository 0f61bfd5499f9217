"""The camera that is assumed, checked when a reference is taken; its uncertainty in the covariance."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from long_cases import others_long

from cad.identity import identity
from cad.params import EndcapParams
from sensing.calibrate import main as calibrate
from sensing.calibration.from_dots import calibrate_from_dots
from sensing.calibration.rest_camera import rest_camera
from sensing.camera.mount import MountedCamera, mount, rotation_matrix
from sensing.camera.nominal import nominal_lens, nominal_mount
from sensing.camera.parameters import camera_at, camera_vector
from sensing.decode import decode_bgr
from sensing.live.core.camera_check import FLAG, CameraCheck, _with_misfit
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.model import load_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.records import DotTracks, Frame, Wrench
from sensing.setup import _await_zeros, _camera_kept
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.settings import RenderSettings
from sensing.tracking.model_input import model_input
from sensing.tracking.zero import save_zero, single_zero
from sensing.wrench.camera_spread import CameraSpread
from sensing.wrench.model import load_wrench_model

PARAMS = EndcapParams(130, 8)
TURNED = mount(nominal_lens(), (0.0, 0.0, 17.0), rotation_matrix(np.radians([1.2, 0.0, 0.9])))


def pressed(surface_mm: np.ndarray, depth_mm: float = 3.0) -> np.ndarray:
    """A dent (n, 3) at the tip."""
    polar = np.hypot(surface_mm[:, 0], surface_mm[:, 1]) / 20.0
    return np.column_stack([np.zeros((len(surface_mm), 2)), -depth_mm * np.exp(-(polar**2))])


@pytest.fixture(scope="module")
def frames() -> dict[str, tuple[Frame, Frame]]:
    """Rest and a press, seen by a camera as designed and by one that is turned by 1.5 degrees."""
    found = {}
    for name, camera in (("nominal", nominal_mount(PARAMS)), ("turned", TURNED)):
        renderer = DomeRenderer(PARAMS, camera, RenderSettings(seed=31).at_level("draft"))
        rest, press = renderer.render(), renderer.render(pressed(renderer.surface_mm), frame=1)
        found[name] = Frame(0.0, 0, name, jpeg=rest.jpeg), Frame(0.1, 1, name, jpeg=press.jpeg)
    return found


def reading(frames: tuple[Frame, Frame], camera=None):
    endcap = EndcapConfig("endcap_0", "test", camera=camera)
    pipeline = EndcapPipeline(endcap, load_model("default", PARAMS), single_zero(frames[0]))
    return pipeline, pipeline.update(frames[1])


def test_specks_on_the_lens_keep_their_place_and_are_no_dots(frames):
    """Six as large and dark as dots, between those near the tip: followed, they held the field back, by 1 N."""
    specked = []
    for frame in frames["nominal"]:
        image = decode_bgr(frame).copy()
        for x, y in ((320, 302), (320, 178), (265, 262), (375, 262), (265, 218), (375, 218)):
            cv2.circle(image, (x, y), 7, (60, 60, 60), -1, cv2.LINE_AA)
        specked.append(Frame(frame.time_s, frame.sequence, "specked", image=image))
    clean, seen = reading(frames["nominal"])[1], reading(tuple(specked))[1]
    assert len(seen.tracks.ids) == len(clean.tracks.ids)
    assert seen.wrench.force_n == pytest.approx(clean.wrench.force_n, abs=0.02)


def test_without_a_calibration_the_camera_is_the_one_that_calibration_finds_on_the_rest_picture(
    frames, tmp_path
) -> None:
    good, reported = reading(frames["nominal"])
    assert good.note == "" and not reported.estimate.flags
    pipeline, uncalibrated = reading(frames["turned"])
    assert "camera turned by 1.4 degrees" in pipeline.note and "sensing.calibrate --photo" in pipeline.note
    zero, out = tmp_path / "endcap_0.npz", tmp_path / "endcap_0.json"
    save_zero(single_zero(frames["turned"][0]), zero)
    assert calibrate(["--zero", str(zero), "--out", str(out)]) == 0
    kept, calibrated = reading(frames["turned"], out)
    assert kept.note == "" and not calibrated.estimate.flags and not uncalibrated.estimate.flags
    for one, other in ((uncalibrated.estimate, calibrated.estimate), (uncalibrated.wrench, calibrated.wrench)):
        assert np.array_equal(one.force_n, other.force_n) and np.array_equal(one.covariance, other.covariance)
    shown, filed = pipeline.camera(1280, 960), MountedCamera.load(out)
    assert np.array_equal(shown.T_camera_endcap, filed.T_camera_endcap)
    assert shown.camera == filed.camera.resized(1280, 960)
    size = np.sqrt(np.diag(reported.estimate.covariance)), np.sqrt(np.diag(calibrated.estimate.covariance))
    assert size[1][2] < 1.5 * size[0][2]


def test_setup_keeps_the_camera_that_it_found_and_no_other(frames, tmp_path) -> None:
    """A camera as designed gets no file, and a file that is there is not overwritten."""
    said: list[str] = []

    def kept(pipeline) -> Path | None:
        return _camera_kept(SimpleNamespace(pipeline=pipeline), tmp_path / "endcap_0.json", said.append)

    assert kept(reading(frames["nominal"])[0]) is None and not said
    turned, without = reading(frames["turned"])
    path = kept(turned)
    assert path == tmp_path / "endcap_0.json" and "turned by 1.4 degrees" in said[-1]
    again, filed = reading(frames["turned"], path)
    assert again.note == "" and np.array_equal(filed.estimate.force_n, without.estimate.force_n)
    path.write_text("mine")
    assert kept(turned) is None and path.read_text() == "mine" and "left as it is" in said[-1]


def test_a_calibration_that_does_not_fit_any_more_is_named_and_its_wrench_flagged_and_widened(frames, tmp_path) -> None:
    out = tmp_path / "endcap_0.json"
    zero = single_zero(frames["turned"][0])
    found = rest_camera(zero.frame(), model_input(zero.frame(), (16, 16), PARAMS).tracker.reference_px, PARAMS)
    assert found.found and found.camera is not None
    found.camera.save(out, identity(PARAMS))
    pipeline, moved = reading(frames["nominal"], out)
    assert f"{out} does not fit this picture" in pipeline.note and "sensing.calibrate --photo" in pipeline.note
    assert FLAG in moved.estimate.flags
    _, right = reading(frames["nominal"])
    width = np.sqrt(np.diag(moved.estimate.covariance))[:3]
    assert (width > np.sqrt(np.diag(right.estimate.covariance))[:3]).all()
    assert (np.abs(moved.estimate.force_n - right.estimate.force_n) < 3 * width).all()


def test_no_camera_is_taken_from_the_picture_of_another_diameter_or_of_a_pressed_dome(frames) -> None:
    large = EndcapParams(150, 8)
    renderer = DomeRenderer(large, nominal_mount(large), RenderSettings(seed=3).at_level("draft"))
    other = Frame(0.0, 0, "large", jpeg=renderer.render().jpeg)
    pipeline, wrong = reading((other, replace(other, time_s=0.1)))
    assert FLAG in wrong.estimate.flags and "D=150 T=8" in pipeline.note
    said: list[str] = []  # setup wrote endcaps.toml without a word of it
    found = [reading(frames[name])[0] for name in ("nominal", "turned")]
    _await_zeros([SimpleNamespace(pipeline=each) for each in (pipeline, *found)], said.append)
    assert len(said) == 1 and "warning: every reading will be flagged" in said[0] and "D=150 T=8" in said[0]
    renderer = DomeRenderer(PARAMS, TURNED, RenderSettings(seed=31).at_level("draft"))
    deep = Frame(0.0, 0, "deep", jpeg=renderer.render(pressed(renderer.surface_mm, 25.0)).jpeg)
    pipeline, wrong = reading((deep, replace(deep, time_s=0.1)))
    assert FLAG in wrong.estimate.flags and "is it pressed? Or is the picture squeezed" in pipeline.note


@pytest.mark.parametrize("parallax", others_long([False, True]), ids=["parallax left in", "parallax taken out"])
def test_spread_is_the_change_of_the_wrench_with_the_camera(frames, parallax) -> None:
    """Against the whole path with each camera, in the directions that change the wrench most."""
    model, rest = load_wrench_model(PARAMS), frames["turned"][0]
    radial = model.radial if parallax else None
    assert model.radial is not None
    plain = model_input(rest, model.shape, PARAMS)
    camera = calibrate_from_dots(plain.tracker.reference_px, PARAMS, plain.tracker.size).mounted
    tracks = plain.track(plain.decode(frames["turned"][1]), 0.1)
    for number, size in ((5, 0.01), (8, 0.3), (0, 2.0)):
        covariance = np.zeros((11, 11))
        covariance[number, number] = size**2
        spread = CameraSpread(
            model_input(rest, model.shape, PARAMS, camera, radial), model, replace(camera, covariance=covariance)
        )
        at = camera_vector(camera)
        ends = []
        for sign in (1, -1):
            moved = camera_at(at + sign * size * np.eye(11)[number], camera)
            field = model_input(rest, model.shape, PARAMS, moved, radial).field(tracks)
            ends.append(model.slope @ field.channels.ravel().astype(float))
        change, predicted = (ends[0] - ends[1]) / 2, spread.deviations(tracks)[0]
        if predicted @ change < 0:
            predicted = -predicted
        assert np.linalg.norm((predicted - change)[:3]) < 0.15 * np.linalg.norm(change[:3])


def test_slope_is_the_models_derivative() -> None:
    """Averaged over fields that have the same draws for parts, by finite differences of :meth:`predict`."""
    model, rng = load_wrench_model(PARAMS), np.random.default_rng(0)
    principal = model.weights["principal"].astype(float)
    fields = rng.standard_normal((64, len(principal))) @ np.linalg.pinv(principal).T
    step = 2e-5 * np.random.default_rng(1).standard_normal(fields.shape[1])
    change = (model.predict(fields + step)[0] - model.predict(fields - step)[0]).mean(axis=0) / 2
    assert np.allclose(model.slope @ step, change, rtol=1e-4, atol=1e-9)


def test_a_photo_of_another_diameter_is_refused_with_both_fits(tmp_path, capsys) -> None:
    large = EndcapParams(150, 8)
    image = DomeRenderer(large, nominal_mount(large), RenderSettings(seed=3).at_level("draft")).render().image_bgr
    photo, out = tmp_path / "a.png", tmp_path / "camera.json"
    cv2.imwrite(str(photo), image)
    assert calibrate(["--photo", str(photo), "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert "D=150 T=8" in error and "D=130 T=8" in error and error.count("\n") == 1 and not out.exists()
    assert calibrate(["--photo", str(photo), "--out", str(out), "--trust-design"]) == 0
    assert calibrate(["--photo", str(photo), "--out", str(out), "--diameter", "150"]) == 0
    assert "D=" not in capsys.readouterr().out and MountedCamera.load(out).covariance is not None


def test_a_camera_that_may_not_see_the_dots_one_deviation_away_is_moved_by_less() -> None:
    """A stand-in whose field goes with the focal length, and ends half a deviation from it."""
    camera, known, slope = nominal_mount(PARAMS), np.ones(2, bool), np.arange(24.0).reshape(6, 4)
    at, covariance = camera_vector(camera), np.zeros((11, 11))
    covariance[0, 0] = 3.0**2

    def linear(moved: MountedCamera) -> np.ndarray:
        off = camera_vector(moved)[0] - at[0]
        return np.full((4, 4), np.nan) if abs(off) > 1.5 else off * np.eye(4)

    seen, model = SimpleNamespace(known=known, linear=linear), SimpleNamespace(slope=slope)
    spread = CameraSpread(seen, model, replace(camera, covariance=covariance))
    moved_px = np.array([[1.0, 2.0], [3.0, 4.0]])
    tracks = DotTracks(0.0, np.arange(2), np.zeros((2, 2)), moved_px, np.ones(2), ~known, (640, 480))
    assert np.abs(spread.deviations(tracks)[0]) == pytest.approx(3.0 * np.abs(slope @ moved_px.T.ravel()))


def test_where_a_camera_does_not_fit_its_whole_distance_to_the_one_found_is_doubted():
    """The numbers of a camera are off together, and the one found is itself not exact."""
    assumed, apart = nominal_mount(PARAMS), np.linspace(0.01, 0.11, 11)
    own = np.diag(np.linspace(1.0, 2.0, 11))
    found = replace(camera_at(camera_vector(assumed) + apart, assumed), covariance=own)
    doubted = _with_misfit(assumed, SimpleNamespace(found=SimpleNamespace(mounted=found)))
    assert doubted.camera == assumed.camera and doubted.covariance == pytest.approx(np.outer(apart, apart) + own)
    exact = SimpleNamespace(mounted=replace(found, covariance=None))
    assert _with_misfit(assumed, SimpleNamespace(found=exact)).covariance == pytest.approx(np.outer(apart, apart))
    assert _with_misfit(assumed, SimpleNamespace(found=None)) is assumed


@pytest.mark.parametrize(("noise", "spread", "wanted"), [(1.0, 2.0, 4.0), (None, 2.0, 3.0), (1.0, None, 2.0)])
def test_doubt_of_the_camera_and_noise_of_its_dots_add_up(noise, spread, wanted):
    check = object.__new__(CameraCheck)  # without the picture that both come from
    check._noise, check._spread = (
        None if size is None else SimpleNamespace(covariance=lambda _, size=size: size * np.eye(6))
        for size in (noise, spread)
    )
    plain = Wrench(0.0, np.zeros(3), np.zeros(3), "sphere", np.eye(6))
    assert check.widened(plain, None).covariance == pytest.approx(wanted * np.eye(6))
