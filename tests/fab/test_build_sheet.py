"""The build sheet: dots on paper, both printers on a small document, the whole command on a tiny export."""

from __future__ import annotations

import math
import re
import zlib
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from cad.dots import dot_pattern
from cad.lens import camera_module
from cad.mold.core import REMOVAL_ORDER
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from cad.robot_sides import robot_words
from fab import camera_view
from fab.bom import bom_lines
from fab.build_sheet import __main__ as command
from fab.build_sheet.blocks import Document, Heading, Paragraph, Picture, Step, Table
from fab.build_sheet.commands import make_command
from fab.build_sheet.content import short_limit
from fab.build_sheet.data import SheetData
from fab.build_sheet.dots import ruler
from fab.build_sheet.finishing import light_check, painting
from fab.build_sheet.html import write_html
from fab.build_sheet.lighting import led_ring, ring_checks
from fab.build_sheet.pdf import write_pdf
from fab.build_sheet.pictures import fill_depth_mm, poured_mesh
from fab.build_sheet.prints import prints
from fab.build_sheet.steps import filled
from fab.camera_view import camera_pixels
from fab.led_ring.driver import fitted_driver
from fab.led_ring.light import dome_light
from fab.recipe import overflow_of, recipe
from fab.steps.cast import cast_steps
from sensing.wrench.weight_files import find_weights

PARAMS = EndcapParams(130.0, 8.0)
MIX = recipe(2e5, overflow_of(MoldLayout(PARAMS)))


@pytest.mark.parametrize(("robot", "count"), [("iso_9409_1_50_4_m6", 5), ("tensegrity_arm", 7), ("blank", 0)])
def test_the_sheet_buys_and_names_what_holds_the_adapter_on_the_robot(robot, count):
    data = SheetData(MoldLayout(PARAMS), {"robot": robot}, None, MIX, [], [], [], [], 0.0, {})
    words = filled(data, ("{robot}: {robot_fixing}",))[0]
    named = robot_words(robot).removeprefix("flange ") if count else "your own robot"
    assert words.startswith(f"{named}: ") and ("drill it" in words) == (count == 0)
    lines = bom_lines(data.layout, {"parts": [], "robot": robot}, [], data.recipe, None)
    assert sum(line.quantity for line in lines if line.owner == "robot") == count
    is_tight = robot == "iso_9409_1_50_4_m6"  # its hole is 6.0 for a pin 6 m6; that of the tensegrity arm is 6.3
    assert ("ream the pin's hole to 6 mm H7" in words) == is_tight
    assert [line.kind for line in lines if line.order_as == "6 mm H7, turned by hand"] == ["tool"] * is_tight


def test_the_wells_are_said_to_hold_no_more_than_is_poured():
    data = SheetData(MoldLayout(PARAMS), {}, None, MIX, [], [], [], [], 0.0, {})
    closed = next(step for step in cast_steps(data.layout, dict.fromkeys(REMOVAL_ORDER, ())) if step.key == "closed")
    lines = filled(data, [line for line in closed.lines if "screws" not in line])
    poured, room, leak = (float(x) for x in re.findall(r"([\d.]+) ml", " ".join(lines)))
    wells = 10 * math.pi * 3.5**2 * 4.0 / 1000
    assert poured > room - wells + leak + wells / 2  # gap and vents are full, the largest leak is lost: a well shows
    assert poured == pytest.approx((MIX.poured_g - MIX.expected_g) / MIX.silicone.density_g_cm3, abs=0.05)


def test_the_commands_of_a_sheet_carry_dots_of_ones_own():
    params = EndcapParams(130.0, 8.0, dot_mm=3.5)
    data = SheetData(MoldLayout(params), {}, None, MIX, [], [], [], [], 0.0, {})
    text = " ".join(block.text for block in light_check(data) if isinstance(block, Paragraph))
    design = "--diameter 130 --wall 8 --dot-mm 3.5"
    assert f"-m sensing.calibrate {design} " in text and f"-m sensing.setup {design} " in text


def words_of(data: SheetData) -> str:
    return " ".join(block.text for block in light_check(data) if isinstance(block, Paragraph))


