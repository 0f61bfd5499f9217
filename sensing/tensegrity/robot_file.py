"""Reads and checks ``robot.toml``: the bars, endcaps, cables and inertial sensors of a tensegrity robot.

    robot = load_robot()                                # the three-bar robot that ships
    robot = load_robot(Path("robot.toml"))

Units are m, kg, s, N and degrees; frames are those of :mod:`sensing.tensegrity.description`. Keys in brackets may be
left out::

    name = "three_bar"

    [[bar]]
    name = "red"
    length_m = 0.82                       # between the mating planes of its two endcaps
    mass_kg = 4.0                         # of all that is screwed to it, endcaps included
    inertia_kg_m2 = [0.46, 0.46, 0.008]   # xx, yy, zz about the centre of mass [; then xy, xz, yz]
    centre_of_mass_m = [0.0, 0.0, 0.01]   # [the middle], bar frame
    ends_m = [[0.3, 0.0, 0.1], [-0.3, 0.2, 0.8]]  # roughly where its ends are when the robot stands, z up

    [[endcap]]
    name = "endcap_0"
    bar = "red"
    end = "first"                         # or "second"
    turn_deg = 0.0                        # [0] how it is screwed on, about its own axis
    diameter_mm = 130.0                   # [130]
    wall_mm = 8.0                         # [8]
    compliance_m_n = 0.00025              # [by its size: 0.00025 at D=130 T=8] yield of its dome under 1 N
    yield_delay_s = 0.0003                # [0.01, the simulated dome's] damping of its dome over its stiffness

    [[cable]]
    name = "red-blue"
    bars = ["red", "blue"]
    points_m = [[0.0, 0.0, -0.41], [0.0, 0.0, -0.41]]  # where it is attached, each in the frame of its bar
    rest_m = 0.5
    stiffness_n_m = 4000.0
    measured = true                       # [true] whether its length is reported

    [[imu]]
    name = "imu_red"
    bar = "red"
    place_m = [0.03, 0.0, 0.0]            # bar frame
    turn_deg = [0.0, 0.0, 0.0]            # [0, 0, 0] about the bar's x, then y, then z: sensor axes to bar axes
    accelerometer = true                  # [false]
"""

from __future__ import annotations

import math
import tomllib
from collections import Counter
from pathlib import Path

import numpy as np

from cad.errors import FileError, ParameterError, printable
from cad.params import EndcapParams
from sensing.tensegrity.description import Bar, Cable, InertialSensor, MountedEndcap, TensegrityRobot
from sensing.tensegrity.robot_table import Table, refuse
from sensing.tensegrity.shape import balanced_shape, rotation_of

SHIPPED = Path(__file__).with_name("three_bar.toml")  # description of the three-bar robot
MOST_BYTES = 1 << 20  # largest file that is read
MOST_STRETCH = 0.5  # of a cable's rest length; more stretch means that the lengths are inconsistent
ENDS_OFF = 0.2  # largest relative difference of the distance of a bar's stated ends from its length
REACH_M = 0.3  # largest distance of an attachment beyond a bar's end, or beside the bar
LEAST_M_N, MOST_M_N, MOST_DELAY_S = 1e-5, 1e-2, 0.1  # a dome of 100 N/mm, one of 0.1 N/mm; more is a typing error
HEAVIEST = 1e6  # kg, m, N/m; more is a typing error


def load_robot(path: Path = SHIPPED) -> TensegrityRobot:
    """Read and check the description of a robot.

    Raises:
        FileError: missing, no TOML, an unknown or missing key.
        ParameterError: a value that no robot can have.
    """
    try:
        with path.open("rb") as stream:
            text = stream.read(MOST_BYTES + 1)
        if len(text) > MOST_BYTES:
            raise ValueError(f"more than {MOST_BYTES} bytes")
        table = Table(str(path), "", tomllib.loads(text.decode("utf-8")))
    except OSError as error:
        raise FileError(f"{path}: {error.strerror}: start from {SHIPPED.name}, which ships") from None
    except (ValueError, RecursionError) as error:  # no TOML, no UTF-8, numbers of thousands of digits, deep nesting
        raise FileError(f"{path}: no TOML ({printable(str(error))[:200]}): start from {SHIPPED.name}") from None
    bars = tuple(_bar(entry) for entry in table.tables("bar"))
    lengths = {bar.name: bar.length_m for bar in bars}
    robot = TensegrityRobot(
        table.text("name"),
        bars,
        tuple(_endcap(entry, lengths) for entry in table.tables("endcap")),
        tuple(_cable(entry, lengths) for entry in table.tables("cable")),
        tuple(_sensor(entry, lengths) for entry in table.tables("imu", fewest=0)),
    )
    table.finish()
    _check_names(str(path), robot)
    _check_shape(str(path), robot)
    return robot


def _bar(entry: Table) -> Bar:
    length = entry.number("length_m", above=0.0, most=HEAVIEST)
    mass = entry.number("mass_kg", above=0.0, most=HEAVIEST)
    six = entry.row("inertia_kg_m2", (3, 6))
    six = np.concatenate([six, np.zeros(6 - len(six))])
    inertia = np.array([[six[0], six[3], six[4]], [six[3], six[1], six[5]], [six[4], six[5], six[2]]])
    principal = np.linalg.eigvalsh(inertia)
    if principal[0] <= 0 or principal[2] > (principal[0] + principal[1]) * (1 + 1e-9):
        reason = "no body has it: each principal moment is positive and at most the sum of the other two"
        refuse(entry, "inertia_kg_m2", six.tolist(), reason)
    ends = entry.rows("ends_m", 2, 3)
    apart = float(np.linalg.norm(ends[1] - ends[0]))
    if abs(apart - length) > ENDS_OFF * length:
        refuse(entry, "ends_m", f"two points {apart:.3g} m apart", f"the bar is {length:g} m long")
    centre = entry.row("centre_of_mass_m", (3,), default=[0.0, 0.0, 0.0])
    _check_place(entry, "centre_of_mass_m", centre, length)
    return Bar(entry.finish("name"), length, mass, inertia, centre, ends)


