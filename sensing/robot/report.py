"""The filter's state as a record for outputs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sensing.robot.between import extrapolate, rate_walk
from sensing.robot.contact import Contact
from sensing.robot.contacts import LONGEST_GAP_S
from sensing.robot.estimate import BarEstimate, EndcapEstimate, Health, Hold, RobotEstimate
from sensing.robot.friction import moments
from sensing.robot.layout import Layout
from sensing.robot.measurement_kernels import point_slopes
from sensing.robot.settings import Contacts, Settings
from sensing.robot.silence import UNSEEN_S
from sensing.robot.state import INCONSISTENT, SILENT_S, State, world_rate
from sensing.tensegrity.description import Array
from sensing.tensegrity.vectors import cross, minus_cross

ROLLING_M_S, ROLLING_SPREAD = 0.01, 0.003  # E: speed of the sphere's centre at which rolling begins; spread
WRONG_BIT = 0.02  # E: probability that the contact bit is wrong
WEIGHT_OFF = 0.5  # relative error of the sum of forces against the weight from which a note is made
SOFTNESS_OFF = 3.0  # in Settings.softness_sd; no silicone differs by more: noise of the forces is taken for it
SLOW_S = 1 / 12  # E: s between samples of an inertial sensor from which a note is made (docs/robot_accuracy.md)
SILENT_LENGTHS_S = 0.2  # s without lengths from which a note is made
ASTRAY_S = 1.0  # E: s; shorter times without a contact occur when two supports touch at once, or in one odd picture
LOST_M_S = 1.0  # standard deviation of the velocity from which a note is made
ANEW_S = 10.0  # s in which a note states that the estimate began again
NAN_3 = np.full(3, np.nan)  # vector without a value
UNKNOWN = Hold(np.nan, np.nan, np.nan, np.nan)  # probabilities of an endcap without a reading that shows its contact


def report_of(
    state: State, measured_s: float, ignored: int, impossible: Sequence[str], layout: Layout, settings: Settings
) -> RobotEstimate:
    """The record of a state.

    Args:
        state: state of the filter; its covariance is changed.
        measured_s: capture time of the newest sample in it, s.
        ignored: number of samples left out so far.
        impossible: one line for each sensor with impossible numbers lately.
        layout, settings: indices and assumptions of the estimator.
    """
    extrapolate(state, layout, settings)
    masses = [_point(state, bar, layout.mass_lever[bar], layout) for bar in range(layout.bars)]
    share = layout.mass_kg / layout.mass_kg.sum()
    centre = sum((part * point for part, (point, _) in zip(share, masses, strict=True)), np.zeros(3))
    slopes = sum((part * slope for part, (_, slope) in zip(share, masses, strict=True)), np.zeros((3, layout.size)))
    friction, friction_sd = moments(state.friction)
    return RobotEstimate(
        state.time_s, measured_s,
        tuple(_bar(state, bar, layout, settings) for bar in range(layout.bars)),
        tuple(_endcap(state, endcap, layout, settings) for endcap in range(layout.endcaps)),
        centre, slopes @ state.covariance @ slopes.T, friction, friction_sd,
        float(state.softness[0]), float(np.sqrt(state.covariance[layout.softness, layout.softness])),
        float(state.delay_s[0]), float(np.sqrt(state.covariance[layout.delay, layout.delay])),
        _health(state, ignored, impossible, layout, settings),
    )  # fmt: skip


def _point(state: State, bar: int, lever: Array, layout: Layout) -> tuple[Array, Array]:
    return point_slopes(state.turn, state.place, bar, np.ascontiguousarray(lever), layout.leader, layout.size)


def _bar(state: State, bar: int, layout: Layout, settings: Settings) -> BarEstimate:
    lever = -layout.reference_m[bar]
    origin, slopes = _point(state, bar, lever, layout)
    rate = _rate(state, bar)
    arm = state.turn[bar] @ lever
    velocity = state.velocity[bar] + cross(rate, arm)
    rows = np.zeros((9, layout.size))
    rows[:3] = slopes
    rows[3:6, layout.turn(bar)] = np.eye(3)
    rows[6:, layout.velocity(bar)] = np.eye(3)
    rows[6:, layout.turn(layout.leader)] += minus_cross(state.velocity[bar])
    across = minus_cross(arm)  # d(rate x arm) = -arm x d rate + rate x d arm
    rows[6:, layout.turn(bar)] += minus_cross(cross(rate, arm))
    rows[6:, layout.rate_bias(bar)] -= across @ state.turn[bar]
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = state.turn[bar], origin
    covariance, of_rate = rows @ state.covariance @ rows.T, _rate_covariance(state, bar, layout, settings)
    variance, bias = _rate_variance(state, bar, settings), layout.rate_bias(bar)
    covariance[6:, 6:] += variance * across @ across.T
    in_bar = state.covariance[bias, bias] + variance * np.eye(3)
    return BarEstimate(layout.robot.bars[bar].name, pose, velocity, rate, covariance, of_rate, in_bar)


def _fell_silent(state: State, bar: int) -> bool:
    """Whether a bar's gyroscope has sent samples but sends none now."""
    return bool(state.silent_after_s[bar] < state.time_s - float(state.rate_s[bar]) < np.inf)


