"""Symmetries, ridge, samples and the fit that goes on: closed forms, refusals, the same weights after a stop."""

from dataclasses import replace

import numpy as np
import pytest
from made_samples import SIDE, bump_fields, made_samples

from cad.errors import ParameterError
from cad.identity import identity
from cad.params import EndcapParams
from sensing.learning.samples import shared_between

torch = pytest.importorskip("torch")
pytest.importorskip("safetensors")


from sensing.learning.fit_config import FitConfig  # noqa: E402
from sensing.learning.fitting import fit  # noqa: E402
from sensing.learning.provenance import provenance  # noqa: E402
from sensing.learning.reference_loads import wrench_scale  # noqa: E402
from sensing.learning.ridge import fit_ridge  # noqa: E402
from sensing.learning.symmetry import COUNT, moved_inputs, moved_wrenches, plane_map, symmetric_moments  # noqa: E402
from sensing.wrench.simulation_spread import learned_from_simulation  # noqa: E402

QUICK = FitConfig(components=12, hidden=24, depth=3, epochs=28, batch=96, rate=1e-2, decay=1e-3)


@pytest.fixture(scope="module")
def data():
    return made_samples()


def test_symmetries_form_a_group_and_move_fields_as_they_move_what_caused_them(data):
    inputs = data.fields.reshape(len(data), -1).astype(float)
    for number in range(COUNT):
        M = plane_map(number)
        assert np.allclose(M @ M.T, np.eye(2))
        moved = moved_inputs(inputs, number, SIDE)
        again = bump_fields(moved_wrenches(data.wrenches, number)).reshape(len(data), -1)
        assert np.abs(moved - again).max() < 0.08  # the noise
    quarter = inputs
    for _ in range(4):
        quarter = moved_inputs(quarter, 1, SIDE)
    assert np.array_equal(quarter, inputs)


def test_mirror_makes_a_torque_a_pseudo_vector():
    """The torque of a mirrored force at a mirrored place, from the cross product."""
    rng = np.random.default_rng(0)
    place, force = rng.normal(size=(5, 3)), rng.normal(size=(5, 3))
    for number in range(COUNT):
        M = np.eye(3)
        M[:2, :2] = plane_map(number)
        reported = moved_wrenches(np.concatenate([force, np.cross(place, force)], axis=1), number)
        assert np.allclose(reported[:, 3:], np.cross(place @ M.T, force @ M.T))


def test_ridge_finds_a_linear_law_and_gives_zero_at_zero():
    rng = np.random.default_rng(1)
    truth = rng.normal(size=(6, 8))
    symmetric = np.zeros_like(truth)
    for k in range(COUNT):  # average over the group: a law that the symmetries allow
        back = moved_inputs(np.eye(8), k, 2)
        symmetric += moved_wrenches((back @ truth.T), [0, 3, 2, 1, 4, 5, 6, 7][k]).T / COUNT
    x = rng.normal(size=(200, 8))
    weights, share = fit_ridge(x, x @ symmetric.T, np.repeat(np.arange(10), 20), 2)
    assert np.abs(weights - symmetric).max() < 1e-6 and share <= 1e-8


def test_ridge_stands_ill_conditioned_duplicate_single_and_constant_samples(data):
    one = fit_ridge(data.inputs[:1], data.wrenches[:1], data.path[:1], SIDE)[0]
    twice = np.repeat(data.inputs[:3], 50, axis=0)
    many = fit_ridge(twice, np.repeat(data.wrenches[:3], 50, axis=0), np.repeat([0, 1, 2], 50), SIDE)[0]
    zero = fit_ridge(np.zeros((9, 72)), np.ones((9, 6)), np.arange(9), SIDE)[0]
    assert np.isfinite(one).all() and np.isfinite(many).all() and not zero.any()
    with pytest.raises(ParameterError, match="need"):
        fit_ridge(data.inputs, data.wrenches[:, :5], data.path, SIDE)
    with pytest.raises(ParameterError, match="not finite"):
        fit_ridge(data.inputs * np.nan, data.wrenches, data.path, SIDE)


