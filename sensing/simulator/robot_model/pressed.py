"""Shells pressed by a plane, by similarity: the states of the springs' fit and of its check (mm, N)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.similarity.library import Library, ShellStates, load_library
from sensing.simulator.similarity.node import CAPACITY_DEPTHS, CAPACITY_TILTS_DEG
from sensing.simulator.similarity.paths import library_paths, touching_steps
from sensing.simulator.similarity.ratios import LoadScale, ShellRatios, wrench_units
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.geometry import ShellGeometry

HELD_OUT_TILTS_DEG = (3.0, 18.0, 32.0, 46.0)  # of the library's paths; the fit has 0, 11, 25, 39, 50 and 54 degrees
NEAR_SLIP = 0.7  # of the friction cone; beyond it the place of the shell under the plane is not determined
PRESSING = ("touch", "load")  # phases in which the plane only approaches


@dataclass(frozen=True)
class PressedStates:
    """States of a shell under a plane with friction.

    Attributes:
        tilt_deg, depth_mm: (s,) tilt, degrees, and depth, mm, of the plane.
        shift_mm: (s, 2) its travel along (meridian, lateral), mm.
        force_n: (s, 3) N, force on the endcap along (outward, meridian, lateral); NaN tangentially where not stored.
        torque_nmm: (s, 3) torque on the endcap about the sphere's centre, same axes, N mm; NaN where it is not stored.
        patch_mm2: (s,) contact area, mm2.
    """

    tilt_deg: Array
    depth_mm: Array
    shift_mm: Array
    force_n: Array
    torque_nmm: Array
    patch_mm2: Array

    def where(self, mask: NDArray[np.bool_]) -> PressedStates:
        """The states that a mask selects."""
        return PressedStates(*(column[mask] for column in vars(self).values()))

    @property
    def normal_n(self) -> Array:
        """(s,) normal force, N, positive."""
        return -self.force_n[:, 0]

    @property
    def is_pressed_only(self) -> NDArray[np.bool_]:
        """(s,) whether the plane did not travel sideways."""
        return np.asarray((self.shift_mm == 0).all(axis=1))

    @property
    def is_held_out(self) -> NDArray[np.bool_]:
        """(s,) whether the state's tilt is held out of the fit."""
        return np.isin(self.tilt_deg, HELD_OUT_TILTS_DEG)

    def between(self, low_mm: float, high_mm: float) -> PressedStates:
        """States within a range of depths, mm."""
        return self.where((self.depth_mm >= low_mm) & (self.depth_mm <= high_mm))


def pressed_states(geometry: ShellGeometry, shear_mpa: float) -> PressedStates:
    """States of a shell: curves to 0.3 R at three tilts, and the library's paths until they come near slip.

    Args:
        geometry: the shell.
        shear_mpa: shear modulus of its silicone.

    Raises:
        ParameterError: a shell outside the library's range.
    """
    library, ratios = load_library(), ShellRatios.of(geometry)
    parts = [_curves(library, geometry, shear_mpa), _paths(library.states(ratios), geometry, shear_mpa)]
    return PressedStates(*(np.concatenate(pair) for pair in zip(*(vars(p).values() for p in parts), strict=True)))


def _curves(library: Library, geometry: ShellGeometry, shear_mpa: float) -> PressedStates:
    radius, depths = geometry.outer_radius_mm, np.array(CAPACITY_DEPTHS)
    found = library.capacity(ShellRatios.of(geometry))
    tilt, depth = np.repeat(CAPACITY_TILTS_DEG, len(depths)), np.tile(depths, len(found)) * radius
    unknown = np.full((len(tilt), 3), np.nan)
    force = unknown.copy()
    force[:, 0] = -found[:, :, 1].ravel() * shear_mpa * radius**2
    patch = found[:, :, 2].ravel() * radius**2
    states = PressedStates(tilt, depth, np.zeros((len(tilt), 2)), force, unknown, patch)
    return states.where(np.isfinite(force[:, 0]))


def _paths(states: ShellStates, geometry: ShellGeometry, shear_mpa: float) -> PressedStates:
    radius, units = geometry.outer_radius_mm, wrench_units(geometry.outer_radius_mm, shear_mpa)
    scale, row = LoadScale.of(geometry, shear_mpa), -1
    found: list[tuple[float, float, Array, Array, Array, float]] = []
    for path in library_paths():
        frame, holds, is_pressing = Indenter(path.tilt_deg).frame(), True, True
        for step in touching_steps(path):
            row, point = row + 1, path.waypoints[step]
            wrench = states.wrench[row] * units
            force, torque = frame.T @ wrench[:3], frame.T @ wrench[3:]
            holds &= bool(states.known[row]) and np.hypot(*force[1:]) < NEAR_SLIP * path.friction * -force[0]
            is_pressing &= point.phase in PRESSING  # after unloading the shell lies elsewhere
            assert point.target is not None
            shift = np.array(point.target.shift_mm) * scale.shift
            if holds and (is_pressing or shift.any()):
                depth, _, patch, _ = states.labels[row]
                found.append((path.tilt_deg, depth * radius, shift, force, torque, patch * radius**2))
    return PressedStates(*(np.array(column) for column in zip(*found, strict=True)))
