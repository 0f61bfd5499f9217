"""Checks of the closed mold's cavity: balance of volumes, thickness of the wall, leak at the joints, trapped air.

Balance, wall and hollows are measured on the meshes as read back from their files, and compared with the shell's solid
or with closed forms. The leak and the air under the flat flange are closed forms of the sizes alone. Millimetres,
endcap frame; the silicone is poured with +z down.
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
from cad.mold.core import ramp_end
from cad.mold.layout import MoldLayout
from fab.checks.check import Check
from fab.checks.core_filler import FACETS, core_filler
from fab.meshing.gyroid import volume_above
from fab.meshing.mesh import to_manifold

BALANCE_RATIO = 5e-4  # largest accepted difference of volumes over the shell's volume
WALL_ERROR_MM = 0.02  # largest accepted deviation of the wall from T
OUTSIDE_MM = 0.05  # the cavity is searched this far outside its nominal surfaces,
INSIDE_MM = 0.1  # and this far inside the core: enough to find a gap, too little to count the joints
WALL_SAMPLES = 3000  # bundles of rays
LEVEL_DEG = 1.0  # E: tilt of a table that is levelled by eye
# E: a film of less than 0.1 mm at the gyroid's foot; a hundredth of the least air that weighing a cast detects
FLANGE_AIR_MM3 = 15.0
SLIT_RAYS = 2  # rays before the measuring one, in order from the surface into slits: it is the third
BUNDLE_MM = 0.5  # radius of a bundle of rays: well over a joint's gap, well under a dot
SURFACE_MM = 0.05  # largest distance of facets from the surface that they approximate
FACING = 0.95  # least cosine between a facet's normal and the radius
# E: least air of a hollow that counts as a trap, a bubble 0.58 mm across: the 0.2 mm steps of the printed gyroid, which
# the smooth mesh lacks, hold as much along 5 mm of one layer (0.2 x 0.2 / 2 mm2 in section, roof sloping by 45 deg).
TRAP_MM3 = 0.1
HOLLOWS_MM3 = 1.0  # E: sum of all smaller hollows; as much as one void of the gyroid may hold
LEVEL_MM = 1e-3  # vertices closer in height than this form one level: a flat roof or a ring


def balance_check(
    layout: MoldLayout,
    pieces: Mapping[str, trimesh.Trimesh],
    interface: trimesh.Trimesh,
    shell_volume_mm3: float,
    opened: manifold3d.Manifold | None = None,
) -> Check:
    """Check that cavity less core less TPU equals the shell, as a ratio of volumes.

    All TPU above the flange counts as TPU in the cavity: other checks prove that it does not overlap the pieces and
    that it lies inside its zone. Its volume is therefore a sum over its facets, and no boolean is needed.

    Args:
        layout: mold sizes.
        pieces: meshes of cup and core.
        interface: mesh of the TPU interface with its gyroid.
        shell_volume_mm3: volume of the shell's solid less the TPU above the flange, mm3.
        opened: result of :func:`opened_space` for the pieces, if available.
    """
    free = cavity_body(layout, pieces, opened=opened).volume()
    tpu = volume_above(interface, layout.params.flange_thickness_mm)
    return Check("cavity.balance_error_ratio", abs((free - tpu) / shell_volume_mm3 - 1), high=BALANCE_RATIO)


def opened_space(layout: MoldLayout, pieces: Mapping[str, trimesh.Trimesh]) -> manifold3d.Manifold:
    """Space inside the cup and above the flange that no piece of cup or core fills, joints included."""
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
    """Space between the pieces of cup and core above the flange, with the adjacent ``flash_mm`` of the core's joints.

    Args:
        layout: mold sizes.
        pieces: meshes of cup and core.
        flash_mm: depth to which the joints between the core's pieces count as space, mm.
        opened: result of :func:`opened_space` for the pieces, if available.
    """
    space = opened_space(layout, pieces) if opened is None else opened
    return space - core_filler(layout, flash_mm)


def wall_check(layout: MoldLayout, pieces: Mapping[str, trimesh.Trimesh]) -> Check:
    """Check of the wall's largest deviation from T, sampled on bundles of rays from the sphere's centre.

    Bumps and the ramp at the rim are excluded, because the wall is not T there by design. A ray that enters a joint's
    slit hits too far inside the core or too far outside the cup. Where slits meet, and where one of the core crosses
    one of the cup, up to four of a bundle's seven rays may enter a slit of one side. Each side is therefore measured
    separately, at the third largest (core) or third smallest (cup) of its seven distances: at least three rays hit the
    surface.
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
    """Check of the share of the pour that could leak through the bowl's joints in its pot life (:mod:`cad.leak`)."""
    row = silicone(layout.silicone)
    ratio = leak_ratio(layout.params, row, layout.joint_clearance_mm, layout.bowl_wall_mm, shell_volume_mm3)
    return Check("cavity.leak_ratio", ratio, high=LEAK_RATIO)


