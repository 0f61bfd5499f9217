"""Slivers that cross their neighbours are repaired, the surface stays closed and the body the same."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from fab.meshing.mesh import to_manifold
from fab.meshing.repair import REACH_MM, without_crossings
from fab.meshing.self_intersections import self_intersections


def folded(over_mm: float, seed: int = 0) -> trimesh.Trimesh:
    """A ball with a sliver: one edge split near its end, and the new corner pushed over the neighbouring face."""
    ball = trimesh.creation.icosphere(3, 20.0)
    rng = np.random.default_rng(seed)
    face = int(rng.integers(len(ball.faces)))
    a, b, c = (int(v) for v in ball.faces[face])
    other = next(int(f) for pair in ball.face_adjacency for f in pair if f != face and {a, b} <= set(ball.faces[f]))
    d = next(int(v) for v in ball.faces[other] if v not in (a, b))
    points, faces = np.asarray(ball.vertices), [list(f) for k, f in enumerate(ball.faces) if k not in (face, other)]
    start = points[a] + 1e-3 * (points[b] - points[a])
    inward = points[d] - start
    place = start + over_mm * inward / np.linalg.norm(inward)  # beyond the sliver's own edge: it folds over a-d
    new = len(points)
    place = place + 2 * over_mm * (points[a] - points[b]) / np.linalg.norm(points[a] - points[b])
    faces += [[a, new, c], [new, b, c], [new, a, d], [b, new, d]]
    return trimesh.Trimesh(np.vstack([points, place]).astype(np.float32), faces, process=False)


@pytest.mark.parametrize("seed", range(4))
def test_a_sliver_folded_over_its_neighbour_is_repaired(seed):
    mesh = folded(4e-3, seed)
    assert mesh.is_watertight and self_intersections(mesh) > 0
    whole = without_crossings(mesh)
    assert self_intersections(whole) == 0
    assert whole.is_watertight and whole.is_winding_consistent
    assert len(to_manifold(whole).decompose()) == 1
    assert whole.volume == pytest.approx(mesh.volume, rel=1e-6)
    away = np.abs(np.linalg.norm(whole.vertices, axis=1) - 20.0)
    assert away.max() < REACH_MM and len(mesh.vertices) - 2 <= len(whole.vertices) <= len(mesh.vertices)


def test_a_sound_mesh_comes_back_as_it_is():
    ball = trimesh.creation.icosphere(3, 20.0)
    assert without_crossings(ball) is ball


def test_bodies_that_cross_are_left_for_the_gates():
    both = trimesh.util.concatenate(
        [trimesh.creation.box((2, 2, 2)), trimesh.creation.box((2, 2, 2)).apply_translation((1.1, 0.3, 0.2))]
    )
    assert self_intersections(without_crossings(both)) > 0


def test_only_the_band_asked_for_is_looked_at():
    mesh = folded(4e-3)
    low, high = mesh.bounds[:, 2]
    assert without_crossings(mesh, (high + 1, high + 2)) is mesh
    assert self_intersections(without_crossings(mesh, (low, high))) == 0
