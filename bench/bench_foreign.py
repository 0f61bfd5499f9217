"""The live pipeline on a world that is not ours: shells solved by CalculiX, pictures by Blender, ink of another hand.

    sudo apt-get install calculix-ccx
    python -m pip install --target exports/blender bpy==4.2.0        # 500 MB, GPL: for this bench alone
    python bench/bench_foreign.py --blender exports/blender
    python bench/bench_foreign.py --forces              # whose force is right; needs no bpy
    python bench/bench_foreign.py --our-forces          # the rows of it that are ours; needs no ccx

Solves two paths of the plane and renders them as two sensors see them: one with another lens, one whose camera is
turned and shifted, too, with another lens law and shiny ink (half an hour of one core; what is there is kept). Then
each is calibrated from its rest picture and answered by the pipeline that ``sensing.live`` runs; ``python -m
sensing.evaluate exports/foreign/other*/`` reads the same sets. Writes bench/foreign.csv, foreign_links.csv (which link
of the chain costs what), foreign_forces.csv (the same presses on finer and finer meshes) and foreign.jpg.
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

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.foreign.forces import force_rows, our_rows
from bench.foreign.ink import Hand
from bench.foreign.links import Link, links, our_states
from bench.foreign.solved import DESIGN, PATHS, solved
from bench.foreign.world import Look, write_set
from bench.one_line import in_one_line
from bench.table_file import write_table
from sensing.evaluation.live_answers import LiveAnswers, live_answers
from sensing.learning.found_camera import found_camera
from sensing.live.core.model import load_model
from sensing.records_labelled import LabelledSet
from sensing.wrench.range import NORMAL_95

HERE = Path(__file__).parent
LOADS_N = (5.0, 35.0)  # true forces that count
OURS = ("data",)  # meshes of our simulator on the same paths: that of the training
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
    parser.add_argument("--blender", type=Path, help="folder into which bpy was installed")
    parser.add_argument("--forces", action="store_true", help="compare the forces of both programs, mesh by mesh")
    parser.add_argument("--our-forces", action="store_true", help="renew our own rows of foreign_forces.csv")
    parser.add_argument("--sets", type=Path, default=Path("exports/foreign"), help="where states and pictures are put")
    parser.add_argument("--weights", type=Path, help="of the model (those that ship)")
    parser.add_argument("--samples", type=int, default=6, help="of the renderer, a pixel")
    parser.add_argument("--threads", type=int, default=1, help="of the renderer")
    parser.add_argument("--out", type=Path, default=HERE / "foreign.csv")
    options = parser.parse_args()
    if options.blender is None and not options.forces and not options.our_forces:
        parser.error("give --blender FOLDER (pictures), --forces (of both programs), --our-forces, or several")
    options.sets.mkdir(parents=True, exist_ok=True)
    if options.forces:
        _write(
            options.out.with_stem("foreign_forces"),
            force_rows(options.sets, load_model("default", DESIGN, options.weights)),
        )
    elif options.our_forces:
        table = options.out.with_stem("foreign_forces")
        _write(table, renewed(table, our_rows(options.sets)))
    if options.blender is not None:
        _pictures(options)
    return 0


def renewed(table: Path, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows of a table with those of ``rows``' kind replaced, where the first of them stood.

    Args:
        table: to read. rows: new ones, all of one value of ``what``.
    """
    with table.open(newline="") as stream:
        before = list(csv.DictReader(stream))
    kinds = [row["what"] for row in before]
    place = kinds.index(rows[0]["what"])
    others = [(k, row) for k, row in enumerate(before) if row["what"] != rows[0]["what"]]
    return [row for k, row in others if k < place] + rows + [row for k, row in others if k > place]


def _pictures(options: argparse.Namespace) -> None:
    """Both sensors: their pictures, answers and links."""
    states = [solved(options.sets, path) for path in PATHS]
    ours = {density: our_states(PATHS, density) for density in OURS}
    rows, chains = [], []
    for name, look in LOOKS.items():
        folder = options.sets / name.replace(",", "").replace(" ", "_")
        if len(list((folder / "shards").glob("*.npz"))) < len(PATHS):
            write_set(folder, list(PATHS), states, look, options.blender, options.samples, options.threads)
        data = LabelledSet(folder)
        model = load_model("default", data.params, options.weights)
        rows += _answered(name, data, options.weights)
        chains += _summed(name, links(data, model, states, ours))
    _write(options.out, rows)
    _write(options.out.with_stem("foreign_links"), chains)
    picture = options.sets / "other_law_turned" / "pictures" / "00" / "00003.png"
    cv2.imwrite(str(options.out.with_suffix(".jpg")), cv2.imread(str(picture)), [cv2.IMWRITE_JPEG_QUALITY, 80])


def _write(path: Path, rows: list[dict[str, Any]]) -> None:
    """A table, and its lines on the screen."""
    write_table(path, rows, figures=5)
    for row in rows:
        print(*(f"{v:.3g}" if isinstance(v, float) else v for v in row.values()), sep="  ")


def _summed(name: str, found: list[Link]) -> list[dict[str, Any]]:
    """Error of every chain of one sensor, over the loads that count."""
    rows = []
    for chain in dict.fromkeys(link.chain for link in found):
        of_chain = [link for link in found if link.chain == chain]
        use = [link for link in of_chain if LOADS_N[0] <= np.linalg.norm(link.truth[:3]) <= LOADS_N[1]]
        error = np.array([link.error for link in use])
        rmse = np.sqrt((error**2).mean(axis=0))
        share = 100 * np.mean([link.error[2] / np.linalg.norm(link.truth[:3]) for link in use])
        rows.append(
            {"sensor": name, "chain": chain, "frames": len(use), "fx_n": rmse[0], "fy_n": rmse[1], "fz_n": rmse[2],
             "fz_bias_n": error[:, 2].mean(), "fz_bias_percent": float(share),
             "tracked_px": float(np.mean([link.tracked_px for link in use]))}
        )  # fmt: skip
    return rows


def _answered(name: str, data: LabelledSet, weights: Path | None) -> list[dict[str, Any]]:
    """Errors with the camera that calibration finds, without a file of it, and with the true one."""
    model = load_model("default", data.params, weights)
    with tempfile.TemporaryDirectory() as folder:
        found = Path(folder) / "camera.json"
        found_camera(data).save(found)
        cameras = {"calibrated": found, "no camera file": None, "true camera": data.folder / "camera.json"}
        return [
            row
            for camera, file in cameras.items()
            for row in _errors({"sensor": name, "camera": camera}, live_answers(data, model, file))
        ]


def _errors(row: dict[str, Any], answers: LiveAnswers) -> list[dict[str, Any]]:
    """Over all frames, and tilt by tilt."""
    load = np.linalg.norm(answers.truth[:, :3], axis=1)
    within = (load >= LOADS_N[0]) & (load <= LOADS_N[1])
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
    sys.exit(in_one_line(main))
