"""Errors of the fitted springs against the pressed shell: normal force, shear force, torque at the mount."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.robot_model.model import RobotModel
from sensing.simulator.robot_model.pressed import PressedStates
from sensing.simulator.robot_model.stiffness import DEPTHS_MM
from sensing.simulator.solid.element import Array

TORQUE_LIMIT = 0.2  # relative error of the torque at the mount that counts as right


@dataclass(frozen=True)
class FitErrors:
    """Errors over the depths of the fit, as ratios.

    Attributes:
        fitted, held_out: largest relative error of the normal force, at tilts of the fit and at others.
        by_tilt: tilt in degrees -> largest relative error of the normal force.
        shear: median of the model's shear force over the shell's, after the same travel sideways.
        torque_same_force, torque_same_motion: part of the states whose torque at the mount is within
            :data:`TORQUE_LIMIT`, if the model bears the shell's force, and if it follows the shell's motion.
    """

    fitted: float
    held_out: float
    by_tilt: dict[float, float]
    shear: float
    torque_same_force: float
    torque_same_motion: float


def fit_errors(model: RobotModel) -> FitErrors:
    """Errors of a model against the states of its shell."""
    states = model.states.between(*DEPTHS_MM)
    force = model.stiffness.force_in_contact(states)
    error, pressed = np.abs(force[:, 0] / states.force_n[:, 0] - 1), states.is_pressed_only
    sheared = ~pressed
    shear = np.linalg.norm(force[sheared, 1:], axis=1) / np.linalg.norm(states.force_n[sheared, 1:], axis=1)
    known = states.where(np.asarray(np.isfinite(states.torque_nmm).all(axis=1)))
    return FitErrors(
        float(error[pressed & ~states.is_held_out].max()),
        float(error[pressed & states.is_held_out].max()),
        {float(tilt): float(error[pressed & (states.tilt_deg == tilt)].max()) for tilt in np.unique(states.tilt_deg)},
        float(np.median(shear)),
        _within(model, known, known.force_n),
        _within(model, known, model.stiffness.force_in_contact(known)),
    )


def _within(model: RobotModel, states: PressedStates, force_n: Array) -> float:
    """Part of the states with the right torque about the mating plane's centre, for forces at the sphere's contact."""
    radius, height = model.params.outer_radius_mm, model.params.centre_height_mm
    centre = height * np.array([Indenter(tilt).frame()[2] for tilt in states.tilt_deg])  # z in contact axes
    contact = centre + np.column_stack([radius - states.depth_mm, states.shift_mm])
    true = states.torque_nmm + np.cross(centre, states.force_n)
    error = np.linalg.norm(np.cross(contact, force_n) - true, axis=1)
    return float((error <= TORQUE_LIMIT * np.linalg.norm(true, axis=1)).mean())
