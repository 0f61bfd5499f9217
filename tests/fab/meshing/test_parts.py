"""Which meshes count as searched for crossings: those that were searched and have none, and no other."""

from __future__ import annotations

import pytest
import trimesh
from build123d import Solid

from cad.mold.core import core_body, core_parts
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from cad.part import Part, Recipe
from cad.shell import shell_part
from fab.meshing import parts as module
from fab.meshing.mesh import TOLERANCE_MM, mesh_sha256, part_tolerance_mm, read_stl, tessellate, write_stl
from fab.meshing.parts import PartMeshes
from fab.meshing.self_intersections import self_intersections


@pytest.fixture
def piece() -> Part:
    ball, prism = Solid.make_sphere(10.0), Solid.make_box(20.0, 20.0, 20.0)
    return Part("piece", "printed", "PLA", ball & prism, (0.5, 0.5, 0.5), recipe=Recipe(ball, (prism,)))


def test_a_mesh_without_crossings_is_known_by_its_content_read_back_too(piece, tmp_path):
    maker = PartMeshes(0.1)
    mesh = maker.of(piece)
    write_stl(tmp_path / "piece.stl", mesh)
    assert maker.uncrossed == {mesh_sha256(read_stl(tmp_path / "piece.stl"))}
    moved = mesh.vertices.copy()
    moved[7, 1] += 1e-4
    write_stl(tmp_path / "piece.stl", trimesh.Trimesh(moved, mesh.faces, process=False))
    assert mesh_sha256(read_stl(tmp_path / "piece.stl")) not in maker.uncrossed


def test_a_repaired_mesh_is_searched_again(piece, monkeypatch):
    monkeypatch.setattr(module, "without_crossings", lambda mesh: mesh.copy())
    maker = PartMeshes(0.1)
    maker.of(piece)
    assert maker.uncrossed == set()


def test_facets_that_cross_and_cannot_be_repaired_are_made_again_finer(piece, monkeypatch):
    """The first two tries leave crossings; the third has none, as few facets as it needs, and the piece's volume."""
    found = iter(([0, 1], [0], []))
    monkeypatch.setattr(module, "without_crossings", lambda mesh: mesh.copy())
    monkeypatch.setattr(module, "crossing_faces", lambda mesh: next(found))
    mesh = PartMeshes(0.1).of(piece)
    assert len(mesh.faces) == len(PartMeshes(0.1)._combined(piece.recipe, 0.05).faces)
    assert mesh.is_watertight and mesh.volume == pytest.approx(piece.solid.volume, rel=0.02)


@pytest.mark.long
def test_a_bump_that_a_joint_cuts_at_a_few_degrees_has_no_crossing_facets() -> None:
    """D=216.17 T=19.57: a facet of the joint's wall crossed three of the bump's, and no local repair helped."""
    params = EndcapParams(216.17, 19.57)
    layout = MoldLayout(params)
    centre = core_parts(layout, core_body(layout))[0]
    mesh = PartMeshes(part_tolerance_mm(params.diameter_mm)).of(centre)
    assert centre.name == "core_centre" and self_intersections(mesh) == 0
    assert mesh.is_watertight and mesh.volume == pytest.approx(centre.solid.volume, rel=1e-3)


def test_a_body_has_the_same_mesh_after_pieces_were_cut_from_it() -> None:
    """The kernel's booleans write into their arguments: meshed afterwards this body was 2.9 % too small."""
    layout = MoldLayout(EndcapParams(103.27, 9.03, dot_rings=(1, 4, 5), dot_mm=7.8))
    body = core_body(layout)
    before = mesh_sha256(tessellate(body, 0.05))
    core_parts(layout, body)
    shell_part(layout, body)
    after = tessellate(body, 0.05)
    assert mesh_sha256(after) == before
    assert after.volume == pytest.approx(body.volume, rel=2e-3)


@pytest.mark.long
def test_a_small_thick_cores_wedges_have_the_volume_of_their_solids() -> None:
    """The coarsest tolerance that the larger sizes hold is too coarse here."""
    params = EndcapParams(99.3, 9.93)
    layout = MoldLayout(params)
    wedges = [part for part in core_parts(layout, core_body(layout)) if "wedge" in part.name]

    def worst(tolerance_mm: float) -> float:
        maker = PartMeshes(tolerance_mm)
        return max(abs(maker.of(part).volume / part.solid.volume - 1) for part in wedges)

    assert worst(part_tolerance_mm(params.diameter_mm)) < 0.8e-3 < 1e-3 < worst(TOLERANCE_MM)
