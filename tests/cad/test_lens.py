"""Camera modules: rows of a table that every file's identity carries; a bad row or name is one line."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from cad import lens, scaling
from cad.errors import FileError, ParameterError
from cad.identity import differing, identity
from cad.lens import RELEASED_MODULE, VARIABLE, camera_module, camera_modules
from cad.params import EndcapParams
from fab.supplies import camera_supply
from sensing.camera.model import monotonic_half_angle_deg
from sensing.camera.nominal import nominal_lens
from sensing.design.bound import DesignBound
from sensing.simulator.solid.geometry import shell_geometry
from sensing.wrench.weight_files import find_weights, weights_name

PARAMS, OTHER = EndcapParams(130, 8), "ELP-USBFHD01M-L170"


def test_without_a_word_it_is_the_released_module(monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    assert camera_module().name == RELEASED_MODULE and scaling.camera_height_mm() == 17.0
    assert camera_module().focal_per_row == 247.0 / 480


def test_another_module_is_another_picture_identity_and_file_of_weights(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    here, usual = identity(PARAMS), nominal_lens()
    seen = len(DesignBound(PARAMS, shell_geometry(130, 8), 0.68).rest_px())
    monkeypatch.setenv(VARIABLE, OTHER)
    assert differing(identity(PARAMS), here) == ["camera"]
    assert nominal_lens().fx_px == pytest.approx(0.541 * 480) and usual.fx_px == pytest.approx(247)
    assert weights_name(PARAMS) == f"D130_T8_{OTHER}.safetensors" and find_weights(PARAMS) is None
    assert camera_supply().order_as.startswith(OTHER)
    circle = [module.focal_per_row * radius(module, module.circle_deg) for module in camera_modules().values()]
    assert circle[1] == pytest.approx(circle[0], rel=2e-3)  # the same image circle at the ends of both views
    assert len(DesignBound(PARAMS, shell_geometry(130, 8), 0.68).rest_px()) < seen  # a narrower view sees fewer dots


def radius(module: lens.CameraModule, angle_deg: float) -> float:
    """Of the image at an angle off the axis, focal length 1."""
    angle = math.radians(angle_deg)
    return angle + sum(k * angle ** (2 * n + 3) for n, k in enumerate(module.k))


def test_an_unknown_module_is_refused_with_those_that_are_known(monkeypatch):
    monkeypatch.setenv(VARIABLE, "webcam")
    with pytest.raises(
        ParameterError, match=f"ENDCAP_CAMERA=webcam: no such camera module: choose one of {RELEASED_MODULE}"
    ):
        identity(PARAMS)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("stack_mm,", ""), r"has not one value for each column"),
        (("stack_mm", "stack"), r"the first line has no column 'stack_mm'"),
        (("L170,32", "L170,38"), r"line 3 \(ELP-USBFHD01M-L170\): board of 38 mm .* the base's seat takes 32 mm"),
        (("L170,32,28,18", "L170,32,28,40"), r"line 3 .*stack_mm=40 outside 14..22"),
        (("0.541", "wide"), r"line 3 .*focal_per_row='wide' is not a positive number"),
        (("0.541,-0.033", "0.541,nan"), r"line 3 .*k1='nan' is not a number"),
        (("0.541,-0.033,-0.007", "0.541,-0.033,inf"), r"line 3 .*k2='inf' is not a number"),
        (("0.541,-0.033", "0.541,-0.5"), r"line 3 .*k1..k4=-0.5, .* stops growing at 46.5 degrees off the axis"),
        (("0,0,85,88", "0,1e307,85,88"), r"line 3 .*k1..k4=.*: the picture's radius"),
        (("0,0,85,88", "0,0,90,88"), r"line 3 .*circle_deg=90 over max_half_angle_deg=88"),
        (("0,0,85,88", "0,0,50,88"), r"line 3 .*circle_deg=50 outside 60..110"),
        (("0,0,85,88", "0,0,none,88"), r"line 3 .*circle_deg='none' is not a positive number"),
    ],
)
def test_a_bad_row_is_named_by_its_line(monkeypatch, tmp_path, change, said):
    table = tmp_path / "cameras.csv"
    table.write_text(lens.TABLE.read_text().replace(*change, 1))
    monkeypatch.setattr(lens, "TABLE", table)
    camera_modules.cache_clear()
    with pytest.raises(FileError, match=said):
        camera_modules()
    camera_modules.cache_clear()


@pytest.mark.parametrize(
    "k", [(-0.033, -0.007, 0.0, 0.0), (-0.5, 0.0, 0.0, 0.0), (-0.2, 0.04, -0.02, 0.0), (0.1, -0.09, 0.0, 0.0)]
)
@pytest.mark.parametrize("angle_deg", [60.0, 75.0, 90.0, 110.0])
def test_a_row_is_refused_where_the_camera_model_refuses_its_lens(k, angle_deg):
    module = replace(camera_module(), k=k, max_half_angle_deg=angle_deg)
    if monotonic_half_angle_deg(k) > angle_deg:
        lens._require_growing(module)
        return
    with pytest.raises(ValueError, match="the picture's radius stops growing"):
        lens._require_growing(module)
