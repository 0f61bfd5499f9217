"""Contact: the stated rate holds on noise of several kinds; places against closed forms."""

import numpy as np
import pytest

from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.records import Wrench
from sensing.wrench.contact import (
    LEAST_ON_N,
    ContactDetector,
    ContactThreshold,
    autocorrelation_time,
    threshold_from_rest,
)
from sensing.wrench.contact_place import contact_centre

PARAMS = EndcapParams(130, 8)


def noise(kind, count, rng):
    if kind == "correlated":
        white = rng.normal(size=(count + 200, 3))
        out = np.zeros_like(white)
        for k in range(1, len(white)):
            out[k] = 0.9 * out[k - 1] + np.sqrt(1 - 0.81) * white[k]
        return 0.03 * out[200:]
    if kind == "offset":
        return rng.normal(size=(count, 3)) * [0.01, 0.02, 0.05] + [0.1, 0, 0]
    return rng.laplace(size=(count, 3)) * 0.02


@pytest.mark.parametrize("kind", ["offset", "correlated", "laplace"])
@pytest.mark.parametrize(("count", "rate"), [(600, 1e-3), (4000, 1e-2)])
def test_stated_rate_holds_with_the_stated_confidence(kind, count, rate):
    """Many intervals: at most a few in twenty may give a threshold whose true rate is above the stated one."""
    rng = np.random.default_rng(7)
    fresh = np.linalg.norm(noise(kind, 200_000 if kind != "correlated" else 60_000, rng), axis=1)
    if count == 600 and kind == "correlated":
        count = 4000
    rates = [np.mean(fresh >= threshold_from_rest(noise(kind, count, rng), rate).on_n) for _ in range(20)]
    assert np.sum(np.array(rates) > rate) <= 4  # 5 % expected of each: P(more than 4 of 20) is 0.3 %
    assert np.mean(rates) > rate / 200  # and the threshold is not absurdly high


def test_order_statistic_is_used_when_there_are_samples_enough():
    rng = np.random.default_rng(0)
    many = threshold_from_rest(rng.normal(size=(20000, 3)), 1e-2)
    few = threshold_from_rest(rng.normal(size=(200, 3)), 1e-2)
    assert not many.extrapolated and few.extrapolated
    from scipy import stats

    exact = np.sqrt(stats.chi2.isf(1e-2, 3))
    assert exact < many.on_n < 1.03 * exact
    assert few.on_n > exact


def test_contact_ends_above_what_an_untouched_endcap_with_an_offset_shows():
    rng = np.random.default_rng(2)
    forces = np.array([0.0, 0.0, -0.5]) + 0.01 * rng.normal(size=(2000, 3))
    found = threshold_from_rest(forces)
    rest = np.median(np.linalg.norm(forces, axis=1))
    assert rest < found.off_n < found.on_n < 0.6
    assert (found.off_n - rest) / (found.on_n - rest) == pytest.approx(0.6, abs=1e-6)


def test_autocorrelation_time_of_a_first_order_process():
    rng = np.random.default_rng(1)
    x = np.zeros(60000)
    for k, e in enumerate(rng.normal(size=len(x) - 1), 1):
        x[k] = 0.8 * x[k - 1] + e
    assert autocorrelation_time(x) == pytest.approx(9.0, rel=0.15)  # (1 + a) / (1 - a)
    assert autocorrelation_time(rng.normal(size=60000)) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("value", [0.0, 0.125, 0.1, 1e-12, 3e5])
def test_equal_numbers_have_no_time_whether_or_not_their_mean_is_exact(value):
    assert autocorrelation_time(np.full(1000, value)) == 1.0


@pytest.mark.parametrize(
    ("forces", "rate", "said"),
    [
        (np.zeros((100, 2)), 1e-3, "shape"),
        (np.full((100, 3), np.nan), 1e-3, "finite"),
        (np.zeros((5, 3)), 1e-3, "longer"),
        (np.zeros((0, 3)), 1e-3, "longer"),
        (np.ones((100, 3)), 0.5, "outside"),
    ],
)
def test_bad_intervals_are_named(forces, rate, said):
    with pytest.raises(ParameterError, match=said):
        threshold_from_rest(forces, rate)


