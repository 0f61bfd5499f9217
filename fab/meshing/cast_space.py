"""The mold's space round the gyroid as voxels, and where a ball gets in it: what thick silicone can fill (mm).

Silicone is poured dome down: it comes from above the zone (the dome) and must fill the space between mold core and cup
down to the flange, through both labyrinths of the gyroid.
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

BALL_DIAMETER_MM = 2.5  # the measure of what 35,000 cP silicone gets through
COVERED_SHARE = 0.80  # E: below it the bond has voids; sets the thinnest wall in cad.feasible
VOXEL_MM = 0.3
VOXEL_MARGIN = 0.25  # of a voxel, by which the nearest TPU lies nearer than its voxel's centre (bench/gyroid_ball.csv)


@dataclass(frozen=True)
class CastSpace:
    """The mold's space around the zone as voxels, all (nx, ny, nz).

    Attributes:
        box: where the voxels are.
        radius: distance from the sphere's centre, mm.
        height: (nz,) mm.
        tpu: the interface above its flange.
        space: between core and cup, above the flange.
    """

    box: VoxelBox
    radius: np.ndarray
    height: np.ndarray
    tpu: np.ndarray
    space: np.ndarray


def cast_space(params: EndcapParams, mesh: trimesh.Trimesh, voxel_mm: float = VOXEL_MM) -> CastSpace:
    """Voxels of TPU and of the space between core and cup, from the flange to a ball above the zone.

    Args:
        params: the design.
        mesh: the whole interface, mm.
        voxel_mm: side of a voxel.
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
    """Where a ball gets that starts in the silicone above the zone.

    With ``VOXEL_MARGIN`` the covered share at 0.3 mm voxels is 0.02 to 0.04 lower than at 0.15 mm, 0.09 and more where
    a passage hardly lets the ball through: on the safe side. So only the finer ones can refuse.

    Args:
        params: the design.
        cast: voxels of the mold's space.
        diameter_mm: of the ball.

    Returns:
        ``(share of the zone's void that the ball covers, least gap between ball and flange in mm)``.
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
