"""Weights read the fields that they were trained with: live, evaluation and training took those of the dots instead."""

from dataclasses import replace

import pytest

pytest.importorskip("torch")
pytest.importorskip("safetensors")

from cad.errors import FileError
from cad.params import EndcapParams
from sensing import evaluate, train
from sensing.evaluation import intervals
from sensing.live.core.model import load_model
from sensing.records_labelled import LabelledSet
from sensing.wrench.model import load_wrench_model

PARAMS = EndcapParams(130, 8)
pytestmark = pytest.mark.usefixtures("looked_for_once")


class AskedError(Exception):
    """Names the method whose fields were asked for."""


@pytest.fixture
def weights(tmp_path):
    """A function that gives a file of weights for fields of a method."""

    def write(method):
        path = tmp_path / f"{method}.safetensors"
        replace(load_wrench_model(PARAMS), method=method).save(path)
        return path

    return write


def asked(data, model, camera):
    raise AskedError(model.method)


def test_live_takes_the_method_of_the_weights_unless_another_is_asked_for(weights):
    path = weights("farneback")
    assert load_model("default", PARAMS).method == "dots"
    assert load_model("default", PARAMS, path).method == "farneback"
    assert load_model("default", PARAMS, path, "dots").method == "dots"


def test_weights_for_a_plug_ins_fields_are_refused_where_it_is_not_installed(weights):
    with pytest.raises(
        FileError, match=r"absent\.safetensors: weights for fields of absent, which no plug-in here adds"
    ):
        load_model("default", PARAMS, weights("absent"))


def test_evaluation_and_intervals_take_it_too(weights, folders, monkeypatch):
    path = weights("farneback")
    for module in (evaluate, intervals):
        monkeypatch.setattr(module, "live_answers", asked)
    with pytest.raises(AskedError, match="farneback"):
        evaluate.evaluate([folders[1]], path)
    with pytest.raises(AskedError, match="farneback"):
        intervals._judged(load_wrench_model(PARAMS, path), LabelledSet(folders[1]))


def test_weights_are_fine_tuned_on_fields_of_their_own_method(weights, folders, tmp_path, capsys):
    words = [str(folders[0]), "--method", "dots", "--epochs", "1", "--out", str(tmp_path / "w.safetensors")]
    assert train.main([*words, "--start", str(weights("farneback"))]) == 2
    assert (
        "fields of farneback, the data are D130_T8 (16, 16), fields of dots: give weights of the same"
        in capsys.readouterr().err
    )
