"""Plastic of prints that are not sliced: closed forms of simple bodies; spools in the sheet follow the size."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
import trimesh

from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.bom import all_joints
from fab.build_sheet.__main__ import _lines
from fab.build_sheet.plastic import estimated_part_g, estimated_plastic_g
from fab.checks.screw_fit import ScrewFit
from fab.recipe import overflow_of, recipe

PLA, TPU = 1.24e-3, 1.21e-3  # g/mm3


def cube(side_mm: float) -> trimesh.Trimesh:
    return trimesh.creation.box((side_mm, side_mm, side_mm))


def test_a_cube_is_walls_layers_and_infill():
    skin = 4 * 100.0**2 * 4 * 0.45 + 2 * 100.0**2 * 5 * 0.2
    assert estimated_part_g("base", "PLA", cube(100.0)) == pytest.approx(PLA * (skin + 0.40 * (1e6 - skin)))
    skin = 4 * 100.0**2 * 2 * 0.45 + 2 * 100.0**2 * 4 * 0.2
    assert estimated_part_g("core_key_1", "PLA", cube(100.0)) == pytest.approx(PLA * (skin + 0.08 * (1e6 - skin)))


def test_thin_parts_and_the_interface_are_solid():
    assert estimated_part_g("base", "PLA", cube(3.0)) == pytest.approx(PLA * 27.0)
    assert estimated_part_g("interface", "TPU 95A", cube(100.0)) == pytest.approx(TPU * 1e6)
    grams = estimated_plastic_g(
        {"base": "PLA", "hanger": "PLA", "interface": "TPU 95A"},
        dict.fromkeys(("base", "hanger", "interface"), cube(3.0)),
    )
    assert grams == {"PLA": pytest.approx(2 * 27.0 * PLA), "TPU 95A": pytest.approx(27.0 * TPU)}


@pytest.mark.parametrize(("side_mm", "spools"), [(100.0, 1), (200.0, 5)])
def test_the_sheet_before_slicing_lists_spools_by_the_size_of_the_parts(side_mm, spools):
    layout = MoldLayout(EndcapParams(130.0, 8.0))
    part = {"name": "base", "role": "printed", "material": "PLA", "quantity": 1}
    export = SimpleNamespace(manifest={"parts": [part]}, printed={"base": "PLA"})
    fits = [ScrewFit(joint, 12.0, 8.0, 9.0, 5.0, 1.0, 0.0) for joint in all_joints(layout)]
    shop = SimpleNamespace(layout=layout, meshes={"base": cube(side_mm)}, fits=fits)
    mix = recipe(282e3, overflow_of(shop.layout))
    found = {line.item: line for line in _lines(export, shop, mix, None)}
    assert found["PLA filament"].quantity == spools and "g until sliced" in found["PLA filament"].use
    project = {"name": "base", "pieces": [{"name": "base", "grams": 90.0, "cost_usd": 1.8}]}
    sliced = {line.item: line for line in _lines(export, shop, mix, {"projects": [project]})}
    assert sliced["PLA filament"].quantity == 1 and "until sliced" not in sliced["PLA filament"].use
