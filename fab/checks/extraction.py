"""Checks that the mold's pieces can be removed: each is moved in small steps past the pieces that are still in place.

A path is a sequence of straight legs (unit direction, length). Core pieces leave through the bore of the TPU interface
in the order of :data:`cad.mold.core.REMOVAL_ORDER`; cup segments move away from the equator. Silicone and TPU flange
are closed forms (sphere, ramp, bumps, bore), exact at the sampled points; other pieces are meshes. Millimetres, endcap
frame.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import manifold3d
import numpy as np
import trimesh

from cad.mold.core import REMOVAL_ORDER
from cad.mold.layout import MoldLayout
from fab.checks.cavity import cavity_faces
from fab.checks.molding_faces import MoldingFaces, molding_faces, nearest_bump
from fab.meshing.mesh import TOLERANCE_MM, to_manifold

STEPS = 5  # samples on each leg after release, and as many before it; more give the same gaps
SEARCH_MM = 0.25  # gaps beyond this are not distinguished
SLOPES_DEG = np.arange(0.0, 29.0, 1.0)  # tried slopes of the pull: from straight inward to nearly along the ramp
TOUCH_MM = 1e-3  # rounding to float32 of surfaces in contact
ROUNDING_MM = 1e-5  # of a corner in an STL file: float32 at 125 mm, both ends of a facet's height
RELEASE_MM = 2.0  # travel after which no surfaces are in contact


@dataclass(frozen=True)
class Leg:
    """One straight leg of a path.

    Attributes:
        direction: unit vector in the endcap frame.
        length_mm: length, mm.
    """

    direction: tuple[float, float, float]
    length_mm: float


@dataclass(frozen=True)
class Extraction:
    """Path and clearances of the removal of one piece.

    Attributes:
        piece: name of the piece.
        legs: its path.
        penetration_mm: largest depth of a point in silicone or TPU, mm; 0 is required.
        piece_gap_mm: least gap to the pieces still in place, mm, at most :data:`SEARCH_MM`.
        draft_deg: least angle between the piece's molding surface and the first leg, degrees.
        rim_strain: strain of the opening where the piece passes it; 0 is required.
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
    """Removal of the core's pieces in the order of :data:`cad.mold.core.REMOVAL_ORDER`.

    Args:
        layout: mold sizes.
        meshes: meshes of the pieces, by name.
        paths: results of :func:`core_path` for the pieces, if available.
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
                _draft_deg(molding_faces(layout, mesh), legs[0], ROUNDING_MM),
                _rim_strain(layout, mesh, legs),
            )
        )
    return results


def extract_cup(layout: MoldLayout, meshes: Mapping[str, trimesh.Trimesh]) -> list[Extraction]:
    """Removal of the cup: bowl segments toward the dome, then collar segments toward the rim."""
    outside = sorted(name for name in meshes if name.startswith("cup_"))
    results = []
    for name in tuple(outside):
        outside.remove(name)
        mesh, down = meshes[name], 1.0 if name.startswith("cup_bowl") else -1.0
        legs = (Leg((0.0, 0.0, down), layout.params.outer_radius_mm),)
        shifted = (mesh.vertices + shift for shift in _shifts(legs))  # facets of a concave sphere lie inside it
        depth = max(float(_depth_in_shell_from_outside(layout, points).max()) for points in shifted)
        inside = cavity_faces(layout, mesh)
        faces = MoldingFaces(mesh.triangles[inside], mesh.face_normals[inside])
        peers = [meshes[other] for other in outside if other[:-1] == name[:-1]]  # bowl and collar touch at the seam
        gap = least_gap_mm(mesh, peers, legs)
        draft_deg = _draft_deg(faces, legs[0], ROUNDING_MM)
        results.append(Extraction(name, legs, depth, gap, draft_deg, 0.0))
    return results


def core_path(layout: MoldLayout, name: str, mesh: trimesh.Trimesh) -> tuple[Leg, ...]:
    """Path of one core piece: the centre moves along the axis, the others inward until they pass the opening, then out.

    The slope of the inward leg is the one that maximises the least draft.

    Args:
        layout: mold sizes.
        name: name of the piece.
        mesh: mesh of the piece, mm.
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
    """Depth of points in the silicone round the core and in the TPU flange round its bore.

    Args:
        layout: mold sizes.
        points: (n, 3) points, mm.

    Returns:
        (n,) depths in mm; 0 or less outside.
    """
    params = layout.params
    radius = np.hypot(points[:, 0], points[:, 1])
    height = points[:, 2] - params.flange_thickness_mm
    slope = math.radians(layout.ramp_deg)
    ramp = (radius - layout.neck_radius_mm) * math.sin(slope) - height * math.cos(slope)
    core = np.maximum(np.linalg.norm(points - _centre(layout), axis=1) - params.inner_radius_mm, ramp)
    near = core > TOUCH_MM  # only these can be in silicone, unless they are on a bump
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
        mesh: mesh of the moving piece.
        others: meshes of the pieces in place.
        legs: path of the piece.
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
                least = min(least, body.min_gap(moved, least))  # larger gaps than the least so far are not needed
    return least


