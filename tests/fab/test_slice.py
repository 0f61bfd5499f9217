"""Slicing: projects read back by an independent reader, G-code by hand and by PrusaSlicer, faults planted."""

from __future__ import annotations

import dataclasses
import json
import math
import shutil
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
import trimesh
from strict_3mf import read_strictly

from cad.errors import FileError, ParameterError
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.slice.filaments import filament
from fab.slice.gcode import read_gcode
from fab.slice.measure import empty_layers, floating_starts, print_figures, zone_figures
from fab.slice.pose import laid_down
from fab.slice.printers import printer
from fab.slice.project_3mf import Volume, single, write_orca, write_prusa
from fab.slice.result import slice_project
from fab.slice.run import NAMES, model_info, slice_to_gcode
from fab.slice.settings import LAYER_MM, Region, native_density_percent, part_settings, zone_region
from fab.variant import Variant

SLICER = next((path for name in NAMES if (path := shutil.which(name))), None)
needs_slicer = pytest.mark.skipif(SLICER is None, reason="PrusaSlicer is not installed: run scripts/slicer.sh")
SMALL = EndcapParams(100.0, 8.0)
SMALL_MOLD = Variant(MoldLayout(SMALL))
SPAN_MM = 2.0  # of the zone's height in the slicing tests


def box(x: float, y: float, z: float) -> trimesh.Trimesh:
    mesh = trimesh.creation.box((x, y, z))
    mesh.apply_translation((0, 0, z / 2))
    return mesh


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "a.gcode"
    path.write_text(text)
    return path


LINES = """\
M83
;LAYER_CHANGE
;Z:0.2
;HEIGHT:0.2
G1 Z.2 F7800
G1 X100 Y100
;TYPE:External perimeter
;WIDTH:0.45
G1 X110 Y100 E1
G1 F900
G1 X110 Y104 E.4
;LAYER_CHANGE
;Z:0.4
;HEIGHT:0.2
G1 Z.4 F7800
G1 X100 Y100
G1 X110 Y100 E1 ; above the first
G1 X150 Y150
G1 X152 Y150 E.2
; filament used [g] = 7.75
; estimated printing time (normal mode) = 1h 2m 3s
"""


def test_gcode_by_hand(tmp_path):
    moves = read_gcode(written(tmp_path, LINES))
    assert moves.length_mm.tolist() == [10.0, 4.0, 10.0, 2.0]
    area = math.pi / 4 * 1.75**2
    assert np.allclose(moves.volume_mm3, area * np.array([1, 0.4, 1, 0.2]))
    assert moves.layer.tolist() == [0, 0, 1, 1] and moves.layer_tops_mm.tolist() == [0.2, 0.4]
    assert len(np.unique(moves.path)) == 3  # a change of speed does not break a line
    assert moves.slicer_time_s == 3723.0 and moves.slicer_grams == 7.75
    for words, seconds in (("1d 1h 2m 3s", 90123.0), ("2m 3s", 123.0), ("3s", 3.0)):
        assert read_gcode(written(tmp_path, LINES.replace("1h 2m 3s", words))).slicer_time_s == seconds


def test_a_line_reaches_half_its_width_beyond_its_moves(tmp_path):
    moves = read_gcode(written(tmp_path, LINES))
    half = moves.width_mm.max() / 2
    ends = np.concatenate([moves.start, moves.end])
    for away, side in ((-ends.min(axis=0), "near"), (256.0 - ends.max(axis=0), "far")):
        at_edge = dataclasses.replace(moves, start=moves.start + away, end=moves.end + away)
        figures = print_figures(at_edge, filament("PLA"))
        assert figures.outside_bed_mm == pytest.approx(half), side
        assert figures.extent_mm[:2] == pytest.approx(np.ptp(ends, axis=0) + 2 * half)
    tall = dataclasses.replace(moves, top_mm=moves.top_mm + printer().height_mm)
    assert print_figures(tall, filament("PLA")).outside_bed_mm == pytest.approx(0.4)


def test_grams_are_compared_with_those_that_the_slicer_states(tmp_path):
    figures = print_figures(read_gcode(written(tmp_path, LINES.replace("7.75", "0.008"))), filament("PLA"))
    grams = math.pi / 4 * 1.75**2 * 2.6 * 1.24e-3
    assert figures.grams == pytest.approx(grams) and figures.grams_error == pytest.approx(1 - grams / 0.008)


def test_absolute_filament_and_resets_give_the_same_volume(tmp_path):
    relative = read_gcode(written(tmp_path, LINES))
    text = LINES.replace("M83", "M82").replace("Y104 E.4", "Y104 E1.4").replace(";Z:0.4", ";Z:0.4\nG92 E0")
    absolute = read_gcode(written(tmp_path, text.replace("X152 Y150 E.2", "X152 Y150 E1.2")))
    assert np.allclose(absolute.volume_mm3, relative.volume_mm3)


