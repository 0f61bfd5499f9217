"""The size that a printer is too small for: what the refusal proposes is accepted, whole."""

from __future__ import annotations

import re

import pytest

from cad.errors import ParameterError
from cad.mold_layout import MoldLayout
from cad.params import EndcapParams
from cad.pattern import parse_rings
from fab.slice.footprints import require_printer
from fab.slice.printers import printer


def test_the_largest_size_that_a_refusal_names_can_be_made_with_what_it_names_beside():
    crowded = EndcapParams(250.0, 25.0, (1, 8, 16, 24, 32, 39, 45, 51, 55, 59, 61, 62), 8.0)
    with pytest.raises(ParameterError) as refused:
        require_printer(MoldLayout(crowded, 0.3), printer("generic180"))
    words = re.search(r"largest D of this printer is ([\d.]+) with (.*?);", str(refused.value))
    options = dict(word.split("=") for word in words[2].split())
    assert set(options) == {"T", "dots", "joint_clearance"}  # none of the three can be kept
    design = EndcapParams(float(words[1]), float(options["T"]), parse_rings(options["dots"]), 8.0)
    require_printer(MoldLayout(design, float(options["joint_clearance"])), printer("generic180"))
