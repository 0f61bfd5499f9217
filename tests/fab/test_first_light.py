"""The build sheet's chapter of the first frame: what can be read off a frame, and what its commands do."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from cad.dots import dot_pattern, ring_count
from cad.lens import VARIABLE, camera_module, camera_modules
from cad.mold.core import REMOVAL_ORDER
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.build_sheet import finishing
from fab.build_sheet.blocks import Drawing, Paragraph, Step, Table
from fab.build_sheet.casting import silicone
from fab.build_sheet.commands import weights_g
from fab.build_sheet.data import SheetData
from fab.build_sheet.dots import first_light
from fab.build_sheet.finishing import edge_words, light_check, painting
from fab.build_sheet.lighting import led_ring
from fab.build_sheet.prints import prints
from fab.build_sheet.shopping import bill
from fab.camera_view import FRAME_PX, camera_pixels, disc_px, edge_cuts_px, edge_px, lens_px
from fab.recipe import overflow_of, recipe
from fab.steps.endcap import all_steps
from fab.supplies import supply_lines
from sensing.calibration.picture import draw_fit
from sensing.design.weights import DesignRequest
from sensing.sources.__main__ import main as sources
from sensing.weighing import words as weighing
from sensing.weighing.gain import LEAST_RATIO

PARAMS = EndcapParams(142.0, 7.5)


def sheet(params: EndcapParams = PARAMS) -> tuple[str, dict[str, tuple[str, ...]]]:
    """Running text, and the table's rows by their first cell."""
    blocks = light_check(
        SheetData(MoldLayout(params), {}, None, recipe(2e5, overflow_of(MoldLayout(params))), [], [], [], [], 0.0, {})
    )
    table = next(block for block in blocks if isinstance(block, Table))
    text = " ".join(block.text for block in blocks if isinstance(block, Paragraph))
    return text, {str(row[0]): tuple(map(str, row[1:])) for row in table.rows}


def test_the_edge_is_where_the_circle_meets_the_edges_of_the_frame():
    for radius in edge_px():
        assert radius > FRAME_PX[0] / 2  # wider than the frame: neither centre nor radius can be read off it
        upper, side = edge_cuts_px(radius)
        assert (320 - upper) ** 2 + 240**2 == pytest.approx(radius**2) == 320**2 + (240 - side) ** 2
    words = sheet()[1]["edge of the bright disc"][0]
    assert words == edge_words() and "73 to 92 px from each corner" in words and "113 to 155 px" in words


def test_the_edge_of_another_lens_is_its_circle_where_that_ends_before_the_shell(monkeypatch):
    monkeypatch.setenv(VARIABLE, "ELP-USBFHD01M-L170")  # circle at 85 degrees, shell's end at 86.4
    module = camera_module()
    assert module.circle_deg == 85.0 and edge_px() == (lens_px(math.radians(85.0)),) * 2
    assert disc_px() == pytest.approx(344.2, abs=0.05)
    assert "arcs that cut the upper and lower edge about 73 px from each corner" in edge_words()
    assert 'r="344"' in first_light(PARAMS).svg


def test_no_edge_is_computed_beyond_what_the_lens_model_holds_for(monkeypatch):
    for name, module in camera_modules().items():
        monkeypatch.setenv(VARIABLE, name)
        assert max(edge_px()) <= lens_px(math.radians(module.max_half_angle_deg))


@pytest.mark.parametrize(
    ("radii", "expected"),
    [
        ((220.0, 230.0), "a whole circle: centre within 10 px of the frame's, radius 220 to 230 px"),
        ((300.0, 310.0), "upper and lower edge 124 to 140 px from each corner, the four alike to 32 px"),
        ((410.0, 420.0), "not in the frame: it lies outside the corners"),
    ],
)
def test_of_another_lens_only_what_is_seen_is_named(radii, expected, monkeypatch):
    monkeypatch.setattr(finishing, "edge_px", lambda: radii)
    assert edge_words().endswith(expected)


