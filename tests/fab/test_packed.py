"""Parts as bytes: nothing is lost on the way through another process or the cache."""

from __future__ import annotations

import pickle
import tempfile

import numpy as np
import pytest
from build123d import Solid

from bench.sizes import Inline
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from cad.part import Part, Recipe
from cad.ring_spacer import ring_spacer_part
from fab.cache import Cache
from fab.design import build_design
from fab.meshing.mesh import mesh_sha256
from fab.packed import _kept, _packed


@pytest.fixture(scope="module")
def spacer():
    part = ring_spacer_part(EndcapParams(130.0, 8.0))
    return part, _packed([part], 0.05)[0]


def test_a_part_comes_back_with_its_solid_and_its_mesh(spacer):
    part, packed = spacer
    back, mesh = pickle.loads(pickle.dumps(packed)).unpacked()
    assert (back.name, back.role, back.material, back.color, back.quantity) == (
        *(part.name, part.role, part.material, part.color, part.quantity),
    )
    assert back.solid.is_valid and back.solid.volume == pytest.approx(part.solid.volume, rel=1e-12)
    assert mesh.is_watertight and mesh.volume == pytest.approx(part.solid.volume, rel=1e-2)


def test_the_cache_gives_what_was_made_and_makes_it_once(spacer, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "full"))  # nothing can be written there
    cache, made = Cache(tmp_path), []

    def make():
        made.append(1)
        return [spacer[1]]

    first, again = (_kept(cache, "key", make)[0] for _ in range(2))
    assert len(made) == 1
    assert (first.uncrossed, again.uncrossed) == (False, False)  # its mesh comes from the solid and was not searched
    assert again.shape == first.shape and again.color == first.color and again.quantity == first.quantity
    assert np.array_equal(again.vertices, first.vertices) and np.array_equal(again.faces, first.faces)


@pytest.mark.parametrize("crossings", [False, True])
def test_whether_a_mesh_was_searched_for_crossings_travels_with_it(crossings, monkeypatch):
    ball, prism = Solid.make_sphere(10.0), Solid.make_box(20.0, 20.0, 20.0)
    part = Part("piece", "printed", "PLA", ball & prism, (0.5, 0.5, 0.5), recipe=Recipe(ball, (prism,)))
    if crossings:  # a repaired mesh is searched again
        monkeypatch.setattr("fab.meshing.parts.without_crossings", lambda mesh: mesh.copy())
    assert _packed([part], 0.1)[0].uncrossed is not crossings


@pytest.mark.long
def test_no_piece_of_the_mold_is_searched_for_crossings_twice():
    design = build_design(MoldLayout(EndcapParams(130.0, 8.0)), Inline(), lambda _: None)
    searched = {name for name, mesh in design.meshes.items() if mesh_sha256(mesh) in design.uncrossed}
    assert searched == {name for name in design.mold if name != "hanger"}
