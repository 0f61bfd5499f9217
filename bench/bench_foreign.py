"""The live pipeline on a world that is not ours: shells solved by CalculiX, pictures by Blender, ink of another hand.

    sudo apt-get install calculix-ccx
    python -m pip install --target exports/blender bpy==4.2.0        # 500 MB, GPL: for this bench alone
    PYTHONPATH=. python bench/bench_foreign.py --blender exports/blender

Solves two paths of the plane and renders them as two sensors see them: one with another lens, one whose camera is
turned and shifted, too, with another lens law and shiny ink (six minutes of one core; what is there is kept). Then each
is calibrated from its rest picture and answered by the pipeline that ``sensing.live`` runs; ``python -m
sensing.evaluate exports/foreign/other*/`` reads the same sets. Writes bench/foreign.csv and bench/foreign.jpg.
"""

from __future__ import annotations

import argparse
import csv
import sys
import tempfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scipy.interpolate import RBFInterpolator

from bench.foreign.ink import Hand
from bench.foreign.mesh import Shell
from bench.foreign.press import PlanePath, Pressed, Silicone, pressed
from bench.foreign.world import Look, write_set
from cad.materials import silicone
from cad.params import EndcapParams
from sensing.evaluation.live_answers import LiveAnswers, live_answers
from sensing.learning.found_camera import found_camera
from sensing.live.core.model import load_model
from sensing.records_labelled import LabelledSet
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Target
from sensing.simulator.scene import Scene
from sensing.simulator.solid.geometry import shell_geometry

HERE = Path(__file__).parent
SEEN_MM = 20.0  # height above which the inner surface is compared
NORMAL_95 = 1.959964
PATHS = (  # tilt, friction, (depth, travel) of the plane; the last state is on the way back
    PlanePath(24, 0.8, ((1.2, 0.0), (2.8, -0.5), (4.6, 0.6), (6.6, 0.6), (4.0, 0.9))),
    PlanePath(42, 0.35, ((2.0, 0.0), (3.8, 1.0), (5.6, 0.3), (7.2, -0.5), (3.4, -0.5))),
)
LOOKS = {
    "other lens": Look("equisolid", 245.0, azimuth_deg=35.0),
    "other law, turned": Look(
        "equidistant", 236.0, (1.1, -0.9, 2.0), (0.4, -0.3, 0.3), 250.0, roughness=(0.5, 0.25), specular=0.6, lamps=7,
        lamp_radius_mm=20.0, lamp_height_mm=13.0, uneven=0.25,
        hand=Hand(2.0, 0.12, 0.25, 0.1, 0.03, 0.36, 0.03, 0.03), seed=2,
    ),
}  # fmt: skip