def test_bad_samples_are_refused(data):
    with pytest.raises(ParameterError, match="no axis missing"):
        replace(data, wrenches=data.wrenches[:, :5])
    with pytest.raises(ParameterError, match="not finite"):
        replace(data, fields=data.fields * np.float32("nan"))
    with pytest.raises(ParameterError, match="at least 2 needed"):
        fit(data.take(data.path == data.path[0]), QUICK)
    with pytest.raises(ParameterError, match="all zero"):
        fit(replace(data, fields=np.zeros_like(data.fields)), QUICK)
    with pytest.raises(ParameterError, match="hidden=0"):
        FitConfig(hidden=0)
    assert len(made_samples(paths=3)) and not data.take(np.zeros(0, int)).fields.size


def test_leaks_between_training_and_test_are_found(data):
    train, test = data.split(0.3, 1)
    assert shared_between(train, test) == []
    assert 0.2 < len(np.unique(test.path)) / 24 < 0.4
    leak = test.take(np.arange(3))
    assert any(line.startswith("path") for line in shared_between(data, leak))
    renamed = replace(leak, path=np.array(["other"] * 3))
    assert "identical fields" in shared_between(data, renamed)
    posed = replace(
        train, tilt_deg=np.full(len(train), 10.0), azimuth_deg=np.ones(len(train)), friction=np.ones(len(train))
    )
    other = replace(
        test, tilt_deg=np.full(len(test), 10.0), azimuth_deg=np.ones(len(test)), friction=np.ones(len(test))
    )
    assert shared_between(posed, other) == ["pose tilt=10 azimuth=1 friction=1"]


@pytest.mark.parametrize("stage", ["mean", "spread"])
def test_an_interrupted_training_goes_on_to_the_same_weights(stage, tmp_path, monkeypatch):
    monkeypatch.setattr("sensing.learning.checkpoint.EVERY_S", 0.0)
    small, config, kept = made_samples(paths=8, seed=3), replace(QUICK, epochs=6), tmp_path / "kept"
    whole = fit(small, config)
    reported = []

    def stop(part, seconds, error):
        reported.append(part)
        if reported.count(stage) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit(small, config, progress=stop, checkpoint=kept)
    assert kept.is_file()
    again = []
    resumed = fit(small, config, progress=lambda part, seconds, error: again.append(part), checkpoint=kept)
    assert again.count(stage) < reported.count(stage) + 4 and again.count("mean") + reported.count("mean") == 6
    for name, value in whole.weights.items():
        assert np.array_equal(value, resumed.weights[name]), name
    fit(small, config, progress=lambda *_: pytest.fail("trained again"), checkpoint=kept)  # until weights are saved


def test_a_checkpoint_of_other_samples_or_damaged_is_not_used(tmp_path, monkeypatch):
    monkeypatch.setattr("sensing.learning.checkpoint.EVERY_S", 0.0)
    small, config, kept = made_samples(paths=8, seed=3), replace(QUICK, epochs=2), tmp_path / "kept"

    def stop(part, seconds, error):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit(made_samples(paths=8, seed=4), config, progress=stop, checkpoint=kept)
    whole, other = fit(small, config), fit(small, config, checkpoint=kept)
    assert all(np.array_equal(value, other.weights[name]) for name, value in whole.weights.items())
    kept.write_bytes(b"damaged")
    assert np.array_equal(fit(small, config, checkpoint=kept).weights["linear"], whole.weights["linear"])


def test_moments_of_the_symmetric_copies_are_those_of_the_copies(data):
    gram, moment = symmetric_moments(data.inputs, data.wrenches, SIDE)
    copies = [(moved_inputs(data.inputs, k, SIDE), moved_wrenches(data.wrenches, k)) for k in range(COUNT)]
    assert np.allclose(gram, sum(x.T @ x for x, _ in copies)) and np.allclose(moment, sum(x.T @ w for x, w in copies))


