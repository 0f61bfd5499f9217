"""From a folder of labelled frames to weights and a table, on pictures drawn and warped (no simulator)."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from live_stand_in import stand_in
from pictured_set import DOTS, write_set

from cad.errors import FileError, ParameterError
from cad.params import EndcapParams
from sensing.wrench.model import load_wrench_model

pytest.importorskip("torch")
pytest.importorskip("safetensors")

from sensing import evaluate, train
from sensing.learning.compliance import contact_axes, fit_compliance, turned_field
from sensing.learning.contenders import Views, frame_keys, held_out
from sensing.learning.marker_fields import PLAIN, MarkerSensor
from sensing.learning.samples import VIEWS, read_samples, shared_between
from sensing.learning.scores import score, table

pytestmark = pytest.mark.usefixtures("looked_for_once")


@pytest.fixture(scope="module")
def weights(folders, tmp_path_factory):
    out = tmp_path_factory.mktemp("weights") / "w.safetensors"
    assert train.main([str(folders[0]), "--out", str(out), "--method", "dots", "--epochs", "30"]) == 0
    return out


def test_train_then_evaluate(folders, weights, tmp_path, capsys):
    out, by_cell = tmp_path / "table.csv", tmp_path / "cells.csv"
    arguments = [str(folders[1]), "--weights", str(weights), "--train", str(folders[0]), "--csv", str(out)]
    arguments += ["--cells-csv", str(by_cell)]
    assert evaluate.main([*arguments, "--paper-epochs", "1"]) == 0
    said = capsys.readouterr().out
    for name in (
        "ours, test",
        "ridge, test",
        "physics inverse, test",
        "paper, test",
        "ours + filter, test",
        "predicted to now, test",
    ):
        assert name in said
    assert "RMSE of fz N, tilt" in said and "15 to 25 deg" in said
    found = list(csv.DictReader(by_cell.open()))
    assert sum(int(row["frames"]) for row in found) == 18
    assert {row["name"] for row in found} == {"ours, test", "ours, no camera file, test"}
    rows = {row["name"]: row for row in csv.DictReader(out.open())}
    assert float(rows["ours, test"]["rmse_fx_n"]) < 1.0 < float(rows["paper, test"]["rmse_fx_n"])
    assert float(rows["ours, test"]["rest_n"]) < 0.3


def test_a_plug_in_is_not_judged_on_frames_of_another_endcap(folders, tmp_path):
    """It was made for the first folder's, and answered for all."""
    other = write_set(tmp_path / "other", 1, 5, diameter=140.0)
    with pytest.raises(FileError, match="test frames for the design D140_T8"):
        evaluate.evaluate([folders[1], other], model=stand_in())


def test_the_filter_is_judged_with_the_answers_and_covariances_of_live(folders, monkeypatch):
    """It took the network's own, without what live adds for camera, noise and simulation; a plug-in's had no row."""
    plain = evaluate.evaluate([folders[1]], model=stand_in())[0]
    live_answers = evaluate.live_answers

    def wider(data, model, camera):
        found = live_answers(data, model, camera)
        return replace(found, covariance=1e6 * found.covariance)

    monkeypatch.setattr(evaluate, "live_answers", wider)
    wide = evaluate.evaluate([folders[1]], model=stand_in())[0]
    assert plain["ours + filter, test"].coverage < 0.9 and wide["ours + filter, test"].coverage == 1.0


def test_leaks_and_bad_input_are_refused_in_one_line(folders, weights, tmp_path, capsys):
    assert evaluate.main([str(folders[0]), "--weights", str(weights)]) == 2
    assert "shares 8 paths, poses or pictures with the training (path static-1-0)" in capsys.readouterr().err
    assert train.main([str(tmp_path), "--out", str(tmp_path / "w")]) == 2
    assert train.main([str(folders[0]), "--out", str(tmp_path / "none" / "w")]) == 2
    other = write_set(tmp_path / "other", 1, 5, diameter=140.0)
    assert train.main([str(folders[0]), str(other), "--method", "dots", "--out", str(tmp_path / "w")]) == 2
    assert "give folders of one design" in capsys.readouterr().err
    assert evaluate.main([str(other), "--weights", str(weights)]) == 2
    assert "weights of D130_T8, this endcap is D140_T8" in capsys.readouterr().err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["other"]


def test_contacts_of_other_kinds_are_of_this_endcap_and_count_as_seen(folders, tmp_path, capsys):
    other, out = write_set(tmp_path / "other", 1, 5, diameter=140.0), tmp_path / "w.safetensors"
    learn = [str(folders[0]), "--out", str(out), "--method", "dots", "--epochs", "1", "--others"]
    assert train.main([*learn, str(other)]) == 2
    assert "data for the design D140_T8" in capsys.readouterr().err and not out.exists()
    assert train.main([*learn, str(folders[1])]) == 0
    assert evaluate.main([str(folders[1]), "--weights", str(out)]) == 2
    assert "shares 3 paths, poses or pictures with the training (path static-2-0)" in capsys.readouterr().err


