"""No result of a training or an evaluation is lost or replaced: by a later row, a full disk, or a late refusal."""

import csv

import pytest
from pictured_set import write_set

pytest.importorskip("torch")
pytest.importorskip("safetensors")

from sensing import evaluate, train
from sensing.learning import fitting
from sensing.wrench.model import WrenchModel

pytestmark = pytest.mark.usefixtures("looked_for_once")


@pytest.fixture(scope="module")
def weights(folders, tmp_path_factory):
    out = tmp_path_factory.mktemp("weights") / "w.safetensors"
    assert train.main([str(folders[0]), "--out", str(out), "--method", "dots", "--epochs", "1"]) == 0
    return out


def test_test_folders_of_one_name_keep_their_rows(weights, tmp_path, capsys, monkeypatch):
    """Sets by sensor often end alike (sensor71/test, sensor72/test): the later one replaced the earlier, silently."""
    for name, seed in (("a", 7), ("b", 8)):
        write_set(tmp_path / name / "test", 1, seed)
    out, by_cell = tmp_path / "e.csv", tmp_path / "c.csv"
    monkeypatch.chdir(tmp_path / "b" / "test")
    ours = ["--weights", str(weights), "--csv", str(out), "--cells-csv", str(by_cell)]
    assert evaluate.main([str(tmp_path / "a" / "test"), ".", *ours]) == 0
    names = {row["name"] for file in (out, by_cell) for row in csv.DictReader(file.open())}
    assert {"ours, a/test", "ours, b/test"} <= names
    assert evaluate.main([".", str(tmp_path / "b" / "test"), *ours]) == 2
    assert "test=. is given twice" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["--train", "D", "--holdout", "path", "--cells-csv", "c.csv"], "no test folders with --cells-csv"),
        (["--train", "D", "--holdout", "path", "--weights", "w"], "no test folders with --weights"),
        (["T", "--seed", "3"], "no --holdout with --seed"),
        (["T", "--paper-epochs", "3"], "no --train with --paper-epochs"),
        (["D", "--csv", "c.csv", "--cells-csv", "./c.csv"], "--csv and --cells-csv are both c.csv"),
    ],
)
def test_what_evaluate_would_ignore_or_overwrite_is_refused(given, said, capsys):
    assert evaluate.main(given) == 2
    assert said in capsys.readouterr().err


def test_a_training_whose_last_steps_fail_is_not_lost(folders, tmp_path, capsys, monkeypatch):
    """A full disk, bad interval data or Ctrl-C after the fit cost all of it, and the message promised otherwise."""
    out, epochs, save = tmp_path / "w.safetensors", [], WrenchModel.save
    learn = [str(folders[0]), "--out", str(out), "--method", "dots", "--epochs", "3"]
    with monkeypatch.context() as untrained:
        untrained.setattr(fitting, "fit", lambda *_, **__: pytest.fail("trained before the refusal"))
        assert train.main([*learn, "--intervals", str(folders[1])]) == 2
        assert "3 loading paths to calibrate intervals on" in capsys.readouterr().err
        assert train.main([*learn, "--intervals", str(folders[0])]) == 2
        assert "path static-1-0 of the interval data is one of training" in capsys.readouterr().err
    descend = fitting._descend
    monkeypatch.setattr(fitting, "_descend", lambda *given: descend(*given[:6], lambda *_: epochs.append(1), given[7]))

    def stopped(model, path):
        raise KeyboardInterrupt

    monkeypatch.setattr(WrenchModel, "save", stopped)
    assert train.main(learn) == 130 and "goes on from here" in capsys.readouterr().err
    spent = len(epochs)
    monkeypatch.setattr(WrenchModel, "save", save)
    assert train.main(learn) == 0 and spent == len(epochs) == 4
    assert [path.name for path in tmp_path.iterdir()] == [out.name]
