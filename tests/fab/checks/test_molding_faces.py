"""The core's facets that shape the silicone have the area of its sphere and its ramp, also where the ramp is low."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from long_cases import others_long

from cad.mold.core import core_profile, ramp_end
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from cad.solids import revolved
from fab.checks.molding_faces import molding_faces
from fab.meshing.mesh import tessellate


@pytest.mark.parametrize("size", others_long([(99.3, 9.92), (130.0, 8.0), (250.0, 25.0)]))
def test_the_molding_faces_are_sphere_and_ramp(size):
    layout = MoldLayout(EndcapParams(*size))
    params = layout.params
    across, top = ramp_end(layout)
    slant = math.hypot(across - layout.neck_radius_mm, top - params.flange_thickness_mm)
    ramp = math.pi * (across + layout.neck_radius_mm) * slant if top > params.flange_thickness_mm else 0.0
    sphere = 2 * math.pi * params.inner_radius_mm * (params.centre_height_mm + params.inner_radius_mm - top)
    found = molding_faces(layout, tessellate(revolved(core_profile(layout))))
    areas = trimesh.triangles.area(found.triangles)
    assert areas.sum() == pytest.approx(sphere + ramp, rel=1e-3)
    low = np.isclose(found.normals[:, 2], -math.cos(math.radians(layout.ramp_deg)), rtol=0, atol=1e-12)
    assert areas[low].sum() == pytest.approx(ramp, rel=0.01)
    assert np.linalg.norm(found.normals, axis=1) == pytest.approx(np.ones(len(areas)))
