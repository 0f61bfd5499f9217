"""Targets of one press from the untouched shell: a normal force or a depth in equal steps, then a tangential travel.

The travel has steps, too: friction remembers where it came from, and turns into the direction of the travel only over
some millimetres. In one step of 5 mm across it was 2.4 degrees, and the displacement 2.5 %, behind that of ten steps.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from cad.errors import ParameterError
from cad.materials import HyperelasticLaw
from sensing.simulator.press.press import MAX_DEPTH_RATIO, Target
from sensing.simulator.press.state import Refusal
from sensing.simulator.similarity.ratios import LoadScale
from sensing.simulator.solid.geometry import ShellGeometry

MOST_N = 10_000.0  # E: N, more than any shell bears within the depths that are modelled
MOST_TRAVEL = 2.0  # of R: by then a plane slides and its state no longer changes; another body has left the dome
STEP_N = 5.0  # N, largest load step; on a softer shell as much less as it bears
ROUND_OFF = 1e-9  # of a step: a load that is a whole number of steps takes no more
TRAVEL_STEP, MOST_STEPS = 0.125, 10  # of T, largest step of a travel: 1 mm at T=8; past so many steps the body slides
DEPTH_STEP = 0.03  # of R, largest step of a depth: 2 mm at D=130, where 5 N press as deep


def ramp(
    geometry: ShellGeometry, law: HyperelasticLaw, normal_n: float | None, depth_mm: float | None,
    shift_mm: tuple[float, float],
) -> list[Target]:  # fmt: skip
    """Targets in order; what the solver would refuse after minutes is refused at once.

    Args:
        geometry: geometry of the shell.
        law: its silicone.
        normal_n: normal force at the end, N; None under a given depth.
        depth_mm: depth at the end, mm; None under a given force.
        shift_mm: tangential travel along (meridian, lateral) there, mm.

    Raises:
        ParameterError: both or neither of force and depth are given.
        Refusal: ``range`` for a force, depth or travel beyond the limits.
    """
    _require_travel(geometry, shift_mm)
    if normal_n is not None and depth_mm is None:
        end = by_force(geometry, law, normal_n)
    elif depth_mm is not None and normal_n is None:
        end = by_depth(geometry, depth_mm)
    else:
        given = "neither" if depth_mm is None else "both"
        raise ParameterError(f"normal_n and depth_mm: {given} given; give exactly one", name="depth_mm", value=depth_mm)
    return [*end, *_travel(geometry, end[-1], shift_mm)]


def by_force(geometry: ShellGeometry, law: HyperelasticLaw, normal_n: float) -> list[Target]:
    """Equal steps of :data:`STEP_N` or less, in proportion to what the shell bears.

    Args:
        geometry: geometry of the shell.
        law: its silicone.
        normal_n: normal force at the end, N.

    Raises:
        Refusal: ``range`` for a force that no shell bears.
    """
    if not abs(normal_n) <= MOST_N:  # a negative one is refused by the solver, at once
        limits = f"0..{MOST_N:g} N: no shell bears more within the depths that are modelled"
        raise Refusal("range", f"normal_n={normal_n:g} outside {limits}")
    step_n = STEP_N * min(1.0, LoadScale.of(geometry, law.shear_mpa).force)
    steps = max(1, math.ceil(normal_n / step_n - ROUND_OFF))
    return [Target(normal_n=float(part * normal_n)) for part in np.linspace(0, 1, steps + 1)[1:]]


def by_depth(geometry: ShellGeometry, depth_mm: float) -> list[Target]:
    """Equal steps of :data:`DEPTH_STEP` R or less.

    Args:
        geometry: geometry of the shell.
        depth_mm: depth at the end, mm.

    Raises:
        Refusal: ``range`` for a depth at which self-contact is not modelled.
    """
    radius_mm = geometry.outer_radius_mm
    most_mm = MAX_DEPTH_RATIO * radius_mm
    if not 0 < depth_mm <= most_mm:
        limits = f"0..{most_mm:g} mm (0.6 R): self-contact is not modelled beyond it"
        raise Refusal("range", f"depth_mm={depth_mm:g} outside {limits}")
    steps = math.ceil(depth_mm / (DEPTH_STEP * radius_mm))
    return [Target(depth_mm=float(part * depth_mm)) for part in np.linspace(0, 1, steps + 1)[1:]]


def _travel(geometry: ShellGeometry, pressed: Target, shift_mm: tuple[float, float]) -> list[Target]:
    """Equal steps of :data:`TRAVEL_STEP` T or less, but :data:`MOST_STEPS` at most; none without travel."""
    steps = min(MOST_STEPS, math.ceil(float(np.hypot(*shift_mm)) / (TRAVEL_STEP * geometry.wall_mm)))
    parts = [float(part) for part in np.linspace(0, 1, steps + 1)[1:]]
    return [replace(pressed, shift_mm=(part * shift_mm[0], part * shift_mm[1])) for part in parts]


def _require_travel(geometry: ShellGeometry, shift_mm: tuple[float, float]) -> None:
    travel, most = float(np.hypot(*shift_mm)), MOST_TRAVEL * geometry.outer_radius_mm
    if not travel <= most:
        raise Refusal(
            "range",
            f"tangential travel of {travel:g} mm outside 0..{most:g} mm (2 R): a plane that has slid for some mm "
            "changes nothing any more, and any other body has left the dome; give less",
        )
