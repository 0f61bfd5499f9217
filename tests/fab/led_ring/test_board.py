"""The LED ring's board: files read by another reader, nets found from copper, planted faults, light on the dome."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from zipfile import ZipFile

import numpy as np
import pytest
from shapely import LineString, Point, Polygon, unary_union

from cad.errors import FileError, ParameterError
from cad.led_ring.board import BOARD_INNER_RADIUS_MM, BOARD_OUTER_RADIUS_MM, BOARD_THICKNESS_MM, led_ring_part
from cad.led_ring.placement import placements
from cad.lens import camera_module
from cad.params import EndcapParams
from fab.build_sheet.lighting import ring_checks
from fab.led_ring.__main__ import main
from fab.led_ring.copper import Track, Via, build_copper
from fab.led_ring.gerber import board_files, read_archive, regions, write_archive
from fab.led_ring.kicad import kicad_checks, write_project
from fab.led_ring.light import CONTRAST, INK_SHARE, RIPPLE, dome_light, irradiance, light_checks
from fab.led_ring.rules import edge_distance_mm, envelope, rule_checks
from fab.led_ring.silk import PAD_GAP_MM, WORDS, word


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    path = tmp_path_factory.mktemp("ring") / "ring.zip"
    write_archive(board_files(build_copper()), path)
    return path


FACE = Point(0, 0).buffer(BOARD_OUTER_RADIUS_MM) - Point(0, 0).buffer(BOARD_INNER_RADIUS_MM)


def failed_rules(copper, tmp_path, places=None) -> set[str]:
    write_archive(board_files(copper), tmp_path / "board.zip")
    layers, holes = read_archive(tmp_path / "board.zip")
    return {c.name for c in rule_checks(layers, holes, copper.pads, places or placements()) if not c.ok}


def read_gerber(text: str) -> tuple[float, float]:
    """Area of dark lines, flashes and regions, and length of arcs drawn; a strict reader of the few commands we use."""
    shapes, widths, tool, at, region = [], {}, "", (0.0, 0.0), None
    arc_mm = 0.0
    assert "%FSLAX45Y45*%" in text
    assert "%MOMM*%" in text
    for line in text.split("\n"):
        if not line or line.startswith(("G04", "%TF", "%FS", "%MO")):
            continue
        assert line.endswith(("*", "%")), line  # every command is ended
        if found := re.fullmatch(r"%ADD(\d+)C,([\d.]+)\*%", line):
            widths[found[1]] = float(found[2])
        elif found := re.fullmatch(r"D(\d\d)\*", line):
            tool = found[1]
        elif line == "G36*":
            region = []
        elif line == "G37*":
            shapes.append(Polygon(region).buffer(0))
            region = None
        elif found := re.fullmatch(r"(?:X(-?\d+))?(?:Y(-?\d+))?(?:I(-?\d+))?(?:J(-?\d+))?D0(\d)\*", line):
            to = tuple(
                int(v) / 1e5 if v else 0.0 if v is None and k < 0 else at[k] for k, v in enumerate(found.groups()[:2])
            )
            if found[5] == "3":
                shapes.append(Point(to).buffer(widths[tool] / 2, 32))
            elif found[5] == "1" and found[3] is not None:
                arc_mm += math.pi * math.hypot(int(found[3]), int(found[4] or 0)) / 1e5
            elif found[5] == "1" and region is None:
                shapes.append(LineString([at, to]).buffer(widths[tool] / 2, 32))
            if region is not None:
                region.append(to)
            at = to
        else:
            assert line in ("G75*", "G01*", "G02*", "G03*", "%LPD*%", "M02*"), line
    return unary_union(shapes).area, arc_mm


def test_every_layer_says_the_same_to_another_reader(archive):
    layers, holes = read_archive(archive)
    with ZipFile(archive) as files:
        for name, area in layers.items():
            text = files.read(f"led_ring-{name}.gbr").decode()
            assert "%ADD" in text, name  # without an aperture gerbv takes the file for RS-274D
            other, arc_mm = read_gerber(text)
            if name == "Edge_Cuts":
                assert arc_mm == pytest.approx(area.length, rel=1e-4)
            else:
                assert other == pytest.approx(area.area, rel=2e-4)
        drill = files.read("led_ring-drill_plated.drl").decode()
    assert len(re.findall(r"^X-?[\d.]+Y-?[\d.]+$", drill, re.M)) == len(holes) == 7
    assert "METRIC" in drill


def test_the_kicad_board_is_the_gerber_files_and_a_moved_pad_or_a_wrong_net_shows(archive, tmp_path):
    layers, _ = read_archive(archive)
    write_project(build_copper(), 9, tmp_path)
    path = tmp_path / "led_ring.kicad_pcb"
    assert [check.name for check in kicad_checks(path, layers, 9) if not check.ok] == []
    good = path.read_text()
    found = re.search(r'\(pad "K" smd rect \(at (-?[\d.]+) ', good)
    path.write_text(good[: found.start(1)] + f"{float(found[1]) + 0.05:.6f}" + good[found.end(1) :])
    assert [c.name for c in kicad_checks(path, layers, 9) if not c.ok] == ["ring.kicad_f_copper_difference_mm2"]
    net = re.search(r'\(net (\d+) "FB"\)\)', good)
    path.write_text(good[: net.start()] + '(net 1 "VIN"))' + good[net.end() :])
    assert [c.name for c in kicad_checks(path, layers, 9) if not c.ok] == ["ring.kicad_wrong_pins"]
    path.write_text(good.replace(" (filled_areas_thickness no)", ""))  # KiCad draws the plane half a line wider
    assert [c.name for c in kicad_checks(path, layers, 9) if not c.ok] == ["ring.kicad_b_copper_difference_mm2"]
    path.write_text(good.replace("(size ", "(size wide ", 1))
    with pytest.raises(FileError, match="cannot be read as a KiCad board"):
        kicad_checks(path, layers, 9)


def test_board_is_the_cad_part(archive):
    layers, _ = read_archive(archive)
    solid = led_ring_part(EndcapParams(130, 8)).solid
    bare = solid.volume - sum(p.part.length_mm * p.part.width_mm * p.part.height_mm for p in placements())
    assert layers["Edge_Cuts"].area == pytest.approx(bare / BOARD_THICKNESS_MM, rel=1e-4)


def test_every_part_of_the_driver_has_its_name_beside_it_and_off_the_solder():
    names = {text: word(text, s, t, side) for text, s, t, side in WORDS}
    copper = build_copper()
    holes = unary_union([via.shape for via in copper.vias])
    driver = [place for place in placements() if not place.reference.startswith("LED")]
    assert names.keys() - {place.reference for place in driver} == {"5V", "GND"}
    for place in driver:
        name = names[place.reference]
        others = [other for other in placements() if other.side == place.side]
        nearest = min(others, key=lambda other: envelope(other).distance(name))
        assert nearest.reference == place.reference
        assert not name.intersects(envelope(place)) and FACE.contains(name)
        lands = unary_union([pad.shape for pad in copper.pads if pad.side == place.side])
        assert name.difference(lands.buffer(PAD_GAP_MM)).difference(holes).area > 0.99 * name.area


def test_a_board_of_six_breaks_no_rule(tmp_path):
    assert failed_rules(build_copper(6), tmp_path, placements(6)) == set()


def test_a_trace_near_the_edge_or_beyond_it(tmp_path):
    copper = build_copper()
    stray = Track("N1", "top", ((-38.4, 0.0), (-35.5, 0.0)), 0.3)  # from the string's track to the rim
    assert failed_rules(replace(copper, tracks=(*copper.tracks, stray)), tmp_path) >= {"ring.copper_to_edge_mm"}
    assert edge_distance_mm(replace(stray, points=((-39.5, 0.0), (-35.5, 0.0))).shape, FACE) < -0.9


def test_shorts_opens_and_bad_holes(tmp_path):
    copper = build_copper()
    cut = replace(copper, tracks=tuple(t for t in copper.tracks if t.net != "N4"))
    assert failed_rules(cut, tmp_path) == {"ring.open_nets"}
    pads = {(p.reference, p.pin): p for p in copper.pads}
    bridge = Track("FB", "top", (pads["U1", "6"].centre, pads["U1", "5"].centre), 0.2)
    assert "ring.shorted_nets" in failed_rules(replace(copper, tracks=(*copper.tracks, bridge)), tmp_path)
    near = pads["LED5", "K"].centre
    rim = Via("N5", (near[0] * 38.3 / 35, near[1] * 38.3 / 35))
    broken = failed_rules(replace(copper, vias=(*copper.vias, rim)), tmp_path)
    assert {"ring.hole_to_edge_mm", "ring.copper_to_edge_mm"} <= broken
    patch = Track("N5", "top", ((0.0, -36.5), (0.5, -36.5)), 0.4)
    assert failed_rules(replace(copper, tracks=(*copper.tracks, patch)), tmp_path) == {"ring.stray_conductors"}
    missing = replace(copper, vias=tuple(v for v in copper.vias if v.net != "VIN"))
    assert "ring.open_nets" in failed_rules(missing, tmp_path)


def test_parts_that_collide_are_seen(tmp_path):
    places = tuple(replace(p, s_mm=-1.0) if p.reference == "U1" else p for p in placements())
    assert "ring.parts_gap_mm" in failed_rules(build_copper(), tmp_path, places)


def test_regions_keep_area_and_have_no_holes():
    shape = Point(0, 0).buffer(10) - Point(3, 1).buffer(2) - Point(-4, 0).buffer(1)
    pieces = regions(shape)
    area = unary_union([Polygon(piece.outline) for piece in pieces]).area
    assert area == pytest.approx(shape.area, rel=1e-9)


def test_a_broken_archive_is_refused(tmp_path, archive):
    with ZipFile(archive) as files, ZipFile(tmp_path / "half.zip", "w") as half:
        for name in files.namelist()[:-3]:
            half.writestr(name, files.read(name))
    with pytest.raises(FileError, match="not a whole set of board files"):
        read_archive(tmp_path / "half.zip")


def test_a_lambertian_source_on_a_sphere_lights_it_evenly():
    """Integrating sphere: from a point of its wall every other point gets Phi / (4 pi r^2)."""
    rng = np.random.default_rng(1)
    outward = rng.normal(size=(500, 3))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    outward = outward[outward[:, 2] > -0.99]
    radius = 57.0
    wall = radius * outward
    light = irradiance(np.array([0.0, 0.0, -radius]), wall, -outward)
    assert light == pytest.approx(np.full(len(wall), 1 / (4 * math.pi * radius**2)), rel=1e-9)


def test_light_of_the_ring():
    params = EndcapParams(130, 8)
    nine, six = dome_light(params), dome_light(params, 6)
    assert nine.ripple < six.ripple  # more LEDs, less swing
    assert dome_light(params, reflectance=0.0).ripple > nine.ripple  # scattered light evens it out
    orders = sum(0.5**order for order in range(1, 60))  # of the whole flux, scattered again and again
    assert nine.total - nine.direct == pytest.approx(orders / (4 * math.pi * params.inner_radius_mm**2))
    tip = nine.direct[0]  # on the axis every azimuth is the same place
    assert np.ptp(tip) < 1e-12 * tip.mean()
    height = params.tip_height_mm - params.wall_mm - 7.55
    square = height**2 + 35.0**2
    assert tip[0] == pytest.approx(height**2 / (math.pi * square**2), rel=1e-9)


@pytest.mark.parametrize(
    ("diameter", "wall"), [(98.86, 6.5), (99.2, 9.54), (99.54, 9.9), (100.0, 9.99), (250.0, 6.5), (250.0, 25.0)]
)
def test_nine_leds_light_every_size_evenly_enough(diameter, wall):
    """The page of the ring names the worst size, found on a grid over the region."""
    light = dome_light(EndcapParams(diameter, wall))
    assert light.ripple < 0.325 and (light.ripple > 0.315) == (diameter == 99.2)
    assert light.polar_deg[-1] == EndcapParams(diameter, wall).view_rim_polar_deg  # worst there at small D
    assert all(check.ok for check in light_checks(light))


def test_too_few_leds_are_refused_with_a_number_that_does(tmp_path, capsys):
    assert main(["leds=6", "D=99", "T=8", f"exports={tmp_path}"]) == 2
    line = capsys.readouterr().err
    assert "leds=6 lights the rim of D=99 T=8 too unevenly" in line
    fewest = int(line.split("take leds=")[1])
    small = EndcapParams(99.0, 8.0)
    assert [dome_light(small, count).ripple <= RIPPLE for count in (fewest - 1, fewest)] == [False, True]
    darkest_silicone, brightest_dot = 1 - RIPPLE, INK_SHARE * (1 + RIPPLE)
    assert darkest_silicone / brightest_dot == pytest.approx(CONTRAST)


def test_a_camera_that_looks_too_low_for_all_nine_leds_is_named(tmp_path, capsys, monkeypatch):
    low = replace(camera_module(), name="low camera", stack_mm=14.0)
    for user in ("cad.scaling", "fab.led_ring.light"):
        monkeypatch.setattr(f"{user}.camera_module", lambda: low)
    assert main(["D=100", "T=10", f"exports={tmp_path}"]) == 2 and list(tmp_path.iterdir()) == []
    line = capsys.readouterr().err
    assert "leds=9 lights the rim of D=100 T=10 too unevenly" in line
    assert "low camera sees down to it from 14 mm over its seat: take a thinner wall, a larger D" in line
    with pytest.raises(ParameterError, match="a camera with a higher stack"):
        ring_checks(EndcapParams(100.0, 10.0))


def test_command_writes_a_whole_folder_or_nothing(tmp_path, capsys):
    assert main(["leds=10", f"exports={tmp_path}"]) == 2
    assert "leds=10 outside 6..9" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
    assert main([f"exports={tmp_path}"]) == 0
    report = json.loads((tmp_path / "led_ring" / "led_ring.json").read_text())
    assert all(check["ok"] for check in report["checks"])
    assert report["circuit"]["input_a"] < 0.130
    names = {path.name for path in (tmp_path / "led_ring").iterdir()}
    assert names == {
        "led_ring-gerber.zip",
        "led_ring-bom.csv",
        "led_ring.kicad_pcb",
        "led_ring.kicad_pro",
        "led_ring.kicad_sch",
        "led_ring-placement.csv",
        "led_ring.png",
        "led_ring-light.png",
        "led_ring.json",
    }


def test_a_wrong_resistor_in_the_table_stops_the_command(tmp_path, monkeypatch, capsys):
    import fab.led_ring.__main__ as command
    from fab.led_ring.driver import choose_driver

    monkeypatch.setattr(command, "fitted_driver", lambda count: replace(choose_driver(count), r_set_ohm=15.0))
    assert main([f"exports={tmp_path}"]) == 1
    assert "ring.r_set_ohm = 15, wanted = 10" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
