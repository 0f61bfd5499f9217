"""Facets of the core that shape the silicone: those of its sphere, its bumps and its ramp (mm, endcap frame)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from cad.dots import dot_pattern
from cad.mold.core import bump_sphere_centre_mm, bump_sphere_radius_mm, ramp_end
from cad.mold.layout import MoldLayout

FACING = 0.95  # least cosine between a facet's normal and that of the surface
SURFACE_MM = 0.05  # largest distance of facets from the surface that they approximate


@dataclass(frozen=True)
class MoldingFaces:
    """Facets of a piece that touch silicone.

    Attributes:
        triangles: (m, 3, 3) corners, mm.
        normals: (m, 3) unit normals of the surface at the facets.
    """

    triangles: np.ndarray
    normals: np.ndarray


def molding_faces(layout: MoldLayout, mesh: trimesh.Trimesh) -> MoldingFaces:
    """Faces of a core piece that touch silicone: those with the position and normal of sphere, bump or ramp.

    The position alone does not suffice, as the walls of seams and tabs end at the same surface. Facets of a low ramp
    span its two circles and deviate by a degree; the normals used for them are those of the ramp itself.
    """
    points, normals = mesh.triangles_center, np.array(mesh.face_normals)
    outward = points - np.array([0.0, 0.0, layout.params.centre_height_mm])
    distance = np.linalg.norm(outward, axis=1)
    nearest, from_bump = nearest_bump(layout, points)
    on_sphere = np.abs(distance - layout.params.inner_radius_mm) < SURFACE_MM
    outside = distance > layout.params.inner_radius_mm - SURFACE_MM  # the rest of a bump's sphere lies inside the core
    on_bump = (np.abs(nearest) < SURFACE_MM) & outside
    facing_out = np.einsum("ij,ij->i", normals, outward) > FACING * distance
    facing_bump = np.einsum("ij,ij->i", normals, from_bump) > FACING * np.linalg.norm(from_bump, axis=1)
    on_ramp, ramp_normals = _ramp(layout, points, normals)
    normals[on_ramp] = ramp_normals[on_ramp]
    found = (on_sphere & facing_out) | (on_bump & facing_bump) | on_ramp
    return MoldingFaces(mesh.triangles[found], normals[found])


def _ramp(layout: MoldLayout, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mask of the facets on the ramp's cone over the flange, and the cone's normals (m, 3) at all facets."""
    slope, top = math.radians(layout.ramp_deg), ramp_end(layout)[1]
    radius = np.hypot(points[:, 0], points[:, 1])
    height = points[:, 2] - layout.params.flange_thickness_mm
    away = (radius - layout.neck_radius_mm) * math.sin(slope) - height * math.cos(slope)
    across = points[:, :2] / np.maximum(radius, SURFACE_MM)[:, None] * math.sin(slope)
    of_cone = np.column_stack([across, np.full(len(points), -math.cos(slope))])
    facing = np.einsum("ij,ij->i", normals, of_cone) > FACING
    return (np.abs(away) < SURFACE_MM) & (points[:, 2] < top) & (height > 0) & facing, of_cone


def nearest_bump(layout: MoldLayout, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Signed distance (n,) to the union of the bumps' spheres, and vectors (n, 3) from the nearest centre, mm."""
    radius = bump_sphere_radius_mm(layout.params)
    directions = np.array([dot.direction for dot in dot_pattern(layout.params)])
    centres = directions * bump_sphere_centre_mm(layout.params)
    centres[:, 2] += layout.params.centre_height_mm
    distance, nearest = cKDTree(centres).query(points)
    return distance - radius, points - centres[nearest]
