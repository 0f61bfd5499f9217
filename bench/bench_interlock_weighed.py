"""What a weighing leaves of the interlock's stiffness: ``python bench/bench_interlock_weighed.py``.

The weights that ship know plain silicone; the shell D=130 T=8 that is pressed here has an interlock as stiff as
bench/interlock_cell.csv says. As `sensing.weigh` would, two known weights on a level table give one gain. Writes
bench/interlock_weighed.csv: for each tilt and load what plain shell and composite are off by without the gain and with
it, half of the 95 % interval beside it, and the dots: displacement of the composite against that of plain silicone
under the same load, and under the load that the gain makes equal. Fields are those of a nominal sensor without noise,
so that what is left is the mechanics. Two minutes of processor time.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from cad.params import EndcapParams
from sensing.camera.nominal import nominal_mount
from sensing.design.weights import DesignRequest
from sensing.learning.marker_fields import PLAIN, MarkerSensor
from sensing.learning.symmetry import disc_cells
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.press.press import Target
from sensing.simulator.press.ramp import by_force
from sensing.simulator.scene import Scene, SceneState
from sensing.simulator.similarity.labelled import shell_of
from sensing.simulator.similarity.ratios import about
from sensing.tensegrity.description import GRAVITY_M_S2
from sensing.weighing.gain import Pose, fit_gain
from sensing.wrench.model import WrenchModel, load_wrench_model
from sensing.wrench.range import NORMAL_95

HERE = Path(__file__).parent
DESIGN = EndcapParams(130, 8)
WEIGHTS_G = (600.0, 1800.0)  # those of bench/bench_weigh.py
WEIGHT_SD_N = 0.005
TILTS_DEG, LOADS_N = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0), (5.0, 10.0, 20.0, 35.0)
DRAG = 0.25  # walls, along the meridian and across it, after the press
MESH = "data"  # that of the weights' training


def stiffer() -> float:
    """Interlock over plain silicone, on the finest voxels of bench_interlock.py."""
    with (HERE / "interlock_cell.csv").open(newline="") as stream:
        return float(max(csv.DictReader(stream), key=lambda row: int(row["voxels"]))["ratio"])


class Pressed:
    """A shell whose interlock is stiffer by a factor, and what the weights say of its states.

    Args:
        factor: 1 for plain silicone. model: weights.
    """

    def __init__(self, factor: float, model: WrenchModel) -> None:
        request = DesignRequest(DESIGN).data("off", 1)
        self.simulator = shell_of(replace(request, density=MESH, interlock=factor))[0]
        self._model = model
        self._sensor = MarkerSensor(DESIGN, model.shape, PLAIN, np.random.default_rng(0))

    def press(self, load_n: float, tilt_deg: float, drag: float = 0.0) -> SceneState:
        """A press, then a drag of so many walls along the meridian and across it, in one step."""
        targets = by_force(self.simulator.geometry, self.simulator.law, load_n)
        if drag:
            targets.append(Target(load_n, shift_mm=(drag * DESIGN.wall_mm,) * 2))
        return list(self.simulator.follow(Scene(Indenter(tilt_deg)), targets))[-1]

    def truth(self, state: SceneState) -> np.ndarray:
        """(6,) wrench about the sphere's centre, N and N m."""
        wrench = about(state.wrench, np.array([0.0, 0.0, DESIGN.centre_height_mm]))
        return wrench / np.repeat([1.0, 1000.0], 3)

    def read(self, state: SceneState) -> tuple[np.ndarray, np.ndarray]:
        """(6,) wrench and (6, 6) covariance that the weights give for a state."""
        fields = self._sensor.fields(self.simulator.outlines(state, nominal_mount(DESIGN))[None])
        inputs = (fields * disc_cells(self._model.shape)).reshape(1, -1).astype(float)
        value, covariance = self._model.predict(inputs)
        return value[0], covariance[0]

    def gain(self) -> float:
        """Of two known weights on a level table."""
        poses = []
        for grams in WEIGHTS_G:
            state = self.press(grams / 1000 * GRAVITY_M_S2, 0.0)
            value, covariance = self.read(state)
            poses.append(Pose(f"{grams:g} g", self.truth(state)[:3], WEIGHT_SD_N, value[:3], covariance[:3, :3]))
        return fit_gain(poses).gain


def row(plain: Pressed, composite: Pressed, gain: float, place: tuple[float, float, float]) -> dict[str, Any]:
    """One tilt, load and drag."""
    tilt, load, drag = place
    states = plain.press(load, tilt, drag), composite.press(load, tilt, drag)
    like = plain.press(load / gain, tilt, drag)  # plain silicone, pressed so that the weights read the same
    dots = [shell.simulator.markers(s) for shell, s in ((plain, states[0]), (composite, states[1]), (plain, like))]
    size = np.linalg.norm(dots[1])
    found = {"tilt_deg": tilt, "load_n": load, "drag_walls": drag}
    found |= {"dots_percent": 100 * float(np.linalg.norm(dots[1] - dots[0]) / size)}
    found |= {"dots_weighed_percent": 100 * float(np.linalg.norm(dots[1] - dots[2]) / size)}
    for name, shell, state, factor in (
        ("plain", plain, states[0], 1.0), ("composite", composite, states[1], 1.0),
        ("weighed", composite, states[1], gain),
    ):  # fmt: skip
        value, covariance = shell.read(state)
        off = factor * value - shell.truth(state)
        found |= {f"{name}_{axis}": float(off[k]) for k, axis in enumerate(("fx_n", "fy_n", "fz_n"))}
        found |= {f"{name}_torque_nm": float(np.sqrt((off[3:] ** 2).mean()))}
    half = NORMAL_95 * factor * np.sqrt(np.diag(covariance))
    return found | {f"half_interval_{axis}": float(half[k]) for k, axis in enumerate(("fx_n", "fy_n", "fz_n"))}


def main(arguments: list[str] | None = None) -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(description="What a weighing leaves of the interlock's stiffness.")
    parser.add_argument("--stiffer", type=float, default=stiffer(), help="interlock over plain silicone (%(default)s)")
    options = parser.parse_args(arguments)
    model = load_wrench_model(DESIGN)
    plain, composite = Pressed(1.0, model), Pressed(options.stiffer, model)
    own, gain = plain.gain(), composite.gain()
    print(f"gain {gain:.4f} on the composite, {own:.4f} on plain silicone", flush=True)
    rows = []
    for place in [(tilt, load, drag) for tilt in TILTS_DEG for load in LOADS_N for drag in (0.0, DRAG)]:
        rows.append({"stiffer": options.stiffer, "gain": gain} | row(plain, composite, gain, place))
        print({name: round(float(value), 4) for name, value in rows[-1].items()}, flush=True)
    for name in ("plain", "composite", "weighed"):
        off = np.array([[line[f"{name}_{axis}_n"] for axis in ("fx", "fy", "fz")] for line in rows])
        print(f"{name}: {np.sqrt((off**2).mean()):.3f} N an axis, {np.abs(off).max():.3f} N at most")
    write_table(HERE / "interlock_weighed.csv", rows, figures=5)
    return 0


if __name__ == "__main__":
    sys.exit(in_one_line(main))
