"""Update of the state by a reading of an endcap: a rolling anchor, which may slip with a probability."""

from __future__ import annotations

import math

import numpy as np

from sensing.robot.between import is_between, measured_errors
from sensing.robot.contact import Contact, contact_of
from sensing.robot.dome import DomeCentre, count_load, difference, dome_centre, unloaded
from sensing.robot.friction import learned, slip_probability
from sensing.robot.jump import jumps
from sensing.robot.layout import Layout
from sensing.robot.measurement_kernels import update_step
from sensing.robot.settings import Contacts, Settings
from sensing.robot.slide import friction_axis, move_by_creep, slide
from sensing.robot.state import MEAN_WEIGHT, State, world_rate
from sensing.tensegrity.description import GRAVITY_M_S2, Array
from sensing.tensegrity.samples import FootSample
from sensing.tensegrity.vectors import cross

LONGEST_GAP_S = 0.15  # largest time between readings of one contact; after a longer one it starts again
STAYS, STARTS = 0.7, 0.02  # E: probabilities that a slip continues, and that one starts at an unremarkable ratio
LEAST, MOST = 1e-3, 0.999  # limits of the probability of slip
STILL_M_S2 = 0.5  # acceleration below which the forces balance the weight
UP = np.array([0.0, 0.0, 1.0])  # vertical of the world


def take(state: State, endcap: int, sample: FootSample, layout: Layout, settings: Settings) -> None:
    """Update the state by one reading of an endcap.

    Args:
        state: predicted to the sample's time; it is changed.
        endcap: number of the endcap.
        sample: the reading.
        layout, settings: indices and assumptions of the estimator.
    """
    contact = contact_of(sample, endcap, layout, settings)
    since = state.time_s - state.contact_s[endcap]
    hear(state, endcap, contact)
    _update_weight_ratio(state, layout)
    if settings.contacts is Contacts.NONE:
        return
    if settings.contacts in (Contacts.BIT_FIXED, Contacts.BIT_ROLLING):
        _take_bit(state, endcap, contact, since, layout, settings)
    elif contact.known and contact.touching:
        if _take_wrench(state, endcap, contact, since, layout, settings):
            state.contact_s[endcap] = state.time_s
    elif contact.touching is False or np.isfinite(contact.push_n) or since > LONGEST_GAP_S:
        release(state, endcap, layout)


def hear(state: State, endcap: int, contact: Contact) -> None:
    """Record a reading of an endcap, and since when its readings have shown no contact.

    Args:
        state: state at the time of the reading; it is changed.
        endcap: number of the endcap.
        contact: contact by the reading.
    """
    state.contacts[endcap], state.reading_s[endcap] = contact, state.time_s
    shows = contact.touching is False or np.isfinite(contact.push_n)
    state.astray_s[endcap] = np.nan if shows else np.fmin(state.astray_s[endcap], state.time_s)


def release(state: State, endcap: int, layout: Layout) -> None:
    """Remove the anchor of an endcap from the state.

    Args:
        state: it is changed.
        endcap: number of the endcap.
        layout: indices of the robot.
    """
    at = layout.anchor(endcap)
    state.anchored[endcap], state.slips[endcap] = 0, 0.0
    state.covariance[at], state.covariance[:, at] = 0.0, 0.0


def _take_bit(state: State, endcap: int, contact: Contact, since: float, layout: Layout, settings: Settings) -> None:
    if not contact.touching:
        return release(state, endcap, layout)
    state.contact_s[endcap], state.normal[endcap] = state.time_s, UP
    variance = np.full(3, settings.bit_sd_m**2)
    centre = DomeCentre(layout.endcap_lever[endcap], np.zeros(3), np.zeros((3, 3)), np.zeros(3))
    fresh = not state.anchored[endcap] or since > LONGEST_GAP_S
    variance += _between(state, endcap, centre, np.eye(3), fresh, layout, settings)
    if fresh:
        return _begin(state, endcap, centre, variance, layout)
    at = layout.anchor(endcap)
    state.covariance[at, at] += settings.anchor_walk**2 * since * np.eye(3)
    _hold(state, endcap, centre, np.eye(3), variance, layout)


