"""Words of parts, sizes and the workshop: true of the parts, and each in the glossary."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from build123d import Solid

from cad.materials import DEFAULT_SILICONE
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from cad.shell import shell_part
from fab.build_sheet import casting, dots, finishing
from fab.exports.index_page import _facts
from fab.part_words import PARTS, WORKSHOP, height_words
from fab.steps import cast, mold
from fab.variant import Variant


@pytest.mark.parametrize("size", [(130.0, 8.0), (142.0, 7.5)])
def test_the_height_of_the_dome_is_that_of_the_cast_silicone(size):
    params = EndcapParams(*size)
    core = Solid.make_sphere(params.inner_radius_mm).translate((0, 0, params.centre_height_mm))
    box = shell_part(MoldLayout(params), core).solid.bounding_box()
    cast, whole, flange = map(float, re.findall(r"[\d.]+", height_words(params)))
    assert cast == pytest.approx(box.max.Z - box.min.Z, abs=0.06) and whole == pytest.approx(box.max.Z, abs=0.06)
    assert flange == params.flange_thickness_mm
    manifest = {"parts": [{"name": "shell", "volume_mm3": {"mesh": 3e5}}], "gyroid": {"period_mm": 9, "density": 0.1}}
    page = _facts(Variant(MoldLayout(params, silicone=DEFAULT_SILICONE)), manifest)
    assert f"{cast:.1f} mm high as cast; {whole:.1f} mm with" in page
    assert "<th>camera</th><td>ELP-USBFHD01M-L180</td>" in page


GLOSSARY = (Path(__file__).parents[2] / "docs" / "glossary.md").read_text(encoding="utf-8")
TERMS = {term for row in re.findall(r"(?m)^\| ([^|]+) \|", GLOSSARY) for term in re.split(r", | and ", row.strip())}


def test_the_sheet_explains_the_words_of_its_steps_and_so_does_the_glossary():
    text = " ".join(
        Path(module.__file__).read_text(encoding="utf-8") for module in (cast, mold, casting, dots, finishing)
    )
    for word in WORKSHOP:
        assert word in TERMS and re.search(rf"\b{word}s?\b", text), word
    assert {"dam", "piston", "well", "gore"} <= set(WORKSHOP) and not set(WORKSHOP) & set(PARTS)
