"""Which weights an endcap of another silicone is weighed with, and which it runs with once it is."""

from dataclasses import replace

import pytest

from cad.errors import FileError
from cad.identity import identity
from cad.materials import DEFAULT_SILICONE
from cad.params import EndcapParams
from sensing import dwell
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.endcaps_file import save_config
from sensing.live.core.model import weights_in_use
from sensing.live.open_endcaps import configured_models
from sensing.wrench.model import load_wrench_model
from sensing.wrench.stiffness import weights_digest
from sensing.wrench.weight_files import weights_folder, weights_name

PARAMS, SOFT = EndcapParams(164.0, 9.0), "Ecoflex 00-30"
ENDCAP = EndcapConfig("endcap_0", "0", diameter_mm=164.0, wall_mm=9.0, silicone=SOFT)


@pytest.fixture
def make(tmp_path, monkeypatch):
    """Writes weights of a silicone where live finds them; returns their digest."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    shipped = load_wrench_model(EndcapParams(130.0, 8.0))

    def write(silicone: str, factor: float) -> str:
        tensors = shipped.weights | {"units": shipped.weights["units"] * type(shipped.weights["units"][0])(factor)}
        model = replace(shipped, design=PARAMS, identity=identity(PARAMS, silicone), weights=tensors)
        path = weights_folder() / weights_name(PARAMS, silicone)
        path.parent.mkdir(parents=True, exist_ok=True)
        model.save(path)
        return weights_digest(model)

    return write


def weighing(endcap: EndcapConfig = ENDCAP):
    return configured_models(LiveConfig((endcap,)), any_silicone=True)(endcap)


def test_an_endcap_is_weighed_with_the_weights_of_its_own_silicone(make):
    digest = make(SOFT, 0.04)
    assert weights_digest(weighing().estimator) == digest
    weighed = replace(ENDCAP, gain=1.02, gain_sd=0.01, gain_weights=digest)
    assert weights_digest(configured_models(LiveConfig((weighed,)))(weighed).estimator) == digest


def test_a_weighed_endcap_keeps_the_weights_that_it_was_weighed_with(make):
    """Weights that are made later, for this silicone or the other one, are not those of its gain."""
    usual, own = make(DEFAULT_SILICONE, 1.0), make(SOFT, 0.04)
    for digest, cast_of in ((usual, DEFAULT_SILICONE), (own, SOFT)):
        weighed = replace(ENDCAP, gain=0.9, gain_sd=0.01, gain_weights=digest)
        config = LiveConfig((weighed,))
        assert weights_in_use(config, weighed).name == weights_name(PARAMS, cast_of)
        assert weights_digest(configured_models(config)(weighed).estimator) == digest
    assert weights_digest(weighing().estimator) == own


def test_weights_of_its_own_silicone_that_were_trained_anew_stay_its_own(make):
    """The gain was of weights that are gone, and those of another silicone answered: 25 times too much."""
    _, before = make(DEFAULT_SILICONE, 1.0), make(SOFT, 0.04)
    make(SOFT, 0.05)
    weighed = replace(ENDCAP, gain=1.02, gain_sd=0.01, gain_weights=before)
    assert weights_in_use(LiveConfig((weighed,)), weighed).name == weights_name(PARAMS, SOFT)


def test_a_dwell_test_of_a_weighed_endcap_is_read_with_the_weights_of_its_gain(make, monkeypatch, tmp_path):
    """Weights of its own silicone that were made later gave half of the weight that stood on the dome."""
    usual, own = make(DEFAULT_SILICONE, 1.0), make(SOFT, 0.04)
    used = []
    monkeypatch.setattr(dwell, "film_readings", lambda _, __, model: used.append(weights_digest(model.estimator)) or ())
    monkeypatch.setattr(dwell, "warm_up", lambda _: None)
    for endcap, digest in (
        (ENDCAP, own), (replace(ENDCAP, gain=0.04, gain_sd=0.001, gain_weights=usual), usual),
        (replace(ENDCAP, gain=0.9, gain_sd=0.01, gain_weights=own), own),
    ):  # fmt: skip
        save_config(LiveConfig((endcap,)), path := tmp_path / "e.toml")
        assert dwell.main(["--config", str(path), "--source", "dwell.mcap"]) == 2 and used.pop() == digest


def test_without_weights_the_command_for_its_own_silicone_is_named(make):
    with pytest.raises(FileError, match=f"no weights for D164_T9 in {SOFT}.*--silicone"):
        weighing()
