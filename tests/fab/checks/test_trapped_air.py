"""Air that a cast would hold under the mold: pockets, roofs, rings and hollows, planted on a round block."""

from __future__ import annotations

import math

import pytest
import trimesh
from build123d import Solid

from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from cad.solids import drill, one_solid
from fab.checks.cavity import (
    hollows_mm3,
    trapped_air_checks,
)
from fab.meshing.mesh import tessellate

LAYOUT = MoldLayout(EndcapParams(130.0, 8.0))


def cast_block(*tools: Solid) -> trimesh.Trimesh:
    """A round cast of 40 mm height above the flange's level, with something added."""
    block = drill((0, 0), 30.0, 6.0, 46.0)
    return tessellate(one_solid(block.fuse(*tools) if tools else block, "block"), 0.05)


def traps(cast: trimesh.Trimesh) -> float:
    return next(check.value for check in trapped_air_checks(LAYOUT, cast) if check.name == "cavity.air_traps")


def test_air_is_trapped_where_the_cast_rises_into_a_pocket_of_the_mold():
    """The mold is poured with +z down: a pocket reaches toward lower z above the level of the vents."""
    assert traps(cast_block()) == 0  # all its summits are at the vents
    pockets = [Solid.make_sphere(6.0).translate((32 * math.cos(a), 32 * math.sin(a), 30.0)) for a in (0.3, 1.7, 4.0)]
    for count in (1, 2, 3):
        assert traps(cast_block(*pockets[:count])) == count


def test_air_is_trapped_under_a_flat_roof_and_in_a_ring():
    brim = drill((0.0, 0.0), 36.0, 30.0, 40.0)  # its roof leads to the block, so it holds no air itself
    assert traps(cast_block(brim)) == 0
    chimney = drill((33.0, 0.0), 1.5, 25.0, 31.0)
    assert traps(cast_block(brim, chimney)) == 1
    ring = one_solid(drill((0.0, 0.0), 34.0, 25.0, 31.0).cut(drill((0.0, 0.0), 32.0, 24.0, 32.0)), "ring")
    assert traps(cast_block(brim, ring)) == 1


def test_air_climbs_along_a_sloping_roof():
    cone = Solid.make_cone(30.0, 40.0, 10.0).translate((0, 0, 20.0))  # its upper side (lower z) leads to the block
    assert traps(cast_block(cone)) == 0


def test_the_air_of_a_hollow_is_what_it_holds_up_to_its_spill():
    """A bowl in the roof of a brim, which leads up to the block: the air is that of a spherical segment."""
    radius, depth = 3.0, 0.5
    brim = drill((0.0, 0.0), 36.0, 30.0, 40.0)
    bowl = Solid.make_sphere(radius).translate((33.0, 0.0, 30.0 + radius - depth))  # reaches over the roof, to lower z
    volumes = hollows_mm3(cast_block(brim, bowl), 6.01)
    assert len(volumes) == 1
    assert volumes[0] == pytest.approx(math.pi * depth**2 * (3 * radius - depth) / 3, rel=0.06)  # chords of 0.05 mm
    small = Solid.make_sphere(radius).translate((33.0, 0.0, 30.0 + radius - 0.1))  # 0.093 mm3
    checks = {check.name: check for check in trapped_air_checks(LAYOUT, cast_block(brim, small))}
    assert checks["cavity.air_traps"].value == 0
    assert checks["cavity.hollow_air_mm3"].value == pytest.approx(0.093, rel=0.3)
