"""How contacts move over their support: slips of those that give way, and the creep of those that turn under load."""

from __future__ import annotations

import numpy as np

from sensing.robot.contact import Contact
from sensing.robot.friction import moments
from sensing.robot.layout import Layout
from sensing.robot.settings import Settings
from sensing.robot.state import State, world_rate
from sensing.tensegrity.description import Array

FASTEST_M_S, LEAST_SPIN_M = 0.3, 5e-4  # E: largest mean speed of a slip; torque over normal force that is only noise


def slide(state: State, endcap: int, bar: int, contact: Contact, settings: Settings) -> tuple[Array, Array]:
    """Velocity of a slipping contact, which opposes the friction force.

    Args:
        state: it is read.
        endcap: number of the endcap.
        bar: number of its bar.
        contact: contact with its force and torque.
        settings: assumptions of the estimator.

    Returns:
        (3,) mean, world, m/s; (3, 3) covariance, m^2/s^2.
    """
    normal, along = state.normal[endcap], friction_axis(state, endcap, bar, contact)
    flat = np.eye(3) - np.outer(normal, normal)
    spin = abs(float(world_rate(state, bar) @ normal))
    needs = max(contact.spin_m, LEAST_SPIN_M) * moments(state.friction)[0] ** 2
    speed = min(settings.slip_gain * spin * contact.ratio * settings.spin_lever_m**2 / needs, FASTEST_M_S)
    variance = settings.slip_sd_m_s**2 + (settings.slip_share * speed) ** 2
    spread = variance * (settings.slip_across**2 * flat + (1 - settings.slip_across**2) * np.outer(along, along))
    return -speed * along, spread


def friction_axis(state: State, endcap: int, bar: int, contact: Contact) -> Array:
    """(3,) unit direction of the friction force, world.

    Args:
        state: it is read.
        endcap: number of the endcap.
        bar: number of its bar.
        contact: contact with its force.
    """
    normal = state.normal[endcap]
    force = state.turn[bar] @ contact.force_n
    along = force - (force @ normal) * normal
    return np.asarray(along / max(float(np.sqrt(along @ along)), 1e-9))


def move_by_creep(state: State, endcap: int, turned_m: Array, layout: Layout) -> None:
    """Move an anchor against its friction force by the creep of an endcap that turns under load.

    Slow slip does not raise the probability of slip, but continues as long as the endcap rolls or pivots, on a slope
    always in the same direction. With the friction ratio r along the unit vector t, the radius R and the angular
    velocity w, an anchor a moves by da/dt = -c r t R |w|. The creep c is part of the state, so that its error is common
    to all anchors.

    Args:
        state: it is changed.
        endcap: number of the endcap.
        turned_m: (3,) r t R |w| times the time step, m.
        layout: indices of the robot.
    """
    at = layout.anchor(endcap)
    state.anchor[endcap] -= turned_m * state.creep[0]
    state.covariance[at] -= np.outer(turned_m, state.covariance[layout.creep])
    state.covariance[:, at] -= np.outer(state.covariance[:, layout.creep], turned_m)