def test_nothing_to_train_on_is_refused(tmp_path, capsys):
    for arguments in (["--start", "default"], ["--intervals", str(tmp_path)], []):
        assert train.main([*arguments, "--out", str(tmp_path / "no")]) == 2
        assert "nothing to train on" in capsys.readouterr().err
    assert not (tmp_path / "no").exists()


@pytest.mark.parametrize("ignored", [["--others", "DATA"], ["--cells", "24"]])
def test_what_a_design_would_ignore_is_refused(ignored, capsys):
    assert train.main(["--design", "130", "8", "--dot-mm", "0.1", *ignored]) == 2
    assert f"--design with {ignored[0]}: its states come from the library" in capsys.readouterr().err


@pytest.mark.parametrize(
    "ignored", [["--silicone", "Dragon Skin 20"], ["--dot-mm", "3"], ["--unless-there"], ["--copy-to", "DIR"]]
)
def test_what_folders_would_ignore_is_refused(ignored, tmp_path, capsys):
    assert train.main([str(tmp_path), "--out", str(tmp_path / "w"), *ignored]) == 2
    assert f"folders with {ignored[0]}: it belongs to --design" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--start", "default", "--intervals", "DATA", "--others", "DATA"], "--intervals without DATA with --others"),
        (["--start", "default", "--intervals", "DATA", "--epochs", "3"], "--intervals without DATA with --epochs"),
        (["DATA", "--tilt-to", "50"], "no --intervals with --tilt-to"),
    ],
)
def test_what_nothing_reads_is_refused(words, said, tmp_path, capsys):
    assert train.main([*words, "--out", str(tmp_path / "w")]) == 2
    assert said in capsys.readouterr().err


def test_fine_tuning_keeps_the_size_of_the_network_and_records_it(folders, weights, tmp_path, capsys):
    """--hidden was dropped without a word, and the file stated the size that was asked for."""
    tune = [str(folders[1]), "--method", "dots", "--start", str(weights), "--epochs", "1", "--out", str(tmp_path / "w")]
    assert train.main([*tune, "--hidden", "32"]) == 2
    assert "hidden=32: weights that are fine-tuned keep their 64; leave it out" in capsys.readouterr().err
    assert train.main([*tune, "--components", "3"]) == 0
    tuned = load_wrench_model(path=tmp_path / "w")
    assert tuned.about["training"]["config"]["components"] == len(tuned.weights["principal"]) > 3


def test_scores_of_known_errors():
    truth = np.zeros((4, 6))
    truth[:2, 2] = -2.0
    reported = truth + np.array([0.1, 0, 0, 0, 0, 0.01])
    reported[3, 2] = 0.5
    covariance = np.tile(np.diag([0.01, 1, 1, 1, 1, 1e-6]), (4, 1, 1))
    covariance[2:] = 0.0  # without contact: not counted
    s = score(reported, truth, np.array([True, True, False, False]), covariance)
    assert s.rmse[0] == pytest.approx(0.1) and s.rmse[2] == pytest.approx(0.25) and s.mae[5] == pytest.approx(0.01)
    assert s.mixed_mse == pytest.approx((0.01 * 4 + 0.25 + 1e-4 * 4) / 24)
    assert s.precision == pytest.approx(2 / 3) and s.recall == 1.0 and s.rest_n == pytest.approx(np.hypot(0.1, 0.5))
    assert s.direction_deg == pytest.approx(np.degrees(np.arctan(0.05)))
    assert s.coverage == pytest.approx(5 / 6)
    assert "0.2500" in table({"a": s})
    with pytest.raises(ParameterError, match="never give them"):
        score(reported * np.nan, truth, np.ones(4, bool))


def test_turning_a_field_turns_place_and_direction():
    y, x = np.mgrid[-10:11, -10:11].astype(float)
    field = np.stack([np.exp(-((x - 5) ** 2 + y**2) / 8), 0 * x])
    reported = turned_field(field, 90.0)  # from +x to +y
    expected = np.stack([0 * x, np.exp(-(x**2 + (y - 5) ** 2) / 8)])
    assert np.abs(reported - expected).max() < 0.02


