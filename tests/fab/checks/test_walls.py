"""The thinnest wall: between faces, from inner edges, in coarse holes; what only ends in an edge is none."""

from __future__ import annotations

import math

import manifold3d
import numpy as np
import pytest
import trimesh

from fab.checks.walls import min_wall_check, min_wall_mm
from fab.meshing.mesh import from_manifold


def block(*sides: float) -> manifold3d.Manifold:
    return manifold3d.Manifold.cube(sides, True)


def hole(radius: float, length: float, facets: int) -> manifold3d.Manifold:
    return manifold3d.Manifold.cylinder(length, radius, radius, facets, True)


@pytest.mark.parametrize("wall_mm", [0.4, 0.8 - 1e-3, 2.0])
def test_the_thickness_of_a_plate(wall_mm):
    check = min_wall_check("plate", trimesh.creation.box((40, 30, wall_mm)))
    assert check.value == pytest.approx(wall_mm, abs=1e-5)
    assert check.ok == (wall_mm >= 0.8)


@pytest.mark.parametrize("turn_deg", [0.0, 7.0, 13.0])
@pytest.mark.parametrize("facets", [20, 64])
def test_a_hole_beside_a_face_however_its_facets_lie(facets, turn_deg):
    radius, wall = 3.0, 0.6
    drilled = block(20, 20, 10) - hole(radius, 20, facets).rotate([0, 0, turn_deg]).translate(
        [10 - radius - wall, 0, 0]
    )
    sag = radius * (1 - math.cos(math.pi / facets))
    assert wall - 1e-4 <= min_wall_mm(from_manifold(drilled)) <= wall + 2 * sag + 1e-3


@pytest.mark.parametrize("roof_deg", [20.0, 35.0, 50.0, 70.0])
def test_the_bottom_of_a_blind_hole_under_a_slope(roof_deg):
    """No two faces are parallel there: the wall goes from the hole's bottom edge square onto the slope."""
    slope, wall = math.radians(roof_deg), 0.5
    normal = np.array([math.sin(slope), 0.0, math.cos(slope)])
    roof = block(60, 60, 60).trim_by_plane((-normal).tolist(), -5.0)
    pocket = block(6, 6, 40)  # its upper edge at x = 3: through the floor, so its own height decides
    top = (5.0 - wall - 3.0 * normal[0]) / normal[2]
    mesh = from_manifold(roof - pocket.translate([0, 0, top - 20]))
    assert min_wall_mm(mesh) == pytest.approx(wall, rel=0.01)


def test_a_wedge_ends_in_an_edge_and_is_no_wall():
    wedge = manifold3d.CrossSection([np.array([(0.0, 0.0), (20.0, 0.0), (20.0, 9.0)])]).extrude(30)
    assert min_wall_mm(from_manifold(wedge)) > 5


def test_a_ball_and_an_empty_search_have_no_thin_wall():
    assert min_wall_mm(trimesh.creation.icosphere(3, 10.0)) > 19
    assert (
        min_wall_mm(
            trimesh.Trimesh([[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
        )
        > 1
    )


@pytest.mark.parametrize("apart_mm", [4e-6, 2e-4])
def test_a_sliver_in_a_plane_face_makes_no_inner_edge(apart_mm):
    """Two corners of a boolean were 4e-6 mm apart at D=208.13 T=9.16, and gave a wall of 0.16 mm that is none."""
    near = [20.0, 0.0, -4.0]
    side = [[20, -15, -5], [20, 15, -5], [20, 15, 5], [20, -15, 5], near, [near[0] + apart_mm, *near[1:]]]
    faces = [[0, 1, 4], [1, 2, 4], [2, 5, 4], [2, 3, 5], [3, 0, 5], [0, 4, 5]]
    back = [[-20, -15, -5], [-20, 15, -5], [-20, 15, 5], [-20, -15, 5]]
    faces += [
        [6, 8, 7],
        [6, 9, 8],
        [0, 6, 7],
        [0, 7, 1],
        [2, 8, 9],
        [2, 9, 3],
        [1, 7, 8],
        [1, 8, 2],
        [3, 9, 6],
        [3, 6, 0],
    ]
    mesh = trimesh.Trimesh([*side, *back], faces, process=False)
    assert mesh.is_volume
    assert min_wall_mm(mesh) == pytest.approx(10.0, abs=1e-3)