def main() -> int:
    """Solve and render what is missing, answer, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--blender", type=Path, required=True, help="folder into which bpy was installed")
    parser.add_argument("--sets", type=Path, default=Path("exports/foreign"), help="where states and pictures are put")
    parser.add_argument("--weights", type=Path, help="of the model (those that ship)")
    parser.add_argument("--samples", type=int, default=3, help="of the renderer, a pixel")
    parser.add_argument("--threads", type=int, default=1, help="of the renderer")
    parser.add_argument("--compare", nargs="*", default=[], metavar="DENSITY", help="our own meshes on the same paths")
    parser.add_argument("--out", type=Path, default=HERE / "foreign.csv")
    options = parser.parse_args()
    states = [_solved(options.sets, number) for number in range(len(PATHS))]
    for density in options.compare:
        compare(states, density)
    rows = []
    for name, look in LOOKS.items():
        folder = options.sets / name.replace(",", "").replace(" ", "_")
        if len(list((folder / "shards").glob("*.npz"))) < len(PATHS):
            write_set(folder, list(PATHS), states, look, options.blender, options.samples, options.threads)
        rows += _answered(name, LabelledSet(folder), options.weights)
    with options.out.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)
    picture = options.sets / "other_law_turned" / "pictures" / "00" / "00004.png"
    cv2.imwrite(str(options.out.with_suffix(".jpg")), cv2.imread(str(picture)), [cv2.IMWRITE_JPEG_QUALITY, 80])
    for row in rows:
        print(*(f"{v:.3g}" if isinstance(v, float) else v for v in row.values()), sep="  ")
    return 0


def compare(states: list[Pressed], density: str) -> None:
    """Our simulator's force over theirs with the plane in the same place, and their displacements over ours.

    Args:
        states: theirs, of every path. density: of our mesh.
    """
    simulator = Simulator(shell_geometry(130, 8), silicone().neo_hooke(), density)
    rest = simulator.surface.position
    use = (rest[:, 1] >= 0) & (rest[:, 2] > SEEN_MM)
    for path, theirs in zip(PATHS, states, strict=True):
        targets = [Target(depth_mm=depth, shift_mm=(shift, 0.0)) for depth, shift in path.places]
        ours = simulator.follow(Scene(Indenter(path.tilt_deg), path.friction), targets)
        for state, moved, wrench in zip(ours, theirs.moved, theirs.wrench, strict=True):
            force = np.linalg.norm(state.force_n) / np.linalg.norm(wrench[:3])
            surface, other = state.surface_mm[use], RBFInterpolator(theirs.rest, moved, neighbors=30)(rest[use])
            scale = (surface * other).sum() / (surface**2).sum()
            where = f"{density}, {path.tilt_deg:g} degrees, {np.linalg.norm(wrench[:3]):.1f} N"
            print(f"{where}: our force {force:.3f} of theirs, their displacement {scale:.3f} of ours", flush=True)


def _solved(folder: Path, number: int) -> Pressed:
    """A path's states, solved once."""
    file = folder / f"path_{number}.npz"
    if not file.exists():
        params, law = EndcapParams(130, 8), silicone().neo_hooke()
        shell = Shell(
            params.outer_radius_mm, params.inner_radius_mm, params.centre_height_mm, params.flange_thickness_mm
        )
        made = pressed(shell, Silicone(law.c10_mpa, law.bulk_mpa), PATHS[number], folder / f"ccx_{number}")
        np.savez(folder / f"ccx_{number}" / "states.npz", **vars(made))
        (folder / f"ccx_{number}" / "states.npz").rename(file)
        print(f"path {number}: forces", *np.linalg.norm(made.wrench[:, :3], axis=1).round(1), flush=True)
    with np.load(file) as found:
        return Pressed(**{name: found[name] for name in found.files})


def _answered(name: str, data: LabelledSet, weights: Path | None) -> list[dict[str, Any]]:
    """Errors with the camera that calibration finds, without a calibration, and with the true one."""
    model = load_model("default", data.params, weights)
    with tempfile.TemporaryDirectory() as folder:
        found = Path(folder) / "camera.json"
        found_camera(data).save(found)
        cameras = {"calibrated": found, "not calibrated": None, "true camera": data.folder / "camera.json"}
        return [
            row
            for camera, file in cameras.items()
            for row in _errors({"sensor": name, "camera": camera}, live_answers(data, model, file))
        ]


def _errors(row: dict[str, Any], answers: LiveAnswers) -> list[dict[str, Any]]:
    """Over all frames, and tilt by tilt."""
    load = np.linalg.norm(answers.truth[:, :3], axis=1)
    within = (load >= 5) & (load <= 35)
    groups = {"all": within} | {
        f"{tilt:g}": within & (answers.tilt_deg == tilt) for tilt in np.unique(answers.tilt_deg)
    }
    found = []
    for tilt, use in groups.items():
        error = (answers.value - answers.truth)[use]
        sd = np.sqrt(np.diagonal(answers.covariance, axis1=1, axis2=2)[use])
        rmse = np.sqrt((error**2).mean(axis=0))
        found.append(
            row | {"tilt_deg": tilt, "frames": int(use.sum()), "fx_n": rmse[0], "fy_n": rmse[1], "fz_n": rmse[2],
            "fz_bias_n": error[:, 2].mean(), "torque_nm": float(np.sqrt((rmse[3:] ** 2).mean())),
            "covered": float((np.abs(error) <= NORMAL_95 * sd).mean()), "flagged": float(answers.flagged[use].mean())}
        )  # fmt: skip
    return found


if __name__ == "__main__":
    sys.exit(main())
