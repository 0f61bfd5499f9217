"""Network and weights: exact zero, calibration, refusals, and what is no number."""

import json
from dataclasses import replace

import numpy as np
import pytest
from made_samples import PARAMS, SIDE, bump_fields, made_samples

from cad.errors import FileError
from cad.params import EndcapParams
from sensing.records import ShearField

torch = pytest.importorskip("torch")
pytest.importorskip("safetensors")

from sensing.learning.fit_config import FitConfig  # noqa: E402
from sensing.learning.fitting import fit  # noqa: E402
from sensing.wrench.kernels import estimate_one  # noqa: E402
from sensing.wrench.model import load_wrench_model  # noqa: E402
from sensing.wrench.range import contact_angle_deg, range_measures  # noqa: E402
from sensing.wrench.weight_files import SHIPPED  # noqa: E402

QUICK = FitConfig(components=12, hidden=24, doubting=24, epochs=28, batch=96, rate=1e-2, decay=1e-3)


@pytest.fixture(scope="module")
def data():
    return made_samples()


@pytest.fixture(scope="module")
def model(data):
    return fit(data, QUICK)


def test_network_beats_its_linear_part_on_new_paths(model):
    fresh = made_samples(seed=5)
    value, _ = model.predict(fresh.inputs)
    linear = fresh.inputs @ model.weights["linear"].astype(float).T
    ours, plain = (np.sqrt(((v - fresh.wrenches) ** 2).mean(axis=0)) for v in (value, linear))
    assert ours[2] < 0.8 * plain[2] and (ours < 1.1 * plain).all()  # the law bends along z only


def test_zero_shear_gives_exactly_zero(model):
    wrench = model.estimate(ShearField(0.0, np.zeros((2, SIDE, SIDE), np.float32)))
    assert not wrench.force_n.any() and not wrench.torque_nm.any() and not wrench.flags
    masked = ShearField(0.0, np.full((2, SIDE, SIDE), 9, np.float32), valid=np.zeros((SIDE, SIDE), bool))
    reported = model.estimate(masked)
    assert (
        not reported.force_n.any()
        and reported.flags == {"dots_lost", "missing"}
        and np.isnan(reported.covariance).all()
    )


def test_interval_covers_new_paths_of_the_same_kind(model):
    fresh = made_samples(paths=60, seed=8)
    value, covariance = model.predict(fresh.inputs)
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    inside = (np.abs(value - fresh.wrenches) <= 1.96 * sigma).mean()
    assert 0.85 < inside <= 1.0  # four paths calibrate it: coarse
    assert (np.linalg.eigvalsh(covariance) > 0).all()
    narrow = (np.abs(value - fresh.wrenches) <= 0.2 * 1.96 * sigma).mean()
    assert narrow < 0.85  # the interval is not wide for nothing


def test_strange_fields_are_flagged_and_known_ones_are_not(model, data):
    assert model.out_of_range(data.inputs).mean() < 0.01
    rng = np.random.default_rng(0)
    assert model.out_of_range(data.inputs[11::12] * 8).all()
    assert model.out_of_range(rng.normal(size=(20, 72)) * 2).all()


def test_cells_that_do_not_count_do_not_stand_in_for_lost_dots(model, data):
    """Under half of the cells that count are seen; with the corners, where no dot is, it is more than half."""
    valid = ~model.range.cells
    inner = np.flatnonzero(model.range.cells)
    valid.flat[inner[: int(0.48 * len(inner))]] = True
    assert valid.sum() > 0.5 * len(inner)
    assert "dots_lost" in model.estimate(ShearField(0.0, data.fields[0], valid=valid)).flags
    valid.flat[inner[: int(0.52 * len(inner))]] = True
    assert "dots_lost" not in model.estimate(ShearField(0.0, data.fields[0], valid=valid)).flags


def test_one_field_alone_gives_what_it_gives_among_others(model, data):
    value, covariance = model.predict(data.inputs)
    distance, rest = range_measures(
        model._doubles["principal"], model._patterns, data.inputs * np.tile(model.range.cells.ravel(), 2)
    )
    for k in range(0, len(data), 17):
        wrench = model.estimate(ShearField(0.0, data.fields[k]))
        assert np.allclose(np.concatenate([wrench.force_n, wrench.torque_nm]), value[k], rtol=1e-9, atol=1e-9)
        assert np.allclose(wrench.covariance, covariance[k], rtol=1e-9)
        reported = estimate_one(data.inputs[k].astype(float), *model._packed)
        assert reported[2:] == pytest.approx((distance[k], rest[k]), rel=1e-6)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e30, 1e5, 1.0, -3.0])