def _take_wrench(state: State, endcap: int, contact: Contact, since: float, layout: Layout, settings: Settings) -> bool:
    """Update the state by a contact; False, with normal and load as before, for a reading that jumped."""
    bar = int(layout.endcap_bar[endcap])
    fresh = not state.anchored[endcap] or since > LONGEST_GAP_S
    known = state.known[endcap] if settings.contacts is Contacts.KNOWN else None
    before = state.normal[endcap].copy(), state.normal_variance[endcap], state.load_n[endcap].copy()
    if known is None:
        _learn_normal(state, endcap, contact, fresh, since, bar, settings)
    else:
        state.normal[endcap], state.normal_variance[endcap] = (
            -state.turn[bar] @ _bar_normal(known.normal, endcap, layout),
            1e-6,
        )
    count_load(state, endcap, contact, fresh, layout)
    centre = dome_centre(state, endcap, contact, layout, settings)
    axes = axes_about(state.normal[endcap])
    stays = settings.error_stays_s / min(max(since, 1e-3), settings.error_stays_s)  # samples that share an error
    variance = stays * _variance_of_place(axes @ state.turn[bar], endcap, contact, centre, layout, settings)
    between = _between(state, endcap, centre, axes, fresh, layout, settings)
    single, variance = variance / stays + between, variance + between
    if not fresh:
        _loosen(state, endcap, bar, since, stays, layout, settings)
        if jumps(state, endcap, centre, float(single[0]), stays, layout):
            if state.jumped[endcap]:  # no spike: it stands elsewhere
                release(state, endcap, layout)
                return _take_wrench(state, endcap, contact, since, layout, settings)
            state.normal[endcap], state.normal_variance[endcap], state.load_n[endcap] = before
            state.jumped[endcap] = True
            return False
    state.jumped[endcap] = False
    if fresh:
        state.slips[endcap] = slip_probability(state.friction, contact.use, contact.use_sd)
        _begin(state, endcap, centre, variance, layout)
    else:
        _slide_and_hold(state, endcap, contact, centre, single, variance, since, layout, settings)
    return True


def _loosen(
    state: State, endcap: int, bar: int, since: float, stays: float, layout: Layout, settings: Settings
) -> None:
    """Increase an anchor's covariance by the errors of rolling since the last reading."""
    rate, reach = world_rate(state, bar), float(layout.radius_m[endcap]) * since
    rolled = reach * np.linalg.norm(cross(rate, state.normal[endcap]))
    at, across = layout.anchor(endcap), np.outer(state.normal[endcap], state.normal[endcap])
    walk = settings.anchor_walk**2 * since + stays * (settings.roll_share * rolled) ** 2
    lift = walk + stays * state.normal_variance[endcap] * rolled**2
    state.covariance[at, at] += walk * (np.eye(3) - across) + lift * across


def _slide_and_hold(
    state: State, endcap: int, contact: Contact, centre: DomeCentre, single: Array, variance: Array,
    since: float, layout: Layout, settings: Settings,
) -> None:  # fmt: skip
    """Move an anchor by its slip and creep, and update the state by its place; ``single``: its errors alone."""
    bar, axes = int(layout.endcap_bar[endcap]), axes_about(state.normal[endcap])
    at, across = layout.anchor(endcap), np.outer(state.normal[endcap], state.normal[endcap])
    known = state.known[endcap] if settings.contacts is Contacts.KNOWN else None
    if known is None:
        slips = _slips(state, endcap, contact, centre, axes, single, since, layout, settings)
        state.friction = learned(state.friction, contact.use, contact.use_sd, slips)
    else:
        slips = 0.0 if known.holds else 1.0
    state.slips[endcap] = slips
    mean, spread = slide(state, endcap, bar, contact, settings)
    state.anchor[endcap] += slips * since * mean
    if known is None:
        rate = world_rate(state, bar)
        turned_m = float(layout.radius_m[endcap]) * since * math.sqrt(float(rate @ rate))
        move_by_creep(state, endcap, turned_m * contact.ratio * friction_axis(state, endcap, bar, contact), layout)
    far = slips * since**2 * (spread + (1 - slips) * np.outer(mean, mean))
    state.covariance[at, at] += far + np.trace(far) * state.normal_variance[endcap] * across
    _hold(state, endcap, centre, axes, variance, layout)


def _between(
    state: State, endcap: int, centre: DomeCentre, axes: Array, fresh: bool, layout: Layout, settings: Settings
) -> Array:
    """(3,) variance along ``axes`` of the place of a contact because no inertial sample is of its time."""
    if not is_between(state):
        return np.zeros(3)
    slopes = (unloaded if fresh else difference)(state, endcap, centre, layout)[1]
    return measured_errors(state, axes @ slopes, layout, settings)


def _variance_of_place(
    turn: Array, endcap: int, contact: Contact, centre: DomeCentre, layout: Layout, settings: Settings
) -> Array:
    """(3,) variance of the place of a contact along the rows of ``turn`` (3, 3), bar axes."""
    loads = turn @ (centre.lever_m - layout.endcap_lever[endcap])
    noise = layout.compliance_m_n(endcap, settings) ** 2 * np.einsum(
        "ij,jk,ik->i", turn, contact.force_covariance, turn
    )
    return np.asarray(settings.anchor_sd_m**2 + (settings.compliance_share * loads) ** 2 + noise)


def _bar_normal(normal: Array, endcap: int, layout: Layout) -> Array:
    return np.asarray(layout.endcap_turn[endcap] @ normal)