@pytest.mark.parametrize(
    ("rings", "left", "limit"),
    [
        (PARAMS.dot_rings, "and as straight to the left", "if it is less than 90°"),
        ((1, 5, 11), "none to the left", "from the dots"),
        ((1, 6, 9), "to the left rings of an even count alone", "if it is less than 60°"),
    ],
)
def test_the_line_of_dots_is_on_the_sides_where_the_drawing_has_it(rings, left, limit):
    params = EndcapParams(142.0, 7.5, rings)
    line, turn = sheet(params)[1]["dots of the common meridian"]
    assert line.endswith(left) and turn.endswith(limit)
    on_left = {dot.ring for dot, (x, y) in camera_pixels(params).items() if x < 319 and abs(y - 240) < 1e-6}
    assert all(ring_count(params, ring) % 2 == 0 for ring in on_left)
    assert bool(on_left) == ("none" not in left)


@pytest.mark.parametrize(
    ("rings", "turned"),
    [
        (PARAMS.dot_rings, "both turned by 180°: turn the board"),
        ((1, 6, 12, 18), "both turned by 60° or a multiple: turn the board"),
        ((1, 5, 9, 11, 14), "both turned alike: leave the camera"),
    ],
)
def test_a_finger_shows_a_camera_half_a_turn_round_and_a_mirrored_picture_which_the_dots_hide(rings, turned):
    """The board fits its posts in four turns, and the sheet named none: fx and fy had the wrong sign, silently."""
    params = EndcapParams(142.0, 7.5, rings)
    good, otherwise = sheet(params)[1]["a second frame, a finger on the dome"]
    places = {round(dot.azimuth_deg, 6): pixel for dot, pixel in camera_pixels(params).items() if dot.ring == 2}
    x, y = places[0.0]
    assert "at the mark 0 it moves the dots at the right" in good and x > 320 and y == pytest.approx(240)
    quarter = min(places, key=lambda azimuth: abs(azimuth - 90.0))
    assert "a quarter turn clockwise from it" in good and "at the bottom" in good and places[quarter][1] > 300
    assert otherwise.startswith(turned) and "one of the two opposite: the picture is mirrored" in otherwise
    looks = [{(d.ring, round(d.azimuth_deg, 4) % 360) for d in dot_pattern(params) if d.ring}]
    for turn, sign in ((180.0, 1.0), (0.0, -1.0)):  # half a turn, a mirror
        looks.append({(ring, round((sign * azimuth + turn) % 360, 4) % 360) for ring, azimuth in looks[0]})
    assert (looks[1] == looks[0]) == ("leave the camera" not in otherwise) and looks[2] == looks[0]


def test_the_sheet_saves_the_frame_with_a_command_that_there_is(tmp_path, capsys):
    text, _ = sheet()
    assert ".venv/bin/python -m sensing.sources save 0 a.jpg" in text
    with pytest.raises(SystemExit) as end:
        sources(["save", "--help"])
    assert end.value.code == 0 and "save one frame" in capsys.readouterr().out.lower()


def test_the_sheet_focuses_the_lens_while_it_can_be_reached_and_checks_it_with_a_command_that_there_is(
    tmp_path, capsys
):
    """No chapter named the focus; closed, the lens is under the dome."""
    params = EndcapParams(142.0, 7.5, (1, 6, 12, 18), 3.5)
    text, rows = sheet(params)
    assert "base off" in rows["focus"][1]
    words = re.search(r"python -m sensing.sources check 0 (.*? --dot-rings 1-6-12-18 --dot-mm 3.5) ", text)[1].split()
    assert sources(["check", str(tmp_path / "missing.jpg"), *words]) == 2
    assert "missing.jpg" in capsys.readouterr().err
    layout = MoldLayout(params)
    data = SheetData(layout, {}, None, recipe(2e5, overflow_of(layout)), [], [], [], [], 0.0, {})
    words = " ".join(block.text for block in finishing.assembling(data) if isinstance(block, Paragraph))
    inner_tip = params.centre_height_mm + params.inner_radius_mm
    assert "Focus the camera before A4" in words and f"page {inner_tip - 17.0:.0f} mm above the lens" in words


def test_no_text_of_the_chapters_has_marks_of_markdown():
    layout = MoldLayout(PARAMS)
    mix, pictures = recipe(2e5, overflow_of(layout)), dict.fromkeys(("dots", "ring_light"), Path("a.png"))
    ways = dict.fromkeys(REMOVAL_ORDER, ())
    data = SheetData(layout, {}, None, mix, [], [], supply_lines(mix, layout), [], 0.0, pictures)
    chapters = (*light_check(data), *painting(data), *led_ring(data), *prints(data), *silicone(data), *bill(data))
    words = str([block for block in chapters if not isinstance(block, Drawing)]) + str(all_steps(layout, ways))
    assert "make setup" in words and "`" not in words and "**" not in words


