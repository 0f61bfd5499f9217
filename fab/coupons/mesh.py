"""Meshes of the coupons: tessellated solids, and a gyroid sheet of 10 % in a box on the bond specimens. Millimetres.

The sheet lies between the level sets -t/2 and +t/2 of the distance to the gyroid. It is the difference of two closed
bodies, each on one side of a level set, so its wall may be thinner than a step of the grid.
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
    """Mesh of each part, and the wall of the gyroid (mm) of those that have one.

    Args:
        parts: by name.
    """
    meshes = {name: tessellate(part.solid) for name, part in parts.items()}
    walls = {}
    for name, zone in zones_mm().items():
        meshes[name], walls[name] = with_gyroid(meshes[name], zone)
    return meshes, walls


def with_gyroid(block: trimesh.Trimesh, zone: Box) -> tuple[trimesh.Trimesh, float]:
    """Mesh of a block with the gyroid on it, whose wall is adjusted until the zone is 10 % TPU; and the wall, mm.

    Args:
        block: mesh of the solid part, mm.
        zone: lowest and highest corner (x, y, z) of the gyroid's box, mm.

    Raises:
        GeometryError: no wall gives the density.
    """
    period = AREA_PER_PERIOD * WALL_MM / RELEASED_GYROID
    points, distance = _sampled(zone, period)
    body, wall = to_manifold(block), WALL_MM
    for _ in range(TRIALS):
        whole = _standing(body, _sheet(points, distance, wall, zone))
        density = (whole.volume() - body.volume()) / _volume(zone)
        if abs(density / RELEASED_GYROID - 1) < DENSITY_TOLERANCE:
            return from_manifold(whole), wall
        wall *= RELEASED_GYROID / density
    raise GeometryError(
        f"gyroid density {density:.4f} not within {DENSITY_TOLERANCE:.1%} of {RELEASED_GYROID}: take a smaller STEP_MM "
        "in fab/coupons/mesh.py"
    )


def _sampled(zone: Box, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Lowest corner (3,) of a grid two steps larger than the zone, and the distance at its nodes (x, y, z), mm."""
    low = np.array(zone[0]) - 2 * STEP_MM
    counts = np.ceil((np.array(zone[1]) + 2 * STEP_MM - low) / STEP_MM).astype(int) + 1
    nodes = np.stack(np.meshgrid(*(low[k] + STEP_MM * np.arange(counts[k]) for k in range(3)), indexing="ij"), axis=-1)
    return low, gyroid_distance_mm(nodes.astype(np.float32), period, 3 * STEP_MM)


def _sheet(low: np.ndarray, distance: np.ndarray, wall: float, zone: Box) -> manifold3d.Manifold:
    """Sheet inside the zone, extended below it by its root in the block."""
    outer, inner = (_side(low, distance, level) for level in (-wall / 2, wall / 2))
    size = np.array(zone[1]) - np.array(zone[0]) + (0, 0, ROOT_MM)
    box = manifold3d.Manifold.cube(size.tolist()).translate((np.array(zone[0]) - (0, 0, ROOT_MM)).tolist())
    return (outer - inner) ^ box


def _side(low: np.ndarray, distance: np.ndarray, level: float) -> manifold3d.Manifold:
    """Closed body in which the distance exceeds a level."""
    field = np.pad(distance, 1, constant_values=-10.0)
    corners, faces, _, _ = marching_cubes(field, level, gradient_direction="ascent")
    mesh = weld(low + STEP_MM * (corners - 1.0), faces)
    return to_manifold(mesh if mesh.volume > 0 else weld(mesh.vertices, mesh.faces[:, ::-1]))


def _standing(block: manifold3d.Manifold, sheet: manifold3d.Manifold) -> manifold3d.Manifold:
    """Union of block and sheet without pieces that are not connected to the block."""
    return max((block + sheet).decompose(), key=lambda part: part.volume())


def _volume(zone: Box) -> float:
    return float(np.prod(np.array(zone[1]) - np.array(zone[0])))
