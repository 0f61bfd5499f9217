"""Checks of the interface's gyroid, measured on its mesh (as read back from its STL; endcap frame, mm)."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.ndimage import label

from cad.interface import zone_clip_radius_mm, zone_radii_mm, zone_volume_mm3
from cad.params import EndcapParams
from fab.checks.check import Check
from fab.meshing.cast_space import COVERED_SHARE, VOXEL_MM, CastSpace, ball_reach, cast_space
from fab.meshing.gyroid import WALL_MM, volume_above
from fab.meshing.mesh import to_manifold

FINE_VOXEL_MM = 0.15  # side of the voxels of the second try
MOST_VOXELS = 1.5e8  # of these, three gigabytes: up to D = 135; larger domes have a roomy phase (docs/sizes.md)
DENSITY_RATIO = 3e-3  # largest accepted relative error of the volume fraction
WALL_RANGE = (0.40, 0.50)  # E: line widths of a 0.4 mm nozzle
TRAPPED_MM3 = 1.0  # E: a bubble that is invisible in print and cast
CLOSED_SHARE = 0.35  # TPU covers 10 % of an open face, a few times that where a small face is parallel to a wall
FLOOR_GAP_MM = 0.5  # E: two voxels, within which the ball touches the flange
_SECTORS = 10  # azimuths into which a face is divided


def gyroid_checks(params: EndcapParams, mesh: trimesh.Trimesh) -> list[Check]:
    """All checks of the gyroid.

    Args:
        params: design of the endcap.
        mesh: mesh of the whole interface, mm.
    """
    walls = sheet_walls_mm(params, mesh)
    cast = cast_space(params, mesh)
    covered, floor_gap = ball_reach(params, cast)
    fine = cast.tpu.size * (VOXEL_MM / FINE_VOXEL_MM) ** 3 <= MOST_VOXELS
    if covered < COVERED_SHARE and fine:  # a passage one voxel wide may be closed by discretisation
        covered, floor_gap = ball_reach(params, cast_space(params, mesh, FINE_VOXEL_MM))
    return [
        Check("gyroid.density_error_ratio", abs(density(params, mesh) / params.gyroid - 1), high=DENSITY_RATIO),
        Check("gyroid.outside_zone_mm", outside_zone_mm(params, mesh), high=0.02),
        Check("gyroid.wall_p1_mm", float(np.percentile(walls, 1)), low=WALL_RANGE[0]),
        Check("gyroid.wall_p99_mm", float(np.percentile(walls, 99)), high=WALL_RANGE[1]),
        Check("gyroid.wall_mean_error_ratio", abs(float(walls.mean()) / WALL_MM - 1), high=0.01),
        Check("gyroid.closed_face_share", closed_face_share(params, cast), high=CLOSED_SHARE),
        Check("gyroid.trapped_void_mm3", trapped_void_mm3(params, cast), high=TRAPPED_MM3),
        Check("gyroid.ball_covered_share", covered, low=COVERED_SHARE),
        Check("gyroid.ball_floor_gap_mm", floor_gap, high=FLOOR_GAP_MM),
    ]


def density(params: EndcapParams, mesh: trimesh.Trimesh) -> float:
    """Volume fraction of TPU: TPU above the flange over the closed form of the zone's volume."""
    return volume_above(mesh, params.flange_thickness_mm) / zone_volume_mm3(params)


def outside_zone_mm(params: EndcapParams, mesh: trimesh.Trimesh) -> float:
    """Largest excess of the mesh above the flange over the zone, mm: above its top, or into the silicone's skin."""
    points = mesh.vertices[mesh.vertices[:, 2] > params.flange_thickness_mm + 1e-3]
    radius = np.linalg.norm(points - (0, 0, params.centre_height_mm), axis=1)
    inner, outer = zone_radii_mm(params)
    top = points[:, 2].max() - params.interlock_top_mm
    return float(max(0.0, top, inner - radius.min(), radius.max() - outer))


def sheet_walls_mm(params: EndcapParams, mesh: trimesh.Trimesh, samples: int = 3000) -> np.ndarray:
    """Thicknesses (n,) of the sheet along its normal at evenly chosen facets, away from the zone's faces, mm.

    Args:
        params: design of the endcap.
        mesh: mesh of the whole interface, mm.
        samples: approximate number n of facets.
    """
    centres = mesh.triangles_center
    radius = np.linalg.norm(centres - (0, 0, params.centre_height_mm), axis=1)
    inner, outer = zone_radii_mm(params)
    margin = 2 * WALL_MM
    clear = (radius > inner + margin) & (radius < outer - margin)
    clear &= np.hypot(centres[:, 0], centres[:, 1]) > zone_clip_radius_mm(params) + margin
    clear &= (centres[:, 2] > params.flange_thickness_mm + margin) & (centres[:, 2] < params.interlock_top_mm - margin)
    normals = mesh.face_normals
    body = to_manifold(mesh)
    chosen = np.flatnonzero(clear)
    chosen = chosen[:: max(1, len(chosen) // samples)]
    walls = []
    for point, normal in zip(centres[chosen], normals[chosen], strict=True):
        start = point - 1e-3 * normal
        hits = body.ray_cast(start.tolist(), (point - 4 * WALL_MM * normal).tolist())
        walls.append(np.linalg.norm(np.asarray(hits[0].position) - point) if hits else np.inf)
    return np.array(walls)


def closed_face_share(params: EndcapParams, cast: CastSpace) -> float:
    """Largest share of TPU in a tenth of the zone's inner, outer or top face, within one wall thickness below it."""
    inner, outer = zone_radii_mm(params)
    x, y = cast.box.axis(0), cast.box.axis(1)
    off_axis, clip = np.hypot(x[:, None], y[None, :])[..., None], zone_clip_radius_mm(params)
    zone = (cast.radius > inner) & (cast.radius < outer) & (cast.height < params.interlock_top_mm) & (off_axis > clip)
    faces = (
        zone & ((cast.radius < inner + WALL_MM) | (off_axis < clip + WALL_MM)),
        zone & (cast.radius > outer - WALL_MM),
        zone & (cast.height > params.interlock_top_mm - WALL_MM),
    )
    azimuth = np.arctan2(y[None, :], x[:, None]) / (2 * np.pi) % 1.0
    sector = np.minimum((azimuth * _SECTORS).astype(np.int64), _SECTORS - 1).ravel()  # of each column
    worst = 0.0
    for face in faces:
        all_of, tpu_of = (
            np.bincount(sector, weights=cells.sum(axis=2).ravel(), minlength=_SECTORS)
            for cells in (face, face & cast.tpu)
        )
        worst = max(worst, float((tpu_of / np.maximum(all_of, 1)).max()))
    return worst


def trapped_void_mm3(params: EndcapParams, cast: CastSpace) -> float:
    """Volume of the voids without a path to the silicone above the zone, mm3 (both labyrinths must have one)."""
    parts, count = label(cast.space & ~cast.tpu)
    sizes = np.bincount(parts.ravel(), minlength=count + 1)
    source = np.unique(parts[..., cast.height > params.interlock_top_mm + 1.0])
    sizes[0] = 0
    sizes[source] = 0
    return float(sizes.sum()) * cast.box.step_mm**3
