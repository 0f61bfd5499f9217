"""The rate filter against an independent integration, the material's own constants, and abuse."""

from itertools import pairwise

import numpy as np
import pytest
from live_stand_in import film, frames, stand_in
from scipy.integrate import solve_ivp

from cad.errors import ParameterError
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.endcaps_file import load_config, save_config
from sensing.live.core.pipeline import EndcapPipeline
from sensing.records import Wrench
from sensing.wrench.relaxation import RateFilter, Term

TERMS = (Term(0.06, 0.1, 0.006), Term(0.04, 1.0, 0.004))


def wrench(value, time_s, flags=frozenset()):
    value = np.asarray(value, float)
    return Wrench(time_s, value[:3], value[3:], "sphere", np.eye(6) * 0.01, flags)


def run(terms, values, times):
    rate, found = RateFilter(terms), []
    for value, time_s in zip(values, times, strict=True):
        step = rate.step(wrench(value, time_s))
        rate.take(step)
        found.append([*step.wrench.force_n, *step.wrench.torque_nm])
    return np.array(found)


def test_any_intervals_give_the_integral_of_the_equations():
    """Reference: a general integrator on dh/dt = b dw/dt - h / tau with the same piecewise linear wrench."""
    rng = np.random.default_rng(3)
    times = np.cumsum(rng.choice([0.001, 0.033, 0.05, 0.7, 3.0], 40))
    values = np.cumsum(rng.normal(size=(40, 6)), axis=0)
    expected, state = [values[0]], np.zeros((2, 6))
    for k, (a, b) in enumerate(pairwise(times)):
        slope = (values[k + 1] - values[k]) / (b - a)

        def rate(_, h, slope=slope):
            h = h.reshape(2, 6)
            return np.concatenate([t.strength * slope - h[i] / t.tau_s for i, t in enumerate(TERMS)])

        state = solve_ivp(rate, (a, b), state.ravel(), rtol=1e-10, atol=1e-12).y[:, -1].reshape(2, 6)
        expected.append(values[k + 1] + state.sum(axis=0))
    assert run(TERMS, values, times) == pytest.approx(np.array(expected), abs=1e-7)


def test_frames_that_are_lost_on_a_ramp_change_nothing():
    times = np.linspace(0, 2, 61)
    values = np.outer(np.clip(times, 0, 1), [1, 2, -10, 0.1, 0.2, 0.0])
    kept = np.sort(np.r_[0, 15, 30, 60, np.random.default_rng(1).choice(61, 20)])
    kept = np.unique(kept)
    assert run(TERMS, values[kept], times[kept])[-1] == pytest.approx(run(TERMS, values, times)[-1], abs=1e-12)


def test_a_step_shows_the_instantaneous_modulus_and_fades_to_the_long_term_one():
    values = [np.zeros(6)] + [np.array([0, 0, -10.0, 0, 0, 0])] * 4
    found = run(TERMS, values, [0.0, 1e-6, 0.1, 1.0, 60.0])[:, 2]
    assert found[1] == pytest.approx(-10 * 1.1, abs=1e-3)
    assert found[2] == pytest.approx(-10 * (1 + 0.06 * np.exp(-1) + 0.04 * np.exp(-0.1)), abs=1e-3)
    assert found[4] == pytest.approx(-10, abs=1e-6)


def test_without_terms_the_very_same_record_comes_back():
    given = wrench(np.ones(6), 1.0)
    assert RateFilter().step(given).wrench is given


def test_a_step_that_is_not_taken_leaves_no_trace():
    rate, values = RateFilter(TERMS), [np.zeros(6), np.ones(6), 2 * np.ones(6)]
    rate.take(rate.step(wrench(values[0], 0.0)))
    rate.step(wrench(50 * np.ones(6), 0.033))
    rate.take(rate.step(wrench(values[1], 0.066)))
    assert rate.step(wrench(values[2], 0.1)).wrench.force_n == pytest.approx(
        run(TERMS, values, [0, 0.066, 0.1])[-1][:3]
    )


def test_nonsense_never_becomes_a_number_nor_stays():
    rate = RateFilter(TERMS)
    for value, time_s in ((0, 0.0), (np.nan, 0.1), (np.inf, 0.2), (5, np.nan), (5, -1.0), (5, 0.3), (5, 0.3), (5, 1e9)):
        step = rate.step(wrench(np.full(6, value, float), time_s))
        rate.take(step)
        assert np.isfinite(step.wrench.force_n).all() == np.isfinite(value)
    assert step.wrench.force_n == pytest.approx(np.full(3, 5.0)) and np.isfinite(step.wrench.covariance).all()


def test_doubt_about_the_constants_widens_only_while_it_relaxes():
    values = [np.zeros(6), *[np.array([0, 0, -10.0, 0, 0, 0])] * 2]
    rate = RateFilter(TERMS)
    spread = []
    for value, time_s in zip(values, [0.0, 0.01, 90.0], strict=True):
        step = rate.step(wrench(value, time_s))
        rate.take(step)
        spread.append(step.wrench.covariance[2, 2] - 0.01)
    assert spread[0] == 0 and spread[1] > 0.003 and spread[2] < 1e-12


@pytest.mark.parametrize("term", [(0, 1), (-0.1, 1), (2.0, 1), (0.1, 0), (0.1, 1e9), (0.1, np.nan), (np.nan, 1)])
def test_terms_that_no_silicone_has_are_refused(term):
    with pytest.raises(ParameterError, match="relaxation term"):
        Term(*term)


def test_a_reference_and_a_restart_forget_and_the_pipeline_applies_it(tmp_path):
    terms = ((0.2, 1.0, 0.0),)
    plain, rated = (
        EndcapPipeline(EndcapConfig("a", "0", relaxation=each), stand_in(), None, 0, 1) for each in ((), terms)
    )
    given = frames(film([0, 0, 1.0, 1.0, 1.0]))
    for frame in given:
        a, b = plain.update(frame), rated.update(frame)
    factor = b.estimate.force_n[0] / a.estimate.force_n[0]
    assert 1.15 < factor < 1.2
    rated.restart()
    again = rated.update(given[-1])
    assert again.estimate.force_n == pytest.approx(a.estimate.force_n, rel=5e-3)
    save_config(LiveConfig((EndcapConfig("a", "0", relaxation=terms),)), tmp_path / "e.toml")
    assert load_config(tmp_path / "e.toml").endcaps[0].relaxation == terms
    for bad in ("[[0.1, 1.0]]", "[0.1]", "[[0.1, -1.0, 0.0]]", '"soft"', "[[0.1, 1.0, 0.0],[0.1, 1.0, 0.0]]" * 3):
        (tmp_path / "e.toml").write_text(f'[[endcap]]\nname = "a"\nsource = "0"\nrelaxation = {bad}\n')
        with pytest.raises(ValueError, match=r"relaxation|no TOML"):
            load_config(tmp_path / "e.toml")
