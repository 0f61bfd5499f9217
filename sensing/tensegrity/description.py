"""The robot as its description file states it: bars, endcaps, cables and inertial sensors (m, kg, s, N, rad).

Frames (right-handed; ``T_a_b`` takes coordinates in b to coordinates in a; translations in **m** here, because a robot
is described in SI units, where :mod:`sensing.frames` has mm):

======  =============================================================================================
world   z up, against gravity; origin and heading are those of the first estimate
bar     origin half-way between the bar's two ends, z along the bar from its first to its second end
endcap  origin at the centre of the mating plane, z toward the tip (:mod:`cad.params`)
imu     origin and axes of the inertial sensor
======  =============================================================================================
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
GRAVITY_M_S2 = 9.80665  # standard gravity, ISO 80000-3


@dataclass(frozen=True)
class Bar:
    """One rigid bar with all that is screwed to it, its two endcaps included.

    Attributes:
        name: name of the bar in other entries.
        length_m: distance of the mating planes of its two endcaps.
        mass_kg: mass of bar, batteries, electronics and endcaps together.
        inertia_kg_m2: (3, 3) inertia about ``centre_of_mass_m``, bar axes.
        centre_of_mass_m: (3,) centre of mass in the bar frame.
        ends_m: (2, 3) approximate positions of its ends when the robot stands, z up: cable lengths alone cannot
            distinguish a shape from its mirror image. NaN where unknown.
    """

    name: str
    length_m: float
    mass_kg: float
    inertia_kg_m2: Array
    centre_of_mass_m: Array = field(default_factory=lambda: np.zeros(3))
    ends_m: Array = field(default_factory=lambda: np.full((2, 3), np.nan))


@dataclass(frozen=True)
class MountedEndcap:
    """One endcap on the end of a bar.

    Attributes:
        name: name in live readings, ROS topics and recordings.
        bar: name of its bar.
        T_bar_endcap: (4, 4) mounting, m.
        diameter_mm, wall_mm: the design: outer diameter D and wall T.
        compliance_m_n: yield of its dome under 1 N, m/N; None for that of its size in the estimator's settings.
        yield_delay_s: damping of its dome over its stiffness, s; None for that of the estimator's settings.
    """

    name: str
    bar: str
    T_bar_endcap: Array
    diameter_mm: float = 130.0
    wall_mm: float = 8.0
    compliance_m_n: float | None = None
    yield_delay_s: float | None = None


@dataclass(frozen=True)
class Cable:
    """One cable between two bars; it pulls and never pushes.

    Attributes:
        name: name of the length that an encoder reports.
        bars: names of the two bars.
        points_m: (2, 3) attachments, each in the frame of its bar.
        rest_m: length below which it is slack.
        stiffness_n_m: force per metre beyond ``rest_m``.
        measured: whether its length is reported.
    """

    name: str
    bars: tuple[str, str]
    points_m: Array
    rest_m: float
    stiffness_n_m: float
    measured: bool = True


@dataclass(frozen=True)
class InertialSensor:
    """An inertial sensor on a bar: gyroscope, with or without accelerometer.

    Attributes:
        name: name in its samples.
        bar: name of its bar.
        T_bar_imu: (4, 4) mounting, m.
        accelerometer: whether it also reports the specific force.
    """

    name: str
    bar: str
    T_bar_imu: Array
    accelerometer: bool = False


@dataclass(frozen=True)
class TensegrityRobot:
    """A robot of bars and cables; :mod:`sensing.tensegrity.robot_file` reads and checks it.

    Attributes:
        name: name of the robot.
        bars, endcaps, cables, sensors: in the order of the file; every array of the estimator has this order.
    """

    name: str
    bars: tuple[Bar, ...]
    endcaps: tuple[MountedEndcap, ...]
    cables: tuple[Cable, ...]
    sensors: tuple[InertialSensor, ...]

    def bar_number(self, name: str) -> int:
        """Index of a bar in :attr:`bars`."""
        return [bar.name for bar in self.bars].index(name)

    @property
    def mass_kg(self) -> float:
        """Mass of the whole robot, kg."""
        return float(sum(bar.mass_kg for bar in self.bars))
