"""Mass of the screws, washers, nuts and inserts that stay in the finished endcap (kg, m; endcap frame).

Each is a tube about its own axis: a head is as high as its thread is wide (S: ISO 4762; of the M2 pan head E), a shank
as wide as its thread's pitch diameter (S: ISO 68-1), a square nut a disc of its area. The lengths are those that
:mod:`fab.checks.screw_fit` chooses on the meshes. What holds the adapter on the robot is the robot's.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import reduce
from operator import add

import numpy as np
import trimesh

from cad import arm_adapter, base
from cad.bought import bought_mm
from cad.fasteners import ScrewJoint
from cad.interface import POCKET_FLOOR_MM
from cad.params import EndcapParams
from fab.checks.screw_fit import ScrewFit, fitted
from sensing.simulator.robot_model.mjcf import Inertial

STEEL_G_CM3, BRASS_G_CM3 = 7.85, 8.5  # S
PITCH_DIAMETER_PITCHES = 0.6495  # S: ISO 68-1, the pitch diameter is the thread's less this many pitches


def fasteners_inertial(params: EndcapParams, meshes: Mapping[str, trimesh.Trimesh]) -> Inertial:
    """All of them together.

    Args:
        params: the design.
        meshes: closed meshes (mm) of base, adapter, camera and interface, by name.
    """
    joints = (*base.screw_joints(params), *arm_adapter.screw_joints(params))
    return reduce(add, (one for joint in joints for one in _of_joint(fitted(joint, meshes), params)))


def _of_joint(fit: ScrewFit, params: EndcapParams) -> Iterator[Inertial]:
    joint, sign = fit.joint, 1.0 if fit.joint.up else -1.0
    thread, shank = bought_mm(joint.thread, "thread"), _shank_mm(joint)
    washer = joint.thread.replace("screw", "washer")
    thick = joint.washers * bought_mm(washer, "thickness") if joint.washers else 0.0
    neck = fit.seat_mm - thick  # along the screw, where its head ends and its shank begins
    for place in joint.places:
        yield tube_inertial(place, 0.0, bought_mm(joint.thread, "head"), sign * (neck - thread), sign * neck)
        yield tube_inertial(place, 0.0, shank, sign * neck, sign * (neck + fit.length_mm))
        if joint.washers:
            yield tube_inertial(place, thread, bought_mm(washer, "outer"), sign * neck, sign * fit.seat_mm)
        if joint.holder == "captured nut":
            across = bought_mm("nut_m3", "across_flats") * 2 / math.sqrt(math.pi)
            top = POCKET_FLOOR_MM + bought_mm("nut_m3", "thickness")
            yield tube_inertial(place, shank, across, POCKET_FLOOR_MM, top)
        if joint.holder == "insert":
            low, wide = -params.base_thickness_mm, 2 * base.ARM_INSERT_RADIUS_MM
            high = low + bought_mm("insert_m4", "length")
            yield tube_inertial(place, shank, wide, low, high, BRASS_G_CM3)


def _shank_mm(joint: ScrewJoint) -> float:
    return bought_mm(joint.thread, "thread") - PITCH_DIAMETER_PITCHES * bought_mm(joint.thread, "pitch")


def tube_inertial(
    place_mm: tuple[float, float],
    inner_mm: float,
    outer_mm: float,
    start_mm: float,
    end_mm: float,
    density_g_cm3: float = STEEL_G_CM3,
) -> Inertial:
    """Mass, centre and inertia of an upright tube, in closed form.

    Args:
        place_mm: (x, y) of its axis.
        inner_mm, outer_mm: diameters.
        start_mm, end_mm: its ends along z.
        density_g_cm3: of its metal.
    """  # fmt: skip
    inner, outer, high = inner_mm / 2000, outer_mm / 2000, abs(end_mm - start_mm) / 1000
    mass = 1000 * density_g_cm3 * math.pi * (outer**2 - inner**2) * high
    squares = outer**2 + inner**2
    across = mass * (3 * squares + high**2) / 12
    centre = np.array([*place_mm, (start_mm + end_mm) / 2]) / 1000
    return Inertial(mass, centre, np.diag([across, across, mass * squares / 2]))
