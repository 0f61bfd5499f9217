"""The camera that is assumed, checked when a reference is taken; its uncertainty in the covariance."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from cad.params import EndcapParams
from sensing.calibrate import main as calibrate
from sensing.calibration.from_dots import calibrate_from_dots
from sensing.camera.mount import MountedCamera, mount, rotation_matrix
from sensing.camera.nominal import nominal_lens, nominal_mount
from sensing.camera.parameters import camera_at, camera_vector
from sensing.live.core.camera_check import FLAG
from sensing.live.core.config import EndcapConfig
from sensing.live.core.model import load_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.records import Frame
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


def test_a_turned_camera_is_named_and_its_wrench_flagged_until_it_is_calibrated(frames, tmp_path) -> None:
    good, reported = reading(frames["nominal"])
    assert good.note == "" and FLAG not in reported.estimate.flags
    pipeline, uncalibrated = reading(frames["turned"])
    assert "camera turned by 1.4 degrees" in pipeline.note and "sensing.calibrate --zero" in pipeline.note
    assert FLAG in uncalibrated.estimate.flags
    zero, out = tmp_path / "endcap_0.npz", tmp_path / "endcap_0.json"
    save_zero(single_zero(frames["turned"][0]), zero)
    assert calibrate(["--zero", str(zero), "--out", str(out)]) == 0
    pipeline, calibrated = reading(frames["turned"], out)
    assert pipeline.note == "" and not calibrated.estimate.flags
    widths = [np.sqrt(np.diag(r.estimate.covariance)) for r in (reported, calibrated, uncalibrated)]
    assert (widths[2][:3] > widths[1][:3]).all() and widths[1][2] < 1.5 * widths[0][2]
    off = uncalibrated.estimate.force_n - calibrated.estimate.force_n
    assert (np.abs(off) < 3 * widths[2][:3]).all()
    pipeline, _ = reading(frames["nominal"], out)
    assert f"{out} does not fit this picture" in pipeline.note


@pytest.mark.parametrize("parallax", [False, True], ids=["parallax left in", "parallax taken out"])
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