def test_a_line_that_starts_on_air_is_found_and_the_one_above_the_first_is_not(tmp_path):
    assert floating_starts(read_gcode(written(tmp_path, LINES))).tolist() == [[150.0, 150.0, 0.4]]


def test_a_support_layer_between_leaves_what_the_part_stands_on(tmp_path):
    between = ";LAYER_CHANGE\n;Z:0.3\n;HEIGHT:0.1\n;TYPE:Support material\nG1 Z.3 F7800\n"
    between += "G1 X130 Y130\nG1 X132 Y130 E.2\n"
    again = ";TYPE:External perimeter\n"
    at = LINES.index(";LAYER_CHANGE", LINES.index("Z:0.2"))
    text = LINES[:at] + between + again + LINES[at:]
    assert floating_starts(read_gcode(written(tmp_path, text))).tolist() == [[150.0, 150.0, 0.4]]


def test_a_missing_layer_is_counted(tmp_path):
    whole = read_gcode(written(tmp_path, LINES))
    assert empty_layers(whole) == 0
    assert empty_layers(read_gcode(written(tmp_path, LINES.replace("Z.4 ", "Z.6 ")))) == 1


@pytest.mark.parametrize(("text", "words"), [("G1 X1\n", "no move extrudes"), ("G2 X1 Y1 I1 E1\n", "arcs")])
def test_gcode_that_cannot_be_measured_is_refused(tmp_path, text, words):
    with pytest.raises(FileError, match=words):
        read_gcode(written(tmp_path, text))


def test_density_asked_exceeds_the_density_wanted_and_falls_with_the_wall():
    asked = [native_density_percent(wall) for wall in (4.5, 6.0, 23.0, 1e9)]
    assert asked == sorted(asked, reverse=True)
    assert asked[-1] == pytest.approx(10 * 2 * math.pi / 2.44**2)


def test_projects_are_sound_3mf_for_an_independent_reader(tmp_path):
    meshes = (box(20, 20, 2), box(10, 10, 4))
    project = single("two", part_settings("interface", "TPU 95A"), tuple(
        Volume(f"v{k}", mesh, zone_region(6.0) if k else None) for k, mesh in enumerate(meshes)
    ))  # fmt: skip
    for write, objects in ((write_prusa, 1), (write_orca, 2)):
        path = tmp_path / f"{write.__name__}.3mf"
        write(project, path)
        first = path.read_bytes()
        write(project, path)
        assert path.read_bytes() == first
        found = read_strictly(path).GetMeshObjects()
        assert found.Count() == objects
        triangles = 0
        while found.MoveNext():
            mesh = found.GetCurrentMeshObject()
            triangles += mesh.GetTriangleCount()
            assert mesh.IsManifoldAndOriented()
        assert triangles == 24


def test_orca_project_names_every_setting_of_part_and_zone(tmp_path):
    path = tmp_path / "a.3mf"
    zone = zone_region(6.0)
    volumes = (Volume("flange", box(9, 9, 1)), Volume("zone", box(5, 5, 2), zone))
    write_orca(single("a", part_settings("interface", "TPU 95A"), volumes), path)
    archive = ZipFile(path)
    settings = json.loads(archive.read("Metadata/project_settings.config"))
    assert settings["layer_height"] == "0.2" and settings["filament_type"] == ["TPU"]
    own = archive.read("Metadata/model_settings.config").decode()
    for key, value in zone.orca().items():
        assert f'key="{key}" value="{value}"' in own
    assert '"BambuStudio-' not in own and b">BambuStudio-" in archive.read("3D/3dmodel.model")


def test_poses_stand_on_the_bed_and_a_part_too_large_is_refused():
    bowl = box(30, 20, 10)
    bowl.apply_translation((7, 3, 40))
    laid = laid_down("cup_bowl_1", bowl)
    assert laid.bounds.tolist() == [[-15, -10, 0], [15, 10, 10]]
    assert laid.is_watertight and laid.volume > 0
    long = box(260, 4, 4)
    assert max(laid_down("base", long).extents[:2]) < 248  # turned
    with pytest.raises(ParameterError, match=r"base \(300 x 300 x 5 mm\).*none of the table takes every part"):
        laid_down("base", box(300, 300, 5))


def test_unknown_material_names_those_known():
    with pytest.raises(ParameterError, match="PLA, PETG, TPU 95A"):
        filament("ABS")


