"""Constants of rate effects out of dwell tests whose constants are known, and tests that show none."""

import numpy as np
import pytest
from dwell_stand_in import STRENGTH, TAU_S, creep
from scipy.optimize import nnls

from sensing import dwell as command
from sensing.weighing.dwell import DwellError, _solved, _system, _Test, fit_dwell, unit_overstress
from sensing.weighing.scatter import Scatter, scatter_of, unbiased


def test_known_constants_come_back():
    time_s, force_n, load = creep()
    found = fit_dwell(time_s, force_n)
    assert len(found.terms) == 2 and found.level_n == pytest.approx(15.0, abs=0.03)
    for term, strength, tau in zip(found.terms, STRENGTH, TAU_S, strict=True):
        assert term.strength == pytest.approx(strength, rel=0.15) and term.tau_s == pytest.approx(tau, rel=0.15)
    assert found.before_n > 0.1 and found.after_n < 0.02
    assert np.abs(found.corrected_n - load)[found.used].max() < 0.05


def test_a_light_weight_that_stands_long_shows_the_same_constants():
    """The overstress is made of the readings: their scatter made the short term a fifth too small, three deviations."""
    runs = [fit_dwell(*creep(weight_n=8.0, dwell_s=40.0, seed=seed)[:2]).terms for seed in (2, 3)]
    assert np.mean([terms[0].strength for terms in runs]) == pytest.approx(STRENGTH[0], rel=0.08)
    assert np.mean([terms[0].tau_s for terms in runs]) == pytest.approx(TAU_S[0], rel=0.08)


def test_what_scatter_adds_is_that_of_every_reading_by_itself():
    """A reading alone changes the overstress as a unit force at its time does; independent ones add their squares."""
    rng, taus = np.random.default_rng(2), [0.05, 0.3, 2.0]
    time_s = np.cumsum(rng.uniform(0.02, 0.05, 60))
    used = rng.random(60) < 0.6
    of_one = np.array([unit_overstress(time_s, unit, taus) for unit in np.eye(60)])  # (reading, term, time)
    found = scatter_of(time_s, used, taus, 0.1)
    assert found.squares == pytest.approx(0.01 * np.einsum("rik,rjk->ij", of_one[..., used], of_one[..., used]))
    assert found.with_reading == pytest.approx(0.01 * of_one[used, :, used].sum(axis=0))


def test_nothing_is_subtracted_where_scatter_is_most_of_it():
    time_s, noise = np.arange(200) / 30, np.random.default_rng(0).normal(size=200)
    matrix = unit_overstress(time_s, noise, [0.1]).T
    scatter = scatter_of(time_s, np.ones(200, bool), [0.1], 1.0)
    strength, counted = unbiased(matrix, -noise, scatter)
    assert not counted.squares.any() and strength == pytest.approx(np.linalg.lstsq(matrix, -noise, rcond=None)[0])


@pytest.mark.parametrize("rest_n", [0.3, -0.3])
def test_what_an_old_reference_reads_untouched_is_no_creep(rest_n):
    time_s, force_n, _ = creep()
    found, shifted = fit_dwell(time_s, force_n), fit_dwell(time_s, force_n + rest_n)
    assert shifted.rest_n == pytest.approx(rest_n, abs=0.01) and shifted.level_n == pytest.approx(found.level_n)
    for term, wanted in zip(shifted.terms, found.terms, strict=True):
        assert (term.strength, term.tau_s) == pytest.approx((wanted.strength, wanted.tau_s), rel=1e-6)


def test_a_weight_that_is_not_taken_off_whole_leaves_creep():
    time_s, force_n, load = creep()
    assert fit_dwell(time_s, force_n).left_share < 0.05
    assert fit_dwell(time_s, force_n).noise_n == pytest.approx(0.01, rel=0.15)
    plate_n = np.where(time_s > time_s[load > 7].max(), 0.5, 0.0)
    assert fit_dwell(time_s, force_n + plate_n).left_share > command.MOST_LEFT


def test_constants_hold_for_another_load_and_rhythm():
    found = fit_dwell(*creep()[:2])
    time_s, force_n, load = creep(25.0, 3.0, 3.0, 0.0, 5, 0.5, 15.0)
    taus = [term.tau_s for term in found.terms]
    corrected = force_n + np.array([term.strength for term in found.terms]) @ unit_overstress(time_s, force_n, taus)
    assert np.abs(force_n - load).max() > 0.7 and np.abs(corrected - load).max() < 0.12


def test_one_relaxation_time_gives_one_term_or_two_that_act_alike():
    time_s, force_n, load = creep(strength=np.array([0.08]), noise_n=0.005)
    found = fit_dwell(time_s, force_n)
    assert sum(term.strength for term in found.terms) == pytest.approx(0.08, rel=0.15)
    assert np.abs(found.corrected_n - load)[found.used].max() < 0.05


