"""What the closed mold encloses: balance of volumes, thickness of the wall, leaks at the joints, trapped air.

Balance, wall and hollows are measured on the meshes as read back from their files, against the shell's solid or closed
forms. What leaks, and the air under the flat flange, are closed forms of the sizes alone. Millimetres, endcap frame;
the mold is poured with +z down.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from heapq import heapify, heappop, heappush

import manifold3d
import numpy as np
import trimesh
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components

from cad.dots import dot_pattern
from cad.interface import COLLAR_CLEARANCE_MM, VENT_DIAMETER_MM, vent_azimuths_deg
from cad.leak import LEAK_RATIO, leak_ratio
from cad.materials import silicone
from cad.mold_core import ramp_end
from cad.mold_layout import MoldLayout
from fab.checks.check import Check
from fab.checks.core_filler import FACETS, core_filler
from fab.meshing.gyroid import volume_above
from fab.meshing.mesh import to_manifold

BALANCE_RATIO = 5e-4
WALL_ERROR_MM = 0.02
OUTSIDE_MM = 0.05  # the cavity is looked for this far outside its nominal surfaces,
INSIDE_MM = 0.1  # and this far inside the core: deep enough to see a gap, shallow enough not to count the joints
WALL_SAMPLES = 3000
LEVEL_DEG = 1.0  # E: a table levelled by eye
# E: a film of less than 0.1 mm at the gyroid's foot; a hundredth of the least air that the weight of a cast shows
FLANGE_AIR_MM3 = 15.0
SLIT_RAYS = 2  # rays of a bundle that lie before the one that measures
BUNDLE_MM = 0.5  # radius of a bundle of rays: well over a joint's gap, well under a dot
SURFACE_MM = 0.05  # facets lie this near to the surface they stand for
FACING = 0.95  # cosine of a facet's normal to the radius
# E: air of a hollow that is no trap, a bubble 0.58 mm across: the 0.2 mm steps of the printed gyroid, which the smooth
# mesh does not have, hold as much along 5 mm of one layer (0.2 x 0.2 / 2 mm2 across, where the roof slopes by 45 deg).
TRAP_MM3 = 0.1
HOLLOWS_MM3 = 1.0  # E: all such hollows together; as much as one void of the gyroid may hold
LEVEL_MM = 1e-3  # vertices this near in height are on one level: facets of a flat roof or a ring


def balance_check(
    layout: MoldLayout,
    pieces: Mapping[str, trimesh.Trimesh],
    interface: trimesh.Trimesh,
    shell_volume_mm3: float,
    opened: manifold3d.Manifold | None = None,
) -> Check:
    """Cavity less core less TPU against the shell, as a ratio.

    The TPU in the cavity is all of it above the flange: that none of it lies in the pieces is the mold's overlap check,
    that it keeps to its zone a check of the gyroid. So its volume is a sum over its facets, and no boolean is needed.

    Args:
        layout: mold sizes.
        pieces: meshes of cup and core.
        interface: mesh of the TPU interface with its gyroid.
        shell_volume_mm3: volume of the shell's solid less the TPU above the flange.
        opened: what :func:`opened_space` gave for the pieces, where it is known.
    """
    free = cavity_body(layout, pieces, opened=opened).volume()
    tpu = volume_above(interface, layout.params.flange_thickness_mm)
    return Check("cavity.balance_error_ratio", abs((free - tpu) / shell_volume_mm3 - 1), high=BALANCE_RATIO)


def opened_space(layout: MoldLayout, pieces: Mapping[str, trimesh.Trimesh]) -> manifold3d.Manifold:
    """The space inside the cup and above the flange that no piece of cup or core fills, joints and all."""
    params = layout.params
    centre = [0.0, 0.0, params.centre_height_mm]
    ball = manifold3d.Manifold.sphere(params.outer_radius_mm + OUTSIDE_MM, FACETS).translate(centre)
    space = ball.trim_by_plane([0.0, 0.0, 1.0], params.flange_thickness_mm)
    bodies = [to_manifold(mesh) for mesh in pieces.values()]
    return manifold3d.Manifold.batch_boolean([space, *bodies], manifold3d.OpType.Subtract)


def cavity_body(
    layout: MoldLayout,
    pieces: Mapping[str, trimesh.Trimesh],
    flash_mm: float = INSIDE_MM,
    opened: manifold3d.Manifold | None = None,
) -> manifold3d.Manifold:
    """The space between the pieces of cup and core above the flange, with ``flash_mm`` of the joints next to it.

    Args:
        layout: mold sizes.
        pieces: meshes of cup and core.
        flash_mm: how deep the joints between the core's pieces are left open.
        opened: what :func:`opened_space` gave for the pieces, where it is known.
    """
    space = opened_space(layout, pieces) if opened is None else opened
    return space - core_filler(layout, flash_mm)


def wall_check(layout: MoldLayout, pieces: Mapping[str, trimesh.Trimesh]) -> Check:
    """Largest deviation of the wall from T, sampled on bundles of rays from the sphere's centre.

    Left out, as the wall is not T there by design: the bumps and the ramp at the rim. A joint is a slit, which lets
    rays through: always too far into the core, and too far out of the cup. Where slits meet, and where one of the core
    crosses one of the cup, up to four of a bundle's seven rays may pass a slit of their own side, so each side is
    measured by itself, at its third ray: three agree on a surface that is there.
    """
    params = layout.params
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(WALL_SAMPLES, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ramp = (ramp_end(layout)[1] - params.centre_height_mm) / params.inner_radius_mm
    rim = (params.flange_thickness_mm - params.centre_height_mm) / params.outer_radius_mm
    dots = np.array([dot.direction for dot in dot_pattern(params)])
    clear = np.cos((params.dot_radius_mm + 2 * BUNDLE_MM) / params.inner_radius_mm)
    directions = directions[(directions[:, 2] > max(ramp, rim) + 0.02) & ((directions @ dots.T).max(axis=1) < clear)]

    origin = np.array([0.0, 0.0, params.centre_height_mm])
    bundles = _bundles(directions, BUNDLE_MM / params.inner_radius_mm)
    rays = bundles.reshape(-1, 3)
    core = _radii(_joined(pieces, "core_"), origin, rays, np.fmax, 0.0)
    cup = _radii(_joined(pieces, "cup_"), origin, rays, np.fmin, np.inf)
    inner = np.sort(core.reshape(bundles.shape[:2]), axis=1)[:, -1 - SLIT_RAYS]
    walls = np.sort(cup.reshape(bundles.shape[:2]), axis=1)[:, SLIT_RAYS] - inner
    return Check("cavity.wall_error_mm", float(np.abs(walls - params.wall_mm).max()), high=WALL_ERROR_MM)


def leak_check(layout: MoldLayout, shell_volume_mm3: float) -> Check:
    """Share of the pour that could creep through the bowl's joints before it sets (:mod:`cad.leak`)."""
    row = silicone(layout.silicone)
    ratio = leak_ratio(layout.params, row, layout.joint_clearance_mm, layout.bowl_wall_mm, shell_volume_mm3)
    return Check("cavity.leak_ratio", ratio, high=LEAK_RATIO)


