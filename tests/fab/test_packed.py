"""Parts as bytes: nothing is lost on the way through another process or the cache."""

from __future__ import annotations

import pickle
import tempfile

import numpy as np
import pytest

from cad.params import EndcapParams
from cad.ring_spacer import ring_spacer_part
from fab.cache import Cache
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
    assert again.shape == first.shape and again.color == first.color and again.quantity == first.quantity
    assert np.array_equal(again.vertices, first.vertices) and np.array_equal(again.faces, first.faces)