@pytest.mark.parametrize("material", ["Smooth-Sil 950", "Dragon Skin 30"])
@pytest.mark.parametrize("params", [PARAMS, EndcapParams(142.0, 7.5), EndcapParams(130.0, 8.0, dot_mm=3.5)])
def test_weights_are_made_before_setup_where_none_ship(params, material, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))  # what this user trained does not count
    data = SheetData(MoldLayout(params), {}, None, recipe(2e5, MIX.overflow, material), [], [], [], [], 0.0, {})
    text = words_of(data)
    assert ("make train" in text) == (find_weights(params, material) is None)
    if "make train" in text:
        assert text.index("make train") < text.index("sensing.setup")


def test_the_gyroid_asks_for_no_weights_of_its_own():
    params = EndcapParams(130.0, 8.0, gyroid=0.12)
    data = SheetData(MoldLayout(params), {}, None, MIX, [], [], [], [], 0.0, {})
    assert "make train" not in words_of(data)


def test_with_another_camera_the_commands_name_it_and_photos_of_the_released_sensor_do_not_count(monkeypatch):
    data = SheetData(MoldLayout(PARAMS), {}, None, MIX, [], [], [], [], 0.0, {})
    assert "released sensor: 92" in str(light_check(data)) and "ENDCAP_CAMERA" not in str(light_check(data))
    monkeypatch.setenv("ENDCAP_CAMERA", "ELP-USBFHD01M-L170")
    text = str(light_check(data))
    assert text.count("ENDCAP_CAMERA=ELP-USBFHD01M-L170 .venv/bin/python -m ") == 5
    assert "released sensor: 92" not in text
    assert make_command("slice", data).startswith("ENDCAP_CAMERA=ELP-USBFHD01M-L170 make slice D=130 T=8")


def test_dots_that_a_narrow_lens_does_not_see_are_painted_and_not_counted(monkeypatch):
    narrow = replace(camera_module(), max_half_angle_deg=60.0)
    monkeypatch.setattr(camera_view, "camera_module", lambda: narrow)
    data = SheetData(MoldLayout(PARAMS), {}, None, MIX, [], [], [], [], 0.0, {"dots": Path("dots.png")})
    table = next(block for block in painting(data) if isinstance(block, Table))
    assert sum(int(row[1]) for row in table.rows) == len(dot_pattern(PARAMS)) > len(camera_pixels(PARAMS))
    assert table.rows[0][3] == "1" and table.rows[-1][3] == "0"


def test_the_poured_silicone_has_its_volume_and_fills_to_the_depth():
    layout = MoldLayout(PARAMS)
    half = 2 / 3 * math.pi * PARAMS.outer_radius_mm**3
    assert fill_depth_mm(layout, half) == pytest.approx(0.0, abs=1e-6)
    depth = fill_depth_mm(layout, 325_000.0)
    assert poured_mesh(layout, depth).volume == pytest.approx(325_000.0, rel=0.01)


@pytest.fixture
def document(tmp_path):
    picture = tmp_path / "a.jpg"
    Image.new("RGB", (40, 30), (200, 90, 20)).save(picture)
    blocks = (
        Heading("Print", 1),
        Paragraph('Open <part>.3mf & say "yes" #1 \\ $2 °'),
        Picture(picture, "a picture"),
        Table(("", "item"), ((picture, "M3 x 12"), ("", "[nut]")), (1, 2)),
        Step("C1", "Pour", ("slowly", "*not* over the seam_"), picture),
        ruler(),
    )
    return Document("Endcap D = 130", "a test", blocks)


def test_html_is_one_file_with_every_word_escaped(document, tmp_path):
    path = tmp_path / "a.html"
    write_html(document, path)
    text = path.read_text()
    assert "Open &lt;part&gt;.3mf &amp; say" in text and "C1 Pour" in text and "<svg" in text
    assert text.count("data:image/jpeg;base64,") == 3
    assert not re.search(r'(src|href)="(?!data:)', text)


