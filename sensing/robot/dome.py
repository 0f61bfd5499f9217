"""By how much a dome yields under its contact, and where its centre would be without load."""

from __future__ import annotations

from dataclasses import dataclass

from sensing.robot.contact import Contact
from sensing.robot.layout import Layout
from sensing.robot.measurement_kernels import point_slopes
from sensing.robot.settings import Settings
from sensing.robot.state import State, world_rate
from sensing.tensegrity.description import Array
from sensing.tensegrity.vectors import cross, minus_cross


@dataclass(frozen=True)
class DomeCentre:
    """Where the centre of an unloaded dome would be, by the contact that it has.

    Attributes:
        lever_m: (3,) from the bar's reference point, bar axes.
        softens_m: (3,) by which a softness of one moves it.
    """

    lever_m: Array
    softens_m: Array


def dome_centre(state: State, endcap: int, contact: Contact, layout: Layout, settings: Settings) -> DomeCentre:
    """The unloaded dome above a contact.

    A dome of stiffness k and damping c has F = k d + c d', so d = (F - c d') / k: one that is just being pressed has
    yielded less than its force says. Along the normal d' is the speed with which the bar's end nears the ground.
    1 / k = (1 + b) ``compliance_m_n``: the softness b is a part of the state, so that its error is one in all domes.

    Args:
        state: with its velocities and the contact's normal.
        endcap: its number.
        contact: its force.
        layout, settings: of the estimator.
    """
    bar, normal = int(layout.endcap_bar[endcap]), state.normal[endcap]
    lever, yields = layout.endcap_lever[endcap], settings.compliance_m_n * contact.force_n
    arm = state.turn[bar] @ lever
    leaves = float((state.velocity[bar] + cross(world_rate(state, bar), arm)) @ normal)
    late = settings.yield_delay_s * leaves * (normal @ state.turn[bar])
    return DomeCentre(lever + (1 + state.softness[0]) * yields + late, yields)


def unloaded(state: State, endcap: int, centre: DomeCentre, layout: Layout) -> tuple[Array, Array]:
    """Where the centre of an unloaded dome is.

    Args:
        state: of the bars.
        endcap: number of the endcap.
        centre: of its sphere.
        layout: of the robot.

    Returns:
        (3,) world, m, (3, N) slopes of its error, less the turn of the leading bar.
    """
    bar = int(layout.endcap_bar[endcap])
    point, slopes = point_slopes(state.turn, state.place, bar, centre.lever_m, layout.leader, layout.size)
    # not of the anchor: a turn about the vertical must show in nothing, by no noise either
    slopes[:, layout.turn(layout.leader)] -= minus_cross(point)
    slopes[:, layout.softness] = state.turn[bar] @ centre.softens_m
    return point, slopes