def trapped_air_checks(layout: MoldLayout, shell: trimesh.Trimesh) -> list[Check]:
    """Checks of the hollows in the cast's roofs, vents excluded, in which a bubble rising along the surface would stay.

    With +z down, air moves to lower z. A vertex of the cast, or a patch of vertices on one level (a flat roof, a ring),
    retains air if all its neighbours lie deeper and the mold is above it (outside the cast), unless it is on the
    flange's level, where the vents are. The volume of air is that of the hollow up to its spill height. Facets of a
    saddle form hollows of some thousandths of a mm3, and the gyroid consists of saddles; a hollow therefore counts as a
    trap from :data:`TRAP_MM3` on, and the sum of the smaller ones has a limit of its own.
    """
    volumes = hollows_mm3(shell, layout.params.flange_thickness_mm + 0.01)
    small = volumes <= TRAP_MM3
    return [
        Check("cavity.air_traps", float((~small).sum()), high=0),
        Check("cavity.hollow_air_mm3", float(volumes[small].sum()), high=HOLLOWS_MM3),
    ]


def hollows_mm3(shell: trimesh.Trimesh, above_mm: float) -> np.ndarray:
    """Volumes of air (n,) in the hollows above a height, mm3; infinite for a hollow without a spill height.

    Args:
        shell: mesh of the cast; it is poured with +z down.
        above_mm: height z, mm; hollows at lower z, where the vents are, are ignored.
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
    # the mold lies above, in the pose of the pour
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
        # a plane's mean positive head is at most that of its corners: the air is never underestimated
        heads = np.maximum(spill - z[faces[near]], 0.0).mean(axis=1)
        volumes.append(float((flat[near] * heads).sum()) if math.isfinite(spill) else math.inf)
    return np.array(volumes)


def _basin(links: csr_matrix, z: np.ndarray, summit: np.ndarray) -> tuple[list[int], float]:
    """Vertices of the hollow round a summit, and its spill height z; infinite where its air cannot spill."""
    top = spill = float(z[summit].min())
    seen = set(summit.tolist())
    heap = [(float(z[vertex]), vertex) for vertex in seen]
    heapify(heap)
    passed: list[int] = []
    filled = 0  # number of passed vertices that lie in the hollow; the others lie beyond its spill height
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
    """Check of the air that stays under the flat flange between two vents of a mold tilted by :data:`LEVEL_DEG`."""
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
    """Air trapped under a flat tilted ceiling with vents at its edge, mm3.

    The tilt has the worst direction, in which the middle between two vents is highest. Air flows along the ceiling to
    its highest place and leaves through a vent that is as high. The air above the nearer ends of both vents,
    x > x0 = R cos(pi / n - a) with a = vent / (2 R), stays:
    V = tan(tilt) (2/3 (R^2 - x0^2)^(3/2) - x0 (R^2 acos(x0 / R) - x0 sqrt(R^2 - x0^2))).

    Args:
        outer_mm: radius R of the ceiling's edge, mm.
        vents: number n of vents, equally spaced.
        vent_mm: diameter of a vent, mm.
        tilt_deg: tilt of the ceiling, degrees.
    """
    start = outer_mm * math.cos(math.pi / vents - vent_mm / (2 * outer_mm))
    half_chord = math.sqrt(outer_mm**2 - start**2)
    area = outer_mm**2 * math.acos(start / outer_mm) - start * half_chord
    return math.tan(math.radians(tilt_deg)) * (2 / 3 * half_chord**3 - start * area)


def cavity_faces(layout: MoldLayout, mesh: trimesh.Trimesh) -> np.ndarray:
    """Mask of a cup segment's faces that shape the silicone: on the outer sphere, with normals toward its centre."""
    outward = mesh.triangles_center - np.array([0.0, 0.0, layout.params.centre_height_mm])
    distance = np.linalg.norm(outward, axis=1)
    facing_in = np.einsum("ij,ij->i", mesh.face_normals, outward) < -FACING * distance
    return facing_in & (np.abs(distance - layout.params.outer_radius_mm) < SURFACE_MM)


def _joined(pieces: Mapping[str, trimesh.Trimesh], prefix: str) -> trimesh.Trimesh:
    """All pieces whose names begin with ``prefix`` as one mesh, for rays."""
    meshes = [mesh for name, mesh in pieces.items() if name.startswith(prefix)]
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)])
    return trimesh.Trimesh(np.concatenate([mesh.vertices for mesh in meshes]), faces, process=False)


def _bundles(directions: np.ndarray, spread: float) -> np.ndarray:
    """Seven unit vectors (n, 7, 3) round each direction (n, 3), on a cone of half angle atan(``spread``)."""
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
    """Distances (n,) from the origin at which rays (n, 3) meet a mesh, mm: ``pick`` selects among a ray's hits."""
    places, rays, _ = mesh.ray.intersects_location(np.tile(origin, (len(directions), 1)), directions)
    radii = np.full(len(directions), start)
    pick.at(radii, rays, np.linalg.norm(places - origin, axis=1))
    return radii
