"""Words of the sheet's steps that depend on the size, the silicone and what is known of its recipe."""

from __future__ import annotations

import pytest

from cad.mold_core import REMOVAL_ORDER
from cad.mold_layout import MoldLayout
from cad.params import EndcapParams
from fab.build_sheet.data import SheetData
from fab.build_sheet.steps import filled
from fab.recipe import overflow_of, recipe
from fab.steps.cast import cast_steps
from fab.supplies import supply_lines

PARAMS = EndcapParams(150.0, 9.0)


@pytest.mark.parametrize(("material", "degassed"), [("Smooth-Sil 950", True), ("Ecoflex 00-50", False)])
def test_the_step_degasses_where_the_clock_does(material, degassed):
    layout = MoldLayout(PARAMS, silicone=material)
    mix = recipe(2e5, overflow_of(layout), material)
    data = SheetData(layout, {}, None, mix, [], [], [], [], 0.0, {})
    step = next(step for step in cast_steps(layout, dict.fromkeys(REMOVAL_ORDER, ())) if step.key == "mix")
    words = " ".join(filled(data, step.lines))
    assert ("degas until" in words) == degassed == any("degas" in row.what for row in mix.timeline)
    assert ("do not degas" in words) != degassed
    assert any(line.item == "vacuum chamber and pump" for line in supply_lines(mix)) == degassed