def wrench(force, time_s=0.0):
    return Wrench(time_s, np.array(force, float), np.zeros(3))


def test_hysteresis_and_unusable_frames():
    detector = ContactDetector(ContactThreshold(1.0, 0.5, 1e-3, 100, False))
    forces = [0.9, 1.0, 0.6, np.nan, 0.5, 0.49, 0.9]
    states = [detector.update(wrench([f, 0, 0], k)) for k, f in enumerate(forces)]
    assert [s.touching for s in states] == [False, True, True, True, True, False, False]
    assert [s.known for s in states] == [True, True, True, False, True, True, True]
    assert [s.since_s for s in states] == [0, 1, 1, 1, 1, 5, 5]
    with pytest.raises(ParameterError, match="off_n=2"):
        ContactThreshold(1.0, 2.0, 1e-3, 1, False)


def pressure_centre(force, torque):
    """Centre of pressure of a force and its torque about the endcap's origin."""
    about_centre = torque - np.cross([0, 0, PARAMS.centre_height_mm / 1000], force)
    return contact_centre(np.array(force, float), about_centre, PARAMS.outer_radius_mm, PARAMS.centre_height_mm)


def touches(seed):
    """50 times outward normal, place (mm) and force (N) of a push with friction."""
    rng = np.random.default_rng(seed)
    for _ in range(50):
        outward = rng.normal(size=3)
        outward /= np.linalg.norm(outward)
        touch = PARAMS.outer_radius_mm * outward + [0, 0, PARAMS.centre_height_mm]
        side = np.cross(outward, rng.normal(size=3))
        yield outward, touch, -5 * outward + 3 * side / np.linalg.norm(side)


def test_pressure_centre_of_a_force_at_a_point():
    for _, touch, force in touches(3):
        centre = pressure_centre(force, np.cross(touch / 1000, force))
        assert np.allclose(centre.position_mm, touch, atol=1e-9)
        assert centre.miss_mm == 0 and centre.spin_nm == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("spin_nm", [-0.06, 0.06])
def test_the_place_of_a_contact_that_pivots_is_not_moved_by_its_friction_about_the_normal(spin_nm):
    for outward, touch, force in touches(4):
        centre = pressure_centre(force, np.cross(touch / 1000, force) + spin_nm * outward)
        assert np.allclose(centre.position_mm, touch, atol=1e-9)
        assert centre.miss_mm == 0 and centre.spin_nm == pytest.approx(spin_nm)


def test_a_couple_that_no_contact_can_transmit_leaves_the_place_on_the_line():
    force, touch = np.array([0.0, -3.0, -4.0]), np.array([0.0, 0.0, 65 + PARAMS.centre_height_mm])
    torque = np.cross(touch / 1000, force)
    couple = 0.5 * force / 5  # over 4 N that is more than the sphere's radius
    assert np.allclose(pressure_centre(force, torque + couple).position_mm, touch, atol=1e-9)
    assert pressure_centre(force, torque + couple).spin_nm == pytest.approx(0.5, rel=1e-9)
    assert not np.allclose(pressure_centre(force, torque + 0.1 * couple).position_mm, touch, atol=0.5)


def test_a_line_that_misses_the_sphere_and_no_force():
    lever = np.array([80.0, 0, PARAMS.centre_height_mm])
    centre = pressure_centre([0, 0, -1], np.cross(lever / 1000, [0, 0, -1.0]))
    assert centre.miss_mm == pytest.approx(15) and centre.position_mm[0] == pytest.approx(65)
    assert np.isnan(pressure_centre([0, 0, 0], np.zeros(3)).position_mm).all()
    assert np.isnan(pressure_centre([np.nan, 0, 0], np.zeros(3)).position_mm).all()


def test_a_quiet_minute_does_not_make_a_threshold_that_a_lamp_passes():
    forces = 1e-4 * np.random.default_rng(0).normal(size=(400, 3))
    threshold = threshold_from_rest(forces)
    assert threshold.on_n == LEAST_ON_N and 0 < threshold.off_n < LEAST_ON_N
