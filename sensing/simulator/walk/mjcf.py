"""MJCF of a tensegrity robot: bars, endcaps with compliant domes, cables that only pull (m, kg, s, N).

An endcap's dome is a rigid sphere on three slides with springs, and touches the ground with a hard contact: its force
at a depth does not depend on the mass that it carries. The contact's own compliance (``solref``) would scale with
the carried mass. The integrator is explicit: an implicit one changes a light dome's velocity after the contact
was solved, so that held contacts slide.
A cable is a spatial tendon whose spring begins at its rest length; an actuator adds the damping, at most as large as
the spring's force. Bars collide neither with one another nor with the ground.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache, partial
from xml.sax.saxutils import quoteattr

import numpy as np

from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.simulator.walk.terrain import HARD, Ground
from sensing.tensegrity.description import GRAVITY_M_S2, Array, Bar, MountedEndcap, TensegrityRobot

TIMESTEP_S = 0.001  # time step of MuJoCo


@dataclass(frozen=True)
class Dome:
    """Compliance of an endcap's dome, D=130 T=8 by default.

    Attributes:
        stiffness_n_m: stiffness of each slide, N/m; 4 N/mm: D=130 T=8 under 5 to 10 mm (docs/verification.md).
        damping_ns_m: damping of each slide, N s/m (E).
        mass_kg: mass of the moving shell, kg.
    """

    stiffness_n_m: float = 4000.0
    damping_ns_m: float = 40.0
    mass_kg: float = 0.09

    def of(self, endcap: MountedEndcap) -> Dome:
        """The dome of an endcap, if this is one of D=130 T=8: by its size, or as its description states it.

        Stiffness grows with T^2/D, as in :class:`sensing.simulator.similarity.ratios.LoadScale`; damping over stiffness
        stays, and the mass is that of a sphere's wall.

        Args:
            endcap: endcap of the description.

        Raises:
            ParameterError: a stated dome that the time step is too long for.
        """
        diameter, wall = endcap.diameter_mm / 130.0, endcap.wall_mm / 8.0
        given, delay_s = endcap.compliance_m_n, endcap.yield_delay_s
        stiffness = self.stiffness_n_m * (wall**2 / diameter) if given is None else 1 / given
        delay_s = self.damping_ns_m / self.stiffness_n_m if delay_s is None else delay_s
        mass = self.mass_kg * (diameter**2 * wall)
        least_m_n = max(delay_s * TIMESTEP_S, TIMESTEP_S**2) / mass  # explicit steps become unstable from half of it
        if least_m_n * stiffness > 1:
            raise ParameterError(
                f'endcap "{endcap.name}": a dome of {mass:.2g} kg with compliance_m_n = {1 / stiffness:.3g} and '
                f"yield_delay_s = {delay_s:g} is too stiff for the simulation's steps of {TIMESTEP_S:g} s: at least "
                f"{least_m_n:.2g} m/N, or a shorter delay",
                name="compliance_m_n", value=1 / stiffness,
            )  # fmt: skip
        return Dome(stiffness, delay_s * stiffness, mass)


def robot_mjcf(robot: TensegrityRobot, ground: Ground, poses: Array, dome: Dome = Dome()) -> str:
    """The model as XML; ``ground.heights`` go into the compiled model.

    Args:
        robot: description of the robot.
        ground: ground below it.
        poses: (B, 4, 4) m, T_world_bar at the start.
        dome: compliance of an endcap D=130 T=8.

    Raises:
        ParameterError: a stated dome too stiff for the time step, or a bar whose mass or inertia is smaller than
            that of its domes.
    """
    bodies = "".join(_bar(robot, number, pose, dome) for number, pose in enumerate(poses))
    return f"""<mujoco model={quoteattr(robot.name)}>
<compiler angle="radian" autolimits="true" inertiafromgeom="false"/>
<option timestep="{TIMESTEP_S}" gravity="0 0 {-GRAVITY_M_S2}" integrator="Euler" cone="elliptic" impratio="100">
<flag eulerdamp="disable"/></option>
<size memory="16M"/>
<asset>{ground.assets}</asset>
<worldbody>{ground.xml}{bodies}</worldbody>
<tendon>{"".join(_cable(robot, place) for place in range(len(robot.cables)))}</tendon>
<actuator>{"".join(f'<motor tendon="cable{place}" gear="-1"/>' for place in range(len(robot.cables)))}</actuator>
</mujoco>"""


def sphere_centre_m(endcap: MountedEndcap) -> Array:
    """(3,) centre of the untouched sphere in the frame of its bar."""
    height = centre_height_m(endcap.diameter_mm, endcap.wall_mm)
    return np.asarray(endcap.T_bar_endcap[:3, 3] + height * endcap.T_bar_endcap[:3, 2])


@lru_cache(maxsize=64)
def centre_height_m(diameter_mm: float, wall_mm: float) -> float:
    """Height of the sphere's centre over the mating plane, m."""
    return EndcapParams(diameter_mm, wall_mm).centre_height_mm / 1000


