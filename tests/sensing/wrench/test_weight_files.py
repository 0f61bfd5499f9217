"""Files of weights whose description is damaged: one line that says so, whatever stands in it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from safetensors.numpy import save

from cad.errors import FileError
from cad.identity import identity
from cad.materials import silicone
from cad.params import EndcapParams
from sensing.wrench import model as models
from sensing.wrench.model import load_wrench_model
from sensing.wrench.stiffness import shear_mpa_of
from sensing.wrench.weight_files import FORMAT, SHIPPED, read_weights, weights_name

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
