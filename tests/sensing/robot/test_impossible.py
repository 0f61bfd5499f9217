"""Numbers that no sensor of a robot measures: a broken message, or another unit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from standing_robot import feed, standing_samples

from cad.errors import ParameterError
from sensing.live.outputs.ros import types as ros
from sensing.robot.estimator import RobotEstimator
from sensing.robot.filter import _misfits
from sensing.robot.layout import layout_of
from sensing.robot.node import messages
from sensing.robot.node.record import estimate_text
from sensing.robot.samples_check import SampleCheck
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample

ROBOT = load_robot()
POSES, SAMPLES = standing_samples(ROBOT, 2.0, rate_hz=100.0, every=5)
CASES = {
    "rate": (InertialSample, "rate_rad_s", 1e200, "rad/s"),
    "rate of a broken word": (InertialSample, "rate_rad_s", 572.0, "rad/s"),
    "acceleration": (InertialSample, "acceleration_m_s2", -1e4, "m/s^2"),
    "lengths": (LengthSample, "lengths_m", 540.0, " m is outside"),
    "lengths of zero": (LengthSample, "lengths_m", 0.0, " m is outside"),
    "force": (FootSample, "force_n", 1e300, " N is outside"),
    "torque": (FootSample, "torque_nm", float("inf"), " N m is outside"),
}


def broken(sample, kind, field, value):
    if not isinstance(sample, kind) or getattr(sample, field) is None:
        return sample
    return replace(sample, **{field: np.full(np.shape(getattr(sample, field)), value)})


@pytest.mark.parametrize("case", CASES)
@pytest.mark.filterwarnings("error")
def test_a_few_impossible_numbers_change_nothing_and_are_named(case):
    kind, field, value, unit = CASES[case]
    estimator = RobotEstimator(ROBOT)
    feed(estimator, [broken(s, kind, field, value) if 1.395 < s.time_s < 1.43 else s for s in SAMPLES])
    estimate = estimator.state()
    expected = RobotEstimator(ROBOT)
    feed(expected, SAMPLES)
    wanted = expected.state()
    assert wanted.health.good
    assert any(unit in note and "left out" in note for note in estimate.health.notes), estimate.health.notes
    for found, true in zip(estimate.bars, wanted.bars, strict=True):
        assert np.abs(found.T_world_bar - true.T_world_bar).max() < 0.02
        assert np.isfinite(found.covariance).all()
    estimate_text(estimate)


def test_a_spike_of_a_force_under_which_no_dome_yields_changes_no_softness():
    estimators = []
    for spike_n in (np.nan, 900.0):
        estimator = RobotEstimator(ROBOT)
        for sample in SAMPLES:
            if isinstance(sample, FootSample) and sample.touching and 1.695 < sample.time_s < 1.72:
                wrench = np.array([*sample.force_n, *sample.torque_nm])
                wrench *= spike_n / np.linalg.norm(sample.force_n)
                sample = replace(sample, force_n=wrench[:3], torque_nm=wrench[3:])
            feed(estimator, [sample])
        estimators.append(estimator.state())
    missing, spiked = estimators
    assert spiked.softness == missing.softness and abs(spiked.softness) < 0.2
    assert spiked.centre_of_mass_m == pytest.approx(missing.centre_of_mass_m, abs=1e-9)


def test_one_impossible_length_counts_as_missing():
    taken = []
    for value in (np.nan, np.inf, -0.5, 540.0):
        estimator = RobotEstimator(ROBOT)
        one = np.arange(9) == 4
        feed(
            estimator,
            [
                replace(s, lengths_m=np.where(one, value, s.lengths_m)) if isinstance(s, LengthSample) else s
                for s in SAMPLES
            ],
        )
        taken.append(estimator.state())
    assert 'cable "green-blue second": no length, or none that fits, yet' in taken[0].health.notes
    for estimate in taken[1:]:
        assert (estimate.bars[1].T_world_bar == taken[0].bars[1].T_world_bar).all()
        assert 'cable "' in estimate.health.notes[0] and estimate.health.ignored == 0


@pytest.mark.parametrize("jump_m", [0.03, 0.1, -0.3])
def test_a_length_that_jumps_once_counts_as_missing(jump_m):
    """It counted as a shape in which no length fits, so it was taken: 0.1 m turned a bar by 8 degrees."""
    found = []
    for off_m in (np.nan, jump_m):
        estimator = RobotEstimator(ROBOT)
        for sample in SAMPLES:
            if isinstance(sample, LengthSample) and 1.7 < sample.time_s < 1.73:
                lengths_m = sample.lengths_m.copy()
                lengths_m[3] += off_m
                feed(estimator, [replace(sample, lengths_m=lengths_m)])
                found.append(estimator.state())
            else:
                feed(estimator, [sample])
        found.append(estimator.state())
    missing, later, jumped, later_jumped = found
    assert missing.health.rejected == 0 and jumped.health.rejected == 1 and later_jumped.health.good
    for one, other in ((missing, jumped), (later, later_jumped)):
        assert all((a.T_world_bar == b.T_world_bar).all() for a, b in zip(one.bars, other.bars, strict=True))


def test_lengths_that_are_all_a_little_off_are_no_jump():
    """Linear steps leave all lengths off: with the largest alone left out, one run drifted by a third more."""
    fits = np.append(np.full(8, 0.5), np.nan)
    assert not _misfits(np.append(fits, 60.0), again=False) and _misfits(np.append(fits, 60.0), again=True)
    assert _misfits(np.append(np.full(8, 3.0), 60.0), again=False)


def test_a_length_that_stays_off_is_no_jump():
    """A filter that left it out for good would never come back from a wrong shape."""
    estimator, rejected = RobotEstimator(ROBOT), []
    for sample in SAMPLES:
        if isinstance(sample, LengthSample) and sample.time_s > 1.7:
            sample = replace(sample, lengths_m=sample.lengths_m + 0.3 * (np.arange(9) == 3))
        feed(estimator, [sample])
        if isinstance(sample, LengthSample) and sample.time_s > 1.7:
            rejected.append(estimator.state().health.rejected)
    assert rejected[:2] == [1, 0] and not estimator.state().health.good


def test_lengths_in_millimetres_are_named_before_there_is_an_estimate():
    estimator = RobotEstimator(ROBOT)
    feed(estimator, [replace(s, lengths_m=1000 * s.lengths_m) if isinstance(s, LengthSample) else s for s in SAMPLES])
    assert estimator.state() is None
    assert len(estimator.left_out()) == 9 and "outside 0..2.46" in estimator.left_out()[0]


def test_wrenches_of_no_contact_on_the_dome_are_named():
    """A torque in N mm: the line of action passes a dome at meters, so no contact counts and the place is lost."""
    samples = standing_samples(ROBOT, 3.0, rate_hz=100.0, every=5)[1]
    wrong = [replace(s, torque_nm=1000 * s.torque_nm) if isinstance(s, FootSample) else s for s in samples]
    notes = []
    for given in (samples, wrong):
        estimator = RobotEstimator(ROBOT)
        feed(estimator, given)
        notes.append(estimator.state().health.notes)
    named = [note.split(":")[0] for note in notes[1] if "of no contact on its dome" in note]
    assert named == ["endcap_0", "endcap_2", "endcap_4"] and not notes[0]


def test_numbers_that_their_sender_calls_invalid_count_as_none():
    """Zeros in them meant an endcap that touches nothing."""
    sample = foot(force_n=0.0)
    message = ros.decode(ros.ENDCAP_WRENCH, messages.sample_message(sample, (), 0)[1])
    assert (messages.sample_from(ros.ENDCAP_WRENCH, message, 0).force_n == 0).all()
    found = messages.sample_from(ros.ENDCAP_WRENCH, replace(message, valid=False), 0)
    assert np.isnan(found.force_n).all() and found.touching is None


@pytest.mark.parametrize("touching", [None, True])
def test_readings_without_numbers_are_named(touching):
    """Of an endcap whose pictures show nothing, health was good, and with a contact bit it was said to hold."""
    estimator = RobotEstimator(ROBOT)
    for sample in standing_samples(ROBOT, 3.2, rate_hz=100.0, every=5)[1]:
        if isinstance(sample, FootSample) and sample.endcap == "endcap_0" and sample.time_s > 2.0:
            nothing = np.full(3, np.nan)
            sample = replace(sample, force_n=nothing, torque_nm=nothing, touching=touching)
        feed(estimator, [sample])
        if sample.time_s == pytest.approx(2.9):  # a second is no fault yet
            assert estimator.state().health.good
    estimate = estimator.state()
    assert [note for note in estimate.health.notes if note.startswith("endcap_0: no valid force for 1.1 s")]
    assert [endcap.hold.word for endcap in estimate.endcaps] == ["unknown", "free", *["holds", "free"] * 2]


def test_an_inertial_message_that_measures_no_rate_is_no_bar_that_stands():
    """sensor_msgs/Imu has -1 as the first covariance of what is not measured; its zeros were taken for a rate."""
    sample = InertialSample(1.0, "imu_red", np.zeros(3), np.array([0.0, 0.0, 9.81]))
    message = ros.decode(messages.IMU, messages.sample_message(sample, (), 0)[1])
    assert (messages.sample_from(messages.IMU, message, 0).rate_rad_s == 0).all()
    without = replace(message, angular_velocity_covariance=np.full(9, -1.0))
    assert np.isnan(messages.sample_from(messages.IMU, without, 0).rate_rad_s).all()
    estimator = RobotEstimator(ROBOT)
    names = {s.name for s in ROBOT.sensors} - {"imu_red"}
    nan = np.full(3, np.nan)
    green = [s if getattr(s, "sensor", "") not in names else replace(s, rate_rad_s=nan) for s in SAMPLES]
    feed(estimator, green)
    assert any("imu_green: no sample" in note for note in estimator.state().health.notes)


@pytest.mark.parametrize("filled", [0.0, np.nan, 1e6])
def test_what_fills_the_acceleration_of_a_sensor_without_accelerometer_changes_nothing(filled):
    """Zeros, as many drivers fill it, were taken for a fall: no estimate for ten seconds, and none that was good."""
    estimates = []
    for value in (None, np.full(3, filled)):
        estimator = RobotEstimator(ROBOT)
        named = {sensor.name for sensor in ROBOT.sensors if not sensor.accelerometer}
        for sample in SAMPLES:
            of_gyroscope = getattr(sample, "sensor", "") in named
            feed(estimator, [replace(sample, acceleration_m_s2=value) if of_gyroscope else sample])
        estimates.append(estimator.state())
    assert estimate_text(estimates[0]) == estimate_text(estimates[1]) and estimates[0].health.good


@pytest.mark.parametrize(("factor", "frames"), [(5.0, 1), (0.1, 1), (5.0, 2), (5.0, 10)])
def test_forces_that_jump_move_neither_pose_nor_softness(factor, frames):
    """One frame of 200 N, which its sender calls valid, moved the softness by 0.6; ten frames are another contact."""
    _, samples = standing_samples(ROBOT, 4.0, noise=0.0)
    plain, spiked = RobotEstimator(ROBOT), RobotEstimator(ROBOT)
    feed(plain, samples)
    times = [s.time_s for s in samples if isinstance(s, FootSample) and s.endcap == "endcap_0" and s.time_s > 2.5]
    for sample in samples:
        if isinstance(sample, FootSample) and sample.endcap == "endcap_0" and sample.time_s in times[:frames]:
            sample = replace(sample, force_n=factor * sample.force_n, torque_nm=factor * sample.torque_nm)
        feed(spiked, [sample])
    wanted, found = plain.state(), spiked.state()
    assert abs(found.softness - wanted.softness) < 0.02
    assert np.linalg.norm(found.centre_of_mass_m - wanted.centre_of_mass_m) < 1e-3
    state = spiked._history.at(spiked.newest_s).state
    assert state.contact_s[0] == max(times)  # it counts again


def checked(sample, newest_s=1.0):
    return SampleCheck(layout_of(ROBOT)).usable(sample, newest_s)


def imu(**changed) -> InertialSample:
    sensor = next(sensor.name for sensor in ROBOT.sensors if sensor.accelerometer)
    return replace(InertialSample(1.0, sensor, np.zeros(3), np.array([0.0, 0.0, 9.8])), **changed)


def foot(force_n=0.0, torque_nm=0.0) -> FootSample:
    return FootSample(1.0, "endcap_0", np.array([0.0, 0.0, force_n]), np.array([0.0, 0.0, torque_nm]))


@pytest.mark.parametrize(
    ("possible", "impossible"),
    [
        (imu(rate_rad_s=np.full(3, 74.0)), imu(rate_rad_s=np.full(3, -76.0))),
        (imu(acceleration_m_s2=np.full(3, -990.0)), imu(acceleration_m_s2=np.full(3, 1010.0))),
        (imu(acceleration_m_s2=None), imu(acceleration_m_s2=np.array([0.0, np.nan, 9.8]))),
        (foot(force_n=-11_000.0), foot(force_n=13_000.0)),  # a hundred times its weight of 12 kg, over 1000 N
        (foot(torque_nm=-11_000.0), foot(torque_nm=13_000.0)),  # at a lever of a metre
    ],
    ids=["rate", "acceleration", "NaN", "force", "torque"],
)
def test_what_a_sensor_may_measure_ends_where_it_should(possible, impossible):
    assert checked(possible) is possible and checked(impossible) is None


def test_an_impossible_number_is_named_for_ten_seconds():
    check = SampleCheck(layout_of(ROBOT))
    check.usable(imu(rate_rad_s=np.full(3, 80.0)), 1.0)
    assert [len(check.notes(time_s)) for time_s in (1.0, 10.9, 11.1)] == [1, 1, 0]


def test_samples_of_two_clocks_are_those_more_than_a_minute_apart():
    """One as far ahead may follow a pause."""
    assert checked(imu(), newest_s=60.9) is not None and checked(imu(), newest_s=-1000.0) is not None
    with pytest.raises(ParameterError, match=r"time_s=1\.000 is 60 s before the other samples"):
        checked(imu(), newest_s=61.1)
