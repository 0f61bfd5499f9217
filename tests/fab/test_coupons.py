"""Coupons: gaps of the fit steps, gyroid on the bond specimens, planted faults, and the way back into the molds."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
import trimesh
from strict_3mf import read_strictly

import cad.coupons as coupons
from cad.bought import bought_mm
from cad.errors import ParameterError
from cad.interface import POCKET_WIDTH_MM
from cad.materials import DEFAULT_SILICONE, silicone
from cad.mold.layout import JOINT_CLEARANCE_MM, JOINT_CLEARANCE_RANGE_MM, MoldLayout
from cad.params import EndcapParams
from cad.pattern import RELEASED_GYROID
from fab.checks.cavity import LEAK_RATIO, leak_check
from fab.checks.fit import bed_check
from fab.coupons.__main__ import coupon_bom, main
from fab.coupons.checks import closed_share, coupon_checks, solid_checks
from fab.coupons.mesh import with_gyroid
from fab.coupons.projects import write_fit_projects
from fab.meshing.mesh import tessellate
from fab.slice.filaments import filament
from fab.slice.printers import printer
from fab.slice.settings import part_settings

PAGE = Path(__file__).resolve().parents[2] / "docs" / "coupons.md"


@pytest.fixture(scope="module")
def parts():
    return {part.name: part for part in coupons.coupon_parts()}


@pytest.fixture(scope="module")
def tensile(parts):
    return with_gyroid(tessellate(parts["tensile_tpu"].solid), coupons.zones_mm()["tensile_tpu"])[0]


def failed(checks) -> set[str]:
    return {check.name for check in checks if not check.ok}


def test_solids_have_their_closed_form_volumes(parts):
    """Boxes and discs; a socket takes what of its disc lies below the seam that is cut back."""
    for tray in coupons.TRAYS:
        outer = (tray.length_mm + 8) * (tray.width_mm + 8) * (tray.depth_mm + 4)
        hole = math.pi * 16 * 4 if tray.push_mm else 0.0
        inside = tray.length_mm * tray.width_mm * tray.depth_mm
        assert parts[tray.name].solid.volume == pytest.approx(outer - inside - hole, rel=1e-6)
    tab = 16 * math.pi - segment(4.0, 2.48)  # the part of the disc above the seam is inside the handle
    assert parts["fit_tab"].solid.volume == pytest.approx(8 * (12 * 12 + tab), rel=1e-6)
    plate = 84 * 14.0
    for k, gap in enumerate(coupons.CLEARANCES_MM):
        radius, depth = 4.0 + gap, 2.48 - gap
        socket = math.pi * radius**2 - segment(radius, depth)
        plate -= 14 * gap + socket + (k + 1) * 1.2 * 1.0
    assert parts["fit_plate"].solid.volume == pytest.approx(8 * plate, rel=1e-6)


def segment(radius: float, distance: float) -> float:
    """Area of a disc beyond a chord at a distance from its centre."""
    return radius**2 * math.acos(distance / radius) - distance * math.sqrt(radius**2 - distance**2)


def test_every_step_has_its_gap_and_a_shifted_tab_is_seen(parts):
    assert failed(solid_checks(parts)) == set()
    from build123d import Pos

    moved = replace(parts["fit_tab"], solid=Pos(0, 0.1, 0) * parts["fit_tab"].solid)
    assert {f"fit_plate.socket_{k}_gap_mm" for k in range(1, 7)} <= failed(solid_checks({**parts, "fit_tab": moved}))


def test_every_pocket_is_measured_and_one_of_another_width_is_seen(parts, monkeypatch):
    nuts = {"fit_nuts": parts["fit_nuts"]}
    monkeypatch.setattr("fab.coupons.checks.zones_mm", lambda: {})
    pockets = [f"fit_nuts.pocket_{k}_play_mm" for k in range(1, 5)]
    found = coupon_checks(nuts, {"fit_nuts": tessellate(parts["fit_nuts"].solid)})
    assert failed(found) == set() and set(pockets) <= {check.name for check in found}
    widths = coupons.NUT_WIDTHS_MM
    monkeypatch.setattr(coupons, "NUT_WIDTHS_MM", (*widths[:2], widths[2] + 0.05, widths[3]))
    other = coupons.fit_nuts()
    found = coupon_checks({"fit_nuts": replace(parts["fit_nuts"], solid=other)}, {"fit_nuts": tessellate(other)})
    assert failed(found) == {pockets[2]}


def test_specimens_are_the_papers(parts):
    size = parts["tensile_plain_tpu"].solid.bounding_box().size
    assert tuple(size) == pytest.approx((25, 25, 50))
    low, high = coupons.zones_mm()["tensile_tpu"]
    assert high[2] - low[2] == pytest.approx(25)  # interference
    low, high = coupons.zones_mm()["peel_tpu"]
    assert (high[0] - low[0], high[2]) == (pytest.approx(200), pytest.approx(25 - coupons.ARM_MM))
    assert coupons.NUT_WIDTHS_MM[1] == POCKET_WIDTH_MM
    assert min(coupons.NUT_WIDTHS_MM) > bought_mm("nut_m3", "across_flats")


def test_gyroid_on_a_specimen(parts, tensile):
    zone = coupons.zones_mm()["tensile_tpu"]
    assert tensile.is_watertight
    assert tensile.body_count == 1
    extra = tensile.volume - parts["tensile_tpu"].solid.volume
    assert extra / 25**3 == pytest.approx(RELEASED_GYROID, rel=2e-3)
    assert tensile.bounds == pytest.approx(np.array([[-12.5, -12.5, 0], [12.5, 12.5, 50]]), abs=1e-5)
    assert 0.05 < closed_share(tensile, *zone) < 0.35
    section = tensile.section(plane_origin=(0, 0, 37.3), plane_normal=(0, 0, 1)).to_2D()[0]
    assert section.area / 625 == pytest.approx(RELEASED_GYROID, rel=0.25)  # another way: a cut through the zone


def test_a_closed_side_and_an_open_mesh_are_seen(parts, tensile, monkeypatch):
    monkeypatch.setattr("fab.coupons.checks.zones_mm", lambda: {"tensile_tpu": coupons.zones_mm()["tensile_tpu"]})
    only = {"tensile_tpu": parts["tensile_tpu"]}
    assert failed(coupon_checks(only, {"tensile_tpu": tensile})) == set()
    lid = trimesh.creation.box(extents=(25, 25, 1), transform=trimesh.transformations.translation_matrix((0, 0, 49.5)))
    closed = trimesh.boolean.union([tensile, lid], engine="manifold")
    assert {"tensile_tpu.closed_side_share", "tensile_tpu.density_error_ratio"} <= failed(
        coupon_checks(only, {"tensile_tpu": closed})
    )
    torn = trimesh.Trimesh(tensile.vertices, tensile.faces[:-1], process=False)
    assert "tensile_tpu.watertight" in failed(coupon_checks(only, {"tensile_tpu": torn}))


def test_pours_balance():
    """Silicone and TPU of a tensile specimen fill its tray, play included."""
    volumes = {"tensile_tpu": 25**3 * (1 + RELEASED_GYROID), "peel_tpu": 300 * 25 * 5.5 + 0.1 * 200 * 25 * 14}
    lines = {line.item: line for line in coupon_bom({}, volumes, "Smooth-Sil 950", 1.24)}
    wanted = 75.4 * 25.4 * 25 - volumes["tensile_tpu"]
    assert lines["tensile_tray filled"].volume_mm3 == pytest.approx(wanted)
    assert lines["tensile_tray filled"].mass_g == pytest.approx(1.24e-3 * wanted)
    peel = lines["peel_tray filled"].volume_mm3
    assert peel == pytest.approx(300.4 * 25.4 * 25 - volumes["peel_tpu"] - 99.8 * 25 * 14)


def test_the_measured_step_goes_back_into_the_molds():
    layout = MoldLayout(EndcapParams(130, 8), 0.20)
    usual = MoldLayout(EndcapParams(130, 8))
    assert layout.neck_radius_mm == pytest.approx(usual.neck_radius_mm - 0.05)
    assert usual.bowl_wall_mm == 6.0 < layout.bowl_wall_mm < 9.0  # a wider joint leaks more: a longer way through it
    pour_mm3 = 2.8e5  # of this shell
    assert leak_check(layout, pour_mm3).value < LEAK_RATIO
    assert min(coupons.CLEARANCES_MM) == JOINT_CLEARANCE_RANGE_MM[0]
    assert max(coupons.CLEARANCES_MM) == JOINT_CLEARANCE_RANGE_MM[1]
    assert JOINT_CLEARANCE_MM in coupons.CLEARANCES_MM
    for wrong in (0.04, 0.22, 0.31, math.nan):
        with pytest.raises(ParameterError, match=r"joint_clearance=.* outside 0\.05\.\.0\.217 mm a side at D=130 T=8"):
            MoldLayout(EndcapParams(130, 8), wrong)


def test_molds_command_takes_the_clearance(monkeypatch, tmp_path, capsys):
    import fab.molds as molds

    seen = []
    monkeypatch.setattr(molds, "load_libraries", lambda _: None)
    monkeypatch.setattr(molds, "make_molds", lambda variant, *_: seen.append(variant.layout) or "made")
    assert molds.main(["D=130", "T=8", "joint_clearance=0.20", f"exports={tmp_path}", "cache=no"]) == 0
    assert seen[0].joint_clearance_mm == 0.20
    assert [path.name for path in tmp_path.iterdir()] == ["D130_T8_c0.2"]
    assert molds.main(["joint_clearance=0.5"]) == 2
    assert "joint_clearance=0.5 outside 0.05..0.217" in capsys.readouterr().err


def test_the_page_says_which_bed_the_long_prints_need(parts):
    """It named that of the specimen alone; the tray, without which it cannot be cast, is larger."""
    words = PAGE.read_text(encoding="utf-8")
    for name in ("peel_tpu", "peel_tray"):
        side = bed_check(name, tessellate(parts[name].solid)).value
        assert f"({side:.0f} mm square)" in words and side < 256


def test_what_floats_in_the_tray_is_held():
    """Nothing held the TPU in its denser silicone: 12 g of lift on a foot of 15 % infill, 26 on a spacer."""
    assert filament("TPU 95A").density_g_cm3 < silicone(DEFAULT_SILICONE).density_g_cm3
    words = " ".join(PAGE.read_text(encoding="utf-8").split())
    assert "Stick the TPU to the tray, and the spacer to the TPU" in words
    assert words.index("Stick the TPU") < words.index("silicone to the brim")


def test_bad_options(capsys, tmp_path):
    assert main(["material=dragn skin 30", f"exports={tmp_path}"]) == 2
    assert "material=dragn skin 30 is not in cad/materials.csv: did you mean Dragon Skin 30" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
    assert json.dumps(coupons.CLEARANCES_MM) == "[0.05, 0.1, 0.15, 0.2, 0.25, 0.3]"


def test_a_failed_check_leaves_nothing(monkeypatch, capsys, tmp_path):
    import fab.coupons.checks
    import fab.coupons.mesh
    from fab.checks.check import Check

    box = trimesh.creation.box(extents=(25, 25, 25))
    monkeypatch.setattr(fab.coupons.mesh, "coupon_meshes", lambda parts: ({name: box for name in parts}, {}))
    monkeypatch.setattr(
        fab.coupons.checks, "solid_checks", lambda _: [Check("fit_plate.socket_3_gap_mm", 0.2, 0.1, 0.15)]
    )
    monkeypatch.setattr(fab.coupons.checks, "coupon_checks", lambda *_: [])
    assert main([f"exports={tmp_path}"]) == 1
    assert "fit_plate.socket_3_gap_mm = 0.2, wanted 0.1 .. 0.15" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_fit_coupons_have_projects_with_the_settings_of_what_they_stand_for(parts, tmp_path):
    """Printed with a slicer's own settings, a coupon fits another step than the molds."""
    meshes = {name: tessellate(parts[name].solid) for name in ("fit_plate", "fit_tab", "fit_nuts")}
    where = printer("a1_mini")
    files = write_fit_projects(meshes, where, tmp_path)
    assert sorted(files) == sorted(path.name for path in tmp_path.iterdir()) and len(files) == 4
    same = ("perimeters", "perimeter_generator", "elefant_foot_compensation", "xy_size_compensation", "temperature")
    for name, part, material in (("fit_joints", "cup_collar_1", "PLA"), ("fit_nuts", "interface", "TPU 95A")):
        config = ZipFile(tmp_path / f"{name}.prusa.3mf").read("Metadata/Slic3r_PE.config").decode()
        found = dict(line[2:].split(" = ", 1) for line in config.splitlines())
        wanted = part_settings(part, material, where).prusa()
        assert [found[key] for key in same] == [wanted[key] for key in same]
        assert found["bed_shape"] == "0x0,180x0,180x180,0x180"
    placed = read_strictly(tmp_path / "fit_joints.prusa.3mf").GetBuildItems()
    middles = []
    while placed.MoveNext():
        middles.append(placed.GetCurrent().GetObjectTransform().Fields[3][:2])
    depths = [meshes[name].extents[1] for name in ("fit_plate", "fit_tab")]
    assert abs(middles[0][1] - middles[1][1]) >= sum(depths) / 2 + 3
    assert all(y - depth / 2 > 0 and y + depth / 2 < 180 for (_, y), depth in zip(middles, depths, strict=True))


def test_an_unknown_printer_of_the_coupons_is_refused_before_anything_is_made(capsys, tmp_path):
    assert main(["printer=mk5", f"exports={tmp_path}"]) == 2
    assert "printer=mk5 is not in fab/slice/printers.csv" in capsys.readouterr().err and not list(tmp_path.iterdir())


def test_the_page_corrects_outlines_by_half_the_difference(parts):
    """Both parts of a joint give way: the gap grows by twice the correction on each side."""
    words = " ".join(PAGE.read_text(encoding="utf-8").split())
    found = re.search(r"e\.g\. (-[0-9.]+) mm for ([0-9.]+) where ([0-9.]+) is allowed", words)
    correction, fits, allowed = (float(number) for number in found.groups())
    assert allowed - 2 * correction == pytest.approx(fits)