def _endcap(entry: Table, lengths: dict[str, float]) -> MountedEndcap:
    bar, end = entry.choice("bar", lengths), entry.choice("end", ("first", "second"))
    turn = math.radians(entry.number("turn_deg", default=0.0))
    diameter = entry.number("diameter_mm", default=130.0)
    wall = entry.number("wall_mm", default=8.0)
    try:
        EndcapParams(diameter, wall)
    except ParameterError as error:  # a design that cannot be made
        raise ParameterError(f"{entry.where()}{error}", name=error.name, value=error.value) from None
    compliance = entry.number_if_given("compliance_m_n", above=LEAST_M_N, most=MOST_M_N)
    delay = entry.number_if_given("yield_delay_s", above=0.0, most=MOST_DELAY_S)
    pose = np.eye(4)
    pose[:3, :3] = rotation_of(np.array([0.0, 0.0, turn]))
    pose[2, 3] = lengths[bar] / 2
    if end == "first":
        pose = np.diag([1.0, -1.0, -1.0, 1.0]) @ pose
    return MountedEndcap(entry.finish("name"), bar, pose, diameter, wall, compliance, delay)


def _cable(entry: Table, lengths: dict[str, float]) -> Cable:
    bars = entry.texts("bars", 2)
    for name in bars:
        if name not in lengths:
            refuse(entry, "bars", f'"{name}"', f"a cable to nowhere: the bars are {', '.join(lengths)}")
    if bars[0] == bars[1]:
        refuse(entry, "bars", f'"{bars[0]}" twice', "a cable joins two bars")
    points = entry.rows("points_m", 2, 3)
    for name, point in zip(bars, points, strict=True):
        _check_place(entry, "points_m", point, lengths[name])
    rest = entry.number("rest_m", above=0.0, most=HEAVIEST)
    stiffness = entry.number("stiffness_n_m", above=0.0, most=HEAVIEST)
    measured = entry.flag("measured", default=True)
    return Cable(entry.finish("name"), (bars[0], bars[1]), points, rest, stiffness, measured)


def _sensor(entry: Table, lengths: dict[str, float]) -> InertialSensor:
    bar = entry.choice("bar", lengths)
    pose = np.eye(4)
    pose[:3, 3] = entry.row("place_m", (3,))
    _check_place(entry, "place_m", pose[:3, 3], lengths[bar])
    for axis, angle in enumerate(np.radians(entry.row("turn_deg", (3,), default=[0.0, 0.0, 0.0]))):
        pose[:3, :3] = rotation_of(angle * np.eye(3)[axis]) @ pose[:3, :3]
    accelerometer = entry.flag("accelerometer", default=False)
    return InertialSensor(entry.finish("name"), bar, pose, accelerometer)


def _check_place(entry: Table, key: str, point: np.ndarray, length_m: float) -> None:
    if abs(point[2]) > length_m / 2 + REACH_M or math.hypot(point[0], point[1]) > REACH_M:
        refuse(
            entry, key, point.tolist(), f"off the bar, whose ends are at z = -{length_m / 2:g} and {length_m / 2:g} m"
        )


def _check_names(path: str, robot: TensegrityRobot) -> None:
    for kind in ("bars", "endcaps", "cables", "sensors"):
        for name, times in Counter(entry.name for entry in getattr(robot, kind)).items():
            if times > 1:
                raise ParameterError(
                    f'{path}: {kind} named "{name}": {times} of them: give each a name of its own',
                    name="name",
                    value=name,
                )
    ends = Counter((endcap.bar, float(endcap.T_bar_endcap[2, 3]) > 0) for endcap in robot.endcaps)
    for (bar, second), times in ends.items():
        if times > 1:
            end = "second" if second else "first"
            raise ParameterError(
                f'{path}: {times} endcaps on the {end} end of bar "{bar}": an end carries one', name="end", value=end
            )


def _check_shape(path: str, robot: TensegrityRobot) -> None:
    """Check that the cables hold the bars in a shape.

    Raises:
        ParameterError: they do not, or only far beyond their rest lengths.
    """
    joined = {robot.bars[0].name}
    for _ in robot.bars:
        joined |= {name for cable in robot.cables if joined & set(cable.bars) for name in cable.bars}
    for bar in robot.bars:
        if bar.name not in joined:
            raise ParameterError(f'{path}: no cable holds bar "{bar.name}"', name="cable", value=bar.name)
    shape = balanced_shape(robot)
    pulling = shape.tension_n > 0
    if not pulling.any():
        raise ParameterError(
            f"{path}: an impossible shape: every cable is slack, so that nothing holds the bars: shorten rest_m",
            name="rest_m",
            value=None,
        )
    for cable, length, tension in zip(robot.cables, shape.length_m, shape.tension_n, strict=True):
        where = f'{path}: cable "{cable.name}": rest_m = {cable.rest_m:g}'
        if not tension:
            raise ParameterError(
                f"{where} is longer than {length:.4g} m, which the others leave it: it would never pull: shorten it",
                name="rest_m",
                value=cable.rest_m,
            )
        if length > (1 + MOST_STRETCH) * cable.rest_m:
            raise ParameterError(
                f"{where} would be stretched to {length:.4g} m: bars and cables do not fit: at most "
                f"{1 + MOST_STRETCH:g} times its rest length",
                name="rest_m",
                value=cable.rest_m,
            )
