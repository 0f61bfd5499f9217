"""Do the mold's pieces come out? Every piece is moved along its path in small steps past everything still in place.

A path is a sequence of straight legs (unit direction, length). Core pieces leave through the bore of the TPU interface
in the order of :data:`cad.mold_core.REMOVAL_ORDER`; cup segments leave away from the equator. Silicone and TPU flange
are closed forms (sphere, ramp, bumps, bore), exact at the sampled points; other pieces are meshes. Mm, endcap frame.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import manifold3d
import numpy as np
import trimesh

from cad.mold_core import REMOVAL_ORDER
from cad.mold_layout import MoldLayout
from fab.checks.cavity import cavity_faces
from fab.checks.molding_faces import MoldingFaces, molding_faces, nearest_bump
from fab.meshing.mesh import TOLERANCE_MM, to_manifold

STEPS = 5  # samples on each leg after release, and as many before it: more find the same gaps
SEARCH_MM = 0.25  # gaps beyond this are not distinguished
SLOPES_DEG = np.arange(0.0, 29.0, 1.0)  # pulls tried: from straight inward to nearly along the ramp
TOUCH_MM = 1e-3  # float32 coordinates of a surface in contact
RELEASE_MM = 2.0  # travel after which nothing is in contact any more


@dataclass(frozen=True)
class Leg:
    """One straight move.

    Attributes:
        direction: unit vector.
        length_mm: how far.
    """

    direction: tuple[float, float, float]
    length_mm: float


@dataclass(frozen=True)
class Extraction:
    """How one piece leaves.

    Attributes:
        piece: its name.
        legs: the path.
        penetration_mm: deepest that a point enters silicone or TPU (0 wanted).
        piece_gap_mm: least gap to the pieces still in place, at most :data:`SEARCH_MM`.
        draft_deg: least angle between the piece's molding surface and the first leg.
        rim_strain: how far the opening must stretch to let it pass (0 wanted).
    """

    piece: str
    legs: tuple[Leg, ...]
    penetration_mm: float
    piece_gap_mm: float
    draft_deg: float
    rim_strain: float


def extract_core(
    layout: MoldLayout, meshes: Mapping[str, trimesh.Trimesh], paths: Mapping[str, tuple[Leg, ...]] | None = None
) -> list[Extraction]:
    """Take the core apart in its stated order.

    Args:
        layout: mold sizes.
        meshes: of the pieces.
        paths: what :func:`core_path` gave for them, where it is known.
    """
    inside = [name for name in REMOVAL_ORDER if name in meshes]
    results = []
    for name in tuple(inside):
        inside.remove(name)
        mesh = meshes[name]
        legs = paths[name] if paths else core_path(layout, name, mesh)
        rest = [meshes[other] for other in inside]
        seams = [seam_azimuth_deg(layout, name, other) for other in inside]
        results.append(
            Extraction(
                name,
                legs,
                max(float(depth_in_cast(layout, points).max()) for points in _swept(mesh, legs)),
                least_gap_mm(mesh, rest, legs, seams),
                _draft_deg(molding_faces(layout, mesh), legs[0]),
                _rim_strain(layout, mesh, legs),
            )
        )
    return results


def extract_cup(layout: MoldLayout, meshes: Mapping[str, trimesh.Trimesh]) -> list[Extraction]:
    """Take the cup off: bowl segments toward the dome, then collar segments toward the rim."""
    outside = sorted(name for name in meshes if name.startswith("cup_"))
    results = []
    for name in tuple(outside):
        outside.remove(name)
        mesh, down = meshes[name], 1.0 if name.startswith("cup_bowl") else -1.0
        legs = (Leg((0.0, 0.0, down), layout.params.outer_radius_mm),)
        shifted = (mesh.vertices + shift for shift in _shifts(legs))  # facets of a hollow sphere lie inside it
        depth = max(float(_depth_in_shell_from_outside(layout, points).max()) for points in shifted)
        inside = cavity_faces(layout, mesh)
        faces = MoldingFaces(mesh.triangles[inside], mesh.face_normals[inside])
        peers = [meshes[other] for other in outside if other[:-1] == name[:-1]]  # bowl and collar touch at the seam
        gap = least_gap_mm(mesh, peers, legs)
        results.append(Extraction(name, legs, depth, gap, _draft_deg(faces, legs[0]), 0.0))
    return results


def core_path(layout: MoldLayout, name: str, mesh: trimesh.Trimesh) -> tuple[Leg, ...]:
    """The way out of one core piece: centre straight along the axis, the others inward until they fit, then out.

    The slope of the inward pull is the one with the largest least draft.

    Args:
        layout: mold sizes.
        name: of the piece.
        mesh: of the piece, mm.
    """
    out = Leg((0.0, 0.0, -1.0), layout.params.tip_height_mm)
    if name == "core_centre":
        return (out,)
    azimuth = math.radians(_azimuth_deg(layout, name))
    faces = molding_faces(layout, mesh)
    pulls = [_pull(azimuth, math.radians(slope)) for slope in SLOPES_DEG]
    direction = max(pulls, key=lambda pull: _draft_deg(faces, Leg(pull, 0.0)))
    inward = -np.array([math.cos(azimuth), math.sin(azimuth)])
    points = mesh.vertices[:, :2]
    along, across = points @ -inward, points @ np.array([-inward[1], inward[0]])
    reach = np.sqrt(np.maximum(0.0, layout.exit_radius_mm**2 - across**2))
    stroke = float((along - reach).max()) / math.hypot(*direction[:2])
    return (Leg(direction, stroke), out)


def depth_in_cast(layout: MoldLayout, points: np.ndarray) -> np.ndarray:
    """How deep points lie in what is cast or stays: silicone round the core, TPU flange round its bore.

    Args:
        layout: mold sizes.
        points: (n, 3) in mm.

    Returns:
        (n,) depths in mm; 0 or less outside.
    """
    params = layout.params
    radius = np.hypot(points[:, 0], points[:, 1])
    height = points[:, 2] - params.flange_thickness_mm
    slope = math.radians(layout.ramp_deg)
    ramp = (radius - layout.neck_radius_mm) * math.sin(slope) - height * math.cos(slope)
    core = np.maximum(np.linalg.norm(points - _centre(layout), axis=1) - params.inner_radius_mm, ramp)
    near = core > TOUCH_MM  # only these can be in silicone, and of them not those on a bump
    if near.any():
        core[near] = np.minimum(core[near], nearest_bump(layout, points[near])[0])
    flange = np.minimum(radius - params.bore_radius_mm, np.minimum(-height, points[:, 2]))
    return np.where(height > 0, np.minimum(core, height), flange)


def least_gap_mm(
    mesh: trimesh.Trimesh,
    others: Sequence[trimesh.Trimesh],
    legs: tuple[Leg, ...],
    seams_deg: Sequence[float] | None = None,
) -> float:
    """Least gap between a piece on its path and the pieces still in place; 0 where they touch or overlap.

    Args:
        mesh: the piece.
        others: the pieces in place.
        legs: the path.
        seams_deg: azimuth of the seam with each of the others (:func:`seam_azimuth_deg`), for speed only.

    Returns:
        The gap in mm, at most :data:`SEARCH_MM`.
    """
    least = SEARCH_MM
    for other, seam in zip(others, seams_deg or [0.0] * len(others), strict=True):
        piece, body = (turned(to_manifold(item), seam) for item in (mesh, other))
        for shift in turned_points(np.array(_shifts(legs)), seam):
            moved = piece.translate(shift.tolist())
            if _boxes_within(body.bounding_box(), moved.bounding_box(), least):
                least = min(least, body.min_gap(moved, least))  # a gap beyond the least so far need not be known
    return least


def seam_azimuth_deg(layout: MoldLayout, first: str, second: str) -> float:
    """Azimuth along or square to which the walls between two pieces of the core run; 0 where they share none.

    Booleans of bodies are turned back by it: boxes round facets that lie along the axes are thin, and those of two
    slanted walls that slide past each other meet by the thousand. Between a key and a wedge that is a factor of ten.

    Args:
        layout: mold sizes.
        first, second: names of the pieces.
    """
    for stem in ("core_key_", "core_wedge_"):
        for name in (first, second):
            if name.startswith(stem) and all(other.startswith("core_") for other in (first, second)):
                return _azimuth_deg(layout, name)
    return 0.0


def turned(body: manifold3d.Manifold, azimuth_deg: float) -> manifold3d.Manifold:
    """A body turned about z, so that what lay at an azimuth lies at 0."""
    return body.rotate((0.0, 0.0, -azimuth_deg)) if azimuth_deg else body


def turned_points(points: np.ndarray, azimuth_deg: float) -> np.ndarray:
    """Points or shifts (n, 3), turned as :func:`turned` turns a body."""
    c, s = math.cos(math.radians(azimuth_deg)), math.sin(math.radians(azimuth_deg))
    return points @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) if azimuth_deg else points


def _azimuth_deg(layout: MoldLayout, name: str) -> float:
    """Azimuth of the middle of a key or a wedge."""
    return layout.key_azimuths_deg[int(name[-1]) - 1] + (60.0 if "wedge" in name else 0.0)


def _pull(azimuth: float, slope: float) -> tuple[float, float, float]:
    """Inward along an azimuth and toward the opening by a slope."""
    c = math.cos(slope)
    return (-c * math.cos(azimuth), -c * math.sin(azimuth), -math.sin(slope))


def _centre(layout: MoldLayout) -> np.ndarray:
    return np.array([0.0, 0.0, layout.params.centre_height_mm])


def _depth_in_shell_from_outside(layout: MoldLayout, points: np.ndarray) -> np.ndarray:
    """Depth of points inside the outer sphere above the mating plane: silicone or TPU."""
    depth = layout.params.outer_radius_mm - np.linalg.norm(points - _centre(layout), axis=1)
    return np.minimum(depth, points[:, 2])


def _draft_deg(faces: MoldingFaces, leg: Leg) -> float:
    """Least angle by which the faces open along a leg: below 0 is an undercut.

    A facet whose undercut is less deep than the mesh is true to its surface counts as parallel (0): at the sphere's
    equator, where the true draft is 0, slivers beside a seam lean by up to that much either way.
    """
    direction = np.array(leg.direction)
    opening = -(faces.normals @ direction)
    reach = np.ptp(faces.triangles @ direction, axis=1)  # of each facet along the way
    shallow = (opening < 0) & (-opening * reach < 2 * TOLERANCE_MM)
    opening[shallow] = 0.0
    return float(np.degrees(np.arcsin(np.clip(opening.min(), -1.0, 1.0))))


def _rim_strain(layout: MoldLayout, mesh: trimesh.Trimesh, legs: tuple[Leg, ...]) -> float:
    """Stretch of the opening by the widest section that passes it on the last leg."""
    start = mesh.vertices + sum(leg.length_mm * np.array(leg.direction) for leg in legs[:-1])
    widest = float(np.hypot(start[:, 0], start[:, 1]).max())
    return max(0.0, widest / layout.params.opening_radius_mm - 1.0)


def _shifts(legs: tuple[Leg, ...]) -> list[np.ndarray]:
    """Sampled positions along a path; the start is sampled more densely, where surfaces still touch."""
    shifts, corner = [], np.zeros(3)
    for leg in legs:
        direction = np.array(leg.direction)
        close = np.linspace(0.0, min(RELEASE_MM, leg.length_mm), STEPS, endpoint=False)
        for travel in [*close, *np.linspace(min(RELEASE_MM, leg.length_mm), leg.length_mm, STEPS)]:
            shifts.append(corner + travel * direction)
        corner = corner + leg.length_mm * direction
    return shifts


def _swept(mesh: trimesh.Trimesh, legs: tuple[Leg, ...]) -> list[np.ndarray]:
    """Points of the piece (vertices and face centres) at every sampled position."""
    points = np.concatenate([mesh.vertices, mesh.triangles_center])
    return [points + shift for shift in _shifts(legs)]


def _boxes_within(a: tuple[float, ...], b: tuple[float, ...], distance: float) -> bool:
    return all(a[i] <= b[i + 3] + distance and b[i] <= a[i + 3] + distance for i in range(3))