def test_a_limit_takes_one_line_of_the_appendix():
    limits = ["0.0989997 .. 0.101", ">= 0.8", "= 34", "<= 0.408451", "<= 1e-05", "5.75 .. 37"]
    assert [short_limit(limit) for limit in limits] == ["0.099 .. 0.101", *limits[1:3], "<= 0.4085", *limits[4:]]


def test_pdf_has_pages_pictures_and_the_same_bytes_twice(document, tmp_path):
    pytest.importorskip("typst")
    paths = [tmp_path / name for name in ("a.pdf", "b.pdf")]
    for path in paths:
        write_pdf(document, path)
    data = paths[0].read_bytes()
    assert data.startswith(b"%PDF") and data.rstrip().endswith(b"%%EOF") and b"/Image" in data
    assert data == paths[1].read_bytes()
    parts = [part.split(b"endstream")[0] for part in re.split(rb"stream\r?\n", data)[1:]]
    inside = b"".join(zlib.decompressobj().decompress(part) for part in parts if part[:1] == b"x")
    alternatives = re.findall(rb"/Alt ?\((.*?)\)", inside)  # for screen readers, as in the HTML
    ruler_says = b"100 mm: if this measures otherwise, print again at 100 %"
    assert sorted(alternatives) == [ruler_says, b"Pour", b"a", b"a"]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["D=130", "T=99"], "T=99 outside"),
        (["material=Butter"], "material=Butter is not in cad/materials.csv"),
        (["paper=A3"], "'paper=A3' is not an option"),
        (["printer=mk5"], "printer=mk5 is not in"),
        (["printer=mk4"], "run `make molds D=130 T=8 exports={exports}` first"),
        ([], "run `make molds D=130 T=8 exports={exports}` first"),
    ],
)
def test_bad_input_gets_one_line_status_2_and_no_files(words, expected, tmp_path, capsys):
    assert command.main([*words, f"exports={tmp_path}"]) == 2
    err = capsys.readouterr().err
    assert len(err.splitlines()) == 1 and expected.format(exports=tmp_path) in err and list(tmp_path.iterdir()) == []


def ring_data(params):
    return SheetData(MoldLayout(params), {}, None, MIX, [], [], [], [], 0.0, {"ring_light": Path("none.png")})


def test_the_ring_of_the_sheet_is_the_ring_that_is_made():
    blocks = led_ring(ring_data(PARAMS))
    text = next(block.text for block in blocks if isinstance(block, Paragraph))
    driver = fitted_driver()
    assert f"R1 = {driver.r_set_ohm:g} ohm" in text and f"draws {1e3 * driver.input_a:.0f} mA" in text
    parts, table = (block for block in blocks if isinstance(block, Table))
    assert parts.rows[0][0] == "1 x U1" and not any("any" in cell for row in parts.rows for cell in row)
    light = dome_light(PARAMS, 6)
    assert table.rows[0] == ("6", f"{100 * light.ripple:.0f} %", f"{light.darkest:.2f}", f"{light.brightest:.2f}")
    assert all(check.ok for check in ring_checks(PARAMS))


def test_a_wrong_resistor_fails_the_gates_of_the_sheet(monkeypatch):
    wrong = replace(fitted_driver(), r_set_ohm=4.7)
    monkeypatch.setattr("fab.build_sheet.lighting.fitted_driver", lambda: wrong)
    assert any(not check.ok for check in ring_checks(PARAMS))


PIECE = {"name": "base", "settings": {"walls": 3, "density_percent": 80.0, "pattern": "grid", "brim_mm": 0.0,
         "support": False, "grow_mm": 0.0}, "own_settings": {}}  # fmt: skip
SLICED = {
    "printer": {"name": "a1_mini", "title": "A1 mini", "size": "180", "nozzle_mm": 0.4, "prusa_printer": "",
                "orca_printer": ""},
    "slicer": "PrusaSlicer",
    "projects": [{"name": "base", "layer_mm": 0.2, "material": "PLA", "pieces": [PIECE, PIECE], "time_s": 60.0,
                  "grams": 1.0, "zone": None}],
}  # fmt: skip