def trapped_air_checks(layout: MoldLayout, shell: trimesh.Trimesh) -> list[Check]:
    """Hollows of the cast's roofs, vents left out, where a bubble that rises along the surface would stay.

    Poured with +z down, air moves to lower z. A vertex of the cast, or a patch of vertices on one level (a flat roof, a
    ring), whose neighbours all lie deeper, and above which (outside the cast) is mold, holds air, unless it is on the
    flange's level, where the vents are. The air is what the hollow holds up to where it spills. Facets of a saddle make
    hollows of some thousandths of a cubic millimetre (the gyroid is all saddles), so a hollow counts as a trap from
    :data:`TRAP_MM3` on, and the air of those that do not count is bounded by itself.
    """
    volumes = hollows_mm3(shell, layout.params.flange_thickness_mm + 0.01)
    small = volumes <= TRAP_MM3
    return [
        Check("cavity.air_traps", float((~small).sum()), high=0),
        Check("cavity.hollow_air_mm3", float(volumes[small].sum()), high=HOLLOWS_MM3),
    ]


def hollows_mm3(shell: trimesh.Trimesh, above_mm: float) -> np.ndarray:
    """Air (n,) that each hollow above a height holds; infinite where it has no way to rise past.

    Args:
        shell: the cast; poured with +z down.
        above_mm: hollows at lower z are left out: there the vents are.
    """
    z = np.asarray(shell.vertices[:, 2])
    first, second = np.asarray(shell.edges_unique).T
    level = np.abs(z[first] - z[second]) < LEVEL_MM
    graph = coo_matrix((np.ones(level.sum()), (first[level], second[level])), shape=(len(z), len(z)))
    number, patch = connected_components(graph, directed=False)
    top, around = np.full(number, np.inf), np.full(number, np.inf)
    np.minimum.at(top, patch, z)
    for inside, outside in ((first[~level], second[~level]), (second[~level], first[~level])):
        np.minimum.at(around, patch[inside], z[outside])
    # the mold lies on the upper side, as the machine is poured
    roofed = np.bincount(patch, weights=shell.vertex_normals[:, 2] < 0, minlength=number) > 0
    summits = np.flatnonzero(roofed & (around > top) & (top > above_mm))
    if len(summits) == 0:
        return np.empty(0)
    edges = coo_matrix((np.ones(len(first)), (first, second)), shape=(len(z), len(z)))
    links = (edges + edges.T).tocsr()
    faces = np.asarray(shell.faces)
    rows = np.repeat(np.arange(len(faces)), 3)
    at = coo_matrix((np.ones(faces.size), (faces.ravel(), rows)), shape=(len(z), len(faces))).tocsr()
    flat = np.abs(shell.face_normals[:, 2]) * shell.area_faces
    order = np.argsort(patch, kind="stable")
    members = np.split(order, np.searchsorted(patch[order], np.arange(1, number)))
    volumes = []
    for summit in summits:
        basin, spill = _basin(links, z, members[summit])
        near = np.unique(at[basin].indices)
        # a plane's mean of positive heads is no more than that of its corners': never too little air
        heads = np.maximum(spill - z[faces[near]], 0.0).mean(axis=1)
        volumes.append(float((flat[near] * heads).sum()) if math.isfinite(spill) else math.inf)
    return np.array(volumes)


