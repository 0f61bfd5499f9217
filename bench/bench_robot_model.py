"""The endcap of robot simulators against our FEM: ``python bench/bench_robot_model.py``; robot_model.csv and .png.

1. Press: the MJCF of three designs, pressed in MuJoCo with 1 and 12 kg behind it, beside the shell pressed anew at
   tilts and depths that no spring was fitted to (level 2, friction 0.6).
2. Drop: 2 kg that meet the ground at 0.5 m/s on the tip: how fast they leave it, in MuJoCo, and with the same mass on
   the shell with its silicone's rate effects (Prony series) and without.
3. Step: MuJoCo's time step against force, rebound, creep, and the part of a core that a simulated second takes.

Masses of base and shell are round numbers here: no spring depends on them. Six minutes of processor time.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from cad.materials import silicone
from cad.params import EndcapParams
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Target
from sensing.simulator.robot_model.measured import CARRIED_KG, Rig
from sensing.simulator.robot_model.mjcf import OPTIONS, Bodies, Inertial, endcap_file, endcap_pieces
from sensing.simulator.robot_model.model import robot_model
from sensing.simulator.scene import Scene
from sensing.simulator.solid.geometry import shell_geometry

HERE = Path(__file__).parent
DESIGNS = ((130.0, 8.0), (99.0, 6.5), (180.0, 10.0))
TILTS_DEG = (0.0, 7.0, 22.0, 36.0, 55.0)
DEPTHS_MM = (2.0, 4.0, 6.0, 8.0, 10.0)
FRICTION = 0.6
DROP_KG, DROP_M_S, DROP_STEP_S = 2.0, 0.5, 0.002
STEPS_S = (0.00025, 0.0005, 0.001, 0.002, 0.004)
SHELL_KG, BASE_KG = 0.09, 0.5
COLUMNS = (
    "study", "diameter_mm", "wall_mm", "tilt_deg", "depth_mm", "shell_n", "light_n", "heavy_n", "error_percent",
    "step_s", "force_n", "rebound", "shell_rebound", "elastic_rebound", "creep_mm_s", "core_share",
)  # fmt: skip


def written(folder: Path, diameter_mm: float, wall_mm: float, step_s: float = 0.001) -> Path:
    """MJCF of a design."""

    def ball(mass_kg: float, height_m: float) -> Inertial:
        return Inertial(mass_kg, np.array([0, 0, height_m]), mass_kg * 2e-3 * np.eye(3))

    pieces = endcap_pieces(
        robot_model(EndcapParams(diameter_mm, wall_mm)), Bodies(ball(BASE_KG, 0.01), ball(SHELL_KG, 0.05))
    )
    path = folder / f"D{diameter_mm:g}_T{wall_mm:g}_{step_s:g}.xml"
    assert 'timestep="0.001"' in OPTIONS
    path.write_text(endcap_file(pieces, "endcap", "").replace('timestep="0.001"', f'timestep="{step_s:g}"'))
    return path


def row(study: str, design: tuple[float, float], **values: float) -> dict[str, object]:
    """One row; what it does not know stays empty."""
    known = {name: f"{value:.5g}" for name, value in values.items()}
    return {"study": study, "diameter_mm": f"{design[0]:g}", "wall_mm": f"{design[1]:g}", **known}


def presses(folder: Path) -> list[dict[str, object]]:
    """Normal force of shell and file, by tilt and depth."""
    rows = []
    for design in DESIGNS:
        path, shell = written(folder, *design), Simulator(shell_geometry(*design), silicone().neo_hooke())
        for tilt in TILTS_DEG:
            targets = [Target(depth_mm=depth) for depth in DEPTHS_MM]
            shell_n = np.array([s.normal_n for s in shell.follow(Scene(Indenter(tilt), FRICTION), targets)])
            light, heavy = (
                Rig(path, tilt, kg).ramp(1.3 * shell_n[-1]).normal_at(np.array(DEPTHS_MM)) for kg in CARRIED_KG
            )
            for k, depth in enumerate(DEPTHS_MM):
                off = 100 * max(abs(n[k] / shell_n[k] - 1) for n in (light, heavy))
                place = {"tilt_deg": tilt, "depth_mm": depth, "shell_n": shell_n[k]}
                rows.append(row("press", design, **place, light_n=light[k], heavy_n=heavy[k], error_percent=off))
            print(rows[-1], flush=True)
            shell.forget()
    return rows


def shell_drop(design: tuple[float, float], has_rate_effects: bool) -> float:
    """Speed after over speed before of a mass on the pressed shell, by the explicit central difference."""
    series = silicone().prony_series() if has_rate_effects else ()
    shell = Simulator(shell_geometry(*design), silicone().neo_hooke(), "draft", prony=series)
    walk = shell.walk(Scene(Indenter(0.0), FRICTION), half=True)
    depth, speed, force, now = 0.0, 1000 * DROP_M_S, 0.0, 0.0  # mm, mm/s, N, s
    while True:
        halfway = speed - 500 * DROP_STEP_S * force / DROP_KG
        depth, now = depth + DROP_STEP_S * halfway, now + DROP_STEP_S
        if depth <= 0:
            return -speed / (1000 * DROP_M_S)
        force = walk(Target(depth_mm=depth, time_s=now)).normal_n
        speed = halfway - 500 * DROP_STEP_S * force / DROP_KG
        if speed < 0 and force < 0.05:
            return -speed / (1000 * DROP_M_S)


def file_drop(path: Path) -> float:
    """The same in MuJoCo."""
    rig = Rig(path, 0.0, DROP_KG - BASE_KG - SHELL_KG)
    rig.model.opt.gravity[:] = 0
    rig.data.joint("depth").qvel[0] = DROP_M_S
    for _ in range(round(0.3 / rig.model.opt.timestep)):
        rig.step_free()
        if float(rig.data.joint("depth").qpos[0]) < -1e-4:
            break
    return -float(rig.data.joint("depth").qvel[0]) / DROP_M_S


def drops(folder: Path) -> list[dict[str, object]]:
    """Rebound of every design: of the file, of the shell with rate effects, and of the elastic shell."""
    rows = []
    for design in DESIGNS:
        slow, found, elastic = shell_drop(design, True), file_drop(written(folder, *design)), shell_drop(design, False)
        rows.append(row("drop", design, rebound=found, shell_rebound=slow, elastic_rebound=elastic))
        print(rows[-1], flush=True)
    return rows


def steps(folder: Path) -> list[dict[str, object]]:
    """Time step: force at 6 mm and 36 degrees, rebound, creep, and real seconds a simulated one."""
    rows, design = [], DESIGNS[0]
    for step in STEPS_S:
        path = written(folder, *design, step)
        force = float(Rig(path, 36.0, 2.0).ramp(60.0).normal_at(np.array([6.0]))[0])
        creep, rebound = Rig(path, 25.0, 2.0, travels=True).creep_mm_s(), file_drop(path)
        rig, begin = Rig(path, 0.0, 2.0), time.process_time()
        for _ in range(round(2.0 / step)):
            rig.step_free()
        spent = (time.process_time() - begin) / 2.0
        values = {"step_s": step, "force_n": force, "rebound": rebound, "creep_mm_s": creep, "core_share": spent}
        rows.append(row("step", design, **values))
        print(rows[-1], flush=True)
    return rows


def plot(path: Path, rows: list[dict[str, str]]) -> None:
    """Force over depth for every design and tilt, and the error of each."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, len(DESIGNS), figsize=(12, 6.5), sharex=True, height_ratios=(2, 1))
    for column, design in enumerate(DESIGNS):
        for number, tilt in enumerate(TILTS_DEG):
            here = [
                r for r in rows
                if r["study"] == "press" and (float(r["diameter_mm"]), float(r["tilt_deg"])) == (design[0], tilt)
            ]  # fmt: skip
            depth, shell, light = (np.array([float(r[k]) for r in here]) for k in ("depth_mm", "shell_n", "light_n"))
            color = plt.get_cmap("viridis")(number / len(TILTS_DEG))
            axes[0, column].plot(depth, light, color=color, label=f"{tilt:g} degrees")
            axes[0, column].plot(depth, shell, "o", color=color, markersize=4)
            axes[1, column].plot(depth, 100 * (light / shell - 1), "o-", color=color, markersize=4)
        axes[0, column].set_title(f"D={design[0]:g} T={design[1]:g}: shell (dots), MuJoCo (lines)", fontsize=10)
        axes[1, column].axhspan(-10, 10, color="0.93", zorder=0)
        axes[1, column].set(xlabel="depth, mm", ylim=(-12, 12))
    axes[0, 0].set_ylabel("normal force, N")
    axes[1, 0].set_ylabel("error, %")
    axes[0, 0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="The endcap of robot simulators against our FEM.")
    parser.add_argument("--plot-only", action="store_true", help="draw the rows that are there")
    table = HERE / "robot_model.csv"
    if not parser.parse_args().plot_only:
        with TemporaryDirectory() as folder:
            rows = [*presses(Path(folder)), *drops(Path(folder)), *steps(Path(folder))]
        write_table(table, rows, COLUMNS)
    with table.open(newline="") as stream:
        plot(HERE / "robot_model.png", list(csv.DictReader(stream)))


if __name__ == "__main__":
    sys.exit(in_one_line(main))
