"""A training by similarity that was stopped goes on: nothing is made twice, and the weights are those of one run."""

from dataclasses import replace

import numpy as np
import pytest

from cad.params import EndcapParams
from cad.whole_file import hold_lock
from sensing import train
from sensing.design import unfinished as kept
from sensing.design import weights as made
from sensing.design.weights import DesignRequest, design_weights, saved_weights
from sensing.learning.fit_config import FitConfig

QUICK = DesignRequest(EndcapParams(172, 12.5), azimuths=1, pictures=False, numbers=(0, 4, 8, 9, 13, 17))
CONFIG = FitConfig(components=20, hidden=8, epochs=2)


def _stop_at(stage):
    def say(text):
        if text.startswith(stage):
            raise KeyboardInterrupt

    return say


def _shards(folder):
    return {path.name: path.stat().st_mtime_ns for path in (folder / "states" / "shards").glob("*.npz")}


def test_a_stopped_training_goes_on_to_the_same_weights(tmp_path, monkeypatch):
    out = tmp_path / "w.safetensors"
    folder = tmp_path / ".w.safetensors.unfinished"
    whole, asked = made.library_source, []

    def stopping(simulator):
        source = whole(simulator)

        def states(path):
            asked.append(path.number)
            if len(asked) == 4:
                raise KeyboardInterrupt
            return source(path)

        return states

    monkeypatch.setattr(made, "library_source", stopping)
    with pytest.raises(KeyboardInterrupt):
        saved_weights(out, QUICK, CONFIG, _stop_at("nowhere"))
    first = _shards(folder)
    assert len(first) == 3 and not out.exists()
    with pytest.raises(KeyboardInterrupt):
        saved_weights(out, QUICK, CONFIG, _stop_at("training"))
    assert asked == [0, 4, 8, 9, 9, 13, 17]  # none is made twice but the one that was stopped
    assert _shards(folder).items() > first.items()
    model = saved_weights(out, QUICK, CONFIG, _stop_at("nowhere"))
    assert len(asked) == 7 and [path.name for path in tmp_path.iterdir()] == [out.name]
    single = design_weights(QUICK, CONFIG)
    assert all(np.array_equal(model.weights[name], value) for name, value in single.weights.items())
    assert model.about == single.about


@pytest.mark.parametrize("change", ["silicone", "code"])
def test_what_another_request_or_version_left_is_removed(change, tmp_path, monkeypatch):
    out = tmp_path / "w.safetensors"
    for key in ("one", "one" if change == "code" else "another"):
        with pytest.raises(KeyboardInterrupt), kept.unfinished(out, key) as folder:
            left = folder / "states" / "shards"
            assert not left.exists()
            left.mkdir(parents=True)
            raise KeyboardInterrupt
        assert left.exists()
        if change == "code":
            monkeypatch.setattr(kept, "code_digest", lambda _: "of another version")
    assert repr(QUICK) != repr(replace(QUICK, silicone="Dragon Skin 20"))


def test_two_trainings_of_the_same_weights_do_not_share_a_folder(tmp_path):
    out = tmp_path / "w.safetensors"
    with kept.unfinished(out, "key") as first:
        with kept.unfinished(out, "key") as second:
            assert second != first and second.is_dir()
        assert first.is_dir() and not second.exists()
        with pytest.raises(BlockingIOError):
            hold_lock(first / ".lock")
    assert not first.exists()


def test_the_command_says_that_it_goes_on(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(made, "design_weights", lambda *words, **more: _stop_at("")(""))
    assert train.main(["--design", "172", "12.5", "--out", str(tmp_path / "w.safetensors")]) == 130
    assert "stopped; the same command goes on from here" in capsys.readouterr().err
