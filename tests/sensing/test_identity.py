"""What was made for one endcap is refused for another, by the name of what differs: every kind of file."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import cad.pattern
from cad import materials
from cad.errors import EndcapError, FileError, ParameterError
from cad.identity import identity
from cad.materials import silicones
from cad.params import EndcapParams
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.frames import FtMount
from sensing.learning.contenders import read_all
from sensing.learning.samples import read_samples
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.endcaps_file import load_config, save_config
from sensing.live.open_endcaps import configured_models
from sensing.live.outputs.mcap.config import about, parsed
from sensing.recording.folder import Recording
from sensing.records_labelled import LabelledSet
from sensing.simulator.dataset import writer
from sensing.simulator.dataset.request import DataRequest
from sensing.simulator.robot import frames as film
from sensing.tracking.zero import Zero, load_zero, save_zero
from sensing.wrench.model import load_wrench_model
from sensing.wrench.weight_files import find_weights

PARAMS = EndcapParams(130, 8)
PATTERN = "for the released dot pattern, this endcap has the dot pattern "


@pytest.fixture
def other_dots(monkeypatch):
    """Call it, and the toolkit has another dot pattern."""
    return lambda: monkeypatch.setattr(cad.pattern, "DENT_DEPTH_MM", 0.5)


@pytest.fixture
def begun(tmp_path, monkeypatch):
    """A data set that has been begun, without the cost of its mesh."""
    monkeypatch.setattr(writer, "studio", lambda request: SimpleNamespace(simulator=None))
    monkeypatch.setattr(writer, "rest_arrays", lambda simulator: {"dots_mm": np.zeros((1, 3))})
    folder = tmp_path / "set"
    folder.mkdir()
    writer._begin(DataRequest(3), folder, 1, None)
    return folder


def test_weights_that_ship_are_refused_for_another_pattern_and_another_silicone(other_dots, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert load_wrench_model(PARAMS).design == PARAMS
    endcap, shipped = one(silicone="Dragon Skin 30"), find_weights(PARAMS)
    with pytest.raises(FileError, match=r"no weights for D130_T8 in Dragon Skin 30: make them"):
        configured_models(LiveConfig((endcap,)))(endcap)
    with pytest.raises(FileError, match=r"weights for the silicone Smooth-Sil 950, this endcap has .* Dragon Skin 30"):
        configured_models(LiveConfig((endcap,), weights=shipped))(endcap)
    other_dots()
    with pytest.raises(FileError, match="weights " + PATTERN):
        load_wrench_model(PARAMS)


def test_weights_carry_what_they_are_for(tmp_path, other_dots, monkeypatch):
    model = load_wrench_model(PARAMS)
    model.save(tmp_path / "released.safetensors")
    assert load_wrench_model(PARAMS, tmp_path / "released.safetensors").identity == model.identity
    other_dots()
    changed = type(model)(model.weights, PARAMS, "dots", model.shape, model.range, model.about)
    changed.save(tmp_path / "changed.safetensors")
    assert load_wrench_model(PARAMS, tmp_path / "changed.safetensors").identity == identity(PARAMS, "Smooth-Sil 950")
    monkeypatch.undo()
    with pytest.raises(FileError, match=r"weights for the dot pattern [0-9a-f]{8}, this endcap has the released dot"):
        load_wrench_model(PARAMS, tmp_path / "changed.safetensors")


def test_a_data_set_is_not_extended_with_another_pattern_or_mesh(begun, other_dots, monkeypatch):
    writer._begin(DataRequest(30), begun, 1, None)  # the same, and larger
    assert LabelledSet(begun).identity == DataRequest(3).identity
    with monkeypatch.context() as patch, pytest.raises(FileError, match=r"core_rings_layers=\[6, 9, 1\], here \[6, 10"):
        patch.setattr("sensing.simulator.dataset.request.DENSITIES", {"data": finer()})
        writer._begin(DataRequest(3), begun, 1, None)
    other_dots()
    with pytest.raises(FileError, match="holds a set " + PATTERN):
        writer._begin(DataRequest(3), begun, 1, None)
    with pytest.raises(FileError, match="labelled frames " + PATTERN):
        read_samples(begun)


def finer():
    from sensing.simulator.solid.mesh import MeshDensity

    return MeshDensity(6, 10, 1)


def test_a_set_of_before_is_of_the_silicone_that_it_names(begun):
    manifest = json.loads((begun / "manifest.json").read_text())
    del manifest["identity"]
    (begun / "manifest.json").write_text(json.dumps(manifest))
    assert LabelledSet(begun).identity.aspects["silicone"] == identity(PARAMS, "Smooth-Sil 950").aspects["silicone"]
    manifest["request"] |= {"silicone": "Dragon Skin 30", "c10_mpa": 0.169}
    (begun / "manifest.json").write_text(json.dumps(manifest))
    assert LabelledSet(begun).identity.aspects["silicone"] == identity(PARAMS, "Dragon Skin 30").aspects["silicone"]


def test_folders_of_different_silicones_are_not_trained_together(monkeypatch):
    class Part:
        design = PARAMS

        def __init__(self, silicone):
            self.identity = identity(PARAMS, silicone)

    monkeypatch.setattr("sensing.learning.contenders.read_samples", lambda folder, *_: Part(folder))
    with pytest.raises(FileError, match=r"Dragon Skin 30: data for the silicone Dragon Skin 30"):
        read_all(["Smooth-Sil 950", "Dragon Skin 30"], "dots")


def test_an_own_recording_is_not_continued_with_another_silicone(tmp_path):
    mount = FtMount(np.eye(4), 1)
    first = Recording(tmp_path / "own", PARAMS, mount)
    first._lock.close()
    with pytest.raises(FileError, match="holds a recording for the silicone Smooth-Sil 950"):
        Recording(tmp_path / "own", PARAMS, mount, "Dragon Skin 30")


def test_a_camera_is_refused_for_another_design_or_pattern(tmp_path, other_dots):
    path = tmp_path / "camera.json"
    nominal_mount(PARAMS).save(path, identity(PARAMS))
    assert MountedCamera.load(path, identity(PARAMS)).camera == nominal_mount(PARAMS).camera
    with pytest.raises(FileError, match="a camera for the design D130_T8, this endcap has the design D150_T8"):
        MountedCamera.load(path, identity(EndcapParams(150, 8)))
    nominal_mount(PARAMS).save(tmp_path / "old.json")
    other_dots()
    for name in ("camera.json", "old.json"):
        with pytest.raises(FileError, match="a camera " + PATTERN):
            MountedCamera.load(tmp_path / name, identity(PARAMS))
        MountedCamera.load(tmp_path / name)  # of any endcap


def test_a_reference_is_refused_for_another_design_or_pattern(tmp_path, other_dots):
    zero = Zero(np.full((48, 64, 3), 90, np.uint8), "a", "2026-01-01", 3, np.zeros(2), 90.0)
    stated = Zero(zero.image, "a", zero.date, 3, zero.noise_px, 90.0, made_of=identity(PARAMS))
    save_zero(zero, tmp_path / "unstated.npz")
    save_zero(stated, tmp_path / "stated.npz")
    assert load_zero(tmp_path / "stated.npz", identity(PARAMS)).made_of == identity(PARAMS)
    with pytest.raises(FileError, match="a reference for the design D130_T8"):
        load_zero(tmp_path / "stated.npz", identity(EndcapParams(150, 8)))
    other_dots()
    with pytest.raises(FileError, match="a reference " + PATTERN):
        load_zero(tmp_path / "stated.npz", identity(PARAMS))
    assert load_zero(tmp_path / "unstated.npz", identity(PARAMS)).made_of is None


def one(**more) -> EndcapConfig:
    return EndcapConfig("endcap_0", "0", **more)


def test_a_configuration_and_a_recording_are_refused_for_another_pattern(tmp_path, other_dots):
    config, path = LiveConfig((one(silicone="Dragon Skin 30"),)), tmp_path / "endcaps.toml"
    save_config(config, path)
    assert load_config(path).endcaps[0].identity == config.endcaps[0].identity
    recording = about(config, [])
    assert parsed(recording, path).config.endcaps[0].silicone == "Dragon Skin 30"
    old = tmp_path / "old.toml"
    old.write_text('[[endcap]]\nname = "endcap_0"\nsource = "0"\n')
    assert load_config(old).endcaps[0].silicone == "Smooth-Sil 950"
    other_dots()
    for file in (path, old):
        with pytest.raises(ParameterError, match="dots='released' of endcap_0: it was set up for that dot pattern"):
            load_config(file)
    with pytest.raises(FileError, match="dots='released' of endcap_0"):
        parsed(recording, path)
    with pytest.raises(ParameterError, match=r"silicone='Jelly' is not in cad/materials.csv"):
        one(silicone="Jelly")


def test_a_configuration_of_another_camera_module_names_the_variable_that_chooses_it(tmp_path, monkeypatch):
    """It said to set the endcap up again, where the variable was forgotten in one shell."""
    config, path = LiveConfig((one(),)), tmp_path / "endcaps.toml"
    save_config(config, path)
    recording = about(config, [])
    monkeypatch.setenv("ENDCAP_CAMERA", "ELP-USBFHD01M-L170")
    for refused in (lambda: load_config(path), lambda: parsed(recording, path)):
        with pytest.raises(
            EndcapError, match=r"start with the module .* \(ENDCAP_CAMERA=NAME .*'released' without ENDC"
        ):
            refused()
    with pytest.raises(FileError, match=r"\(recorded with the camera module ELP-USBFHD01M-L180\)$"):
        parsed(recording, path)


def test_data_and_weights_of_another_camera_module_name_the_variable_that_chooses_it(begun, monkeypatch):
    """They said to write the set again, which takes hours, or to train, where one shell lacked the variable."""
    path = find_weights(PARAMS)
    monkeypatch.setenv("ENDCAP_CAMERA", "ELP-USBFHD01M-L170")
    for refused in (lambda: load_wrench_model(PARAMS, path), lambda: read_samples(begun)):
        with pytest.raises(FileError, match=r"focal_per_row=.*: start with the module that it was made with \(ENDCAP_"):
            refused()


def test_a_recording_of_a_silicone_that_is_not_here_is_not_called_damaged(tmp_path, monkeypatch):
    rows = dict(silicones())
    monkeypatch.setattr(materials, "silicones", lambda: rows)
    rows["Jelly"] = replace(rows["Ecoflex 00-30"], name="Jelly")
    recording = about(LiveConfig((one(silicone="Jelly"),)), [])
    assert parsed(recording, tmp_path).config.endcaps[0].silicone == "Jelly"
    rows["Jelly"] = replace(rows["Jelly"], density_g_cm3=1.3)
    with pytest.raises(FileError, match=r"recorded with Jelly of density_g_cm3=1\.07, .* has density_g_cm3=1\.3"):
        parsed(recording, tmp_path)
    kept = about(LiveConfig((one(silicone="Jelly", own_weight="kept"),)), [])
    del rows["Jelly"]
    for each in (recording, kept):
        with pytest.raises(FileError, match=r"silicone='Jelly' is not in cad/materials\.csv.* or add a row$"):
            parsed(each, tmp_path)


def test_kept_pictures_of_the_robot_are_not_used_for_another_pattern(other_dots):
    before = film._digest(film.RobotDesign())
    assert film._digest(film.RobotDesign()) == before
    other_dots()
    assert film._digest(film.RobotDesign()) != before