def seam_azimuth_deg(layout: MoldLayout, first: str, second: str) -> float:
    """Azimuth to which the walls between two pieces of the core are parallel or normal; 0 where they share none.

    Bodies are rotated by minus this angle before a boolean: bounding boxes of facets parallel to the axes are thin,
    whereas those of two oblique walls that slide past each other intersect by the thousand. Between a key and a wedge
    this saves a factor of ten in time.

    Args:
        layout: mold sizes.
        first: name of one piece.
        second: name of the other one.
    """
    for stem in ("core_key_", "core_wedge_"):
        for name in (first, second):
            if name.startswith(stem) and all(other.startswith("core_") for other in (first, second)):
                return _azimuth_deg(layout, name)
    return 0.0


def turned(body: manifold3d.Manifold, azimuth_deg: float) -> manifold3d.Manifold:
    """Body rotated about z by minus ``azimuth_deg``."""
    return body.rotate((0.0, 0.0, -azimuth_deg)) if azimuth_deg else body


def turned_points(points: np.ndarray, azimuth_deg: float) -> np.ndarray:
    """Points or shifts (n, 3) rotated about z by minus ``azimuth_deg``."""
    c, s = math.cos(math.radians(azimuth_deg)), math.sin(math.radians(azimuth_deg))
    return points @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) if azimuth_deg else points


def _azimuth_deg(layout: MoldLayout, name: str) -> float:
    """Azimuth of the middle of a key or a wedge, degrees."""
    return layout.key_azimuths_deg[int(name[-1]) - 1] + (60.0 if "wedge" in name else 0.0)


def _pull(azimuth: float, slope: float) -> tuple[float, float, float]:
    """Unit vector inward along an azimuth and toward the opening by a slope, both in radians."""
    c = math.cos(slope)
    return (-c * math.cos(azimuth), -c * math.sin(azimuth), -math.sin(slope))


def _centre(layout: MoldLayout) -> np.ndarray:
    return np.array([0.0, 0.0, layout.params.centre_height_mm])


def _depth_in_shell_from_outside(layout: MoldLayout, points: np.ndarray) -> np.ndarray:
    """Depth of points inside the outer sphere above the mating plane (silicone or TPU), mm."""
    depth = layout.params.outer_radius_mm - np.linalg.norm(points - _centre(layout), axis=1)
    return np.minimum(depth, points[:, 2])


def _draft_deg(faces: MoldingFaces, leg: Leg, rounding_mm: float = 0.0) -> float:
    """Least draft angle of the faces along a leg, degrees; negative for an undercut.

    A facet whose undercut is less deep than twice the mesh's tolerance counts as parallel (0): at the sphere's equator,
    where the true draft is 0, slivers next to a seam deviate by up to that amount in either direction. Rounded corners
    tilt a facet by up to ``rounding_mm`` over its height: that much lean is no undercut. A path is chosen without it,
    so it is the same whatever the rounding.
    """
    direction = np.array(leg.direction)
    opening = -(faces.normals @ direction)
    undercut = np.flatnonzero(opening < 0)
    corners = faces.triangles[undercut]
    reach = np.ptp(corners @ direction, axis=1)  # extent of each facet along the leg
    edges = corners - np.roll(corners, 1, axis=1)
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2
    height = 2 * area / np.linalg.norm(edges, axis=2).max(axis=1)
    lean = -opening[undercut] - rounding_mm / height
    opening[undercut[lean * reach < 2 * TOLERANCE_MM]] = 0.0
    return float(np.degrees(np.arcsin(np.clip(opening.min(), -1.0, 1.0))))


def _rim_strain(layout: MoldLayout, mesh: trimesh.Trimesh, legs: tuple[Leg, ...]) -> float:
    """Strain of the opening by the widest section that passes it on the last leg."""
    start = mesh.vertices + sum(leg.length_mm * np.array(leg.direction) for leg in legs[:-1])
    widest = float(np.hypot(start[:, 0], start[:, 1]).max())
    return max(0.0, widest / layout.params.opening_radius_mm - 1.0)


def _shifts(legs: tuple[Leg, ...]) -> list[np.ndarray]:
    """Sampled displacements (3,) along a path, mm; denser at the start, where surfaces still touch."""
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
