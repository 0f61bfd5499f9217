"""Gains against closed forms and repeated draws, and everything that is refused."""

import re

import numpy as np
import pytest

from sensing.records import Wrench
from sensing.weighing.gain import (
    CONTRADICTION,
    ContradictionError,
    Pose,
    WeighingError,
    fit_gain,
    pose_gain,
    require_unit,
)
from sensing.weighing.postures import Posture, fit_gains
from sensing.weighing.words import GRAVITY_M_S2, PoseRequest
from sensing.wrench.stiffness import Stiffness

COVARIANCE = np.diag([0.05, 0.05, 0.1]) ** 2


def pose(weight_g, gain=0.73, tilt_deg=0.0, off=(0.0, 0.0, 0.0), typed_g=None, covariance=COVARIANCE):
    """A pose whose silicone has that gain; ``typed_g`` is what the user typed for the weight."""
    true, typed = (PoseRequest(grams, tilt_deg, 30.0) for grams in (weight_g, typed_g or weight_g))
    return Pose(typed.name, typed.load_n(), typed.load_sd_n(), true.load_n() / gain + off, covariance)


def test_the_gain_is_that_of_the_silicone_whatever_the_attitude():
    for tilts in ((0.0, 0.0), (0.0, 30.0), (20.0, 50.0)):
        found = fit_gain([pose(w, tilt_deg=tilt) for w, tilt in zip((500.0, 2000.0), tilts, strict=True)])
        assert found.gain == pytest.approx(0.73, abs=1e-12) and found.chi_square < 1e-12 and found.freedom == 5
    assert pose_gain(pose(1000.0))[0] == pytest.approx(0.73)


def test_the_load_presses_into_the_dome_with_mass_times_gravity():
    load = PoseRequest(1000.0, 30.0, 90.0).load_n()
    assert load == pytest.approx(GRAVITY_M_S2 * np.array([0.0, -0.5, -np.sqrt(0.75)]))
    assert PoseRequest(1000.0).load_n() == pytest.approx([0.0, 0.0, -GRAVITY_M_S2])


@pytest.mark.parametrize("common", [True, False])
def test_the_deviation_is_that_of_repeated_weighings(common):
    """Errors of the model are one and the same in every pose, or independent: the stated deviation covers both."""
    rng = np.random.default_rng(5)
    weights, gains, stated = (400.0, 900.0, 2000.0), [], []
    for _ in range(400):
        unit = rng.normal(size=(1, 4)).repeat(3, 0) if common else rng.normal(size=(3, 4))
        poses = []
        for weight, each in zip(weights, unit, strict=True):
            asked = PoseRequest(weight)
            size = asked.load_n() + np.array([0, 0, asked.load_sd_n() * rng.normal()])
            reading = size / 0.73 * (1 + 0.01 * each[3]) + np.sqrt(np.diag(COVARIANCE)) * each[:3]
            poses.append(Pose(asked.name, asked.load_n(), asked.load_sd_n(), reading, COVARIANCE))
        found = fit_gain(poses)
        gains.append(found.gain)
        stated.append(found.sd)
    spread = float(np.std(gains))
    assert np.mean(gains) == pytest.approx(0.73, abs=3 * spread / 20 + 1e-3)
    assert (0.6 if common else 0.3) * np.mean(stated) < spread < 1.1 * np.mean(stated)


@pytest.mark.long
def test_consistent_weights_are_refused_as_often_as_stated():
    rng, refused = np.random.default_rng(8), 0
    for _ in range(3000):
        asked = [PoseRequest(500.0), PoseRequest(1500.0)]
        poses = []
        for each in asked:
            load = each.load_n()
            tilt = np.array([*(rng.normal(size=2) * np.radians(1.0) * -load[2]), each.load_sd_n() * rng.normal()])
            reading = (load + tilt) / 0.8 * (1 + 0.01 * rng.normal()) + rng.multivariate_normal(np.zeros(3), COVARIANCE)
            poses.append(Pose(each.name, load, each.load_sd_n(), reading, COVARIANCE))
        try:
            fit_gain(poses)
        except WeighingError:
            refused += 1
    assert refused <= 3000 * CONTRADICTION + 4 * np.sqrt(3000 * CONTRADICTION)


def test_a_wrong_weight_is_named():
    three = [pose(500.0), pose(1000.0), pose(2000.0, typed_g=1600.0)]
    with pytest.raises(
        WeighingError, match=r"contradict .*: 1600 g shows a gain of 0\.584, the others 0\.730 to 0\.730"
    ):
        fit_gain(three)
    with pytest.raises(WeighingError, match=r"500 g shows a gain of 0\.730 and 1600 g shows a gain of 0\.584"):
        fit_gain([three[0], three[2]])