def test_no_nan_ever_leaves(model, value):
    wrench = model.estimate(ShearField(0.0, np.full((2, SIDE, SIDE), value, np.float32)))
    assert np.isfinite(wrench.force_n).all() and np.isfinite(wrench.torque_nm).all()
    if not np.isfinite(value) or value > 1e3:
        assert wrench.flags & {"out_of_range", "missing"}
    if "missing" not in wrench.flags:
        assert (np.linalg.eigvalsh(wrench.covariance) > 0).all()


def test_weights_round_trip_and_carry_design_provenance_and_metrics(model, data, tmp_path):
    model.save(tmp_path / "w.safetensors")
    back = load_wrench_model(PARAMS, tmp_path / "w.safetensors")
    for a, b in zip(model.predict(data.inputs), back.predict(data.inputs), strict=True):
        assert np.array_equal(a, b)
    assert back.about["digest"] == PARAMS.digest and len(back.about["training"]["paths"]) == 24
    assert len(back.about["metrics"]["validation_rmse"]) == 6
    assert [p.name for p in tmp_path.iterdir()] == ["w.safetensors"]


def test_weights_of_another_design_or_damaged_are_refused(model, tmp_path):
    path = tmp_path / "w.safetensors"
    model.save(path)
    with pytest.raises(FileError, match=r"weights of D130_T8, this endcap is D140_T8"):
        load_wrench_model(EndcapParams(140, 8), path)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(FileError, match="damaged"):
        load_wrench_model(path=path)
    path.write_bytes(data.replace(PARAMS.digest.encode(), b"0" * 64))
    with pytest.raises(FileError, match="digest"):
        load_wrench_model(path=path)
    from safetensors.torch import save_file

    save_file({"a": torch.zeros(1)}, path)
    with pytest.raises(FileError, match="no weights of this toolkit"):
        load_wrench_model(path=path)
    with pytest.raises(FileError, match="cannot read"):
        load_wrench_model(path=tmp_path / "none")


def test_a_checkpoint_of_torch_is_named_as_such(tmp_path):
    for name, new in (("new.pth", True), ("old.pth", False)):
        path = tmp_path / name
        torch.save({"fc_out.weight": torch.zeros(6, 64)}, path, _use_new_zipfile_serialization=new)
        with pytest.raises(FileError, match=r"a checkpoint of PyTorch.*takes it with --model paper") as caught:
            load_wrench_model(path=path)
        assert "\n" not in str(caught.value)
    path.write_bytes(b"nothing of the kind")
    with pytest.raises(FileError, match="damaged weights"):
        load_wrench_model(path=path)


def test_contact_angle_is_that_of_the_place_and_is_flagged_beyond_training(model):
    radius, rng = PARAMS.outer_radius_mm, np.random.default_rng(0)
    for tilt in (0.0, 20.0, 60.0, 90.0):
        turn, at = rng.uniform(0, 2 * np.pi), np.radians(tilt)
        out = np.array([np.sin(at) * np.cos(turn), np.sin(at) * np.sin(turn), np.cos(at)])
        force = -20 * out + 4 * np.cross(out, rng.standard_normal(3))  # friction, too
        wrench = np.concatenate([force, np.cross(radius * out, force) / 1000])
        assert contact_angle_deg(wrench[None], radius)[0] == pytest.approx(tilt, abs=1e-4)
        assert contact_angle_deg(wrench[None] / 100, radius)[0] == 0.0
    field = bump_fields(np.array([[3.0, 0, -12, 0, 0, 0]]))[0].astype(np.float32)
    seen = contact_angle_deg(model.predict(field.reshape(1, -1).astype(float))[0], radius)[0]
    for limit, flagged in ((seen - 1, True), (seen + 1, False)):
        only = replace(model, range=replace(model.range, distance=1e9, rest_px=1e9, force_n=1e9, tilt_deg=limit))
        assert ("out_of_range" in only.estimate(ShearField(0.0, field)).flags) == flagged