def _rate(state: State, bar: int) -> Array:
    """(3,) angular velocity of a bar, world axes, rad/s; zero, the likeliest, if its gyroscope fell silent."""
    return np.zeros(3) if _fell_silent(state, bar) else world_rate(state, bar)


def _rate_covariance(state: State, bar: int, layout: Layout, settings: Settings) -> Array:
    """(3, 3) covariance of a bar's angular velocity, world axes: rotation, bias, and what the last sample lacks."""
    rows = np.zeros((3, layout.size))
    rows[:, layout.turn(bar)], rows[:, layout.rate_bias(bar)] = minus_cross(_rate(state, bar)), -state.turn[bar]
    return np.asarray(rows @ state.covariance @ rows.T + _rate_variance(state, bar, settings) * np.eye(3))


def _rate_variance(state: State, bar: int, settings: Settings) -> float:
    """Variance of the last rate about each axis, rad^2/s^2: its noise, and that the rate has changed since."""
    noise, over_s, walked = settings.rate_noise, state.rate_over_s[bar], rate_walk(state, bar, settings)
    walked *= max(0.0, float(state.time_s - state.rate_s[bar])) + over_s / 3 if walked else 0.0
    if _fell_silent(state, bar):
        noise, over_s, walked = settings.unknown_rate_noise, SILENT_S, 0.0
    return float(noise**2 / over_s + walked)


def _endcap(state: State, endcap: int, layout: Layout, settings: Settings) -> EndcapEstimate:
    bar = int(layout.endcap_bar[endcap])
    centre, slopes = _point(state, bar, layout.endcap_lever[endcap], layout)
    spread = slopes @ state.covariance @ slopes.T
    name, contact = layout.robot.endcaps[endcap].name, state.contacts[endcap]
    old = state.time_s - state.reading_s[endcap] > LONGEST_GAP_S
    if contact is None or contact.touching is None or old:
        return EndcapEstimate(name, centre, spread, UNKNOWN, NAN_3, NAN_3, np.nan, NAN_3, np.nan, np.nan)
    counts = bool(state.anchored[endcap]) or (contact.known and settings.contacts is Contacts.NONE)
    shows = counts or not contact.touching or np.isfinite(contact.push_n)  # else nothing says whether it slips
    hold = _hold(state, endcap, bar, bool(contact.touching), layout) if shows else UNKNOWN
    force = state.turn[bar] @ contact.force_n
    if not (contact.touching and counts):
        return EndcapEstimate(name, centre, spread, hold, NAN_3, NAN_3, np.nan, force, np.nan, np.nan)
    normal = state.normal[endcap].copy()
    pressed = state.anchor[endcap] if state.anchored[endcap] else centre  # its load has moved the sphere on the bar
    return EndcapEstimate(
        name, centre, spread, hold, pressed - layout.radius_m[endcap] * normal, normal,
        float(np.sqrt(state.normal_variance[endcap])), force, contact.ratio, contact.ratio_sd,
    )  # fmt: skip


def _hold(state: State, endcap: int, bar: int, touching: bool, layout: Layout) -> Hold:
    free = WRONG_BIT if touching else 1 - WRONG_BIT
    speed = layout.radius_m[endcap] * float(np.linalg.norm(cross(_rate(state, bar), state.normal[endcap])))
    rolls = 1 / (1 + float(np.exp(np.clip((ROLLING_M_S - speed) / ROLLING_SPREAD, -40, 40))))
    slips = (1 - free) * float(state.slips[endcap])
    rest = 1 - free - slips
    return Hold((1 - rolls) * rest, rolls * rest, slips, free)


def _health(state: State, ignored: int, impossible: Sequence[str], layout: Layout, settings: Settings) -> Health:
    notes = [*impossible, *_lost(state, layout), *_of_inertial(state, layout), *_of_cables(state, layout)]
    for number, endcap in enumerate(layout.robot.endcaps):
        if (since := state.time_s - state.reading_s[number]) > LONGEST_GAP_S:
            notes.append(f"{endcap.name}: no reading {_since(since)}")
        elif (since := state.time_s - state.astray_s[number]) > ASTRAY_S:
            notes.append(f"{endcap.name}: {_astray(state.contacts[number], since)}")
    lengths, anchors = (float(value) for value in state.consistency)
    if lengths > INCONSISTENT:
        notes.append(f"cable lengths are off by {lengths**0.5:.1f} times what is expected: check attachments")
    if anchors > INCONSISTENT:
        notes.append(f"contacts are off by {anchors**0.5:.1f} times what is expected")
    if abs(state.weight_ratio - 1) > WEIGHT_OFF:
        notes.append(
            f"the endcaps carry {state.weight_ratio:.2f} of the weight: something else touches, or forces are off"
        )
    softness = float(state.softness[0])
    if abs(softness) > SOFTNESS_OFF * settings.softness_sd:
        notes.append(
            f"domes seem to yield by {1 + softness:.2f} of Settings.compliance_m_n: it is wrong, or wrenches are "
            "noisier than they state: heights of contacts may be off by more than their covariance says"
        )
    return Health(lengths, anchors, float(state.weight_ratio), state.rejected, ignored, tuple(notes))


