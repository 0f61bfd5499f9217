"""What an endcap reads of its own skin's weight when it is turned after zeroing: ``python bench/bench_own_weight.py``.

Writes bench/own_weight.csv. Of each endcap: the skin's weight, and how far the dots move in the picture. For the one
whose weights ship also what ``sensing.live`` reads of rendered pictures: zeroed in one pose, then turned, untouched.
"""

from __future__ import annotations

import csv
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import cv2
import numpy as np

from cad.materials import silicone
from cad.params import EndcapParams
from sensing.calibration.dots import pattern_points
from sensing.camera.nominal import nominal_mount
from sensing.live.endcap import open_endcap
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.own_weight import nodal_mass_kg, own_weight_displacement
from sensing.simulator.solid.shell import ShellModel, shell_model
from sensing.simulator.solid.surface import dot_directions, inner_surface, surface_sampler

HERE = Path(__file__).parent
G = 9.81
POSES = {"tip up": (0.0, 0.0, -G), "sideways": (G, 0.0, 0.0), "tip down": (0.0, 0.0, G)}
ENDCAPS = (
    (130.0, 8.0, "Smooth-Sil 950"), (130.0, 8.0, "Dragon Skin 30"), (99.0, 6.5, "Smooth-Sil 950"),
    (180.0, 10.0, "Smooth-Sil 950"), (250.0, 12.0, "Smooth-Sil 950"),
)  # fmt: skip
SHIPPED = ENDCAPS[0]
REST, TURNED, RATE_HZ = 12, 12, 30.0
NOISE = 1.5  # gray values


def main() -> int:
    """Writes the table and prints it."""
    rows: list[dict[str, Any]] = []
    for endcap in ENDCAPS:
        diameter, wall, name = endcap
        model = shell_model(shell_geometry(diameter, wall), silicone(name).neo_hooke(), "data")
        sags = {pose: own_weight_displacement(model, silicone(name).density_g_cm3, g) for pose, g in POSES.items()}
        for before, after in (("tip up", "sideways"), ("tip up", "tip down")):
            row = _moved(model, endcap, sags[after] - sags[before])
            row |= {"zeroed": before, "turned": after}
            if endcap == SHIPPED:
                row |= _read(model, sags[before], sags[after])
            rows.append(row)
            print(row, flush=True)
    columns = list(dict.fromkeys(key for row in rows for key in row))
    with (HERE / "own_weight.csv").open("w", newline="") as out:
        table = csv.DictWriter(out, columns, restval="", lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    return 0


def _moved(model: ShellModel, endcap: tuple[float, float, str], moved: Any) -> dict[str, Any]:
    """Weight, and the largest motion of a dot in mm and px."""
    diameter, wall, name = endcap
    params, density = EndcapParams(diameter, wall), silicone(name).density_g_cm3
    camera, points = nominal_mount(params), pattern_points(params)[0]
    dots = surface_sampler(model, dot_directions(model.geometry)).sample(moved)
    seen = camera.sees(points)
    pixels = np.linalg.norm(camera.project(points + dots) - camera.project(points), axis=1)[seen].max()
    return {
        "diameter_mm": diameter, "wall_mm": wall, "silicone": name,
        "weight_n": round(float(nodal_mass_kg(model, density).sum()) * G, 2),
        "dot_mm": round(float(np.linalg.norm(dots[seen], axis=1).max()), 3), "dot_px": round(float(pixels), 2),
    }  # fmt: skip


def _read(model: ShellModel, before: Any, after: Any) -> dict[str, Any]:
    """What live says of an untouched endcap that was turned."""
    params, surface, rng = EndcapParams(*SHIPPED[:2]), inner_surface(model), np.random.default_rng(41)
    renderer = DomeRenderer(params, nominal_mount(params), None, surface.position, surface.interpolation)
    pictures = [renderer.render(surface.field(sag)).image_bgr.astype(float) for sag in (before, after)]
    with tempfile.TemporaryDirectory() as folder:
        for index in range(REST + TURNED):
            picture = pictures[index >= REST]
            noisy = np.clip(np.rint(picture + rng.normal(0, NOISE, picture.shape)), 0, 255).astype(np.uint8)
            cv2.imwrite(f"{folder}/{index:03d}.png", noisy)
        with open_endcap(folder, rate_hz=RATE_HZ) as running:
            last = list(running.readings())[-1]
    force, deviation = last.wrench.force_n, np.sqrt(np.diag(last.wrench.covariance)[:3])
    read = {f"{axis}_n": round(float(value), 2) for axis, value in zip(("fx", "fy", "fz"), force, strict=True)}
    stated = {f"sd_{axis}_n": round(float(value), 2) for axis, value in zip("xyz", deviation, strict=True)}
    flags = "+".join(sorted(last.wrench.flags)) or "none"
    return read | stated | {"contact": last.contact.touching, "flags": flags}


if __name__ == "__main__":
    sys.exit(main())
