"""One shard: its paths solved, turned to their azimuths, rendered and labelled (units as the columns are named).

The columns are those of :data:`SIMULATED`. A state is solved once, at azimuth 0, and serves every azimuth
by rotation. Without pictures ``surface_mm`` holds the displacement of the inner surface, at azimuth 0, so that they can
be rendered later; its points at rest are in ``dots.npz``.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from cad.materials import silicone
from sensing.records_labelled import COLUMNS, read_shard
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.dataset.request import DataRequest
from sensing.simulator.dataset.states import PathState, path_states
from sensing.simulator.dataset.stored import stored_states
from sensing.simulator.levels import Simulator
from sensing.simulator.protocols.loading import PHASES, LoadPath
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.settings import RenderSettings
from sensing.simulator.solid.geometry import ShellGeometry
from sensing.simulator.solid.surface import dot_directions, turn_about_axis, turn_wrench

Array = NDArray[np.float64]
# Columns of simulated sets; a tracked window shows the motion of a dot's outline.
SIMULATED = COLUMNS | {"outline_mm": "(d, 3) how each dot's outline moves in the picture: what a tracked window shows"}
STEPS_A_PATH = 1 << 14  # noise numbers of a path; paths have separate ranges
PATHS_A_SEED = 1 << 32  # paths of a seed; seeds have separate ranges of noise numbers


@dataclass(frozen=True)
class Studio:
    """Objects that all shards of a request share: the shell and, unless pictures are off, the renderer."""

    simulator: Simulator
    renderer: DomeRenderer | None


@lru_cache(maxsize=1)
def studio(request: DataRequest) -> Studio:
    """Mesh the shell and paint the endcap; cached, because a worker makes many shards of one request."""
    cv2.setNumThreads(1)  # a worker has one core
    law = silicone(request.silicone).neo_hooke()
    geometry = ShellGeometry.from_params(request.params)
    simulator = Simulator(
        geometry,
        law,
        request.density,
        request.level,
        request.tolerance,
        prony=request.prony,
        interlock=request.interlock,
    )
    return Studio(simulator, renderer_of(request, simulator))


def renderer_of(request: DataRequest, simulator: Simulator) -> DomeRenderer | None:
    """Renderer of the endcap for displacements of the simulator's surface; None where pictures are off."""
    if request.render == "off":
        return None
    surface = simulator.surface
    return DomeRenderer(request.params, request.mounted, request.settings, surface.position, surface.interpolation)


def shard_bytes(request: DataRequest, paths: list[LoadPath], stored: Path | None = None) -> bytes:
    """Bytes of a shard's file.

    Args:
        request, paths, stored: arguments of :func:`shard_arrays`.
    """
    buffer = io.BytesIO()
    np.savez(buffer, **cast(dict[str, Any], shard_arrays(request, paths, stored)))
    return buffer.getvalue()


def shard_arrays(request: DataRequest, paths: list[LoadPath], stored: Path | None = None) -> dict[str, NDArray[Any]]:
    """Columns, pictures and refusals of a shard; they do not depend on states solved before.

    Args:
        request: options of the data set.
        paths: loading paths of this shard.
        stored: shard of the same paths whose solved states are taken (:mod:`sensing.simulator.dataset.stored`); None
            solves the paths.
    """
    tools, kept = studio(request), None if stored is None else read_shard(stored)
    tools.simulator.forget()
    rows: list[dict[str, Any]] = []
    surfaces: list[NDArray[np.float32]] = []
    pictures: list[bytes] = []
    references: list[bytes] = []
    refusals: list[str] = []
    for number, path in enumerate(paths):
        if kept is None:
            states, refused = path_states(tools.simulator, path, request.body(path.tilt_deg))
        else:
            states, refused = stored_states(kept, path)
        refusals += refused
        settings = _settings(request, path)
        if tools.renderer is not None:
            rest = noise_number(request.seed, path.number, 0)
            references.append(tools.renderer.render(frame=rest, settings=settings).jpeg)
        for azimuth_index, azimuth in enumerate(path.azimuths_deg):
            for state in states:
                row = labels_of(request, path, state, azimuth)
                row |= {"reference": number, **light_labels(settings)}
                picture_number = azimuth_index * len(path.waypoints) + state.step + 1
                noise = noise_number(request.seed, path.number, picture_number)
                dots, picture = _picture(tools, request, state, azimuth, noise, settings)
                rows.append(row | dots)
                pictures.append(picture)
                surfaces.append(state.end.surface_mm.astype(np.float32))
    arrays: dict[str, NDArray[Any]] = {name: np.array([row[name] for row in rows]) for name in SIMULATED}
    arrays["refusals"] = np.array(refusals, dtype=np.str_)
    if tools.renderer is None:
        return {**arrays, "surface_mm": np.array(surfaces)}
    return {**arrays, **joined("jpeg", pictures), **joined("reference_jpeg", references)}


def noise_number(seed: int, path: int, picture: int) -> int:
    """Frame number that selects a picture's noise; it contains the seed, so that sets of two seeds share no noise.

    Args:
        seed: seed of the request; the paint has another one, that of the sensor.
        path: number of the path.
        picture: number within the path, 0 for its reference. With seed 0 the number is that of sets written before
            manifests had a ``noise_key``.
    """
    return (seed * PATHS_A_SEED + path) * STEPS_A_PATH + picture


def rest_arrays(simulator: Simulator) -> dict[str, NDArray[Any]]:
    """Rest positions: dots (d, 3) and inner surface (k, 3), mm."""
    directions = dot_directions(simulator.geometry)
    dots = simulator.geometry.inner_radius_mm * directions + np.array(simulator.geometry.centre_mm)
    return {"dots_mm": dots, "surface_mm": simulator.surface.position}


