"""Printers and plates: rows read or named by line, beds that are too small, parts that never touch, what each took."""

from __future__ import annotations

import shutil
from zipfile import ZipFile

import numpy as np
import pytest
import trimesh
from strict_3mf import read_strictly

from cad.arm_adapter import adapter_part
from cad.base import base_part
from cad.data_table import read_table
from cad.errors import FileError, ParameterError
from cad.feasible import nearest_wall_mm
from cad.hanger import hanger_part
from cad.mold.cup import cup_parts
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab import molds
from fab.meshing.mesh import tessellate
from fab.slice import filaments, printers
from fab.slice.excluded import gap_mm, outline, reach_mm
from fab.slice.footprints import footprints, largest_diameter_mm, require_printer
from fab.slice.gcode import read_gcode
from fab.slice.nest import EDGE_MM, PIXEL_MM, Standing, nested
from fab.slice.pose import standing
from fab.slice.printers import Printer, fitting_printers, fitting_turn_deg, printer, require_bed, room_left_mm, turned
from fab.slice.project_3mf import Piece, Project, Volume, write_orca, write_prusa
from fab.slice.result import slice_project
from fab.slice.run import NAMES, slice_to_gcode
from fab.slice.settings import part_settings

SLICER = next((path for name in NAMES if (path := shutil.which(name))), None)
needs_slicer = pytest.mark.skipif(SLICER is None, reason="PrusaSlicer is not installed: run scripts/slicer.sh")


def box(x: float, y: float, z: float) -> trimesh.Trimesh:
    mesh = trimesh.creation.box((x, y, z))
    mesh.apply_translation((0, 0, z / 2))
    return mesh


@pytest.mark.parametrize(
    ("table", "read", "row", "expected"),
    [
        (printers.PRINTER_TABLE, printers._printer, "mine,M,wide,200,200,,0.4,0.8,G29,M84,,,,,,E", "width_mm='wide'"),
        (
            printers.PRINTER_TABLE,
            printers._printer,
            "mine,M,200,200,200,18|28,0.4,0.8,G29,M84,,,,,,E",
            "exclude='18|28' is no",
        ),
        (printers.PRINTER_TABLE, printers._printer, "mine,Mine,200", "not one value for each column"),
        (filaments.FILAMENT_TABLE, filaments._filament, "ABS,ABS,-1,20,250,100,9,0,,,,E", "density_g_cm3='-1'"),
        (filaments.FILAMENT_TABLE, filaments._filament, "TPE,TPU,1.1,20,250,100,9,0,2,,5,E", "retract_mm_s=''"),
        (filaments.FILAMENT_TABLE, filaments._filament, "PLA,PLA,1.2,20,250,100,9,100,,,,E", "is there twice"),
        (
            filaments.FILAMENT_TABLE,
            filaments._filament,
            "ABS,ABS,1.1,20,250,100,9,101,,,,E",
            "fan_percent='101' outside 0..100",
        ),
    ],
)
def test_a_bad_row_is_named_by_its_line(table, read, row, expected, tmp_path):
    copy = tmp_path / table.name
    copy.write_text(table.read_text() + row + "\n")
    line = len(copy.read_text().splitlines())
    with pytest.raises(FileError, match=rf"{table.name} line {line} .*") as caught:
        read_table(copy, read)
    assert expected in str(caught.value) and "\n" not in str(caught.value)


def test_a_bed_that_is_too_small_names_the_part_and_the_smallest_printer_that_takes_all():
    parts = {"base": box(185, 20, 5).vertices, "hanger": box(200, 208 - 8, 5).vertices}
    with pytest.raises(
        ParameterError, match=r"printer=a1_mini: hanger \(200 x 200 x 5 mm\).*printer=generic220"
    ) as caught:
        require_bed(parts, printer("a1_mini"))
    assert "base (" not in str(caught.value)  # it fits across
    assert [p.name for p in fitting_printers(parts)][:2] == ["generic220", "ender3"]
    tall = {"rod": box(5, 5, 251).vertices}
    assert [p.name for p in fitting_printers(tall)] == ["generic256"]


