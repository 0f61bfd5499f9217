"""Measures a written model in MuJoCo: force by depth, tilt and carried mass, signs of sensors, creep (N, mm, kg).

The endcap stands still in its own axes; the ground is a plane that touches it at a tilt, and gravity pulls toward it.
The endcap slides along the plane's normal, loaded slowly through a body that it carries.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cad.errors import FileError
from sensing.records import TABLE_G_M_S2
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.robot_model.model import FRICTION
from sensing.simulator.solid.element import Array

# Time in which the load rises; time before creep is measured; time over which it is measured.
RAMP_S, SETTLED_S, CREEP_S = 1.0, 1.0, 1.0
SAMPLED_STEPS = 5  # time steps between samples of a ramp
STIFF_N_M = 5e3  # approximate stiffness of the springs: gives brakes near the aperiodic limit
CARRIED_KG = (1.0, 12.0)  # masses besides the endcap with which it is measured
CREEP_N, CREEP_SHARE = 20.0, 0.5  # normal force, N, and part of the friction limit that pulls along the plane


class _Sample(NamedTuple):
    """Readings of one time step: depth, mm; normal force, N; (6,) sensors and (6,) wrench of the ground, N and N m."""

    depth_mm: float
    normal_n: float
    sensor: Array
    contact: Array


@dataclass(frozen=True)
class Ramp:
    """Samples of one slow loading.

    Attributes:
        depth_mm, normal_n: (n,) depth, mm, and normal force, N, of the contact, rising.
        sensor: (n, 6) readings of the force and torque sensors, N and N m.
        contact: (n, 6) wrench of the ground on the endcap about the mating plane's centre, N and N m.
        shell_n: (3,) weight of the moving shell, N, which the sensors measure, too.
    """

    depth_mm: Array
    normal_n: Array
    sensor: Array
    contact: Array
    shell_n: Array

    def normal_at(self, depth_mm: Array) -> Array:
        """Normal force, N, at depths, mm; NaN beyond the largest depth."""
        order = np.argsort(self.depth_mm)
        return np.interp(depth_mm, self.depth_mm[order], self.normal_n[order], right=np.nan)

    @property
    def sensor_error_n(self) -> float:
        """Largest error of the force sensor, N, against the ground's force on the endcap plus the shell's weight.

        It is taken over the second half, because at first touch the shell's own inertia acts on the sensor.
        """
        late = slice(len(self.sensor) // 2, None)
        return float(np.abs(self.sensor[late, :3] + self.contact[late, :3] + self.shell_n).max())


class Rig:
    """Test rig: an endcap's file on a slide over a plane.

    Args:
        path: MJCF of one endcap.
        tilt_deg, azimuth_deg: polar angle and azimuth of the plane's first touch, degrees.
        carried_kg: mass besides the endcap, kg.
        travels: whether the endcap may also move along the meridian. Where it may not, the friction is at least that
            of a dry floor, because the shell's states that it is compared with belong to a contact that does not slip.
        name: name of its body in the file.

    Raises:
        FileError: MuJoCo cannot read the file.
    """

    def __init__(
        self, path: Path, tilt_deg: float, carried_kg: float, azimuth_deg: float = 0.0, travels: bool = False,
        name: str = "endcap",
    ) -> None:  # fmt: skip
        import mujoco

        self._mujoco = mujoco
        turn = np.radians(azimuth_deg)
        spin = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
        self.outward, self.meridian, _ = (spin @ Indenter(tilt_deg).frame()).T
        try:
            spec = mujoco.MjSpec.from_file(str(path))
            self._mount(spec, spec.body(name), carried_kg, travels)
            self.model = spec.compile()
        except (ValueError, AttributeError) as error:
            said = " ".join(str(error).split())
            raise FileError(f"{path}: MuJoCo {mujoco.__version__} cannot read it ({said}): take version 4") from None
        self.data, self.name, self._travels = mujoco.MjData(self.model), name, travels
        self._mass_kg = float(self.model.body_mass.sum())
        self.weight_n = (self._mass_kg - float(self.model.body(f"{name}_shell").mass[0])) * TABLE_G_M_S2

    def _mount(self, spec: Any, body: Any, carried_kg: float, travels: bool) -> None:
        sphere = spec.geom(f"{body.name}_sphere")
        radius, centre = float(sphere.size[0]), np.array(sphere.parent.pos)
        kind = self._mujoco.mjtJoint.mjJNT_SLIDE
        body.add_joint(name="depth", type=kind, axis=list(self.outward))
        if travels:
            body.add_joint(name="travel", type=kind, axis=list(self.meridian))
        else:
            sphere.friction[0] = max(sphere.friction[0], FRICTION)
        sphere.parent.gravcomp = 1.0  # the pressed shell of the comparison has no weight
        load = body.add_body(name="carried")
        load.mass, load.inertia, load.explicitinertial = carried_kg, [carried_kg * 1e-3] * 3, True
        spec.worldbody.add_geom(
            name="ground", type=self._mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1],
            pos=list(centre + radius * self.outward), zaxis=list(-self.outward),
        )  # fmt: skip
        spec.option.gravity = list(TABLE_G_M_S2 * self.outward)

    def ramp(self, top_n: float) -> Ramp:
        """Load the endcap slowly from zero to ``top_n``, N."""
        steps, rows = round(RAMP_S / self.model.opt.timestep), []
        for k in range(1, steps + 1):
            self._step(top_n * k / steps)
            if k % SAMPLED_STEPS == 0:
                rows.append(self._read())
        depth, normal, sensor, contact = (np.array(column) for column in zip(*rows, strict=True))
        shell = self.model.body(f"{self.name}_shell").mass[0] * TABLE_G_M_S2 * self.outward
        return Ramp(depth, normal, sensor, contact, shell)

    def creep_mm_s(self) -> float:
        """Speed of slip under a steady pull within friction, mm/s; the rig must travel."""
        mu = float(self.model.geom(f"{self.name}_sphere").friction[0])
        first, last = (round(t / self.model.opt.timestep) for t in (SETTLED_S, SETTLED_S + CREEP_S))
        places = []
        for k in range(last):
            pull = CREEP_SHARE * mu * CREEP_N * min(1.0, 2 * k / first)
            self._step(CREEP_N, pull)
            places.append(float(self.data.joint("travel").qpos[0]))
        return 1000 * abs(places[last - 1] - places[first]) / CREEP_S

    def step_free(self) -> None:
        """One time step under gravity alone."""
        self._mujoco.mj_step(self.model, self.data)

    def _step(self, load_n: float, pull_n: float = 0.0) -> None:
        """One time step under a load and, where the rig travels, a pull along the plane, N; the slides are damped."""
        data, brake = self.data, 2 * np.sqrt(STIFF_N_M * self._mass_kg)
        forces = {"depth": load_n - self.weight_n} | ({"travel": pull_n} if self._travels else {})
        for joint, force in forces.items():
            place = data.joint(joint)
            place.qfrc_applied[0] = force - brake * float(place.qvel[0])
        self._mujoco.mj_step(self.model, data)

    def _read(self) -> _Sample:
        """The readings of the present time step."""
        self._mujoco.mj_forward(self.model, self.data)
        contact = self._contact()
        sensed = np.concatenate([self.data.sensor(f"{self.name}_{kind}").data for kind in ("force", "torque")])
        depth_mm = 1000 * float(self.data.joint("depth").qpos[0])
        return _Sample(depth_mm, float(-contact[:3] @ self.outward), sensed, contact)

    def _contact(self) -> Array:
        """(6,) wrench of the ground on the endcap about the mating plane's centre, endcap axes."""
        found, here = np.zeros(6), self.data.body(self.name).xpos
        for number in range(self.data.ncon):
            contact, wrench = self.data.contact[number], np.zeros(6)
            self._mujoco.mj_contactForce(self.model, self.data, number, wrench)
            axes = contact.frame.reshape(3, 3).T
            sign = 1.0 if self.model.geom(contact.geom[1]).name != "ground" else -1.0
            force, torque = sign * axes @ wrench[:3], sign * axes @ wrench[3:]
            found += np.concatenate([force, torque + np.cross(contact.pos - here, force)])
        return found
