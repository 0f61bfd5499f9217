"""What fills the joints lies inside the core, bumps and all, and takes the fins between the halves of cut bumps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cad.dots import dot_pattern
from cad.mold.core import REMOVAL_ORDER
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.checks.cavity import cavity_body
from fab.checks.core_filler import bump_fillers, core_filler
from fab.checks.extraction import TOUCH_MM, core_path, depth_in_cast
from fab.steps.cast import cast_steps
from fab.steps.sweep import FLASH_MM, step_bodies

INSIDE_MM = 0.05


@pytest.mark.parametrize("dot_mm", [2.9, 8.0])
def test_a_filler_stands_in_every_bump_so_deep_under_its_surface(dot_mm):
    params = EndcapParams(150.0, 9.0, dot_rings=(1, 6, 10, 12, 14), dot_mm=dot_mm)
    layout = MoldLayout(params)
    fillers = bump_fillers(params, INSIDE_MM)
    proud = (fillers - core_filler(layout, INSIDE_MM)).decompose()
    assert len(proud) == len(dot_pattern(params))
    corners = fillers.to_mesh().vert_properties[:, :3].astype(float)
    radius = np.linalg.norm(corners - (0, 0, params.centre_height_mm), axis=1)
    outside = radius > params.inner_radius_mm + 0.01
    assert depth_in_cast(layout, corners[outside]) == pytest.approx(-INSIDE_MM, abs=1e-4)
    assert radius.max() == pytest.approx(params.inner_radius_mm + params.dent_depth_mm - INSIDE_MM, abs=1e-4)


@pytest.mark.long
def test_the_swept_silicone_has_no_fin_in_a_bump_that_a_joint_cuts(released_mold):
    layout, _, meshes = released_mold
    ways = {name: core_path(layout, name, meshes[name]) for name in REMOVAL_ORDER}
    out = next(step for step in cast_steps(layout, ways) if step.key == "wedges_out")
    out = replace(out, moves=[replace(move, past=("shell",)) for move in out.moves])
    silicone = step_bodies(layout, [out], meshes)["shell"]
    inside = bump_fillers(layout.params, 2 * FLASH_MM)
    fins = (cavity_body(layout, meshes, FLASH_MM) ^ inside).decompose()
    assert sum(fin.volume() for fin in fins) > 0.5
    for fin in fins:
        assert (
            depth_in_cast(layout, fin.to_mesh().vert_properties[:, :3].astype(float)).max() <= TOUCH_MM
        )  # in the core
    assert (silicone ^ inside).volume() < 1e-6