def leaning(weight_g, tilt_deg, azimuth_deg, given=(0.0, 0.0)):
    """A pose whose weight presses at one attitude while another one is given."""
    true, typed = PoseRequest(weight_g, tilt_deg, azimuth_deg), PoseRequest(weight_g, *given)
    return Pose(typed.name, typed.load_n(), typed.load_sd_n(), true.load_n() / 0.73, COVARIANCE)


def test_one_of_two_weights_that_is_wrong_by_a_tenth_is_refused_although_nothing_leans():
    """Forces across the loads that agreed hid it: chi-square 19 of 21 allowed, and a gain off by 2.5 deviations."""
    light, heavy = np.diag([0.035, 0.035, 0.064]) ** 2, np.diag([0.076, 0.076, 0.11]) ** 2  # of rendered pictures
    poses = [pose(600.0, 0.993, typed_g=660.0, covariance=light), pose(1800.0, 0.999, covariance=heavy)]
    with pytest.raises(WeighingError, match=r"along the loads 1\d, at most 11\): 660 g shows a gain of 1\.09"):
        fit_gain(poses)
    assert fit_gain([pose(600.0, 0.993, covariance=light), poses[1]]).along < 1
    with pytest.raises(ContradictionError) as refused:  # a third, grossly wrong, is not the only one
        fit_gain([*poses, pose(1200.0, typed_g=2000.0, covariance=light)])
    assert "2000 g shows a gain of 1.217" in str(refused.value) and refused.value.worst is None


@pytest.mark.parametrize("given", [(0.0, 0.0), (20.0, 30.0)])
def test_a_force_that_leans_is_no_wrong_weight_and_the_attitude_said_makes_it_right(given):
    with pytest.raises(WeighingError) as refused:
        fit_gain([leaning(weight, 30.0, 243.6, given) for weight in (1270.0, 2220.0)])
    said = str(refused.value)
    assert "contradict" not in said and "level the table" in said
    assert given[0] or "the force leans by 30.0 degrees from the vertical given" in said
    tilt, azimuth = (float(number) for number in re.search(r"give tilt=([\d.]+),azimuth=([\d.]+)$", said).groups())
    again = fit_gain([leaning(weight, 30.0, 243.6, (tilt, azimuth)) for weight in (1270.0, 2220.0)])
    assert again.gain == pytest.approx(0.73, abs=1e-4) and again.chi_square < 0.1


def test_one_tilted_table_is_named_once_whatever_the_weights():
    """Verticals come from loads of another size each, and are one to rounding only."""
    with pytest.raises(WeighingError, match=r"leans by 1\d\.\d degrees from the vertical given, .*give tilt=30\.0,"):
        fit_gain([leaning(weight, 30.0, 50.0, (20.0, 30.0)) for weight in (500.0, 1200.0, 1900.0)])


def test_the_azimuth_is_opposite_to_the_lateral_force():
    pressed = PoseRequest(1000.0, 20.0, 70.0).load_n()
    assert np.degrees(np.arctan2(-pressed[1], -pressed[0])) == pytest.approx(70.0)


def test_forces_that_lean_each_its_own_way_are_named_with_their_attitudes():
    upright = leaning(1500.0, 2.0, 0.0)  # no more than tables are off
    with pytest.raises(WeighingError, match=r"given, under 1000 g by 12\.0, under 2000 g by 15\.0 degrees") as refused:
        fit_gain([upright, leaning(1000.0, 12.0, 0.0), leaning(2000.0, 15.0, 90.0)])
    assert "tilt=12.0,azimuth=0.0 for 1000 g, tilt=15.0,azimuth=90.0 for 2000 g" in str(refused.value)


def test_no_attitude_is_said_that_would_be_refused():
    """A plate that is held at a steep side of the dome."""
    asked = [PoseRequest(weight) for weight in (500.0, 2000.0)]
    side = np.array([-np.sin(np.radians(70.0)), 0.0, -np.cos(np.radians(70.0))])
    poses = [Pose(r.name, r.load_n(), r.load_sd_n(), side * r.weight_g / 80, COVARIANCE) for r in asked]
    with pytest.raises(WeighingError, match=r"push the weight sideways$"):
        fit_gain(poses)