def _bar(robot: TensegrityRobot, number: int, pose: Array, dome: Dome) -> str:
    bar = robot.bars[number]
    shells = [endcap for endcap in robot.endcaps if endcap.bar == bar.name]
    domes = [dome.of(endcap) for endcap in shells]
    mass, centre, inertia = _without_shells(bar, shells, [one.mass_kg for one in domes])
    full = [inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    sites = "".join(
        f'<site name="cable{place}_{end}" pos="{_text(cable.points_m[end])}" size="0.008"/>'
        for place, cable in enumerate(robot.cables)
        for end in (0, 1)
        if cable.bars[end] == bar.name
    )
    return (
        f'<body name="bar{number}" pos="{_text(pose[:3, 3])}" quat="{_text(quaternion(pose[:3, :3]))}">'
        f'<freejoint/><inertial pos="{_text(centre)}" mass="{mass:.9g}" fullinertia="{_text(full)}"/>'
        f'<geom type="capsule" fromto="0 0 {-bar.length_m / 2:g} 0 0 {bar.length_m / 2:g}" size="0.015" '
        f'contype="0" conaffinity="0"/>{sites}{"".join(map(partial(_shell, robot), shells, domes))}</body>'
    )


def _without_shells(bar: Bar, shells: list[MountedEndcap], shell_kg: list[float]) -> tuple[float, Array, Array]:
    """Mass, centre of mass and inertia about it of a bar without its shells, which are bodies of their own."""
    places = [sphere_centre_m(endcap) for endcap in shells]
    mass = bar.mass_kg - sum(shell_kg)
    if mass <= 0:
        raise _no_body(bar, shell_kg)
    moment = bar.mass_kg * bar.centre_of_mass_m
    moment = moment - sum((kg * place for kg, place in zip(shell_kg, places, strict=True)), np.zeros(3))
    centre = moment / mass if places else bar.centre_of_mass_m
    inertia = bar.inertia_kg_m2 + bar.mass_kg * _steiner(bar.centre_of_mass_m)
    for endcap, place, kg in zip(shells, places, shell_kg, strict=True):
        inertia = inertia - kg * _steiner(place) - _sphere_inertia(kg, endcap)
    inertia = inertia - mass * _steiner(centre)
    least, middle, most = np.linalg.eigvalsh(inertia)
    if least <= 0 or most > (least + middle) * (1 + 1e-9):
        raise _no_body(bar, shell_kg)
    return mass, centre, inertia


def _no_body(bar: Bar, shell_kg: list[float]) -> ParameterError:
    """The error for a bar whose stated mass or inertia is less than that of its shells."""
    return ParameterError(
        f'bar "{bar.name}": its mass_kg = {bar.mass_kg:g} and inertia_kg_m2 are less than those of the {len(shell_kg)} '
        f"simulated domes on it, {sum(shell_kg):.2g} kg: give those of all that is screwed to it, endcaps included",
        name="mass_kg",
        value=bar.mass_kg,
    )


def _sphere_inertia(shell_kg: float, endcap: MountedEndcap) -> Array:
    radius_m = 0.06 * (endcap.diameter_mm / 130.0)  # a thin shell: 60 mm at D=130
    return 2 / 3 * shell_kg * radius_m**2 * np.eye(3)


def _steiner(place: Array) -> Array:
    return np.asarray(place @ place * np.eye(3) - np.outer(place, place))


def _shell(robot: TensegrityRobot, endcap: MountedEndcap, dome: Dome) -> str:
    number = robot.endcaps.index(endcap)
    inertia = _sphere_inertia(dome.mass_kg, endcap)[0, 0]
    slides = "".join(
        f'<joint type="slide" axis="{axis}" stiffness="{dome.stiffness_n_m:g}" damping="{dome.damping_ns_m:g}"/>'
        for axis in ("1 0 0", "0 1 0", "0 0 1")
    )
    return (
        f'<body name="shell{number}" pos="{_text(sphere_centre_m(endcap))}">{slides}'
        f'<inertial pos="0 0 0" mass="{dome.mass_kg:g}" diaginertia="{inertia:.6g} {inertia:.6g} {inertia:.6g}"/>'
        f'<geom name="dome{number}" type="sphere" size="{endcap.diameter_mm / 2000:g}" contype="2" conaffinity="1" '
        f'condim="4" friction="0 0 0" {HARD}/></body>'
    )


def _cable(robot: TensegrityRobot, place: int) -> str:
    cable = robot.cables[place]
    spring = f'stiffness="{cable.stiffness_n_m:g}" springlength="0 {cable.rest_m:g}"'
    return (
        f'<spatial name="cable{place}" {spring} width="0.003">'
        f'<site site="cable{place}_0"/><site site="cable{place}_1"/></spatial>'
    )


def quaternion(rotation: Array) -> Array:
    """(4,) quaternion w, x, y, z of a rotation matrix (Shepperd 1978, doi:10.2514/3.55767b)."""
    trace = float(np.trace(rotation))
    size = np.array([trace, *np.diag(rotation)])
    largest = int(np.argmax(size))
    result = np.zeros(4)
    result[largest] = math.sqrt(max(0.0, 1 + 2 * size[largest] - trace))
    off = rotation - rotation.T
    if largest == 0:
        result[1:] = np.array([off[2, 1], off[0, 2], off[1, 0]]) / result[0]
    else:
        i = largest - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        result[0] = off[k, j] / result[largest]
        result[1 + j] = (rotation[j, i] + rotation[i, j]) / result[largest]
        result[1 + k] = (rotation[k, i] + rotation[i, k]) / result[largest]
    result = result / np.linalg.norm(result)
    return np.asarray(result if result[0] >= 0 else -result)


def _text(values: Array | list[float]) -> str:
    return " ".join(f"{float(value):.10g}" for value in values)
