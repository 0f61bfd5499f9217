"""The endcap as MJCF: a whole file, or the pieces of one endcap for a robot's own file (m, kg, s, N).

    pieces = endcap_pieces(model, bodies, "foot_1", 'pos="0 0 0.45"')
    f"<worldbody><body name='bar'>...{pieces.body}</body></worldbody><tendon>{pieces.tendons}</tendon>..."

Body NAME is the rigid part, its frame that of the endcap (origin at the centre of the mating plane, z to the tip).
Body NAME_shell is the dome: a hard sphere on three slides with springs. Three tendons carry the radial springs' cubic
part: the sum of (r cos a)^4 over three directions 60 degrees apart is 9/8 r^4 at every azimuth. Body NAME_load between
the two has no freedom and no mass; its site NAME_mating is fixed on the mating plane, so its sensors measure the load
on that plane: the contact, and the weight and inertia of the moving shell.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

import numpy as np

from sensing.simulator.robot_model.model import RobotModel
from sensing.simulator.solid.element import Array

AZIMUTHS_DEG = (0.0, 60.0, 120.0)  # directions of the three tendons
FOURTH_POWERS = 9 / 8  # sum of cos^4 over those azimuths, whichever way they are turned
# Hard contact: the constraint takes two steps of 1 ms to close and all but a ten-thousandth of the force, so that only
# the springs yield.
HARD = 'solref="0.002 1" solimp="0.9999 0.9999 0.001"'
# MuJoCo first looks for contacts between bodies of several shapes in bounding boxes, and that of a plane is only
# precise to a micrometre (it reaches 1e10 m): a contact as hard as this one would be missed in some steps, and bounce.
# The gap widens the boxes; no force acts in it.
GAP_M = 1e-4
# Attributes of MJCF's element ``option``; timestep in s.
OPTIONS = 'timestep="0.001" integrator="implicitfast" cone="elliptic" impratio="100"'
TOO_SMALL_KG = 1e-6  # mass that counts as none


@dataclass(frozen=True)
class Inertial:
    """Mass, centre of mass (3,) and inertia (3, 3) about it, endcap axes; kg, m, kg m2."""

    mass_kg: float
    centre_m: Array
    inertia_kg_m2: Array

    def __add__(self, other: Inertial) -> Inertial:
        mass = self.mass_kg + other.mass_kg
        if mass < TOO_SMALL_KG:
            return self
        centre = (self.mass_kg * self.centre_m + other.mass_kg * other.centre_m) / mass
        about = [one.inertia_kg_m2 + one.mass_kg * _steiner(one.centre_m - centre) for one in (self, other)]
        return Inertial(mass, centre, about[0] + about[1])

    def times(self, share: float) -> Inertial:
        """A part of it, with the mass distribution of the whole."""
        return Inertial(share * self.mass_kg, self.centre_m, share * self.inertia_kg_m2)


@dataclass(frozen=True)
class Bodies:
    """Inertias of the rigid part and of the part that moves with the contact; together the whole endcap."""

    base: Inertial
    shell: Inertial

    @property
    def whole(self) -> Inertial:
        """Inertia of both parts, without relative motion."""
        return self.base + self.shell


@dataclass(frozen=True)
class Pieces:
    """MJCF of one endcap: meshes for ``asset``, the body, its tendons and its sensors."""

    assets: str
    body: str
    tendons: str
    sensors: str


def endcap_pieces(
    model: RobotModel, bodies: Bodies, name: str = "endcap", place: str = "", meshes: Mapping[str, str] | None = None
) -> Pieces:
    """MJCF of one endcap, for a robot's file.

    Args:
        model: springs, dampers, friction.
        bodies: inertias of the rigid and the moving part.
        name: name of the body, and beginning of all other names.
        place: attributes ``pos`` and ``quat`` of the body in its parent.
        meshes: files (m) of ``base`` and ``shell``; None draws the sphere alone.
    """
    meshes = meshes or {}
    assets = "".join(f'<mesh name="{name}_{part}" file={quoteattr(file)}/>\n' for part, file in meshes.items())
    body = (
        f'<body name="{name}" {place}>\n{_inertial(bodies.base)}\n{_visual(name, "base", meshes)}'
        f'<body name="{name}_load"><site name="{name}_mating" size="0.004"/>\n'
        f"{shell_body(model, bodies.shell, name, meshes)}</body>\n</body>\n"
    )
    sensors = "".join(f'<{kind} name="{name}_{kind}" site="{name}_mating"/>\n' for kind in ("force", "torque"))
    return Pieces(assets, body, shell_tendons(model, name), sensors)


def shell_body(
    model: RobotModel, shell: Inertial, name: str = "endcap", meshes: Mapping[str, str] | None = None
) -> str:
    """The moving dome alone, for a body whose frame is the endcap's.

    Args:
        model: springs, dampers, friction.
        shell: inertia of the moving part.
        name: as in :func:`endcap_pieces`.
        meshes: as in :func:`endcap_pieces`.
    """
    spring, (radial, axial) = model.stiffness, model.damping_n_s_m
    slides = "".join(
        f'<joint name="{name}_{axis}" type="slide" axis="{text}" stiffness="{linear:.6g} 0 {cubic:.6g}" '
        f'damping="{damping:.5g}"/>\n'
        for axis, text, linear, cubic, damping in (
            ("x", "1 0 0", 1e3 * spring.radial_n_mm, 0.0, radial),
            ("y", "0 1 0", 1e3 * spring.radial_n_mm, 0.0, radial),
            ("z", "0 0 1", 1e3 * spring.axial_n_mm, 1e9 * spring.axial_cubic_n_mm3, axial),
        )
    )
    centred = Inertial(shell.mass_kg, shell.centre_m - [0, 0, model.centre_m], shell.inertia_kg_m2)
    is_drawn = "shell" in (meshes or {})
    return (
        f'<body name="{name}_shell" pos="0 0 {model.centre_m:.6g}">\n{slides}{_inertial(centred)}\n'
        f'<geom name="{name}_sphere" type="sphere" size="{model.radius_m:.6g}" condim="4" priority="1" {HARD} '
        f'gap="{GAP_M:g}" friction="{model.friction:g} {model.torsion_m:.4g} 0" group="{3 if is_drawn else 2}"/>\n'
        f"{_visual(name, 'shell', meshes or {}, f'0 0 {-model.centre_m:.6g}')}</body>\n"
    )


def shell_tendons(model: RobotModel, name: str = "endcap") -> str:
    """The tendons that carry the radial springs' cubic part, for the element ``tendon``."""
    cubic = 1e9 * model.stiffness.radial_cubic_n_mm3 / FOURTH_POWERS
    if cubic == 0:
        return ""
    angles = np.radians(AZIMUTHS_DEG)
    return "".join(
        f'<fixed name="{name}_radial_{number}" stiffness="0 0 {cubic:.6g}" springlength="0">'
        f'<joint joint="{name}_x" coef="{np.cos(angle):.12g}"/><joint joint="{name}_y" coef="{np.sin(angle):.12g}"/>'
        f"</fixed>\n"
        for number, angle in enumerate(angles)
    )


