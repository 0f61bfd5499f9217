"""Yield of a dome under its contact, and the position of its centre without load."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sensing.robot.contact import Contact
from sensing.robot.layout import Layout
from sensing.robot.measurement_kernels import point_slopes
from sensing.robot.settings import Settings
from sensing.robot.state import State, world_rate
from sensing.tensegrity.description import Array
from sensing.tensegrity.vectors import cross, minus_cross

TEACHES = 3.0  # standard deviations of its own error from which a load or a speed teaches softness or delay


@dataclass(frozen=True)
class DomeCentre:
    """Position of the centre that a dome would have without load, from its contact.

    Attributes:
        lever_m: (3,) from the bar's reference point, bar axes, m.
        softens_m: (3,) derivative of the centre by the softness, along the normal, world axes, m.
        late_s: (3, 3) derivative of the centre by the velocity of the bar, world axes, s.
        delays_m_s: (3,) derivative of the centre by the delay, world axes, m/s.
    """

    lever_m: Array
    softens_m: Array
    late_s: Array
    delays_m_s: Array


def count_load(state: State, endcap: int, contact: Contact, fresh: bool, layout: Layout) -> None:
    """Take a contact's normal force as the load by which the softness is learned, if it has changed by more than noise.

    Of two readings that differ by their errors alone, stiffer domes explain the difference better, and a filter whose
    slopes have these errors would be sure of it (errors in variables: Fuller 1987, Measurement error models). The
    load keeps its direction, too, because the error of a normal comes from that of the same force.

    Args:
        state: it is changed.
        endcap: number of the endcap.
        contact: contact with its force.
        fresh: whether the contact begins.
        layout: indices of the robot.
    """
    across = state.normal[endcap] @ state.turn[int(layout.endcap_bar[endcap])]
    push, spread = float(across @ contact.force_n), float(across @ contact.force_covariance @ across)
    changed = push - float(np.linalg.norm(state.load_n[endcap]))
    if fresh or not changed**2 <= TEACHES**2 * 2 * spread:
        state.load_n[endcap] = push * state.normal[endcap]


def dome_centre(state: State, endcap: int, contact: Contact, layout: Layout, settings: Settings) -> DomeCentre:
    """Centre of the unloaded dome above a contact.

    A dome of stiffness k and damping c has F = k d + c d', so d = (F - c d') / k: a dome that is being pressed has
    yielded less than F / k. Along the normal d' is the speed at which the bar's end approaches the ground.
    1 / k = (1 + b) times its compliance: the softness b is part of the state, so that its error is common to all domes.
    So is the delay c / k: it also holds by how much the readings' stamps are late or early, because the force of
    another moment differs by k d' for each second.

    Args:
        state: state with its velocities, the contact's normal and its load (:func:`count_load`).
        endcap: number of the endcap.
        contact: contact with its force.
        layout, settings: indices and assumptions of the estimator.
    """
    bar, normal = int(layout.endcap_bar[endcap]), state.normal[endcap]
    lever, yields = layout.endcap_lever[endcap], layout.compliance_m_n(endcap, settings) * contact.force_n
    arm = state.turn[bar] @ lever
    leaves = float((state.velocity[bar] + cross(world_rate(state, bar), arm)) @ normal)
    delay_s = layout.yield_delay_s(endcap, settings) + float(state.delay_s[0])
    late = delay_s * leaves * (normal @ state.turn[bar])
    late_s = delay_s * np.outer(normal, normal)
    spread = state.covariance[layout.velocity(bar), layout.velocity(bar)]
    teaches = abs(leaves) > TEACHES * math.sqrt(max(0.0, float(normal @ spread @ normal)))
    softens = layout.compliance_m_n(endcap, settings) * state.load_n[endcap]
    return DomeCentre(lever + (1 + state.softness[0]) * yields + late, softens, late_s, teaches * leaves * normal)


def unloaded(state: State, endcap: int, centre: DomeCentre, layout: Layout) -> tuple[Array, Array]:
    """Position of the centre of an unloaded dome in the world.

    Args:
        state: poses of the bars, and the contact's normal.
        endcap: number of the endcap.
        centre: centre of its sphere in the bar.
        layout: indices of the robot.

    Returns:
        (3,) m, world; (3, N) slopes of its error, without the rotation of the leading bar. That by the softness is
        along the normal only: across it, a slip moves the dome against the friction force, as stiffer domes would.
    """
    bar = int(layout.endcap_bar[endcap])
    point, slopes = point_slopes(state.turn, state.place, bar, centre.lever_m, layout.leader, layout.size)
    # not of the anchor, so that a rotation about the vertical changes nothing, noise included
    slopes[:, layout.turn(layout.leader)] -= minus_cross(point)
    slopes[:, layout.velocity(bar)] += centre.late_s
    slopes[:, layout.delay] = centre.delays_m_s
    slopes[:, layout.softness] = centre.softens_m
    return point, slopes


def difference(state: State, endcap: int, centre: DomeCentre, layout: Layout) -> tuple[Array, Array]:
    """How far an endcap is from its anchor.

    Args:
        state: poses of the bars, the anchor, and the contact's normal.
        endcap: number of the endcap.
        centre: centre of its sphere in the bar.
        layout: indices of the robot.

    Returns:
        (3,) anchor minus endcap, m, world; (3, N) slopes of endcap minus anchor by the error state.
    """
    point, slopes = unloaded(state, endcap, centre, layout)
    slopes[:, layout.anchor(endcap)] -= np.eye(3)
    return state.anchor[endcap] - point, slopes
