"""Files of weights whose description is damaged: one line that says so, whatever stands in it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from safetensors.numpy import save

from cad import materials
from cad.errors import FileError
from cad.identity import identity
from cad.materials import silicone, silicones
from cad.params import EndcapParams
from sensing.design.weights import DesignRequest, known_weights
from sensing.wrench import model as models
from sensing.wrench.model import load_wrench_model
from sensing.wrench.stiffness import shear_mpa_of
from sensing.wrench.weight_files import FORMAT, SHIPPED, find_weights, read_weights, weights_folder, weights_name

PARAMS = EndcapParams(130, 8)


def test_a_description_of_brackets_without_end_is_damaged(tmp_path):
    path = tmp_path / "w.safetensors"
    path.write_bytes(save({"a": np.zeros(1, np.float32)}, {"format": FORMAT, "about": "[" * 200_000}))
    with pytest.raises(FileError, match="damaged weights"):
        read_weights(path)


@pytest.mark.parametrize(
    "change",
    [
        {"shape": [float("inf"), 16]},
        {"shape": [16, 10**400]},
        {"design": {"diameter_mm": 10**400, "wall_mm": 8.0}},
        {"range": {"distance": 10**400}},
        {"design": []},
        {"range": [1]},
        {"range": {"distance": float("nan"), "rest_px": 1.0}},
        {"range": {"distance": 1.0, "rest_px": 1.0, "force_n": float("nan")}},
        {"range": {"distance": 1.0, "rest_px": 1.0, "tilt_deg": -1.0}},
        {"range": {"distance": 1.0, "rest_px": 1.0, "rest_px_per_n": float("inf")}},
        {"identity": [1]},
    ],
)
def test_a_number_or_list_that_cannot_be_is_damaged(monkeypatch, change):
    tensors, about = read_weights(SHIPPED / "default_D130_T8.safetensors")
    about = json.loads(json.dumps(about | change))
    monkeypatch.setattr(models, "read_weights", lambda path: (dict(tensors), about))
    with pytest.raises(FileError, match="w: damaged weights") as caught:
        load_wrench_model(PARAMS, "w")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("name", "factor"), [("calibration", 0), ("units", -1), ("range_cells", 0)])
def test_weights_that_could_never_doubt_an_answer_are_damaged(monkeypatch, name, factor):
    tensors, about = read_weights(SHIPPED / "default_D130_T8.safetensors")
    tensors[name] = (tensors[name] * factor).astype(tensors[name].dtype)
    monkeypatch.setattr(models, "read_weights", lambda path: (dict(tensors), about))
    with pytest.raises(FileError, match=f"w: damaged weights .*{name}"):
        load_wrench_model(PARAMS, "w")


@pytest.mark.parametrize("known", [False, True])
def test_numbers_of_a_type_that_numpy_does_not_have_are_damaged(tmp_path, known):
    if known:
        pytest.importorskip("ml_dtypes")  # adds the type to numpy
    data, path = (SHIPPED / "default_D130_T8.safetensors").read_bytes(), tmp_path / "w.safetensors"
    length = int.from_bytes(data[:8], "little")
    head = json.loads(data[8 : 8 + length])
    begin, end = head["units"]["data_offsets"]
    head["units"] = {"dtype": "BF16", "shape": [(end - begin) // 2], "data_offsets": [begin, end]}
    changed = json.dumps(head).encode()
    path.write_bytes(len(changed).to_bytes(8, "little") + changed + data[8 + length :])
    with pytest.raises(FileError, match=r"damaged weights .*bfloat16"):
        read_weights(path)


def test_silicones_whose_names_a_file_cannot_spell_have_weights_of_their_own():
    names = ["Силикон А", "Силикон Б", "Köraform 42 A", "Küraform 42 A"]
    assert len({weights_name(PARAMS, name) for name in names}) == len(names)
    assert weights_name(PARAMS, "Dragon Skin 30") == "D130_T8_Dragon-Skin-30.safetensors"


def test_the_shear_modulus_is_that_of_the_silicone_that_was_learned_on():
    model = load_wrench_model(PARAMS)
    soft = replace(model, identity=identity(model.design, "Ecoflex 00-30"))
    assert shear_mpa_of(soft) == pytest.approx(silicone("Ecoflex 00-30").neo_hooke().shear_mpa)
    assert shear_mpa_of(soft) < shear_mpa_of(model) == shear_mpa_of(object()) == silicone().neo_hooke().shear_mpa


@pytest.fixture
def measured(tmp_path, monkeypatch):
    """A user has measured Smooth-Sil 950 and changed its row; the folder of weights is empty."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    rows = dict(silicones())
    rows["Smooth-Sil 950"] = replace(rows["Smooth-Sil 950"], neo_hooke_c10_mpa=0.3)
    monkeypatch.setattr(materials, "silicones", lambda: rows)
    weights_folder().mkdir(parents=True)
    return weights_folder() / weights_name(PARAMS)


def test_weights_of_a_silicone_that_was_measured_since_are_made_anew(measured, caplog):
    """`make endcap` took them for there and copied them, and live refused them."""
    assert find_weights(PARAMS).name == "default_D130_T8.safetensors"  # whose refusal names what has changed
    with pytest.raises(FileError, match=r"c10_mpa=0\.34, here 0\.3"):
        load_wrench_model(PARAMS)
    with caplog.at_level("INFO"):
        assert known_weights(DesignRequest(PARAMS)) is None
    assert "default_D130_T8.safetensors: damaged, or made with other numbers" in caplog.text


def test_weights_of_ones_own_are_taken_where_those_that_ship_are_of_other_numbers(measured):
    """The command that live's refusal names wrote a file that live then did not look at."""
    shipped = load_wrench_model(None, SHIPPED / "default_D130_T8.safetensors")
    replace(shipped, identity=identity(PARAMS, "Smooth-Sil 950")).save(measured)
    assert find_weights(PARAMS) == known_weights(DesignRequest(PARAMS)) == measured
    assert load_wrench_model(PARAMS).identity.aspects["silicone"]["c10_mpa"] == 0.3


def test_what_ships_comes_first_where_both_fit(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    weights_folder().mkdir(parents=True)
    load_wrench_model(PARAMS).save(weights_folder() / weights_name(PARAMS))
    assert find_weights(PARAMS).parent == SHIPPED
    (weights_folder() / weights_name(PARAMS)).write_bytes(b"damaged")
    assert find_weights(PARAMS).parent == SHIPPED