def endcap_file(pieces: Pieces, title: str, comment: str) -> str:
    """A whole MJCF file.

    Args:
        pieces: MJCF of the endcap.
        title: name of the model.
        comment: first lines of the file.
    """
    said = comment.replace("--", "- -")
    return (
        f"<!--\n{said}\n-->\n<mujoco model={quoteattr(title)}>\n"
        f'<compiler angle="radian" autolimits="true"/>\n<option {OPTIONS}/>\n<asset>\n{pieces.assets}</asset>\n'
        f"<worldbody>\n{pieces.body}</worldbody>\n<tendon>\n{pieces.tendons}</tendon>\n"
        f"<sensor>\n{pieces.sensors}</sensor>\n</mujoco>\n"
    )


def _inertial(one: Inertial) -> str:
    i = one.inertia_kg_m2
    full = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
    return f'<inertial pos="{_text(one.centre_m)}" mass="{one.mass_kg:.6g}" fullinertia="{_text(full)}"/>'


def _visual(name: str, part: str, meshes: Mapping[str, str], place: str = "0 0 0") -> str:
    if part not in meshes:
        return ""
    color = "0.35 0.35 0.38 1" if part == "base" else "0.82 0.8 0.76 1"
    return (
        f'<geom name="{name}_{part}" type="mesh" mesh="{name}_{part}" pos="{place}" contype="0" conaffinity="0" '
        f'group="2" mass="0" rgba="{color}"/>\n'
    )


def _text(values: Array | list[float]) -> str:
    return " ".join(f"{float(value):.7g}" for value in values)


def _steiner(offset: Array) -> Array:
    return np.asarray(offset @ offset * np.eye(3) - np.outer(offset, offset))