@pytest.mark.parametrize(("design", "cast_of"), [((250, 6.5), "Ecoflex 00-30"), ((250, 25), "Smooth-Sil 950")])
def test_training_on_a_soft_or_thick_dome_is_that_of_the_released_one_in_other_newtons(data, design, cast_of):
    """The same fields under loads that are to that dome what they are to D=130 T=8: no unit or limit of training, not
    even the covered angles, may depend on how large an endcap's newtons are. Fine-tuning, too."""
    params, few = EndcapParams(*design), replace(QUICK, epochs=4)
    blank = replace(data, design=params, identity=identity(params, cast_of))
    factor = wrench_scale(blank)

    def of_it(samples):
        return replace(blank.take(np.arange(len(samples))), **{
            name: getattr(samples, name) for name in ("fields", "path", "contact")
        }, wrenches=samples.wrenches * factor)  # fmt: skip

    others, later = made_samples(seed=3), made_samples(seed=5)
    hard = [fit(data, few, others=others)]
    soft = [fit(of_it(data), few, others=of_it(others))]
    hard.append(fit(later, few, start=hard[0]))
    soft.append(fit(of_it(later), few, start=soft[0]))
    assert factor[0] < 0.04 or factor[0] > 9
    for one, other in zip(hard, soft, strict=True):
        (value, covariance), (found, spread) = one.predict(data.inputs), other.predict(data.inputs)
        assert np.abs(found / factor - value).max() < 1e-3
        assert np.allclose(spread / np.outer(factor, factor), covariance, rtol=1e-2, atol=1e-6)
        assert other.range.tilt_deg == pytest.approx(one.range.tilt_deg, abs=1e-6)
        assert other.range.interval_n == pytest.approx(one.range.interval_n * factor[0])
        assert np.mean(other.out_of_range(data.inputs) == one.out_of_range(data.inputs)) > 0.99
        rmse = [np.array(model.about["metrics"]["validation_rmse"]) for model in (one, other)]
        assert rmse[1] == pytest.approx(rmse[0] * factor, rel=1e-2)


def test_fine_tuned_weights_flag_the_bodies_that_those_before_flagged(data):
    """Fine-tuning on a few recorded paths lost the limit of intervals, and with it that flag, without a word."""
    few = replace(QUICK, epochs=4)
    taught = fit(data, few, others=made_samples(seed=3))
    tuned = fit(made_samples(seed=5), few, start=taught)
    wider = tuned.weights["calibration"][:3] / taught.weights["calibration"][:3]
    assert taught.range.interval_n == pytest.approx(0.75)
    assert tuned.range.interval_n == pytest.approx(0.75 * float(wider.min()))
    plain = fit(data, few)
    assert np.isinf(plain.range.interval_n) and np.isinf(fit(data, few, start=plain).range.interval_n)


def test_weights_that_saw_no_recorded_path_state_so(data):
    """All but those that ship stated the opposite, and live left their intervals as narrow as simulated frames have
    them."""
    few = replace(QUICK, epochs=1)
    recorded = replace(data, path=np.char.replace(data.path, "made-0", "recorded-7"))
    simulated, real = fit(data, few), fit(recorded, few)
    assert learned_from_simulation(simulated) and not learned_from_simulation(real)
    later = made_samples(seed=5)
    assert learned_from_simulation(fit(later, few, start=simulated))
    assert not learned_from_simulation(fit(later, few, start=real))
    assert not learned_from_simulation(fit(recorded, few, start=simulated))


def test_weights_name_the_folders_that_they_saw_though_a_name_has_a_space(data):
    seen = replace(data, sources=("/home/jane doe/set one", "exports/train"))
    assert provenance(seen, QUICK, None)["sources"] == ["set one", "train"]


def test_where_fields_say_nothing_of_paths_left_out_the_ridge_holds_still():
    """Errors of the paths that were fitted would choose the least lambda."""
    rng = np.random.default_rng(2)
    inputs, wrenches, path = rng.normal(size=(60, 8)), rng.normal(size=(60, 6)), np.repeat(np.arange(20), 3)
    weights, share = fit_ridge(inputs, wrenches, path, 2)
    assert share >= 0.1
    other, same = fit_ridge(100.0 * inputs, wrenches, path, 2)  # another unit of the fields
    assert same == share and 100.0 * other == pytest.approx(weights, rel=1e-6)
