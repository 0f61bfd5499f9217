"""A labelled set whose pictures are drawn and warped: quick, and without the simulator."""

from __future__ import annotations

import json

import cv2
import numpy as np

from cad.dots import dot_pattern
from cad.params import EndcapParams
from sensing.records_labelled import COLUMNS
from sensing.sources.drawn import Drawing, draw_dots
from sensing.sources.warp import Bump, Displacement, warp_image

DOTS = len(dot_pattern(EndcapParams(130, 8)))
PHASES = ["approach", "touch", "load", "circle", "unload", "clear", "drag", "impact", "stand", "airborne"]


def write_set(folder, paths, seed, diameter=130.0, specks=()):
    """A labelled set whose pictures shift with the force and spread with the push; specks on the lens stand still."""

    def coded(picture):
        for place in specks:
            cv2.circle(picture, place, 7, (50, 55, 70), -1, cv2.LINE_AA)
        return cv2.imencode(".jpg", picture)[1]

    (folder / "shards").mkdir(parents=True)
    request = {"diameter_mm": diameter, "wall_mm": 8.0, "protocol": "static", "seed": seed}
    (folder / "manifest.json").write_text(json.dumps({"format": 2, "phases": PHASES, "request": request}))
    rng = np.random.default_rng(seed)
    image = draw_dots(Drawing())[0]
    reference = coded(image.copy())
    for path in range(paths):
        end = rng.uniform(-1, 1, 3) * [6, 6, 8] - [0, 0, 10]
        forces = np.linspace(0, 1, 4)[:, None] * end
        pictures = []
        for f in forces:
            bump = Bump((320.0, 240.0), (0.8 * f[0], 0.8 * f[1]), 90.0)
            pictures.append(coded(warp_image(image, Displacement((0.0, 0.0), -0.004 * f[2], bumps=(bump,)))))
        n = len(forces)
        rows = {name: np.zeros(n) for name in COLUMNS}
        rows |= {
            "path": np.full(n, path), "step": np.arange(n), "phase": np.array([0, 2, 2, 3]), "scene": np.full(n, -1),
            "endcap": np.full(n, -1), "time_s": np.arange(n) / 30,
            "latency_s": np.full(n, 0.05), "force_n": forces, "torque_nm": np.zeros((n, 3)),
            "contact": np.arange(n) > 0, "tilt_deg": np.full(n, 10.0 * path), "azimuth_deg": np.full(n, 3.0 * seed),
            "friction": np.full(n, 0.5 + 0.01 * path), "reference": np.zeros(n, int),
            "dots_mm": 0.02 * np.repeat(forces[:, None], DOTS, axis=1),
            "dots_px": np.zeros((n, DOTS, 2)), "dots_visible": np.ones((n, DOTS), bool),
            "jpeg": np.concatenate(pictures), "jpeg_end": np.cumsum([len(p) for p in pictures]),
            "reference_jpeg": reference, "reference_jpeg_end": np.array([len(reference)]),
        }  # fmt: skip
        np.savez(folder / "shards" / f"{path:05d}.npz", **rows)
    return folder
