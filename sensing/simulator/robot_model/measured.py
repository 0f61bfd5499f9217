"""Measures a written model in MuJoCo: force by depth, tilt and carried mass, signs of sensors, creep (N, mm, kg).

The endcap stands still in its own axes; the ground is a plane that touches it at a tilt, and gravity pulls toward it.
The endcap slides along the plane's normal, loaded slowly through a body that it carries.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cad.errors import FileError
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.robot_model.model import FRICTION
from sensing.simulator.solid.element import Array

RAMP_S, SETTLED_S, CREEP_S = 1.0, 1.0, 1.0
SAMPLED_STEPS = 5
STIFF_N_M = 5e3  # of the springs, about: for brakes near the aperiodic limit
CARRIED_KG = (1.0, 12.0)
GRAVITY_M_S2 = 9.81
CREEP_N, CREEP_SHARE = 20.0, 0.5  # normal force, and which part of its friction pulls along the plane


@dataclass(frozen=True)
class Ramp:
    """One slow loading.

    Attributes:
        depth_mm, normal_n: (n,) of the contact, rising.
        sensor: (n, 6) force and torque sensors, N and N m.
        contact: (n, 6) wrench of the ground on the endcap about the mating plane's centre, the same units.
        shell_n: (3,) weight of the moving shell, which the sensors feel too.
    """

    depth_mm: Array
    normal_n: Array
    sensor: Array
    contact: Array
    shell_n: Array

    def normal_at(self, depth_mm: Array) -> Array:
        """Normal force at depths; NaN beyond."""
        order = np.argsort(self.depth_mm)
        return np.interp(depth_mm, self.depth_mm[order], self.normal_n[order], right=np.nan)

    @property
    def sensor_error_n(self) -> float:
        """Largest difference of the force sensor's negative and the ground's force on the endcap, shell's weight added.

        Over the second half: at first touch the shell's own inertia is in it.
        """
        late = slice(len(self.sensor) // 2, None)
        return float(np.abs(self.sensor[late, :3] + self.contact[late, :3] + self.shell_n).max())


class Rig:
    """An endcap's file on a slide over a plane.

    Args:
        path: MJCF of one endcap.
        tilt_deg, azimuth_deg: where the plane touches.
        carried_kg: mass carried besides the endcap.
        travels: whether it may also move along the meridian. Where it may not, the friction is at least that of a dry
            floor, because the shell's states that it is compared with belong to a contact that does not slip.
        name: of its body.

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
        self.weight_n = (self._mass_kg - float(self.model.body(f"{name}_shell").mass[0])) * GRAVITY_M_S2

    def _mount(self, spec: Any, body: Any, carried_kg: float, travels: bool) -> None:
        sphere = spec.geom(f"{body.name}_sphere")
        radius, centre = float(sphere.size[0]), np.array(sphere.parent.pos)
        kind = self._mujoco.mjtJoint.mjJNT_SLIDE
        body.add_joint(name="depth", type=kind, axis=list(self.outward))
        if travels:
            body.add_joint(name="travel", type=kind, axis=list(self.meridian))
        else:
            sphere.friction[0] = max(sphere.friction[0], FRICTION)
        sphere.parent.gravcomp = 1.0  # the pressed shell that it is compared with has no weight
        load = body.add_body(name="carried")
        load.mass, load.inertia, load.explicitinertial = carried_kg, [carried_kg * 1e-3] * 3, True
        spec.worldbody.add_geom(
            name="ground", type=self._mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1],
            pos=list(centre + radius * self.outward), zaxis=list(-self.outward),
        )  # fmt: skip
        spec.option.gravity = list(GRAVITY_M_S2 * self.outward)

    def ramp(self, top_n: float) -> Ramp:
        """Load slowly from nothing."""
        steps, rows = round(RAMP_S / self.model.opt.timestep), []
        for k in range(1, steps + 1):
            self._step(top_n * k / steps)
            if k % SAMPLED_STEPS == 0:
                rows.append(self._read())
        depth, normal, sensor, contact = (np.array(column) for column in zip(*rows, strict=True))
        shell = self.model.body(f"{self.name}_shell").mass[0] * GRAVITY_M_S2 * self.outward
        return Ramp(depth, normal, sensor, contact, shell)

    def creep_mm_s(self) -> float:
        """How fast it travels under a steady pull within friction; the rig must travel."""
        mu = float(self.model.geom(f"{self.name}_sphere").friction[0])
        first, last = (round(t / self.model.opt.timestep) for t in (SETTLED_S, SETTLED_S + CREEP_S))
        places = []
        for k in range(last):
            pull = CREEP_SHARE * mu * CREEP_N * min(1.0, 2 * k / first)
            self._step(CREEP_N, pull)
            places.append(float(self.data.joint("travel").qpos[0]))
        return 1000 * abs(places[last - 1] - places[first]) / CREEP_S

    def step_free(self) -> None:
        """One step under nothing but gravity."""
        self._mujoco.mj_step(self.model, self.data)

    def _step(self, load_n: float, pull_n: float = 0.0) -> None:
        """One step under a load, and a pull along the plane where the rig travels; the rig brakes."""
        data, brake = self.data, 2 * np.sqrt(STIFF_N_M * self._mass_kg)
        forces = {"depth": load_n - self.weight_n} | ({"travel": pull_n} if self._travels else {})
        for joint, force in forces.items():
            place = data.joint(joint)
            place.qfrc_applied[0] = force - brake * float(place.qvel[0])
        self._mujoco.mj_step(self.model, data)

    def _read(self) -> tuple[float, float, Array, Array]:
        """Depth, normal force, sensors, wrench of the ground."""
        self._mujoco.mj_forward(self.model, self.data)
        contact = self._contact()
        sensed = np.concatenate([self.data.sensor(f"{self.name}_{kind}").data for kind in ("force", "torque")])
        return 1000 * float(self.data.joint("depth").qpos[0]), float(-contact[:3] @ self.outward), sensed, contact

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
