"""The shell as springs on the centre of its sphere: the simplest that keep the force of the pressed shell (mm, N).

With the centre displaced by (x, y, z) from its place on the base and r^2 = x^2 + y^2, the energy and forces are

    V = k_r r^2 / 2 + c_r r^4 / 4 + k_z z^2 / 2 + c_z z^4 / 4
    F_xy = -(k_r + c_r r^2) (x, y),   F_z = -(k_z + c_z z^2) z

all four constants >= 0: the energy is convex, so there is one rest position. The constants minimise the largest
relative error of the normal force, by linear programming. The shear stiffness follows: one potential of
the centre's position gives a plane that presses and a plane that shears the same springs.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np

from cad.errors import ParameterError
from sensing.simulator.contact.indenter import Indenter, translation
from sensing.simulator.robot_model.pressed import PressedStates
from sensing.simulator.solid.element import Array

DEPTHS_MM = (2.0, 10.0)  # range of depths of the fit and its check
FEWEST_STATES = 12  # fewest states of a fit


@dataclass(frozen=True)
class ShellStiffness:
    """Constants of the springs of the sphere's centre.

    Attributes:
        radial_n_mm, axial_n_mm: linear, N/mm.
        radial_cubic_n_mm3, axial_cubic_n_mm3: cubic, N/mm3.
    """

    radial_n_mm: float
    radial_cubic_n_mm3: float
    axial_n_mm: float
    axial_cubic_n_mm3: float

    def force_n(self, displacement_mm: Array) -> Array:
        """Force on the shell, N, that holds its centre displaced by (..., 3), mm, endcap axes."""
        return np.tensordot(astuple(self), _bases(displacement_mm), axes=1)

    def force_in_contact(self, states: PressedStates) -> Array:
        """(s, 3) force, N, along (outward, meridian, lateral) when the centre follows the plane."""
        frames = np.array([Indenter(tilt).frame() for tilt in states.tilt_deg])
        return np.einsum("sji,sj->si", frames, self.force_n(displacements(states)))


def displacements(states: PressedStates) -> Array:
    """(s, 3) displacement of the sphere's centre, mm, endcap axes, when it follows the plane."""
    columns = zip(states.tilt_deg, states.depth_mm, states.shift_mm, strict=True)
    return np.array([translation(Indenter(tilt).frame(), depth, tuple(shift)) for tilt, depth, shift in columns])


def fitted(states: PressedStates) -> ShellStiffness:
    """Springs with the least largest relative error of the normal force over the states that are not held out.

    Args:
        states: states of the shell.

    Raises:
        ParameterError: too few states, because the shell snaps before it is pressed so deep.
    """
    from scipy.optimize import linprog

    used = states.where(states.is_pressed_only & ~states.is_held_out).between(*DEPTHS_MM)
    if len(used.depth_mm) < FEWEST_STATES:
        raise ParameterError(
            f"{len(used.depth_mm)} states of {DEPTHS_MM[0]:g} to {DEPTHS_MM[1]:g} mm depth where {FEWEST_STATES} are "
            "needed: the shell snaps before; take a thicker wall or a stiffer silicone",
            name="states",
        )
    outward = np.array([Indenter(tilt).frame()[:, 0] for tilt in used.tilt_deg])
    ratio = np.einsum("ksi,si->sk", _bases(displacements(used)), outward) / used.force_n[:, :1]
    count = ratio.shape[1]
    rows = np.vstack([np.hstack([ratio, -np.ones((len(ratio), 1))]), np.hstack([-ratio, -np.ones((len(ratio), 1))])])
    limits = np.concatenate([np.ones(len(ratio)), -np.ones(len(ratio))])
    found = linprog([*[0.0] * count, 1.0], A_ub=rows, b_ub=limits, bounds=[(0, None)] * (count + 1))
    return ShellStiffness(*(float(value) for value in found.x[:count]))


def _bases(displacement_mm: Array) -> Array:
    """(4, ..., 3) force of each spring, N, for a constant of one."""
    radial = displacement_mm * np.array([1.0, 1.0, 0.0])
    axial = displacement_mm - radial
    square = (radial**2).sum(axis=-1, keepdims=True)
    return np.stack([radial, square * radial, axial, axial**3])