def test_the_room_left_on_a_bed_is_negative_where_a_part_does_not_fit():
    where = printer("mk4")  # 250 x 210 x 220 mm, 4 mm round the part
    assert room_left_mm(box(200, 190, 5).vertices, where) == pytest.approx(12.0)
    assert room_left_mm(box(190, 230, 5).vertices, where) == pytest.approx(12.0)  # across
    for mesh in (box(243, 10, 5), box(10, 10, 221), box(230, 230, 5), box(202.5, 242.5, 5)):
        assert (room_left_mm(mesh.vertices, where) >= 0) == where.takes(mesh.vertices)


SIZES = [EndcapParams(98.9, 6.5), EndcapParams(130.0, 8.0), EndcapParams(150.0, 15.0), EndcapParams(250.0, 12.0)]


def side(points: np.ndarray) -> float:
    return min(float(np.ptp(turned(points[:, :2], a), axis=0).max()) for a in range(180))


@pytest.mark.parametrize("params", SIZES, ids=lambda params: params.label)
def test_no_finer_cut_of_the_cup_would_fit_a_smaller_bed(params):
    sides = {name: side(points) for name, points in footprints(MoldLayout(params)).items()}
    whole = [sides[name] for name in ("base", "arm_adapter", "hanger", "interface")]
    assert max(sides["cup_bowl"], sides["cup_collar"]) < min(whole)


@pytest.mark.long
def test_outlines_in_closed_form_are_those_of_the_solids():
    layout = MoldLayout(EndcapParams(98.9, 6.5))
    made = {"base": base_part(layout.params), "arm_adapter": adapter_part(layout.params), "hanger": hanger_part(layout)}
    made["cup_collar"] = next(part for part in cup_parts(layout) if part.name == "cup_collar_3")
    for name, part in made.items():
        points, closed = standing(name, tessellate(part.solid, 0.1)), footprints(layout)[name]
        assert side(points) == pytest.approx(side(closed), abs=0.3), name
        assert np.ptp(points[:, 2]) == pytest.approx(np.ptp(closed[:, 2]), abs=0.01), name