@pytest.mark.parametrize(
    ("weights", "said"), [((), "0 pose"), ((800.0,), "1 pose"), ((800.0, 950.0), "differ by a factor of 1.2")]
)
def test_too_little_to_notice_a_wrong_weight_is_refused(weights, said):
    with pytest.raises(WeighingError, match=said):
        fit_gain([pose(weight) for weight in weights])


def test_one_load_at_two_tilts_is_enough():
    assert fit_gain([pose(800.0), pose(800.0, tilt_deg=11.0)]).gain == pytest.approx(0.73)
    with pytest.raises(WeighingError, match=r"in one direction: use weights that differ .*, or another tilt"):
        fit_gain([pose(800.0), pose(800.0, tilt_deg=9.0)])


@pytest.mark.parametrize(("typed_g", "unit"), [(20.0, "N"), (60.0, "oz")])
def test_a_unit_mixed_up_is_named(typed_g, unit):
    true_g = {"N": 20 / GRAVITY_M_S2 * 1000, "oz": 60 * 28.3495}[unit]
    with pytest.raises(WeighingError, match=rf"no weight in g; was it .*{unit} \(gain 0\.73\)"):
        require_unit(pose(true_g, typed_g=typed_g))


def test_a_load_the_wrong_way_is_refused():
    lifted = pose(500.0)
    with pytest.raises(WeighingError, match="the other way"):
        require_unit(Pose("500 g", lifted.load_n, lifted.load_sd_n, -lifted.force_n, COVARIANCE))


def test_a_gain_scales_the_wrench_and_its_own_doubt_comes_on_top():
    covariance = np.diag([0.1, 0.1, 0.2, 0.01, 0.01, 0.01]) ** 2
    plain = Wrench(0.0, np.array([1.0, 2.0, -10.0]), np.array([0.1, 0.2, 0.0]), "sphere", covariance)
    assert Stiffness().applied(plain) is plain
    found = Stiffness(0.5, 0.02).applied(plain)
    assert found.force_n == pytest.approx([0.5, 1.0, -5.0]) and found.torque_nm == pytest.approx([0.05, 0.1, 0.0])
    assert found.covariance[2, 2] == pytest.approx(0.25 * 0.04 + 0.02**2 * 100)
    assert found.covariance[0, 2] == pytest.approx(0.02**2 * -10)
    assert np.linalg.eigvalsh(found.covariance).min() > 0


# --- a robot's own weight ----------------------------------------------------------------------------------------
NAMES = [f"endcap_{k}" for k in range(6)]
TRUE = dict(zip(NAMES, (0.73, 1.0, 0.9, 1.2, 0.8, 1.05), strict=True))


def stand(name, fractions, rng=None, weight_n=117.7):
    """A posture in which each endcap carries a fraction of the weight, spread along the ground as cables do."""
    generator = np.random.default_rng(list(name.encode()))
    up = np.array([*(0.3 * generator.normal(size=2)), 1.0])
    up /= np.linalg.norm(up)
    force = {key: weight_n * part * up for key, part in fractions.items()}
    side = np.cross(up, [1.0, 0.0, 0.0])
    first, second = list(force)[:2]
    force[first], force[second] = force[first] + 4 * side, force[second] - 4 * side
    noise = (lambda: rng.multivariate_normal(np.zeros(3), COVARIANCE)) if rng is not None else (lambda: np.zeros(3))
    read = {key: value / TRUE[key] + noise() for key, value in force.items()}
    return Posture(name, up, read, dict.fromkeys(read, COVARIANCE))


def postures(rng=None):
    thirds = ((0.2, 0.3, 0.5), (0.5, 0.25, 0.25), (0.3, 0.5, 0.2))
    made = [stand(f"a{k}", dict(zip(NAMES[::2], part, strict=True)), rng) for k, part in enumerate(thirds)]
    return made + [stand(f"b{k}", dict(zip(NAMES[1::2], part, strict=True)), rng) for k, part in enumerate(thirds)]


def test_a_robots_weight_gives_the_gains_of_all_its_endcaps():
    found = fit_gains(postures(), 117.7, NAMES)
    assert found.gain == pytest.approx(TRUE, abs=1e-9) and found.chi_square < 1e-9 and found.freedom == 12
    noisy = fit_gains(postures(np.random.default_rng(2)), 117.7, NAMES)
    assert all(abs(noisy.gain[name] - TRUE[name]) < 4 * noisy.sd[name] < 0.2 for name in NAMES)