def _astray(contact: Contact | None, since_s: float) -> str:
    """What readings of an endcap that show no contact lack."""
    if contact is None or not np.isfinite(contact.force_n).all():
        return f"no valid force {_since(since_s)}: where it is and whether it holds is not measured"
    return (
        "its force and torque are of no contact on its dome: check their units, and that the torque is about the "
        "centre of the mating plane"
    )


def _of_cables(state: State, layout: Layout) -> list[str]:
    """Which lengths do not come, or are left out again and again."""
    since_s = state.time_s - state.lengths_s
    if since_s.min() > SILENT_LENGTHS_S:
        return [f"cable lengths: no sample {_since(float(since_s.min()))}: the shape drifts"]
    names = [cable.name for cable in layout.robot.cables if cable.measured]
    return [
        f'cable "{name}": no length, or none that fits, {_since(silent_s)}'
        for name, silent_s in zip(names, since_s.tolist(), strict=True)
        if silent_s > SILENT_LENGTHS_S
    ]


def _of_inertial(state: State, layout: Layout) -> list[str]:
    """What inertial sensors lack."""
    notes: list[str] = []
    silent_s = state.silent_after_s
    for bar, name in enumerate(layout.sensor_of_bar):
        label = layout.robot.bars[bar].name
        if name is None:
            notes.append(f"bar {label} has no gyroscope: its turn comes from cables and contacts alone")
        elif state.time_s - state.rate_s[bar] > silent_s[bar]:
            notes.append(f"{name}: no sample {_since(state.time_s - state.rate_s[bar])}: bar {label} is less sure")
        elif SLOW_S < state.usual_s[bar] < np.inf:
            notes.append(
                f"{name}: {1 / state.usual_s[bar]:.0f} samples a second, too few to follow how bar {label} turns: "
                "poses may be off by more than their covariance says: give 25 or more"
            )
    if not layout.has_force.any():
        notes.append("no accelerometer: shape and steps of the contacts only; which way is up is not measured")
    elif not state.held_s and state.time_s - state.force_s[layout.leader] > silent_s[layout.leader]:
        notes.append("accelerometer: no sample: shape and steps of the contacts only")
    return notes


def _lost(state: State, layout: Layout) -> list[str]:
    notes = []
    if state.held_s:
        notes.append(
            "pose held as it was: the inertial sensor of the leading bar fell silent, or contacts contradicted it: "
            "once it reports, the robot has to stand still for a second"
        )
    if state.time_s - state.anew_s < ANEW_S:
        notes.append("begun anew while it stood: the shape is measured again, place and heading are those of before")
    notes += _begun(state, layout)
    if state.lost:
        notes.append(
            "contacts contradicted place and velocity, as after a broken inertial sample: these and the shape are less "
            "certain, until the robot has stood still for a second"
        )
    if state.unseen_s >= UNSEEN_S:
        notes.append(
            f"several gyroscopes were silent at once: for {state.unseen_s:.1f} s; bars may be turned by more than "
            "their covariance says, until the robot has stood still for a second"
        )
    at = layout.velocity(layout.leader)
    speed_sd = float(np.sqrt(np.trace(state.covariance[at, at])))
    if not speed_sd <= LOST_M_S:  # also true for NaN
        notes.append(f"place is being lost: velocity is known to {speed_sd:.1f} m/s: contacts or inertial samples lack")
    return notes


def _begun(state: State, layout: Layout) -> list[str]:
    """What was missing as the estimate began."""
    notes = []
    if state.began_moving:
        notes.append(
            "begun while the robot moved, or a gyroscope was off by over 0.1 rad/s: its shape may be wrong until it "
            "has stood still for a second"
        )
    if state.began_silent:
        names = ", ".join(layout.robot.endcaps[endcap].name for endcap in state.began_silent)
        notes.append(
            f"begun without the force of {names}: the shape may be wrong by more than its covariance says, until "
            "they report and the robot has stood still for a second"
        )
    if state.began_lifted:
        notes.append(
            "begun with no endcap on the ground: the shape may be wrong by more than its covariance says, until the "
            "robot has stood on them for a second"
        )
    if state.began_unmeasured:
        names = ", ".join(str(layout.sensor_of_bar[bar]) for bar in state.began_unmeasured)
        notes.append(
            f"begun without {names}: bars may be turned by more than their covariance says, until it reports and the "
            "robot has stood still for a second"
        )
    if state.began_unbalanced:
        notes.append(
            "begun with forces under which the bars are in no balance: the shape is wrong by more than its covariance "
            "says: check the endcaps' names, bar, end and turn_deg in the description, and that nothing else touches"
        )
    return notes


def _since(seconds: float) -> str:
    return f"for {seconds:.1f} s" if np.isfinite(seconds) else "yet"
