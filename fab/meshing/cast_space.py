"""Voxels of the mold's space round the gyroid, and the part that a ball reaches, a model of viscous silicone (mm).

Silicone is poured dome-down: it enters from the dome's side (above the zone in the endcap frame) and must fill the
space between mold core and cup as far as the flange, through both labyrinths of the gyroid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.ndimage import label

from cad.interface import zone_radii_mm
from cad.params import EndcapParams
from fab.meshing.mesh import to_manifold
from fab.meshing.voxels import VoxelBox, inside, within

BALL_DIAMETER_MM = 2.5  # ball that represents 35,000 cP silicone
COVERED_SHARE = 0.80  # E: below it the bond has voids; sets the thinnest wall in cad.feasible
VOXEL_MM = 0.3  # side of a voxel
VOXEL_MARGIN = 0.25  # of a voxel, by which the nearest TPU is closer than its voxel's centre (bench/gyroid_ball.csv)


@dataclass(frozen=True)
class CastSpace:
    """Voxels of the mold's space around the zone, arrays (nx, ny, nz) unless stated.

    Attributes:
        box: positions of the voxels.
        radius: distance of their centres from the sphere's centre, mm.
        height: (nz,) heights of their centres above the mating plane, mm.
        tpu: bool, the interface above its flange.
        space: bool, the space between core and cup above the flange.
    """

    box: VoxelBox
    radius: np.ndarray
    height: np.ndarray
    tpu: np.ndarray
    space: np.ndarray


def cast_space(params: EndcapParams, mesh: trimesh.Trimesh, voxel_mm: float = VOXEL_MM) -> CastSpace:
    """Voxels of TPU and of the space between core and cup, from the flange to a ball above the zone.

    Args:
        params: design of the endcap.
        mesh: mesh of the whole interface, mm.
        voxel_mm: side of a voxel, mm.
    """
    floor, top = params.flange_thickness_mm, params.interlock_top_mm + BALL_DIAMETER_MM
    widest = params.outer_radius_mm
    if params.centre_height_mm > top:
        widest = params.outer_radius_at(top)
    box = VoxelBox.around(np.array([-widest, -widest, floor + voxel_mm / 2]), np.array([widest, widest, top]), voxel_mm)
    above = to_manifold(mesh).trim_by_plane([0.0, 0.0, 1.0], floor).to_mesh()
    tpu = inside(trimesh.Trimesh(above.vert_properties[:, :3], above.tri_verts, process=False), box)
    x, y, z = (box.axis(k).astype(np.float32) for k in range(3))
    radius = np.sqrt((x**2)[:, None, None] + (y**2)[:, None] + (z - np.float32(params.centre_height_mm)) ** 2)
    space = (radius > params.inner_radius_mm) & (radius < params.outer_radius_mm)
    return CastSpace(box, radius, z, tpu, space)


def ball_reach(params: EndcapParams, cast: CastSpace, diameter_mm: float = BALL_DIAMETER_MM) -> tuple[float, float]:
    """Region that a ball reaches which starts in the silicone above the zone.

    With ``VOXEL_MARGIN`` the covered share at 0.3 mm voxels is 0.02 to 0.04 lower than at 0.15 mm, and 0.09 or more
    where the ball hardly passes. This is on the safe side, and only a result at 0.15 mm may refuse an export.

    Args:
        params: design of the endcap.
        cast: voxels of the mold's space.
        diameter_mm: diameter of the ball, mm.

    Returns:
        ``(share, gap)``: share of the zone's voids that the ball covers, and least gap between ball and flange, mm.
    """
    step, radius = cast.box.step_mm, diameter_mm / 2
    free = (cast.radius > params.inner_radius_mm + radius) & (cast.radius < params.outer_radius_mm - radius)
    free &= cast.height > params.flange_thickness_mm + radius
    free &= ~within(cast.tpu, radius / step + VOXEL_MARGIN)
    parts, count = label(free)
    source = np.zeros(count + 1, dtype=bool)
    source[np.unique(parts[..., cast.height > params.interlock_top_mm + radius])] = True
    source[0] = False
    reached = source[parts]
    if not reached.any():
        return 0.0, float("inf")
    inner, outer = zone_radii_mm(params)
    void = (cast.radius > inner) & (cast.radius < outer) & (cast.height < params.interlock_top_mm) & ~cast.tpu
    covered = within(reached, radius / step + VOXEL_MARGIN)
    lowest = float(cast.height[reached.any(axis=(0, 1))].min())
    return float((covered & void).sum() / void.sum()), lowest - radius - params.flange_thickness_mm
