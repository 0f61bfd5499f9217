"""Readings that do not fit: a force that jumps for one frame, as a spike of a sensor does.

Notes:
    Innovation test along the normal (Bar-Shalom, Li and Kirubarajan 2001, Estimation with applications to tracking and
    navigation, section 5.4): a reading whose place is further from the anchor than ``LIMIT`` standard deviations is
    left out whole, so that it moves neither pose nor softness, normal or friction. A second one in a row is no spike:
    the endcap stands elsewhere, and its anchor starts anew there. Across the normal, slips decide.
"""

from __future__ import annotations

from sensing.robot.dome import DomeCentre, difference
from sensing.robot.layout import Layout
from sensing.robot.state import MEAN_WEIGHT, State
from sensing.tensegrity.description import Array

LIMIT = 4.0  # standard deviations; in simulated walks one reading in 3,000 is further off


def jumps(state: State, endcap: int, centre: DomeCentre, variance: float, stays: float, layout: Layout) -> bool:
    """Whether a reading is too far from its anchor along the normal.

    Args:
        state: state with an anchor of the endcap; its consistency takes a reading that is.
        endcap: number of the endcap.
        centre: centre of its unloaded sphere by the reading.
        variance: variance of the reading's place along the normal, m^2.
        stays: factor on it in the update step, for errors that several readings share.
        layout: indices of the robot.
    """
    innovation, slopes = difference(state, endcap, centre, layout)
    row: Array = state.normal[endcap] @ slopes
    square, spread = float(state.normal[endcap] @ innovation) ** 2, float(row @ state.covariance @ row)
    if square <= LIMIT**2 * (spread + variance):
        return False
    state.consistency[1] += MEAN_WEIGHT * (square / (spread + stays * variance) - state.consistency[1])
    return True
