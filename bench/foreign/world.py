"""A set of labelled frames from a world that is not ours: mechanics of CalculiX, pictures of Blender.

    paths = [PlanePath(...), ...]; states = [pressed(shell, law, path, folder) for path in paths]
    write_set(folder, paths, states, Look(...), blender)

What of the project is used: the design's numbers and dots, the silicone's constants, and the format in which
``sensing.evaluate`` reads a set. Lengths in mm, wrenches in N and N m.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from bench.foreign.ink import Hand, map_places, texture
from bench.foreign.mesh import Array, Index
from bench.foreign.press import PlanePath, Pressed
from bench.foreign.solved import DESIGN
from cad.dots import dot_pattern
from cad.identity import identity
from cad.materials import DEFAULT_SILICONE
from cad.params import EndcapParams
from sensing.camera.model import FisheyeCamera
from sensing.camera.mount import MountedCamera, mount, rotation_matrix
from sensing.recording.folder import UNKNOWN
from sensing.records_labelled import COLUMNS
from sensing.set_manifest import FORMAT

SIZE = (640, 480)
LAMP_W = 190.0  # E: gives a gray of about 110
REST_SAMPLES = 4  # of the rest picture, in those of a state: live averages ten frames for its reference
CUTS = 5  # parts of an edge of the solved mesh, in the picture's mesh
SCENE = Path(__file__).with_name("blender_scene.py")
EQUISOLID = (-1 / 24, 1 / 1920, -1 / 322560, 0.0)  # 2 sin(angle / 2) as the camera model's series


@dataclass(frozen=True)
class Look:
    """One sensor of this world.

    Attributes:
        law: of the lens, ``equisolid`` or ``equidistant``. focal_px: pixels per radian on the axis.
        turned_deg: rotation vector of the camera's axes. shifted_mm: of the pupil.
        azimuth_deg: of the contacts. roughness: of silicone and ink. specular: of both.
        lamps: their number. lamp_radius_mm, lamp_height_mm: of their ring. uneven: brightest over mean, less one.
        exposure: factors of two. hand: who painted. seed: of paint and noise.
    """

    law: str
    focal_px: float
    turned_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shifted_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    azimuth_deg: float = 0.0
    roughness: tuple[float, float] = (0.7, 0.6)
    specular: float = 0.3
    lamps: int = 5
    lamp_radius_mm: float = 25.0
    lamp_height_mm: float = 11.0
    uneven: float = 0.1
    exposure: float = 0.0
    hand: Hand = field(default_factory=Hand)
    seed: int = 1

    def camera(self, params: EndcapParams) -> MountedCamera:
        """The true camera, for those who want to know what calibration costs."""
        k = EQUISOLID if self.law == "equisolid" else (0.0, 0.0, 0.0, 0.0)
        centre = (SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2
        lens = FisheyeCamera(*SIZE, self.focal_px, self.focal_px, *centre, k, 95.0)
        pupil = np.array([0, 0, params.camera_height_mm]) + self.shifted_mm
        return mount(lens, pupil, rotation_matrix(np.radians(self.turned_deg)))


@dataclass(frozen=True)
class Surface:
    """The whole inner surface, fine enough to be seen: rest (n, 3), moved (s, n, 3), triangles (t, 3)."""

    rest: Array
    moved: Array
    triangles: Index


def whole_surface(pressed: Pressed, centre_mm: float, radius_mm: float) -> Surface:
    """Both halves of a pressed surface, its quadratic quadrangles cut small into triangles.

    Args:
        pressed: of the half y >= 0. centre_mm: height of the sphere's centre. radius_mm: of the inner surface.
    """
    steps = np.linspace(-1, 1, CUTS + 1)
    corner = np.array([(x, y) for y in steps for x in steps])
    low = (np.arange(CUTS)[:, None] * (CUTS + 1) + np.arange(CUTS)).ravel()
    small = np.concatenate(
        [np.stack([low, low + 1, low + CUTS + 2], 1), np.stack([low, low + CUTS + 2, low + CUTS + 1], 1)]
    )
    shape = _serendipity(corner)
    rest = np.einsum("ka,tai->tki", shape, pressed.rest[pressed.inner]).reshape(-1, 3) - [0, 0, centre_mm]
    rest *= radius_mm / np.linalg.norm(rest, axis=1)[:, None]
    moved = np.einsum("ka,stai->stki", shape, pressed.moved[:, pressed.inner]).reshape(len(pressed.moved), -1, 3)
    triangles = (np.arange(len(pressed.inner))[:, None, None] * len(corner) + small).reshape(-1, 3)
    mirror = np.array([1.0, -1.0, 1.0])
    both = np.concatenate([rest, rest * mirror])
    _, keep, back = np.unique(both.round(4) + 0.0, axis=0, return_index=True, return_inverse=True)
    triangles = back.ravel()[np.concatenate([triangles, triangles[:, ::-1] + len(rest)])]
    moved = np.concatenate([moved, moved * mirror], axis=1)[:, keep]
    return Surface(both[keep] + [0, 0, centre_mm], moved, triangles)


def _serendipity(at: Array) -> Array:
    """(k, 8) shape functions of the 8-node quadrangle, corners first, at (k, 2) in -1..1."""
    x, y = at.T
    corners = [(1 + a * x) * (1 + b * y) * (a * x + b * y - 1) / 4 for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    sides = [(1 - x * x) * (1 - y) / 2, (1 + x) * (1 - y * y) / 2, (1 - x * x) * (1 + y) / 2, (1 - x) * (1 - y * y) / 2]
    return np.stack(corners + sides, axis=1)


def turn(azimuth_deg: float) -> Array:
    """(3, 3) rotation about the endcap's axis."""
    return rotation_matrix([0.0, 0.0, math.radians(azimuth_deg)])


