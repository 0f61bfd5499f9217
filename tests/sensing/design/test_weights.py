"""Weights by similarity: another silicone is another scale, files lie where live finds them, mixtures are refused."""

from __future__ import annotations

import shlex
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cad.design_arguments import design_of
from cad.errors import FileError, ParameterError
from cad.materials import silicone
from cad.params import EndcapParams
from cad.pattern import parse_rings
from sensing import train
from sensing.design.weights import DesignRequest, design_weights
from sensing.learning.fit_config import FitConfig
from sensing.live import cli
from sensing.live.core.endcap_config import EndcapConfig, dots_of
from sensing.live.core.model import known_weights, load_model
from sensing.wrench.model import WrenchModel, load_wrench_model
from sensing.wrench.weight_files import command_for, find_weights, weights_folder, weights_name

DESIGN = EndcapParams(150, 12)
QUICK = DesignRequest(DESIGN, azimuths=1, pictures=False, numbers=(0, 4, 8, 9, 13, 17))
CONFIG = FitConfig(components=20, hidden=8, epochs=2)


@pytest.fixture(scope="module")
def model() -> WrenchModel:
    return design_weights(QUICK, CONFIG)


@pytest.fixture(scope="module")
def models(model) -> tuple[WrenchModel, WrenchModel]:
    return model, design_weights(replace(QUICK, silicone="Dragon Skin 20"), CONFIG)


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    return tmp_path


@pytest.mark.long
def test_another_silicone_is_the_same_network_at_another_scale(models):
    first, second = models
    ratio = silicone("Dragon Skin 20").neo_hooke().shear_mpa / silicone().neo_hooke().shear_mpa
    fields = np.random.default_rng(0).normal(size=(5, 2 * 16 * 16))
    (a, spread_a), (b, spread_b) = first.predict(fields), second.predict(fields)
    assert b == pytest.approx(ratio * a, rel=1e-3, abs=1e-6 * np.abs(a).max())
    assert spread_b == pytest.approx(ratio**2 * spread_a, rel=1e-2)
    assert first.about["range_n"] == pytest.approx(35 * (12 / 8) ** 2)


def test_what_training_covered_is_in_the_designs_own_loads(model):
    """The paths press to 1.15 times the range, with friction on top, at 39 degrees at most."""
    assert 1.0 < model.range.force_n / model.about["range_n"] < 1.7 and 40.0 < model.range.tilt_deg < 48.0


@pytest.mark.long
def test_what_training_covered_is_at_the_scale_of_another_silicone(models):
    first, second = models
    range_n = first.about["range_n"]
    ratio = second.about["range_n"] / range_n
    assert second.range.force_n == pytest.approx(ratio * first.range.force_n, rel=1e-3)
    assert second.range.rest_px_per_n == pytest.approx(first.range.rest_px_per_n / ratio, rel=1e-2)
    assert second.range.tilt_deg == pytest.approx(first.range.tilt_deg, rel=1e-3)


def test_even_these_few_states_give_an_error_of_percents(model):
    force = np.array(model.about["metrics"]["validation_rmse"][:3])
    assert (force < 0.05 * model.about["range_n"]).all()


@pytest.mark.long
def test_weights_lie_where_live_finds_them_and_those_of_another_endcap_do_not(models, home):
    assert find_weights(DESIGN) is None
    weights_folder().mkdir(parents=True)
    path = weights_folder() / weights_name(DESIGN, "Dragon Skin 20")
    models[1].save(path)
    assert path.is_relative_to(home)
    assert find_weights(DESIGN) is None and find_weights(DESIGN, "Dragon Skin 20") == path
    assert known_weights("paper", DESIGN, "Dragon Skin 20") is None
    assert load_model("default", DESIGN, silicone="Dragon Skin 20").shape == (16, 16)
    with pytest.raises(FileError, match=r"no weights for D150_T12 in Smooth-Sil 950: .*--design 150 12; "):
        load_wrench_model(DESIGN)
    with pytest.raises(FileError, match="weights of D150_T12, this endcap is D130_T8"):
        load_wrench_model(EndcapParams(130, 8), path)
    with pytest.raises(FileError, match="silicone"):
        load_wrench_model(DESIGN, path)


@pytest.mark.long
def test_other_dots_have_weights_of_their_own(home):
    own = EndcapParams(150, 12, (1, 6, 10, 12, 16, 18, 20, 22), 3.5)
    model = design_weights(replace(QUICK, params=own), CONFIG)
    path = weights_folder() / weights_name(own)
    path.parent.mkdir(parents=True)
    model.save(path)
    assert find_weights(own) == path and find_weights(DESIGN) is None
    assert load_wrench_model(own).design == own
    with pytest.raises(FileError, match=r"D150_T12_dots.*this endcap is D150_T12"):
        load_wrench_model(DESIGN, path)
    endcap = EndcapConfig("endcap_0", "0", None, 150, 12, **dots_of(own))
    assert endcap.params == own and endcap.dots == "1-6-10-12-16-18-20-22"
    with pytest.raises(ParameterError, match="dots need 6"):
        EndcapConfig("endcap_0", "0", None, 150, 12, dots="1-6-200")


def test_what_ships_is_found_first(home):
    shipped = find_weights(EndcapParams(130, 8))
    assert shipped is not None and shipped.name == "default_D130_T8.safetensors"


def test_the_simulated_robot_without_weights_names_their_command(home, capsys):
    assert cli.main(["--diameter", "180", "--wall", "10", "--no-page"]) == 2
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1 and command_for(EndcapParams(180, 10)) in said


def test_the_command_that_makes_weights_runs_as_it_stands(monkeypatch, tmp_path):
    own = EndcapParams(150, 12, parse_rings("1-6-10-12-16"), 3.5)
    python, *words = shlex.split(command_for(own, "Dragon Skin 30"))
    assert Path.cwd() / shutil.which(python) == Path(sys.executable) and words[:2] == ["-m", "sensing.train"]
    options = train._parser().parse_args(words[2:])
    options.diameter, options.wall = options.design
    assert design_of(options) == own and options.silicone == "Dragon Skin 30"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "nothing to train on"),
        (["--design", "180", "40"], "nearest valid choice"),
        (["--design", "180", "10", "--silicone", "Jelly"], "choose one of"),
        (["somewhere", "--design", "180", "10"], "one or the other"),
        (["--design", "180", "10", "--out", "/nowhere/w.safetensors"], "its folder is not there"),
        (["somewhere"], "--out is missing"),
    ],
)
def test_bad_words_are_one_line(words, said, capsys, home):
    assert train.main(words) == 2
    found = capsys.readouterr().err
    assert said in found and len(found.splitlines()) == 1