def test_the_deviation_of_a_strength_is_that_of_repeated_tests():
    """Where both terms are found: with three times the scatter the short one may be lost, and the slow one grows."""
    runs = [fit_dwell(*creep(noise_n=0.01, seed=seed)[:2]).terms for seed in range(12)]
    assert all(len(terms) == 2 for terms in runs)
    slow = [(terms[-1].strength, terms[-1].sd) for terms in runs]
    assert 0.4 < np.std([b for b, _ in slow]) / np.mean([sd for _, sd in slow]) < 1.5


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"weight_n": 1.0}, "never exceeds"), ({"dwell_s": 2.9}, "stands for"), ({"after_s": 1.9}, "after the release"),
        ({"strength": np.array([1e-6]), "noise_n": 0.03}, "no rate effect over the noise"),
    ],
)  # fmt: skip
def test_a_test_that_shows_nothing_is_refused(options, said):
    with pytest.raises(DwellError, match=said):
        fit_dwell(*creep(**options)[:2])


def test_a_soft_dome_shows_the_same_constants_under_its_own_loads():
    time_s, force_n, _ = creep()
    stiff, soft = fit_dwell(time_s, force_n), fit_dwell(time_s, 0.04 * force_n, 0.04)
    for found, wanted in zip(soft.terms, stiff.terms, strict=True):
        assert (found.strength, found.tau_s) == pytest.approx((wanted.strength, wanted.tau_s), rel=1e-6)
    with pytest.raises(DwellError, match=r"a weight of 0\.12 N or more"):
        fit_dwell(time_s, 0.004 * force_n, 0.04)


def test_a_path_that_never_leaves_rest_or_begins_under_load_is_refused():
    time_s = np.arange(300) / 30
    with pytest.raises(DwellError, match="never exceeds"):
        fit_dwell(time_s, 0.01 * np.sin(time_s))
    with pytest.raises(DwellError, match="begins under load"):
        fit_dwell(time_s, np.where(time_s < 6, 15.0, 0.0))
    with pytest.raises(DwellError, match="hundreds"):
        fit_dwell(time_s[:10], time_s[:10])


def test_a_weight_that_is_put_on_twice_is_refused_for_that():
    time_s, force_n, load = creep()
    lifted = (time_s > 2.5) & (time_s < 3.2)
    with pytest.raises(DwellError, match="put it on once"):
        fit_dwell(time_s, np.where(lifted, 0.0, force_n))
    one = np.flatnonzero(time_s > 3.0)[0]  # a single damaged picture is none
    assert fit_dwell(time_s, np.where(np.arange(len(load)) == one, 0.4 * force_n, force_n)).terms


def test_a_folder_in_which_pictures_are_missing_is_refused_because_its_times_are_wrong(tmp_path, capsys):
    path = tmp_path / "endcaps.toml"
    path.write_text('[[endcap]]\nname = "a"\nsource = "0"\n')
    for number in (*range(40), *range(85, 120)):
        (tmp_path / f"frame_{number}.jpg").touch()
    assert command.main(["--config", str(path), "--source", str(tmp_path)]) == 2
    assert "missing between frame_39.jpg and frame_85.jpg, so times" in capsys.readouterr().err


def test_the_command_refuses_in_one_line(tmp_path, capsys):
    path = tmp_path / "endcaps.toml"
    path.write_text('[[endcap]]\nname = "a"\nsource = "0"\n')
    assert command.main(["--config", str(path), "--source", "nowhere.mcap"]) == 2
    assert "nowhere.mcap: no such file" in capsys.readouterr().err.splitlines()[-1]
    assert command.main(["--config", str(path), "--endcap", "b", "--source", "x"]) == 2
    assert "choose one of a" in capsys.readouterr().err


@pytest.mark.parametrize("seed", range(8))
def test_strengths_are_those_of_least_squares_without_negative_ones(seed):
    rng = np.random.default_rng(seed)
    curves, used = rng.normal(size=(2, 40)), rng.permuted(np.repeat([True, False], 20))
    force_n = np.array([1.0, -0.5]) @ curves + 0.1 * rng.normal(size=40)  # one wants to be negative
    test = _Test(0.02 * np.arange(40.0), -force_n, used, ~used, 0.0)
    square, strength, matrix = _solved(curves, Scatter(np.zeros((2, 2)), np.zeros(2)), test)
    wanted, left = nnls(matrix, _system(curves, test)[1])
    assert strength == pytest.approx(wanted) and square == pytest.approx(left**2) and strength[0] > 0.5


def test_noise_that_lasts_makes_a_strength_less_sure_than_noise_that_does_not():
    time_s, force_n, _ = creep(noise_n=0.0)
    rng = np.random.default_rng(3)
    white = 0.01 * rng.normal(size=len(time_s))
    slow = white.copy()
    for k in range(1, len(slow)):
        slow[k] = 0.8 * slow[k - 1] + 0.6 * white[k]  # of the same variance
    sure, unsure = (fit_dwell(time_s, force_n + noise).terms[-1].sd for noise in (white, slow))
    assert unsure > 1.8 * sure  # (1 + 0.8) / (1 - 0.8) of the variance, where it all counts