def _learn_normal(
    state: State, endcap: int, contact: Contact, fresh: bool, since: float, bar: int, settings: Settings
) -> None:
    measured = -state.turn[bar] @ contact.normal
    variance = contact.normal_sd**2 + settings.normal_sd**2
    if fresh:
        state.normal[endcap], state.normal_variance[endcap] = measured, variance
        return
    before = state.normal_variance[endcap] + settings.normal_walk**2 * since
    gain = before / (before + variance)
    normal = (1 - gain) * state.normal[endcap] + gain * measured
    state.normal[endcap] = normal / np.linalg.norm(normal)
    state.normal_variance[endcap] = max((1 - gain) * before, settings.normal_sd**2)


def axes_about(normal: Array) -> Array:
    """(3, 3) orthonormal rows: the normal (3,), unit, and two tangents."""
    x, y, z = normal
    one = np.array([1.0, 0.0, 0.0]) if abs(x) < 0.6 else UP
    one = one - (one @ normal) * normal
    one /= np.sqrt(one @ one)
    a, b, c = one
    return np.array([normal, one, [y * c - z * b, z * a - x * c, x * b - y * a]])


def _begin(state: State, endcap: int, centre: DomeCentre, variance: Array, layout: Layout) -> None:
    """Start an anchor at the present position of the sphere's centre."""
    at, release_slips = layout.anchor(endcap), state.slips[endcap]
    release(state, endcap, layout)
    point, slopes = unloaded(state, endcap, centre, layout)
    rows = slopes @ state.covariance
    state.covariance[at], state.covariance[:, at] = rows, rows.T
    axes = axes_about(state.normal[endcap])
    state.covariance[at, at] = slopes @ rows.T + axes.T @ np.diag(variance) @ axes
    state.anchor[endcap], state.anchored[endcap], state.slips[endcap] = point, 1, release_slips


def _slips(
    state: State, endcap: int, contact: Contact, centre: DomeCentre, axes: Array, variance: Array, since: float,
    layout: Layout, settings: Settings,
) -> float:  # fmt: skip
    """Probability of slip: prior from friction ratio and last probability, Bayes' rule with the innovation."""
    by_ratio = slip_probability(state.friction, contact.use, contact.use_sd)
    before = state.slips[endcap]
    prior = by_ratio * (STAYS * before + (1 - before)) + STARTS * by_ratio * (1 - by_ratio)
    prior = min(max(prior, LEAST), MOST)
    mean, spread = slide(state, endcap, int(layout.endcap_bar[endcap]), contact, settings)
    innovation, slopes = difference(state, endcap, centre, layout)
    rows = axes[1:] @ slopes
    holds = rows @ state.covariance @ rows.T + np.diag(variance[1:])
    slips = holds + since**2 * axes[1:] @ spread @ axes[1:].T
    across = axes[1:] @ innovation
    logs = [_log_density(across, holds), _log_density(across + since * axes[1:] @ mean, slips)]
    odds = prior / (1 - prior) * float(np.exp(np.clip(logs[1] - logs[0], -20, 20)))
    return min(max(odds / (1 + odds), LEAST), MOST)


def _log_density(x: Array, spread: Array) -> float:
    """Logarithm of the normal density of x (2,) with covariance ``spread`` (2, 2), up to a constant."""
    (a, b), (_, c) = spread.tolist()
    square = max(a * c - b * b, 1e-30)  # rounding can make the determinant of a diverged covariance negative
    u, v = x.tolist()
    return -0.5 * ((c * u * u - 2 * b * u * v + a * v * v) / square + math.log(square))


def _hold(state: State, endcap: int, centre: DomeCentre, axes: Array, variance: Array, layout: Layout) -> None:
    """Update step with the measurement that the endcap is at its anchor."""
    innovation, slopes = difference(state, endcap, centre, layout)
    found = np.empty(3)
    change = update_step(
        state.covariance, np.ascontiguousarray(axes @ slopes), axes @ innovation, variance, np.inf, found
    )
    state.consistency[1] += MEAN_WEIGHT * (float(found.mean()) - state.consistency[1])
    state.correct(change)


def _update_weight_ratio(state: State, layout: Layout) -> None:
    """Update the mean ratio of the vertical forces to the weight while the robot does not accelerate."""
    leader = layout.leader
    push = state.turn[leader] @ (state.force[leader] - state.force_bias[leader])
    recent = state.time_s - state.reading_s <= LONGEST_GAP_S
    if not recent.all() or float(np.linalg.norm(push - GRAVITY_M_S2 * UP)) > STILL_M_S2:
        return
    total = 0.0
    for endcap, contact in enumerate(state.contacts):
        if contact is not None and contact.touching is not False:
            total += float(state.turn[layout.endcap_bar[endcap], 2] @ contact.force_n)
    ratio = total / (layout.mass_kg.sum() * GRAVITY_M_S2)
    if np.isfinite(ratio):
        state.weight_ratio = (
            ratio if np.isnan(state.weight_ratio) else state.weight_ratio + MEAN_WEIGHT * (ratio - state.weight_ratio)
        )