def test_a_softer_silicone_has_gains_and_deviations_in_proportion():
    """Half the force and half its deviation are twice the gain; what the model leaves weighs as much as before."""
    stiff = postures(np.random.default_rng(2))
    soft = [
        Posture(p.name, p.up, {k: f / 2 for k, f in p.force_n.items()}, {k: c / 4 for k, c in p.covariance.items()})
        for p in stiff
    ]
    one, other = fit_gains(stiff, 117.7, NAMES), fit_gains(soft, 117.7, NAMES)
    assert other.chi_square == pytest.approx(one.chi_square) and one.chi_square > 0.01
    for name in NAMES:
        assert other.gain[name] == pytest.approx(2 * one.gain[name])
        assert other.sd[name] == pytest.approx(2 * one.sd[name])


def test_the_deviation_of_a_robots_gains_is_that_of_repeated_weighings():
    """However many postures there are: each model is off in all of them, and so is the weight."""
    rng, off = np.random.default_rng(4), []
    for _ in range(100):
        part = {name: 1 + 0.01 * rng.normal() for name in NAMES}
        typed_n = 117.7 * (1 + 0.005 * rng.normal())
        made = [
            Posture(p.name, p.up, {k: f * part[k] for k, f in p.force_n.items()}, dict.fromkeys(NAMES, COVARIANCE / 10))
            for p in 16 * postures()
        ]
        found = fit_gains(made, typed_n, NAMES)
        off += [(found.gain[name] - TRUE[name]) / found.sd[name] for name in NAMES]
    assert 0.6 < np.std(off) < 1.1


def test_of_a_robots_gains_the_verticals_average_out_and_model_and_weight_do_not():
    """Relative variances beside those of model (1 %) and weight (0.5 %), which no number of postures makes smaller."""

    def excess(times, sd_n):
        every = [
            Posture(p.name, p.up, p.force_n, dict.fromkeys(NAMES, sd_n**2 * np.eye(3))) for p in times * postures()
        ]
        found = fit_gains(every, 117.7, NAMES)
        return np.array([(found.sd[name] / found.gain[name]) ** 2 for name in NAMES]) - (0.01**2 + 0.005**2)

    assert (excess(1, 1e-6) > 1e-7).all() and excess(16, 1e-6) == pytest.approx(excess(1, 1e-6) / 16, rel=1e-3)
    assert excess(16, 1.0) == pytest.approx(excess(1, 1.0), rel=0.05)


@pytest.mark.parametrize("noise_part, separated", [(0.01, True), (0.5, False)])
@pytest.mark.parametrize("gain", [0.05, 4.0])
def test_a_gain_is_separated_by_its_own_size(gain, noise_part, separated):
    """A tenth of a soft silicone's gain is little, of a stiff one's much."""
    made = []
    for p in postures():
        read = {k: f * TRUE[k] / gain for k, f in p.force_n.items()}
        made.append(Posture(p.name, p.up, read, dict.fromkeys(read, np.eye(3) * (noise_part * 30 / gain) ** 2)))
    if separated:
        found = fit_gains(made, 117.7, NAMES)
        assert found.gain == pytest.approx(dict.fromkeys(NAMES, gain)) and max(found.sd.values()) < 0.1 * gain
    else:
        with pytest.raises(WeighingError, match="do not separate"):
            fit_gains(made, 117.7, NAMES)


def test_endcaps_that_the_postures_do_not_show_are_named():
    with pytest.raises(WeighingError, match="endcap_5 never carries load"):
        fit_gains([*postures()[:3], stand("c", {"endcap_1": 0.5, "endcap_3": 0.5})], 117.7, NAMES)
    even = [stand(f"d{k}", dict.fromkeys(NAMES[:3], 1 / 3)) for k in range(3)]
    for posture in even:
        for key in posture.force_n:
            posture.force_n[key] = 117.7 / 3 * posture.up / TRUE[key]
    with pytest.raises(WeighingError, match="do not separate endcap_0, endcap_1, endcap_2"):
        fit_gains(even, 117.7, NAMES[:3])


def test_postures_that_something_else_carries_are_refused():
    fourths = ((0.4, 0.2, 0.4), (0.25, 0.45, 0.3))
    more = [stand(f"c{k}", dict(zip(NAMES[1::2], part, strict=True))) for k, part in enumerate(fourths)]
    bad = postures() + more
    bad[4] = Posture("on a box", bad[4].up, {k: 0.6 * v for k, v in bad[4].force_n.items()}, bad[4].covariance)
    with pytest.raises(WeighingError, match=r"contradict one another .*on a box the most"):
        fit_gains(bad, 117.7, NAMES)
    with pytest.raises(WeighingError, match="at least 2"):
        fit_gains(postures()[:1], 117.7, NAMES[::2])
