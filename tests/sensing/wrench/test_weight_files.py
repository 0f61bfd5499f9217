"""Files of weights whose description is damaged: one line that says so, whatever stands in it."""

import json

import numpy as np
import pytest
from safetensors.numpy import save

from cad.errors import FileError
from cad.params import EndcapParams
from sensing.wrench import model as models
from sensing.wrench.model import load_wrench_model
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


def test_silicones_whose_names_a_file_cannot_spell_have_weights_of_their_own():
    names = ["Силикон А", "Силикон Б", "Köraform 42 A", "Küraform 42 A"]
    assert len({weights_name(PARAMS, name) for name in names}) == len(names)
    assert weights_name(PARAMS, "Dragon Skin 30") == "D130_T8_Dragon-Skin-30.safetensors"