def _basin(links: csr_matrix, z: np.ndarray, summit: np.ndarray) -> tuple[list[int], float]:
    """Vertices of the hollow round a summit, and the height at which its air spills; infinite where it cannot."""
    top = spill = float(z[summit].min())
    seen = set(summit.tolist())
    heap = [(float(z[vertex]), vertex) for vertex in seen]
    heapify(heap)
    passed: list[int] = []
    filled = 0  # of those passed, how many lie in the hollow: the rest are on the way up beyond its spill
    while heap:
        height, vertex = heappop(heap)
        if height < top:
            return passed[: max(filled, 1)], spill
        passed.append(vertex)
        if height > spill:
            spill, filled = height, len(passed)
        for other in links.indices[links.indptr[vertex] : links.indptr[vertex + 1]].tolist():
            if other not in seen:
                seen.add(other)
                heappush(heap, (float(z[other]), other))
    return passed, math.inf


def flange_air_check(layout: MoldLayout) -> Check:
    """Air that stays under the flat flange between two vents when the mold stands off level by :data:`LEVEL_DEG`."""
    vents = len(vent_azimuths_deg())
    params = layout.params
    outer = math.sqrt(
        (params.outer_radius_mm - COLLAR_CLEARANCE_MM) ** 2
        - (params.flange_thickness_mm - params.centre_height_mm) ** 2
    )
    return Check(
        "cavity.flange_air_mm3", flange_air_mm3(outer, vents, VENT_DIAMETER_MM, LEVEL_DEG), high=FLANGE_AIR_MM3
    )


def flange_air_mm3(outer_mm: float, vents: int, vent_mm: float, tilt_deg: float) -> float:
    """Trapped air under a flat ceiling of radius ``outer_mm`` with vents at its edge, tilted so that the middle between
    two vents is highest: the worst direction.

    Air flows along the ceiling to its highest place and out where a vent reaches as high. What lies higher than the
    nearer ends of both vents, x > x0 = R cos(pi / n - a) with a = vent / (2 R), stays:
    V = tan(tilt) (2/3 (R^2 - x0^2)^(3/2) - x0 (R^2 acos(x0 / R) - x0 sqrt(R^2 - x0^2))).

    Args:
        outer_mm: radius of the ceiling's edge R.
        vents: how many, equally spaced, n.
        vent_mm: diameter of a vent.
        tilt_deg: off level.
    """
    start = outer_mm * math.cos(math.pi / vents - vent_mm / (2 * outer_mm))
    half_chord = math.sqrt(outer_mm**2 - start**2)
    area = outer_mm**2 * math.acos(start / outer_mm) - start * half_chord
    return math.tan(math.radians(tilt_deg)) * (2 / 3 * half_chord**3 - start * area)


def cavity_faces(layout: MoldLayout, mesh: trimesh.Trimesh) -> np.ndarray:
    """Faces (mask) of a cup segment that shape the silicone: on the outer sphere, and looking at its centre."""
    outward = mesh.triangles_center - np.array([0.0, 0.0, layout.params.centre_height_mm])
    distance = np.linalg.norm(outward, axis=1)
    facing_in = np.einsum("ij,ij->i", mesh.face_normals, outward) < -FACING * distance
    return facing_in & (np.abs(distance - layout.params.outer_radius_mm) < SURFACE_MM)


def _joined(pieces: Mapping[str, trimesh.Trimesh], prefix: str) -> trimesh.Trimesh:
    """All pieces of a kind as one mesh, for rays."""
    meshes = [mesh for name, mesh in pieces.items() if name.startswith(prefix)]
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)])
    return trimesh.Trimesh(np.concatenate([mesh.vertices for mesh in meshes]), faces, process=False)


def _bundles(directions: np.ndarray, spread: float) -> np.ndarray:
    """Seven unit vectors (n, 7, 3) on a narrow cone round each direction (n, 3)."""
    helper = np.eye(3)[np.abs(directions).argmin(axis=1)]
    first = np.cross(directions, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(directions, first)
    angles = 2 * np.pi * np.arange(7) / 7
    around = first[:, None] * np.cos(angles)[None, :, None] + second[:, None] * np.sin(angles)[None, :, None]
    rays = directions[:, None] + spread * around
    return rays / np.linalg.norm(rays, axis=2, keepdims=True)


def _radii(
    mesh: trimesh.Trimesh, origin: np.ndarray, directions: np.ndarray, pick: np.ufunc, start: float
) -> np.ndarray:
    """Distance from the origin at which each ray (n, 3) meets a mesh: the largest or the smallest of the hits."""
    places, rays, _ = mesh.ray.intersects_location(np.tile(origin, (len(directions), 1)), directions)
    radii = np.full(len(directions), start)
    pick.at(radii, rays, np.linalg.norm(places - origin, axis=1))
    return radii
