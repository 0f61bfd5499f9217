"""Seams: none on what the silicone copies, those of a cup outside, in the files of both slicers and in the G-code."""

from __future__ import annotations

import re
import shutil
from zipfile import ZipFile

import manifold3d
import numpy as np
import pytest
import trimesh
from lib3mf import get_wrapper
from strict_3mf import read_strictly

from cad.params import EndcapParams
from fab.meshing.mesh import from_manifold
from fab.slice.gcode import read_gcode
from fab.slice.pose import laid_down
from fab.slice.printers import printer
from fab.slice.project_3mf import Volume, single, write_orca, write_prusa
from fab.slice.run import NAMES, slice_to_gcode
from fab.slice.seams import FREE, NO_SEAM, SEAM_HERE, seam_paint
from fab.slice.settings import part_settings

SLICER = next((path for name in NAMES if (path := shutil.which(name))), None)
SMALL = EndcapParams(100.0, 8.0)
RADIUS, CENTRE, WALL, HEIGHT = 50.0, SMALL.centre_height_mm, 7.0, 6.0
NEAR_MM = 0.75  # of a seam on the cavity: the middle of its line is half a line beside it


@pytest.fixture(scope="module")
def segment() -> trimesh.Trimesh:
    """A third of a ring round the cavity, below its equator, as the bowl's segments are; endcap frame."""
    ring = manifold3d.Manifold.cylinder(HEIGHT, RADIUS + WALL, circular_segments=180).translate((0, 0, 30.0))
    third = manifold3d.CrossSection([[(0, 0), (90, 0), (90, 90), (-45, 78)]]).extrude(99.0)
    cavity = manifold3d.Manifold.sphere(RADIUS, 180).translate((0, 0, CENTRE))
    return from_manifold((ring ^ third) - cavity)


def at_corners(mesh: trimesh.Trimesh) -> np.ndarray:
    """(n, 3) distance of each triangle's corners from the sphere's middle."""
    return np.linalg.norm(mesh.triangles - np.array([0.0, 0.0, CENTRE]), axis=2)


def test_the_cavity_is_painted_and_of_the_rest_only_the_outside(segment):
    codes, radius = seam_paint("cup_bowl_1", segment, SMALL), at_corners(segment)
    on_cavity, beside = (np.abs(radius - RADIUS) < 0.01).all(axis=1), (np.abs(radius - RADIUS) > 0.05).any(axis=1)
    assert on_cavity.sum() > 100 and (codes[on_cavity] == NO_SEAM).all() and (codes[beside] != NO_SEAM).all()
    outer = np.linalg.norm(segment.triangles[codes == SEAM_HERE][:, :, :2], axis=2)
    assert len(outer) and np.allclose(outer, RADIUS + WALL, atol=0.05)  # neither the joints nor top and bottom
    assert (seam_paint("hanger", segment, SMALL) == FREE).all()


def test_the_dome_of_the_core_is_painted_with_its_bumps():
    inner = SMALL.inner_radius_mm
    dome, bump = (manifold3d.Manifold.sphere(r, 256).translate((0, 0, z)) for r, z in ((inner, CENTRE), (3, 0)))
    mesh = from_manifold(dome + bump.translate((0, 0, CENTRE + inner - 2.4)))
    codes, radius = seam_paint("core_key_1", mesh, SMALL), at_corners(mesh)
    assert radius.max() == pytest.approx(inner + 0.6, abs=0.01)
    assert set(codes) == {NO_SEAM}


def test_both_dialects_carry_the_same_paint(segment, tmp_path):
    codes = seam_paint("cup_bowl_1", segment, SMALL)
    volume = Volume("cup_bowl_1", laid_down("cup_bowl_1", segment), seam=codes)
    project = single("bowl", part_settings("cup_bowl_1", "PLA"), (volume,))
    for write, attribute in ((write_prusa, "slic3rpe:custom_seam"), (write_orca, "paint_seam")):
        write(project, tmp_path / "bowl.3mf")
        text = ZipFile(tmp_path / "bowl.3mf").read("3D/3dmodel.model").decode()
        triangles = re.findall(r"<triangle ([^>]*)/>", text)
        found = [int(m[1]) if (m := re.search(rf' {attribute}="(\d)"', words)) else FREE for words in triangles]
        assert found == codes.tolist()
    write_prusa(project, tmp_path / "bowl.3mf")
    read_strictly(tmp_path / "bowl.3mf")
    write_orca(project, tmp_path / "bowl.3mf")
    reader = get_wrapper().CreateModel().QueryReader("3mf")
    reader.ReadFromFile(str(tmp_path / "bowl.3mf"))  # not strictly: Bambu Studio has this attribute without a namespace
    warnings = {reader.GetWarning(number)[1] for number in range(reader.GetWarningCount())}
    assert warnings == {"Invalid Attribute in namespace."}


@pytest.mark.skipif(SLICER is None, reason="PrusaSlicer is not installed: run scripts/slicer.sh")
def test_no_wall_begins_on_the_cavity(segment, tmp_path):
    """Without paint most seams lie in the corner of cavity and joint: copied by the silicone, in the joint's way."""
    where = printer("ender3")
    settings, laid = part_settings("cup_bowl_1", "PLA", where), laid_down("cup_bowl_1", segment, where)
    axis = np.array(where.middle_mm) + laid.vertices[0, :2] - segment.vertices[0, :2] * (1, -1)
    shares = []
    for codes in (None, seam_paint("cup_bowl_1", segment, SMALL)):
        project = single("bowl", settings, (Volume("cup_bowl_1", laid, seam=codes),))
        write_prusa(project, tmp_path / "bowl.3mf")
        slice_to_gcode(SLICER, tmp_path / "bowl.3mf", tmp_path / "bowl.gcode", where)
        moves = read_gcode(tmp_path / "bowl.gcode")
        first = np.unique(moves.path[moves.kind == moves.kinds.index("External perimeter")], return_index=True)[1]
        outer = moves.pick(moves.kind == moves.kinds.index("External perimeter"))
        # the bowl is printed dome-down: its lowest layer was the highest of the segment, 30 mm + HEIGHT
        height = 30.0 + HEIGHT - (outer.top_mm - outer.height_mm / 2) - CENTRE
        out = np.hypot(np.linalg.norm(outer.start - axis, axis=1), height)[first] - RADIUS
        shares.append(float((out < NEAR_MM).mean()))
    assert shares[0] > 0.5 and shares[1] == 0.0