def write_set(
    folder: Path, paths: list[PlanePath], states: list[Pressed], look: Look, blender: Path, samples: int, threads: int
) -> None:
    """Render all states as one sensor sees them, and write the set.

    Args:
        folder: to write. paths, states: what was solved. look: the sensor. blender: folder into which ``bpy`` was
            installed. samples: of the renderer, a pixel. threads: of the renderer.

    Raises:
        RuntimeError: the renderer failed.
    """
    params = DESIGN
    (folder / "shards").mkdir(parents=True, exist_ok=True)
    look.camera(params).save(folder / "camera.json")
    design = {"diameter_mm": params.diameter_mm, "wall_mm": params.wall_mm}
    record = {
        "format": FORMAT, "phases": ["pressed"], "columns": COLUMNS, "shards": len(paths),
        "identity": identity(params, DEFAULT_SILICONE).record(),
        "request": design | {"protocol": "foreign", "seed": look.seed},
    }  # fmt: skip
    (folder / "manifest.json").write_text(json.dumps(record, indent=1))
    reference = b""
    for number, (path, state) in enumerate(zip(paths, states, strict=True)):
        surface = whole_surface(state, params.centre_height_mm, params.inner_radius_mm)
        work = folder / "pictures" / f"{number:02d}"
        pictures = rendered(work, number, surface, look, blender, samples, threads)
        jpegs = [_jpeg(picture, look.seed, 100 * number + k) for k, picture in enumerate(pictures)]
        if number == 0:
            reference, jpegs = jpegs[0], jpegs[1:]
        _write_shard(folder, number, path, state.wrench, jpegs, reference, look, params)


def _write_shard(
    folder: Path, number: int, path: PlanePath, wrenches: Array, jpegs: list[bytes], reference: bytes, look: Look,
    params: EndcapParams,
) -> None:  # fmt: skip
    """One path; its wrenches (s, 6) are about the sphere's centre at azimuth 0."""
    R, centre = turn(look.azimuth_deg), np.array([0, 0, params.centre_height_mm / 1000])
    rows = []
    for step, wrench in enumerate(wrenches):
        force, torque = R @ wrench[:3], R @ wrench[3:]
        known: dict[str, Any] = {
            "path": number, "step": step, "time_s": 10.0 * (step + 1), "exposure_s": 0.0, "tilt_deg": path.tilt_deg,
            "azimuth_deg": look.azimuth_deg, "friction": path.friction, "depth_mm": path.places[step][0],
            "shift_mm": np.array([path.places[step][1], 0.0]), "force_n": force, "contact": True,
            "torque_nm": torque + np.cross(centre, force), "T_world_endcap": _plane(path, step, R, params),
        }  # fmt: skip
        rows.append({name: known.get(name, UNKNOWN.get(name, np.nan)) for name in COLUMNS})
    arrays = {name: np.array([row[name] for row in rows]) for name in COLUMNS}
    for prefix, pictures in (("jpeg", jpegs), ("reference_jpeg", [reference])):
        arrays[prefix] = np.frombuffer(b"".join(pictures), np.uint8)
        arrays[f"{prefix}_end"] = np.cumsum([len(picture) for picture in pictures])
    np.savez(folder / "shards" / f"{number:05d}.npz", **arrays)