@pytest.mark.parametrize(
    ("sliced", "manifest", "asked", "slices"),
    [
        (SLICED, {}, "", "make slice D=142 T=7.5 printer=a1_mini plates=single"),
        (None, {"printer": "mk4"}, "", "run make slice D=142 T=7.5 printer=mk4, then make sheet"),
        (None, {"printer": "mk4"}, "x1c", "run make slice D=142 T=7.5 printer=x1c, then make sheet"),
        (None, {"printer": "mk4"}, "generic256", "run make slice D=142 T=7.5 printer=generic256, then make sheet"),
        (None, {}, "", "run make slice D=142 T=7.5, then make sheet"),
    ],
)
def test_the_sheet_slices_for_the_printer_that_it_is_made_for(sliced, manifest, asked, slices):
    layout = MoldLayout(EndcapParams(142.0, 7.5))
    data = SheetData(layout, manifest, sliced, MIX, [], [], [], [], 0.0, {}, asked_printer=asked)
    text = " ".join(block.text for block in prints(data) if isinstance(block, Paragraph))
    assert slices in text
    assert ("Another printer: make slice D=142 T=7.5 printer=NAME" in text) == (sliced is not None)


def test_plates_of_one_part_are_not_offered_once_more():
    single = {**SLICED, "projects": [{**SLICED["projects"][0], "pieces": [PIECE]}]}
    for sliced in (SLICED, single):
        data = SheetData(MoldLayout(PARAMS), {}, sliced, MIX, [], [], [], [], 0.0, {})
        text = " ".join(block.text for block in prints(data) if isinstance(block, Paragraph))
        assert ("plates=single" in text and "A plate is lost" in text) == (sliced is SLICED)


@pytest.mark.parametrize(("gyroid", "wanted"), [(0.1, "10"), (0.12, "12"), (0.093, "9.3")])
def test_the_filling_of_the_zone_is_compared_with_that_of_this_endcap(gyroid, wanted):
    zone = {"fraction": gyroid, "open_share": 0.95}
    interface = {"name": "interface_infill", "material": "TPU 95A", "pieces": [], "time_s": 60.0, "grams": 1.0}
    sliced = {**SLICED, "projects": [*SLICED["projects"], {**interface, "layer_mm": 0.2, "zone": zone}]}
    layout = MoldLayout(EndcapParams(130.0, 8.0, gyroid=gyroid))
    text = " ".join(
        block.text
        for block in prints(SheetData(layout, {}, sliced, MIX, [], [], [], [], 0.0, {}))
        if isinstance(block, Paragraph)
    )
    assert f"{100 * gyroid:.2f} % of the zone is printed (wanted {wanted}), 95.0 % of its boundary is open" in text


def test_every_command_names_this_endcap_and_the_interpreter_that_make_set_up():
    params = EndcapParams(150.0, 9.0)
    material = "Dragon Skin 30"
    data = SheetData(
        MoldLayout(params, 0.1, material),
        {"robot": "blank"},
        None,
        recipe(2e5, MIX.overflow, material),
        [],
        [],
        [],
        [],
        0.0,
        {"ring_light": Path("none.png")},
        exports_option=" exports='my endcaps'",
    )
    blocks = [*prints(data), *light_check(data), *led_ring(data)]
    text = " ".join(block.text for block in blocks if isinstance(block, Paragraph))
    variant = "D=150 T=9 joint_clearance=0.1 material='Dragon Skin 30' robot=blank exports='my endcaps'"
    commands = re.findall(r"make (?:molds|slice|sheet|ring)[^,;.]*|\S*python -m \S+", text)
    assert len(commands) == 10
    assert any("-m sensing.weigh" in command for command in commands)
    assert "make train D=150 T=9 material='Dragon Skin 30'" in text
    assert "-m sensing.setup --diameter 150 --wall 9 --silicone 'Dragon Skin 30'" in text
    assert f"make slice {variant}, then make sheet {variant} again" in text
    assert "make ring D=150 T=9 exports='my endcaps' writes" in text
    assert ".venv/bin/python -m sensing.calibrate --diameter 150 --wall 9 --photo a.jpg" in text