def test_a_force_beyond_those_of_training_is_flagged(model, data, tmp_path):
    strongest = np.linalg.norm(data.wrenches[:, :3], axis=1).max()
    assert 0.8 * strongest < model.range.force_n <= 1.05 * strongest
    wrench = data.wrenches[np.argmax(np.linalg.norm(data.wrenches[:, :3], axis=1))][None]
    for size, flagged in ((0.9, False), (1.15, True)):
        fields = bump_fields(wrench * size * model.range.force_n / np.linalg.norm(wrench[0, :3]))
        one = model.estimate(ShearField(0.0, fields[0].astype(np.float32)))
        alone = replace(model, range=replace(model.range, distance=1e9, rest_px=1e9, tilt_deg=180.0))
        assert ("out_of_range" in alone.estimate(ShearField(0.0, fields[0].astype(np.float32))).flags) == flagged
        assert np.linalg.norm(one.force_n) == pytest.approx(size * model.range.force_n, rel=0.1)
        assert alone.out_of_range(fields.reshape(1, -1).astype(float))[0] == flagged
    model.save(tmp_path / "w")
    assert load_wrench_model(path=tmp_path / "w").range.force_n == model.range.force_n
    replace(model, range=replace(model.range, force_n=np.inf)).save(tmp_path / "w")  # as weights before said nothing
    assert load_wrench_model(path=tmp_path / "w").range.force_n == np.inf


def test_training_repeats_and_fine_tuning_helps_on_a_changed_sensor(model):
    small = made_samples(paths=10, seed=3)
    config = replace(QUICK, epochs=5)
    a, b = fit(small, config), fit(small, config)
    assert np.array_equal(a.predict(small.inputs)[0], b.predict(small.inputs)[0])
    changed = made_samples(paths=20, seed=4)
    changed = replace(changed, fields=changed.fields * np.float32(1.15))  # as a softer silicone would
    tuned = fit(changed, replace(QUICK, epochs=15), start=model)
    fresh = made_samples(paths=20, seed=6)
    fresh = replace(fresh, fields=fresh.fields * np.float32(1.15))
    before, after = (((m.predict(fresh.inputs)[0] - fresh.wrenches)[:, :3] ** 2).mean() for m in (model, tuned))
    assert after < 0.4 * before
    assert json.dumps(tuned.about["training"]["start"])


def test_more_principal_fields_start_from_the_same_answers(model):
    """Of other contacts the grown weights leave less; their limit is set anew, and the old paths stay known."""
    other = made_samples(paths=20, seed=4)
    other = replace(other, fields=other.fields + np.float32(0.1) * other.fields**2)
    still = replace(QUICK, epochs=0)
    same, grown = (fit(other, replace(still, components=count), start=model) for count in (12, 20))
    assert len(grown.weights["principal"]) == 20
    assert np.allclose(grown.predict(other.inputs)[0], same.predict(other.inputs)[0], atol=1e-4)
    left = [
        range_measures(m.weights["principal"].astype(float), m._patterns, other.inputs)[1].mean() for m in (same, grown)
    ]
    assert left[1] < 0.9 * left[0] and grown.range.rest_px < same.range.rest_px
    assert set(model.about["training"]["paths"]) < set(grown.about["training"]["paths"])


def test_what_a_field_may_leave_grows_with_the_load(model, data):
    """A outside addition that would pass under the heaviest load is flagged under a light one."""
    assert model.range.rest_px_per_n > 0
    odd = np.random.default_rng(1).normal(size=72)
    odd -= model._patterns @ (model.weights["principal"].astype(float) @ odd)
    odd *= 2 * model.range.rest_px / np.linalg.norm(odd)
    force = np.linalg.norm(data.wrenches[:, :3], axis=1)
    light, heavy = data.inputs[np.abs(force - 2).argmin()], data.inputs[force.argmax()]
    assert not model.out_of_range(np.array([light, heavy])).any()
    assert model.out_of_range(np.array([light, heavy]) + odd).tolist() == [True, False]