# --- the slicer itself --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def ring():
    """The lowest 2 mm of the real zone on a plain flange: quick to slice, and as thick as the whole."""
    from cad.interface import build_zone, zone_radii_mm
    from fab.meshing.mesh import from_manifold, tessellate, to_manifold

    base = SMALL.flange_thickness_mm
    inner, outer = (math.sqrt(r**2 - (base - SMALL.centre_height_mm) ** 2) for r in zone_radii_mm(SMALL))
    flange = trimesh.creation.annulus(inner - 2, outer, base, sections=180)
    flange.apply_translation((0, 0, base / 2))
    whole = to_manifold(tessellate(build_zone(SMALL), 0.05))
    zone = from_manifold(whole.trim_by_plane((0.0, 0.0, -1.0), -(base + SPAN_MM)))
    return flange, zone, float(zone.volume), SMALL.wall_mm - 2 * SMALL.skin_mm


def sliced(ring, region: Region, folder: Path):
    """Moves in the zone after slicing flange and zone with a filling for the zone."""
    flange, zone, volume, _ = ring
    settings = dataclasses.replace(
        part_settings("interface", "TPU 95A"), region=Region(1, 0, 0, 5.0, "rectilinear"), thin_lines=False
    )
    project = folder / "ring.3mf"
    write_prusa(single("ring", settings, (Volume("flange", flange), Volume("zone", zone, region))), project)
    slice_to_gcode(SLICER, project, folder / "ring.gcode")
    moves = read_gcode(folder / "ring.gcode")
    return moves, volume


def fraction(moves, volume: float) -> float:
    above = moves.top_mm - LAYER_MM / 2 > SMALL.flange_thickness_mm
    return float(moves.volume_mm3[above].sum()) / volume


@needs_slicer
def test_the_zone_prints_ten_per_cent_open_and_anchors_or_wrong_infill_show(ring, tmp_path):
    good = zone_region(ring[3])
    figures = {}
    for name, region in {
        "good": good,
        "anchored": dataclasses.replace(good, anchor_mm=None, solid_below_mm2=None),
        "uncorrected": dataclasses.replace(good, density_percent=10.0),
        "walled": dataclasses.replace(good, walls=1),
    }.items():
        moves, volume = sliced(ring, region, tmp_path)
        figures[name] = (fraction(moves, volume), zone_figures(moves, SMALL).side_open_share)
    assert abs(figures["good"][0] - 0.10) < 0.005 and figures["good"][1] > 0.90
    assert figures["anchored"][0] > 0.12 and figures["anchored"][1] < 0.7
    assert figures["uncorrected"][0] < 0.095
    assert figures["walled"][1] < 0.2


@needs_slicer
def test_a_project_is_sliced_as_it_lies_and_its_grams_are_the_slicers(tmp_path):
    settings = part_settings("ring_spacer", "PLA")
    project = single("ring_spacer", settings, (Volume("ring_spacer", box(30, 20, 3)),))
    result = slice_project(SLICER, project, tmp_path, SMALL, keep_gcode=True)
    assert all(check.ok for check in result.checks)
    assert set(result.files) == {"ring_spacer.prusa.3mf", "ring_spacer.orca.3mf"}
    moves = read_gcode(tmp_path / "ring_spacer.gcode").printed
    middle = (moves.start.min(axis=0) + moves.end.max(axis=0)) / 2
    assert np.allclose(middle, 128.0, atol=0.3)
    solid = 30 * 20 * 3 / 1000 * settings.filament.density_g_cm3
    assert 0.5 * solid < result.figures.grams < 1.1 * solid
    assert result.figures.extent_mm[2] == 3.0 and math.isfinite(result.figures.time_s)
    assert moves.kinds and result.record()["pieces"][0]["settings"]["walls"] == settings.region.walls


@needs_slicer
def test_an_open_mesh_and_two_bodies_fail_their_gates(tmp_path):
    settings = part_settings("base", "PLA")
    whole = box(20, 20, 2)
    torn = trimesh.Trimesh(whole.vertices, whole.faces[:-1], process=False)
    twin = box(5, 5, 2)
    twin.apply_translation((30, 0, 0))
    for mesh, gate in ((torn, "slicer_manifold"), (trimesh.util.concatenate([whole, twin]), "slicer_bodies")):
        result = slice_project(SLICER, single("base", settings, (Volume("base", mesh),)), tmp_path, SMALL, False)
        assert [c.name for c in result.checks if not c.ok][:1] == [f"base.{gate}"]


@needs_slicer
def test_a_part_beside_the_bed_shows_in_the_moves(tmp_path):
    mesh = box(20, 20, 1)
    mesh.apply_translation((120, 0, 0))
    path = tmp_path / "beside.3mf"
    write_prusa(single("base", part_settings("base", "PLA"), (Volume("base", mesh),)), path)
    assert model_info(SLICER, path).is_manifold
    try:
        slice_to_gcode(SLICER, path, tmp_path / "beside.gcode")
    except FileError as error:
        assert "beside.3mf" in str(error)  # the slicer itself refused
    else:
        moves = read_gcode(tmp_path / "beside.gcode")
        assert print_figures(moves, filament("PLA")).outside_bed_mm > 1.0