def test_the_words_of_the_fit_are_those_of_its_drawing_and_the_camera_file_has_its_place():
    text, _ = sheet()
    drawn = re.findall(r"(\w+) (cross|ring) \w+", draw_fit.__doc__)
    assert [word for pair in drawn for word in pair] == ["green", "cross", "gray", "cross", "red", "ring"]
    assert all(f"{colour} {mark}" in text for colour, mark in drawn) and "yellow line" in text
    assert "circles" not in text and "ten times" in text and "10 x residual" in draw_fit.__doc__
    assert 'write camera = "camera.json" under [[endcap]] in endcaps.toml' in text


@pytest.mark.parametrize(
    ("rings", "words"),
    [
        (PARAMS.dot_rings, "2 lines from tip to rim have a dot of every ring, 180° apart"),
        ((1, 6, 12, 18), "6 lines from tip to rim have a dot of every ring, 60° apart"),
        ((1, 5, 9, 11, 14), "One line from tip to rim has a dot of every ring: it is azimuth 0"),
    ],
)
def test_of_equal_lines_of_dots_one_is_chosen_and_marked(rings, words):
    params = EndcapParams(142.0, 7.5, rings)
    layout = MoldLayout(params)
    blocks = painting(
        SheetData(layout, {}, None, recipe(2e5, overflow_of(layout)), [], [], [], [], 0.0, {"dots": Path("dots.png")})
    )
    step = next(block for block in blocks if isinstance(block, Step))
    assert step.lines[1].startswith(words) and "Write 0 at its end" in step.lines[1]
    assert "begin there" in step.lines[1] and "from the tip outward" in step.lines[2]  # chosen before it is painted
    azimuths = [{round(d.azimuth_deg, 6) for d in dot_pattern(params) if d.ring == k} for k in range(1, len(rings))]
    assert len(set.intersection(*azimuths)) == (int(words[0]) if words[0].isdigit() else 1)
    full = sorted(set.intersection(*azimuths))
    midway = [a for a in full if min(abs((a - s + 180) % 360 - 180) for s in params.screw_azimuths_deg) > 17.9]
    for azimuth in midway:  # turned by it, the base's holes meet the nuts, and the dots are where they were
        holes = {round((a + azimuth) % 360.0, 6) for a in params.screw_azimuths_deg}
        assert holes == {round(a % 360.0, 6) for a in params.screw_azimuths_deg}
    assert 0.0 in midway and ("midway between two screw holes" in step.lines[1]) == (len(full) > 1)
    text = " ".join(block.text for block in blocks if isinstance(block, Paragraph))
    assert "Azimuth counts clockwise as you look into the dome, print toward you" in text
    assert "azimuth counts clockwise, as on the gores" in sheet(params)[0]


@pytest.mark.parametrize(
    ("size", "cast_of", "words"),
    [
        ((130.0, 8.0), "Smooth-Sil 950", "540 to 2500 g"),
        ((107.0, 7.3), "Dragon Skin 30", "220 to 1000 g"),
        ((212.0, 6.5), "Ecoflex 00-30", "20 to 96 g"),
        ((250.0, 25.0), "Smooth-Sil 950", "3000 to 6000 g"),
    ],
)
def test_the_weights_that_correct_the_forces_are_those_of_this_endcaps_range(size, cast_of, words):
    """A sheet for softer silicone ended with forces that were off by the difference of its batch, and no word of it."""
    params = EndcapParams(*size)
    assert weights_g(params, cast_of) == words
    range_g = 1000 * DesignRequest(params, cast_of).scale.top_n / weighing.GRAVITY_M_S2
    least_g, most_g = map(float, re.findall(r"\d+", words))
    lightest_g, heaviest_g = (min(max(part * range_g, weighing.LEAST_G), weighing.MOST_G) for part in (0.15, 0.7))
    assert most_g == pytest.approx(heaviest_g, rel=0.05) and most_g > LEAST_RATIO * least_g
    assert least_g == pytest.approx(min(lightest_g, heaviest_g / 2), rel=0.05)


def test_the_last_command_of_the_sheet_corrects_the_forces():
    text, _ = sheet()
    assert text.endswith("-m sensing.weigh --config endcaps.toml") and weights_g(PARAMS, "Smooth-Sil 950") in text
    assert "one near each end of that range" in text  # alike, they are refused
