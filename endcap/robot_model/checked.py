"""The written file, loaded into MuJoCo and pressed: what it does beside what the shell does, and the limits on it."""

from __future__ import annotations

import csv
import io
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from fab.checks.check import Check
from sensing.simulator.robot_model.measured import CARRIED_KG, Ramp, Rig
from sensing.simulator.robot_model.model import RobotModel
from sensing.simulator.robot_model.stiffness import DEPTHS_MM

NOT_CHECKED = "not checked: mujoco is not installed (pip install 'endcap-toolkit[robot]')"
FORCE_LIMIT = 0.10  # goal: relative error of the normal force; stated where it is missed
CARRIED_LIMIT = 0.01  # of the force, between two carried masses
SENSOR_LIMIT_N = 0.01
CREEP_LIMIT_MM_S = 1.0
CREEP_TILT_DEG = 25.0
MARGIN = 1.3  # of the load over the shell's largest: the model may be softer


@dataclass(frozen=True)
class PressRow:
    """One state of the shell beside the file's, under each carried mass.

    Attributes:
        tilt_deg, depth_mm, shell_n: tilt, depth and normal force of the shell's state.
        light_n, heavy_n: normal force of the file at that depth, with the smaller and the larger carried mass.
        error: the larger relative error of the two.
        held_out: whether the springs were fitted without that tilt.
    """

    tilt_deg: float
    depth_mm: float
    shell_n: float
    light_n: float
    heavy_n: float
    error: float
    held_out: bool


@dataclass(frozen=True)
class Checked:
    """What was measured in MuJoCo.

    Attributes:
        rows: comparison of every state.
        sensor_error_n: largest error of the force sensor.
        creep_mm_s: speed of creep with the worse of the carried masses.
    """

    rows: list[PressRow]
    sensor_error_n: float
    creep_mm_s: float

    @property
    def force_error(self) -> float:
        """Largest relative error of the normal force."""
        return max(row.error for row in self.rows)

    @property
    def gates(self) -> list[Check]:
        """What stops the export."""
        apart = max(abs(row.heavy_n - row.light_n) / row.shell_n for row in self.rows)
        return [
            Check("robot_model.carried_mass_force_ratio", apart, high=CARRIED_LIMIT),
            Check("robot_model.sensor_error_n", self.sensor_error_n, high=SENSOR_LIMIT_N),
            Check("robot_model.creep_mm_s", self.creep_mm_s, high=CREEP_LIMIT_MM_S),
        ]

    @property
    def table(self) -> str:
        """The rows as CSV."""
        stream = io.StringIO()
        writer = csv.DictWriter(stream, list(PressRow.__dataclass_fields__), lineterminator="\n")
        writer.writeheader()
        for row in self.rows:
            writer.writerow({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in asdict(row).items()})
        return stream.getvalue()


def is_installed() -> bool:
    """Whether MuJoCo is there."""
    return find_spec("mujoco") is not None


def check_in_mujoco(path: Path, model: RobotModel) -> Checked:
    """Press the file at every tilt of the shell's states, with two carried masses.

    Args:
        path: MJCF of the endcap.
        model: springs, sphere and friction of the file.

    Raises:
        FileError: MuJoCo cannot read the file.
    """
    states = model.states.where(model.states.is_pressed_only).between(*DEPTHS_MM)
    rows: list[PressRow] = []
    sensors: list[float] = []
    for tilt in np.unique(states.tilt_deg):
        here = states.where(states.tilt_deg == tilt)
        ramps = [Rig(path, float(tilt), kg).ramp(MARGIN * float(here.normal_n.max())) for kg in CARRIED_KG]
        sensors += [ramp.sensor_error_n for ramp in ramps]
        rows += _rows(ramps, here.depth_mm, here.normal_n, float(tilt), bool(here.is_held_out[0]))
    creep = max(Rig(path, CREEP_TILT_DEG, kg, travels=True).creep_mm_s() for kg in CARRIED_KG)
    return Checked(rows, max(sensors), creep)


def _rows(
    ramps: list[Ramp], depth_mm: np.ndarray, shell_n: np.ndarray, tilt_deg: float, held_out: bool
) -> list[PressRow]:
    """Rows of one tilt by rising depth.

    Args:
        ramps: loadings with the smaller and the larger carried mass.
        depth_mm, shell_n: (s,) depth and normal force of the shell's states.
        tilt_deg: tilt of these states.
        held_out: whether the springs were fitted without them.
    """
    found = np.array([ramp.normal_at(depth_mm) for ramp in ramps])
    error = np.abs(found / shell_n - 1).max(axis=0)
    return [
        PressRow(
            tilt_deg, float(depth_mm[k]), float(shell_n[k]), float(found[0, k]), float(found[1, k]), float(error[k]),
            held_out,
        )
        for k in np.argsort(depth_mm)
    ]  # fmt: skip