@pytest.mark.long
def test_a_size_too_large_for_a_printer_is_refused_with_the_largest_that_fits(capsys):
    layout = MoldLayout(EndcapParams(180.0, 10.0))
    said = r"a1_mini: base, arm_adapter, hanger, interface of D=180 .* largest D of .* is \d+.*; D=180 needs printer="
    with pytest.raises(ParameterError, match=said):
        require_printer(layout, printer("a1_mini"))
    for name, each in printers.printers().items():
        largest = largest_diameter_mm(layout, each)
        assert largest is not None and (largest == 250.0 or name not in ("x1c", "generic256"))
        require_printer(MoldLayout(EndcapParams(largest, nearest_wall_mm(largest, 10.0))), each)
        if largest < 250.0:
            with pytest.raises(ParameterError, match=f"is {largest:g};"):
                require_printer(MoldLayout(EndcapParams(largest + 0.1, 10.0)), each)
    assert molds.main(["D=180", "T=10", "printer=a1_mini"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def footprint(mesh: trimesh.Trimesh, place) -> tuple[np.ndarray, np.ndarray]:
    points = turned(mesh.vertices[:, :2], place.turn_deg) + np.array(place.place_mm)
    return points.min(axis=0), points.max(axis=0)


def test_nested_parts_lie_on_the_bed_apart_and_each_once():
    where = printer("generic180")
    parts = {f"part_{k}": Standing(box(60 + 5 * k, 40 + 3 * k, 5), 3.0) for k in range(9)}
    plates = nested(parts, where)
    placed = [place for plate in plates for place in plate]
    assert sorted(place.name for place in placed) == sorted(parts)
    assert len(plates) < len(parts) / 2
    for plate in plates:
        bodies = []
        for place in plate:
            mesh = parts[place.name].mesh.copy()
            mesh.vertices[:, :2] = turned(mesh.vertices[:, :2], place.turn_deg) + np.array(place.place_mm)
            assert np.abs(mesh.vertices[:, :2]).max() <= 90.0 - 3.0  # brim on the bed, too
            bodies.append(mesh)
        for first, body in enumerate(bodies):
            for other in bodies[first + 1 :]:
                distance = trimesh.proximity.ProximityQuery(body).vertex(other.vertices)[0].min()
                hit = trimesh.boolean.intersection([body, other], engine="manifold")
                assert hit.is_empty and distance > 0


def test_nothing_is_nested_on_what_the_printer_excludes_of_its_bed():
    where = printer("x1c")
    assert where.exclude_mm == (0.0, 0.0, 18.0, 28.0)
    parts = {f"part_{k}": Standing(box(70, 55, 5), 3.0) for k in range(6)}

    def nearest(where: Printer) -> float:
        """Distance of the nearest part, with its brim, from the excluded corner."""
        gaps = []
        for place in (place for plate in nested(parts, where) for place in plate):
            points = turned(parts[place.name].mesh.vertices[:, :2], place.turn_deg) + np.array(place.place_mm)
            gaps.append(gap_mm(outline(points + np.array(where.middle_mm)), (0.0, 0.0, 18.0, 28.0)) - 3.0)
        return min(gaps)

    assert nearest(where) >= EDGE_MM - PIXEL_MM
    assert nearest(printer("generic256")) < 0  # the corner is where the first part goes


def test_a_part_alone_in_the_middle_of_its_bed_keeps_off_what_is_excluded():
    where, anywhere = printer("x1c"), printer("generic256")
    square = box(240, 240, 5).vertices
    assert anywhere.takes(square) and not where.takes(square) and room_left_mm(square, where) < 0
    with pytest.raises(ParameterError, match=r"its bed less x 0 to 18, y 0 to 28 with .* printer=generic256"):
        require_bed({"square": square}, where)
    triangle = np.array([[0, 0, 0], [240, 0, 0], [0, 240, 0], [0, 0, 5]], dtype=float)
    assert fitting_turn_deg(triangle, anywhere) == 0.0 and fitting_turn_deg(triangle, where) == 180.0
    disc = trimesh.creation.cylinder(124, 5).vertices
    assert fitting_turn_deg(disc, where) == 0.0  # round parts of the largest bed leave the corner free
    for params in SIZES:
        assert all(where.takes(points) for points in footprints(MoldLayout(params)).values())


@pytest.mark.parametrize(
    ("start", "end", "reach"),
    [
        ((20.0, 5.0), (30.0, 60.0), 0.0),
        ((10.0, -5.0), (10.0, 60.0), 8.5),  # across the whole of it
        ((-5.0, 33.0), (30.0, -2.0), 9.0 + 0.5),
        ((18.2, 0.0), (18.2, 10.0), 0.3),  # half a line's width
        ((40.0, 1.0), (17.0, 1.0), 1.5),
    ],
)
def test_how_far_a_line_reaches_into_what_is_excluded(start, end, reach):
    ends = np.array([start]), np.array([end])
    exact = reach_mm(*ends, 0.5, (0.0, 0.0, 18.0, 28.0))
    x, y = (ends[0] + np.linspace(0, 1, 100_001)[:, None] * (ends[1] - ends[0])).T
    sampled = np.minimum.reduce([x + 0.5, 18.5 - x, y + 0.5, 28.5 - y]).max()
    assert exact == pytest.approx(max(0.0, sampled), abs=1e-3) == pytest.approx(reach, abs=1e-6)


def test_the_projects_of_orcaslicer_carry_what_is_excluded():
    settings = part_settings("base", "PLA", printer("x1c")).orca()
    assert settings["bed_exclude_area"] == ["0x0", "18x0", "18x28", "0x28"]
    assert "bed_exclude_area" not in part_settings("base", "PLA", printer("a1_mini")).orca()


def test_a_small_part_goes_into_the_hollow_of_a_ring_and_the_same_parts_give_the_same_plates():
    ring = trimesh.creation.annulus(60, 80, 4)
    parts = {"ring": Standing(ring, 0.0), "disc": Standing(trimesh.creation.cylinder(40, 4), 0.0)}
    small = printer("generic180")
    plates = nested(parts, small)
    assert len(plates) == 1 and plates == nested(parts, small)
    middle = {place.name: np.array(place.place_mm) for place in plates[0]}
    assert np.linalg.norm(middle["ring"] - middle["disc"]) < 20.0


def plate_of_two(where: Printer) -> Project:
    first = Piece("cup_bowl_1", part_settings("cup_bowl_1", "PLA", where), (Volume("cup_bowl_1", box(30, 20, 3)),))
    second = Piece("base", part_settings("base", "PLA", where), (Volume("base", box(15, 20, 3)),), (50.0, 10.0))
    return Project("plate_1", (first, second))


def test_both_dialects_hold_each_part_with_its_own_settings_at_its_place(tmp_path):
    project = plate_of_two(printer("mk4"))
    for write, own in ((write_prusa, 'key="perimeters" value="4"'), (write_orca, 'key="wall_loops" value="4"')):
        path = tmp_path / f"{write.__name__}.3mf"
        write(project, path)
        items, places = read_strictly(path).GetBuildItems(), []
        while items.MoveNext():
            fields = items.GetCurrent().GetObjectTransform().Fields
            places.append((fields[3][0], fields[3][1]))
        assert places == [(125.0, 105.0), (175.0, 115.0)]
        with ZipFile(path) as archive:
            names = [name for name in archive.namelist() if "config" in name]
            text = "".join(archive.read(name).decode() for name in names)
        assert own in text and 'value="3"' in text and "MK4" in text and "G29 P1" in text


@needs_slicer
def test_a_plate_is_sliced_for_its_printer_and_each_part_has_its_grams(tmp_path):
    where = printer("ender3")
    project = plate_of_two(where)
    result = slice_project(SLICER, project, tmp_path, EndcapParams(100.0, 8.0), keep_gcode=True)
    assert [check.name for check in result.checks if not check.ok] == []
    grams = {piece.name: piece.grams for piece in result.pieces}
    assert sum(grams.values()) == pytest.approx(result.figures.grams)
    moves = read_gcode(tmp_path / "plate_1.gcode")
    assert set(moves.pieces) == {"cup_bowl_1", "base"}
    labelled = moves.pick(moves.piece == moves.pieces.index("base"))
    assert labelled.start.min(axis=0) == pytest.approx((160 - 7.5, 120 - 10), abs=0.6)
    text = (tmp_path / "plate_1.gcode").read_text()
    assert text.index("\nG28") < text.index("\nG29") < text.index(";LAYER_CHANGE")
    slice_to_gcode(SLICER, tmp_path / "plate_1.prusa.3mf", tmp_path / "again.gcode", printer("a1_mini"))
    small = read_gcode(tmp_path / "again.gcode")
    assert small.end.max() > 160  # the bed alone moves nothing


@needs_slicer
def test_a_part_on_a_plate_gets_the_support_and_the_brim_that_it_gets_alone(tmp_path):
    where = printer()
    roof = box(40, 10, 4)
    roof.apply_translation((0, 0, 10))
    tee = trimesh.boolean.union([box(10, 10, 12), roof], engine="manifold")
    plain = Piece("base", part_settings("base", "PLA", where), (Volume("base", box(20, 20, 4)),), (-50.0, 0.0))
    propped = Piece("core_key_1", part_settings("core_key_1", "PLA", where), (Volume("core_key_1", tee),))
    volumes = {}
    for pieces in ((propped,), (plain, propped)):
        path = tmp_path / f"of_{len(pieces)}.3mf"
        write_prusa(Project(path.stem, pieces), path)
        slice_to_gcode(SLICER, path, path.with_suffix(".gcode"), where)
        moves = read_gcode(path.with_suffix(".gcode"))
        volumes[len(pieces)] = {
            kind: float(moves.volume_mm3[moves.kind == number].sum())
            for number, kind in enumerate(moves.kinds)
            if kind in ("Support material", "Skirt/Brim")
        }
    assert volumes[1]["Support material"] > 100 and volumes[1]["Skirt/Brim"] > 10
    assert volumes[2] == pytest.approx(volumes[1], rel=0.01)