@pytest.mark.long
def test_contacts_of_other_kinds_teach_doubt_and_nothing_else(data):
    """Fields bent otherwise by the same wrenches: unflagged without, flagged with others of their kind in training."""

    def bent(paths, seed):
        made = made_samples(paths=paths, seed=seed)
        return replace(made, fields=made.fields * (1 + 0.5 * np.abs(made.fields) / np.abs(made.fields).max()))

    fresh = bent(10, 21)
    config = replace(QUICK, epochs=80)  # fewer leave the mean in doubt of its own kind
    known, taught = fit(data, config), fit(data, config, others=bent(20, 22))
    taught = replace(taught, range=replace(taught.range, interval_n=1.0))  # so small a network is less sure than ours
    assert np.array_equal(known.predict(fresh.inputs)[0], taught.predict(fresh.inputs)[0])
    off = np.abs(known.predict(fresh.inputs)[0] - fresh.wrenches)[:, 2] > 1.0
    assert off.sum() > 10 and known.out_of_range(fresh.inputs)[off].mean() < 0.5
    assert taught.out_of_range(fresh.inputs)[off].mean() > 0.8
    plain = made_samples(seed=5)
    sure = ~taught.out_of_range(plain.inputs)
    error = np.abs(taught.predict(plain.inputs)[0] - plain.wrenches)[:, :3].max(axis=1)
    assert sure.mean() > 0.75 and (error[sure] < 1.0).mean() > 0.95


def test_an_answer_with_a_wide_interval_is_none(data):
    """The widest of the three forces' intervals counts, torques do not; both ways of asking agree."""
    model = fit(data, QUICK)
    covariance = model.predict(data.inputs)[1]
    widest = 1.959964 * np.sqrt(np.einsum("nkk->nk", covariance)[:, :3].max(axis=1))
    place = np.argsort(widest)[len(widest) // 2]
    for limit, outside in ((1.01, False), (0.99, True)):
        asked = replace(model, range=replace(model.range, interval_n=limit * widest[place]))
        assert bool(asked.out_of_range(data.inputs[place][None])[0]) is outside
        channels = data.inputs[place].reshape(2, *model.shape)
        field = ShearField(0.0, channels, valid=np.ones(model.shape, dtype=bool))
        assert ("out_of_range" in asked.estimate(field).flags) is outside
    covariance[7, 4, 4], covariance[8, 2, 2] = np.inf, np.nan  # a torque, and a force that is no number
    still = np.zeros((len(covariance), 6))
    assert model.range.is_beyond(still, covariance, 65.0).nonzero()[0].tolist() == [8]


@pytest.mark.long
def test_covariance_is_scaled_on_the_pictures_of_paths_held_out():
    small, fresh = made_samples(paths=16, seed=3), made_samples(paths=16, seed=5, noise=0.05)
    noisy = replace(made_samples(paths=16, seed=3, noise=0.05), path=small.path)
    blind, seen = fit(small, QUICK), fit(small, QUICK, pictures=noisy)
    assert np.array_equal(blind.weights["linear"], seen.weights["linear"])

    def covered(model):
        value, covariance = model.predict(fresh.inputs)
        sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        return (np.abs(value - fresh.wrenches) <= 1.96 * sigma).mean()

    assert covered(blind) < 0.8
    assert 0.88 < covered(seen) < 0.99
    elsewhere = replace(noisy, path=np.array([f"other {name}" for name in noisy.path]))
    assert np.array_equal(fit(small, QUICK, pictures=elsewhere).weights["calibration"], blind.weights["calibration"])


def test_the_weights_that_ship_are_those_of_their_design_small_and_answer(tmp_path, monkeypatch):
    model = load_wrench_model(EndcapParams(130, 8))
    assert (SHIPPED / "default_D130_T8.safetensors").stat().st_size < 1.5e6
    assert model.shape == (16, 16) and model.method == "dots" and len(model.about["training"]["paths"]) >= 18
    assert max(model.about["metrics"]["validation_rmse"][:3]) < 1.0  # N, on loading paths left out
    rest = model.estimate(ShearField(0.0, np.zeros((2, 16, 16), np.float32)))
    assert not rest.force_n.any() and not rest.torque_nm.any() and not rest.flags
    y, x = (np.mgrid[0:16, 0:16] - 7.5) / 7.5
    near = np.exp(-3 * (x**2 + y**2))
    pressed = model.estimate(ShearField(0.0, (0.8 * near * np.stack([x, y])).astype(np.float32)))  # spread at the tip
    assert pressed.force_n[2] < -1.0 and np.linalg.norm(pressed.force_n[:2]) < 0.2 * -pressed.force_n[2]
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    with pytest.raises(FileError, match="no weights for D140_T8 in Smooth-Sil 950"):
        load_wrench_model(EndcapParams(140, 8))
