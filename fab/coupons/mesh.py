"""Meshes of the coupons: solids tessellated, and a gyroid sheet of 10 % in a box on the bond specimens. Millimetres.

The sheet is what lies between the level sets -t/2 and +t/2 of the distance to the gyroid: two closed bodies, each the
side of one level set, subtracted. So its wall may be thinner than the grid, and no sheet is sampled as such.
"""

from __future__ import annotations

from collections.abc import Mapping

import manifold3d
import numpy as np
import trimesh
from skimage.measure import marching_cubes

from cad.coupons import zones_mm
from cad.errors import GeometryError
from cad.part import Part
from cad.pattern import RELEASED_GYROID
from fab.meshing.gyroid import AREA_PER_PERIOD, WALL_MM, gyroid_distance_mm
from fab.meshing.mesh import from_manifold, tessellate, to_manifold, weld

STEP_MM = 0.6  # as the interface's
ROOT_MM = 0.3  # how far the sheet reaches into the solid part, to fuse with it
DENSITY_TOLERANCE = 1e-3  # relative
TRIALS = 6

Box = tuple[tuple[float, float, float], tuple[float, float, float]]


def coupon_meshes(parts: Mapping[str, Part]) -> tuple[dict[str, trimesh.Trimesh], dict[str, float]]:
    """Mesh of every part, and the gyroid's wall (mm) of those that have one."""
    meshes = {name: tessellate(part.solid) for name, part in parts.items()}
    walls = {}
    for name, zone in zones_mm().items():
        meshes[name], walls[name] = with_gyroid(meshes[name], zone)
    return meshes, walls


def with_gyroid(block: trimesh.Trimesh, zone: Box, step_mm: float = STEP_MM) -> tuple[trimesh.Trimesh, float]:
    """A block with the gyroid standing on it, its wall tuned until the zone is 10 % TPU.

    Args:
        block: the solid part. zone: lowest and highest corner (x, y, z) of the gyroid's box, mm.
        step_mm: of the sampling.

    Raises:
        GeometryError: the density is not reached.
    """
    period = AREA_PER_PERIOD * WALL_MM / RELEASED_GYROID
    points, distance = _sampled(zone, period, step_mm)
    body, wall = to_manifold(block), WALL_MM
    for _ in range(TRIALS):
        whole = _standing(body, zone, _sheet(points, distance, wall, zone, step_mm))
        density = (whole.volume() - body.volume()) / _volume(zone)
        if abs(density / RELEASED_GYROID - 1) < DENSITY_TOLERANCE:
            return from_manifold(whole), wall
        wall *= RELEASED_GYROID / density
    raise GeometryError(
        f"gyroid density {density:.4f} not within {DENSITY_TOLERANCE:.1%} of {RELEASED_GYROID}: use a finer step"
    )


def _sampled(zone: Box, period: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Low corner (3,) of a grid two steps larger than the zone, and the distance at its nodes (x, y, z)."""
    low = np.array(zone[0]) - 2 * step
    counts = np.ceil((np.array(zone[1]) + 2 * step - low) / step).astype(int) + 1
    nodes = np.stack(np.meshgrid(*(low[k] + step * np.arange(counts[k]) for k in range(3)), indexing="ij"), axis=-1)
    return low, gyroid_distance_mm(nodes.astype(np.float32), period, 3 * step)


def _sheet(low: np.ndarray, distance: np.ndarray, wall: float, zone: Box, step: float) -> manifold3d.Manifold:
    """Sheet of a wall inside the zone, with its root below it."""
    outer, inner = (_side(low, distance, level, step) for level in (-wall / 2, wall / 2))
    size = np.array(zone[1]) - np.array(zone[0]) + (0, 0, ROOT_MM)
    box = manifold3d.Manifold.cube(size.tolist()).translate((np.array(zone[0]) - (0, 0, ROOT_MM)).tolist())
    return (outer - inner) ^ box


def _side(low: np.ndarray, distance: np.ndarray, level: float, step: float) -> manifold3d.Manifold:
    """Body where the distance exceeds a level, closed at the grid's rim."""
    field = np.pad(distance, 1, constant_values=-10.0)
    corners, faces, _, _ = marching_cubes(field, level, gradient_direction="ascent")
    mesh = weld(low + step * (corners - 1.0), faces)
    return to_manifold(mesh if mesh.volume > 0 else weld(mesh.vertices, mesh.faces[:, ::-1]))


def _standing(block: manifold3d.Manifold, zone: Box, sheet: manifold3d.Manifold) -> manifold3d.Manifold:
    """Block and sheet, less what does not hang together with the block."""
    return max((block + sheet).decompose(), key=lambda part: part.volume())


def _volume(zone: Box) -> float:
    return float(np.prod(np.array(zone[1]) - np.array(zone[0])))