def labels_of(request: DataRequest, path: LoadPath, state: PathState, azimuth_deg: float) -> dict[str, Any]:
    """Columns of one frame that do not depend on the picture.

    Args:
        request: request of the shell.
        path: loading path of the state.
        state: solved states at the beginning and the end of the exposure.
        azimuth_deg: azimuth of the contact, degrees.
    """
    begin, end, point = state.begin, state.end, path.waypoints[state.step]
    wrench = turn_wrench((begin.wrench + end.wrench) / 2, azimuth_deg)
    certificate = end.certificate
    return {
        "path": path.number,
        "step": state.step,
        "phase": PHASES.index(point.phase),
        "level": min(begin.level, end.level),
        "scene": path.scene,
        "endcap": path.endcap,
        "time_s": point.time_s - path.exposure_s / 2,
        "exposure_s": path.exposure_s,
        "latency_s": path.latency_s,
        "tilt_deg": path.tilt_deg,
        "azimuth_deg": azimuth_deg,
        "friction": path.friction,
        "depth_mm": (begin.depth_mm + end.depth_mm) / 2,
        "shift_mm": (np.array(begin.shift_mm) + end.shift_mm) / 2,
        "normal_n": (begin.normal_n + end.normal_n) / 2,
        "T_world_endcap": world_pose(request, path, state, azimuth_deg),
        "force_n": wrench[:3],
        "torque_nm": wrench[3:] / 1000,
        "contact": begin.normal_n > 0 or end.normal_n > 0,
        "patch_mm2": end.patch_mm2,
        "slip_share": end.slip_share,
        "residual": end.error_estimate if certificate is None else certificate.residual,
    }


def world_pose(request: DataRequest, path: LoadPath, state: PathState, azimuth_deg: float) -> Array:
    """Endcap to world (4, 4): the plane is z = 0 with its normal toward the endcap, x along the meridian.

    Args:
        request: request of the shell.
        path: tilt of the plane, or ``T_world_sphere`` where a robot determines rotation and place.
        state: its depth and travel are means of begin and end; the depth also sets the height of a robot's endcap.
        azimuth_deg: azimuth of the contact, degrees; not used where a robot determines the rotation.
    """
    geometry = ShellGeometry.from_params(request.params)
    depth = (state.begin.depth_mm + state.end.depth_mm) / 2
    if path.T_world_sphere:
        pose = np.array(path.T_world_sphere).reshape(4, 4)
        pose[2, 3] = geometry.outer_radius_mm - depth  # the robot's statics has rigid spheres, which do not sink in
        pose[:3, 3] -= pose[:3, :3] @ geometry.centre_mm
        return pose
    outward, meridian, lateral = (turn_about_axis(azimuth_deg) @ Indenter(path.tilt_deg).frame()).T
    shift = (np.array(state.begin.shift_mm) + state.end.shift_mm) / 2
    touch = np.array(geometry.centre_mm) + (geometry.outer_radius_mm - depth) * outward
    axes = np.stack([meridian, -lateral, -outward])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = axes, -axes @ (touch + shift[0] * meridian + shift[1] * lateral)
    return pose


def _picture(
    tools: Studio, request: DataRequest, state: PathState, azimuth_deg: float, noise: int, settings: RenderSettings
) -> tuple[dict[str, Any], bytes]:
    """Dots and JPEG of a state; without a renderer, the dots as the camera model projects their nominal places."""
    begin, end = state.begin.surface_mm, state.end.surface_mm
    simulator = tools.simulator
    moved = simulator.markers(state.end, azimuth_deg)
    shown = simulator.outlines(state.end, request.mounted, azimuth_deg)
    if state.begin is not state.end:
        moved = (simulator.markers(state.begin, azimuth_deg) + moved) / 2
        shown = (simulator.outlines(state.begin, request.mounted, azimuth_deg) + shown) / 2
    if tools.renderer is None:
        pixels = request.mounted.project(rest_arrays(simulator)["dots_mm"] + moved)
        camera = request.mounted.camera
        seen = ((pixels > -0.5) & (pixels < [camera.width_px - 0.5, camera.height_px - 0.5])).all(axis=1)
        picture = b""
    else:
        moving = None if state.begin is state.end else begin
        frame = tools.renderer.render(end, start_mm=moving, azimuth_deg=azimuth_deg, frame=noise, settings=settings)
        pixels, seen, picture = frame.dots_px, frame.dots_visible, frame.jpeg
    dots = {
        "dots_mm": moved.astype(np.float32),
        "outline_mm": shown.astype(np.float32),
        "dots_px": pixels.astype(np.float32),
        "dots_visible": seen,
    }
    return dots, picture


def _settings(request: DataRequest, path: LoadPath) -> RenderSettings:
    number = path.number if path.scene < 0 else path.scene
    lamp, exposure = request.light(number)
    return replace(request.settings, lamp=lamp, sensor=replace(request.settings.sensor, exposure=exposure))


def light_labels(settings: RenderSettings) -> dict[str, Any]:
    """Columns of the lamp and the camera's exposure."""
    return {
        "lamp_brightness": settings.lamp.brightness,
        "lamp_gradient": settings.lamp.gradient,
        "lamp_azimuth_deg": settings.lamp.gradient_azimuth_deg,
        "camera_exposure": settings.sensor.exposure,
    }


def joined(prefix: str, pictures: list[bytes]) -> dict[str, NDArray[Any]]:
    """Pictures end to end, and where each of them ends, under the names of a shard."""
    ends = np.cumsum([len(picture) for picture in pictures], dtype=np.int64)
    return {prefix: np.frombuffer(b"".join(pictures), np.uint8), f"{prefix}_end": ends}