def _plane(path: PlanePath, step: int, R: Array, params: EndcapParams) -> Array:
    """(4, 4) endcap to world, mm: the plane is z = 0, toward the endcap."""
    s, c = math.sin(math.radians(path.tilt_deg)), math.cos(math.radians(path.tilt_deg))
    outward, meridian = R @ [s, 0, c], R @ [c, 0, -s]
    pose = np.eye(4)
    pose[:3, :3] = np.stack([meridian, np.cross(meridian, outward), -outward])
    pose[2, 3] = params.outer_radius_mm - path.places[step][0] + params.centre_height_mm * outward[2]
    return pose


def rendered(
    work: Path, number: int, surface: Surface, look: Look, blender: Path, samples: int, threads: int
) -> list[Array]:
    """Gray pictures of a path's states, of the first path the rest before them; those that lie there are kept.

    Args:
        work: folder of scene and pictures. number: of the path. surface: pressed, at azimuth 0. look: the sensor.
        blender, samples, threads: of :func:`write_set`.

    Raises:
        RuntimeError: the renderer failed.
    """
    params, R = DESIGN, turn(look.azimuth_deg)
    shapes = (surface.rest + surface.moved) @ R.T
    each = np.full(len(shapes), samples)
    if number == 0:
        shapes, each = np.concatenate([(surface.rest @ R.T)[None], shapes]), np.append(REST_SAMPLES * samples, each)
    files = [work / f"{k:05d}.png" for k in range(len(shapes))]
    if all(file.exists() for file in files):
        return [cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) for file in files]
    work.mkdir(parents=True, exist_ok=True)
    centre = np.array([0, 0, params.centre_height_mm])
    directions = np.array([dot.direction for dot in dot_pattern(params)])
    gray, ink = texture(directions, params.inner_radius_mm, look.hand, look.seed)
    camera = look.camera(params)
    axes = camera.T_camera_endcap[:3, :3].T @ np.diag([1.0, -1.0, -1.0])  # Blender's camera: right, up, back
    around = 2 * np.pi * (np.arange(look.lamps) / look.lamps + 0.07)
    lamps = np.column_stack([look.lamp_radius_mm * np.cos(around), look.lamp_radius_mm * np.sin(around),
                             np.full(look.lamps, look.lamp_height_mm)])  # fmt: skip
    watts = LAMP_W / look.lamps * (1 + look.uneven * np.cos(around))
    scene = {
        "vertices": shapes, "triangles": surface.triangles, "size": SIZE, "samples": each, "threads": threads,
        "uv": map_places((surface.rest - centre) @ R.T), "gray": gray, "ink": ink, "roughness": look.roughness,
        "specular": look.specular, "axes": axes, "pupil_mm": camera.pupil_endcap_mm, "law": look.law,
        "focal_px": look.focal_px, "lamps_mm": lamps, "lamp_size_mm": 3.0, "lamps_w": watts, "exposure": look.exposure,
    }  # fmt: skip
    np.savez(work / "scene.npz", **scene)
    with (work / "blender.log").open("w") as log:
        command, path = [sys.executable, str(SCENE), "scene.npz", "."], str(blender.resolve())
        done = subprocess.run(
            command, cwd=work, stdout=log, stderr=log, check=False, env={**os.environ, "PYTHONPATH": path}
        )
    if done.returncode != 0 or not all(file.exists() for file in files):
        raise RuntimeError(f"the renderer failed: see {work / 'blender.log'}")
    (work / "scene.npz").unlink()
    return [cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) for file in files]


def _jpeg(picture: Array, *seed: int) -> bytes:
    """As a camera's module would give it: noise of light and of reading, quality 90."""
    rng = np.random.default_rng(seed)
    light = picture.astype(float)
    noisy = light + np.sqrt(0.8 + light / 90) * rng.standard_normal(picture.shape)
    whole = np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
    return cv2.imencode(".jpg", cv2.cvtColor(whole, cv2.COLOR_GRAY2BGR), [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes()
