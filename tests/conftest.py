"""Shared designs, built once for each test process."""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import pytest


@pytest.fixture(scope="session")
def released_mold():
    """Layout, parts by name and meshes by name of cup and core at D=130 T=8."""
    from cad.mold_core import core_body, core_parts
    from cad.mold_cup import cup_parts
    from cad.mold_layout import MoldLayout
    from cad.params import EndcapParams
    from fab.mesh import tessellate

    layout = MoldLayout(EndcapParams(130.0, 8.0))
    made = [*core_parts(layout, core_body(layout)), *cup_parts(layout)]
    return layout, {part.name: part for part in made}, {part.name: tessellate(part.solid) for part in made}