@pytest.mark.long
def test_physics_inverse_finds_place_and_force_of_a_made_up_compliance(folders):
    """Fields from an axisymmetric law at two tilts; the inverse is tried at other azimuths."""
    base = read_samples(folders[0])
    y, x = (np.mgrid[0:16, 0:16] + 0.5) / 8 - 1

    def made(tilt, azimuth, local):
        axes = contact_axes(tilt, azimuth)
        px, py = np.sin(np.radians(tilt)) * np.array([np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth))])
        near = np.exp(-4 * ((x - px) ** 2 + (y - py) ** 2))
        force = axes @ (local * [-1, 1, 1])
        field = 5 * local[0] * near * np.stack([x - px, y - py]) + near * force[:2, None, None]
        lever = axes[:, 0] * base.design.outer_radius_mm / 1000
        return field, np.concatenate([force, np.cross(lever, force)])

    rng = np.random.default_rng(0)
    places = [
        (tilt, rng.uniform(0, 360), rng.uniform(-1, 1, 3) * 3 + [8, 0, 0])
        for tilt in (10, 20, 30, 40)
        for _ in range(30)
    ]
    rows = [made(*place) for place in places]
    n = len(rows)
    samples = replace(
        base, fields=np.array([r[0] for r in rows], np.float32), valid=np.ones((n, 16, 16), bool),
        wrenches=np.array([r[1] for r in rows]), path=np.arange(n).astype(str), phase=np.full(n, "load"),
        time_s=np.zeros(n), contact=np.ones(n, bool), tilt_deg=np.array([p[0] for p in places], float),
        azimuth_deg=np.array([p[1] for p in places]), friction=np.ones(n),
    )  # fmt: skip
    fresh = [made(25.0, rng.uniform(0, 360), np.array([8.0, 2.0, -1.0])) for _ in range(20)]
    reported = fit_compliance(samples).predict(np.array([f.ravel() for f, _ in fresh]))
    error = reported - np.array([w for _, w in fresh])
    assert np.sqrt((error[:, :3] ** 2).mean()) < 0.8 and np.sqrt((error[:, 3:] ** 2).mean()) < 0.05


def test_marker_fields_follow_the_labels_and_stand_for_tracked_ones(folders):
    """Dots that all move alike give that motion everywhere; scatter makes views of one run differ."""
    design = EndcapParams(130, 8)
    plain = MarkerSensor(design, (16, 16), PLAIN, np.random.default_rng(0))
    moved = np.tile([0.0, 0.0, 0.4], (1, DOTS, 1))  # away from the camera: dots shrink toward the centre
    field = plain.fields(moved)[0]
    x = np.linspace(-1, 1, 16)
    assert np.polyfit(x, field[0, 8], 1)[0] < -0.1 and np.polyfit(x, field[1, :, 8], 1)[0] < -0.1
    assert np.abs(field + field[:, ::-1, ::-1]).max() < 0.03 and not plain.fields(0 * moved).any()
    tip = plain._pixels(plain.rest_mm[:1] + np.array([0.4, 0.0, 0.0])) - plain._pixels(plain.rest_mm[:1])
    shifted = plain.fields(np.tile([0.4, 0.0, 0.0], (1, DOTS, 1)))[0]
    assert shifted[0, 7:9, 7:9].mean() == pytest.approx(tip[0, 0] * 200 / 480, rel=0.05)
    marked, tracked = read_samples(folders[1], "markers"), read_samples(folders[1])
    assert len(marked) == VIEWS * len(tracked) and marked.method == "dots"
    assert set(frame_keys(marked)) == set(frame_keys(tracked))
    views = marked.fields[marked.path == marked.path[0]]
    assert np.abs(views[:4] - views[4:8]).max() > 0.01


def test_what_is_held_out_is_on_no_other_side(folders):
    views = Views(read_samples(folders[0]), markers=read_samples(folders[0], "markers"))
    for what in ("random", "path", "pose"):
        rest, held = held_out(views, what)
        assert not set(frame_keys(rest.markers)) & set(frame_keys(held.dots))
        assert len(rest.dots) + len(held.dots) == len(views.dots)
    assert set(held_out(views, "pose")[1].dots.tilt_deg) == {30.0}
    rest, held = held_out(views, "random")
    assert shared_between(rest.dots, held.dots)  # the paper's split leaks, and the detector says so
    assert not shared_between(*(part.dots for part in held_out(views, "path")))
    with pytest.raises(ParameterError, match="0 frames of 32 held out"):
        held_out(views, "friction")
    with pytest.raises(ParameterError, match="choose from random, path"):
        held_out(views, "sensor")


def test_holdouts_are_reported_for_every_model(folders, capsys):
    assert evaluate.main(["--train", str(folders[0]), "--holdout", "path", "--paper-epochs", "2"]) == 0
    said = capsys.readouterr().out
    assert all(f"{name}, leave out path" in said for name in ("ours", "ridge", "physics inverse", "paper"))
    assert evaluate.main(["--holdout", "path"]) == 2
    assert evaluate.main([]) == 2
