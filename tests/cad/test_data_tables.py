"""Tables of bought parts, electronic parts and robot sides: a bad row is named by its line."""

from __future__ import annotations

import re

import pytest

from cad import bought, lens, materials, robot_sides
from cad.data_table import file_name, read_table
from cad.errors import FileError
from cad.led_ring import parts as led_parts

BOUGHT = (bought.TABLE, bought._dimension, ("part", "dimension"))
LED = (led_parts.TABLE, led_parts._part, ("part",))
M6 = "ISO 4762 M6 x 20"
ROBOT = (robot_sides.TABLE, robot_sides._row, ("pattern", "element"))


@pytest.mark.parametrize(
    ("table", "row", "expected"),
    [
        (BOUGHT, "nut_m5,thickness,thick,E,", "value_mm='thick'"),
        (BOUGHT, "nut_m3,thickness,1.8,S,", "is there twice"),
        (BOUGHT, "nut_m5,thickness,4", "not one value for each column"),
        (LED, "r_two,d,m,n,0603,10,ohm,-1.6,0.8,0.5,E", "length_mm='-1.6'"),
        (LED, "r_two,d,m,n,0603,ten,ohm,1.6,0.8,0.5,E", "value='ten'"),
        (ROBOT, f"mine,screw,4.5,25,45,6.6,11,6,8,{M6},E,", "count='4.5'"),
        (ROBOT, f"mine,screw,4,31,45,6.6,11,6,8,{M6},E,", "hub's edge"),
        (ROBOT, f"mine,bolt,4,25,45,6.6,11,6,8,{M6},E,", "element='bolt'"),
        (ROBOT, f"mine,screw,4,25,45,6.6,6,6,8,{M6},E,", "head_diameter_mm=6 is under 10.3"),
        (ROBOT, "blank,none,0,0,0,0,0,0,0,x,E,", "is there twice"),
        (ROBOT, "mine,screw,4,25,45,6.6,11,6,8,x,E,", "order_as='x' does not state the size of a screw"),
        (ROBOT, "mine,screw,4,25,45,6.6,11,6,8,ISO 4762 M7 x 20,E,", "takes heads of M4, M5, M6, M8"),
        (ROBOT, "mine,screw,4,25,45,6.6,13.5,8,8,ISO 4762 M8 x 20,E,", "hole_diameter_mm=6.6 outside 8.3 to 11"),
        (ROBOT, f"mine,screw,4,25,45,9.5,11,6,8,{M6},E,", "hole_diameter_mm=9.5 outside 6.3 to 8"),
        *(
            (ROBOT, f"mine,screw,4,25,45,6.6,11,{depth},8,{M6},E,", f"head_depth_mm={depth} outside 6 to 15")
            for depth in (-3, 0, 3, 20)
        ),
        (ROBOT, "mine,screw,4,25,45,6.6,11,6,8,ISO 4762 M6 x 25,E,", "enters the robot's flange 11 mm, outside 6"),
        (ROBOT, "mine,screw,4,25,45,6.6,11,6,8,ISO 4762 M6 x 16,E,", "enters the robot's flange 2 mm, outside 6"),
        (ROBOT, "mine,pin,1,25,90,6,0,0,0,x,E,", "order_as='x' does not state the size of a pin"),
        (ROBOT, "mine,pin,1,25,90,6,0,0,0,ISO 2338 8 m6 x 16,E,", "hole_diameter_mm=6 is under the pin's 8"),
        (ROBOT, "mine,pin,1,25,90,6,0,3,0,ISO 2338 6 m6 x 16,E,", "a pin has no head"),
        (BOUGHT, "Nut_M3,height,4,E,", "part='Nut_M3' differs from 'nut_m3', in a row above it, in case"),
        (
            ROBOT,
            "tensegrity arm,pin,1,25,90,6,0,0,0,ISO 2338 6 m6 x 16,E,",
            "pattern='tensegrity arm' differs",
        ),
    ],
)
def test_a_bad_row_is_named_by_its_line(table, row, expected, tmp_path):
    path, make, key = table
    copy = tmp_path / path.name
    copy.write_text(path.read_text() + row + "\n")
    line = len(copy.read_text().splitlines())
    with pytest.raises(FileError, match=rf"{path.name} line {line} \(.*") as caught:
        read_table(copy, make, *key)
    assert expected in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        (
            ("mine,screw,4,15.75,45,5.5,9.25,5,8,ISO 4762 M5 x 20,E,",),
            "open into the cable's bore of 34 mm",
        ),  # ISO 9409-1-31.5-4-M5
        (("mine,screw,4,25,0,6.6,11.25,6,8,ISO 4762 M6 x 20,E,",), "opens into the cable's groove at azimuth 0"),
        (("mine,screw,8,25,22.5,6.6,11.25,6,8,ISO 4762 M6 x 20,E,",), "opens into the cable's groove at azimuth 0"),
        (("mine,screw,12,25,30,6.6,12.5,6,8,ISO 4762 M6 x 20,E,",), "opens into the cable's groove at azimuth 0"),
        (
            ("mine,screw,4,25,45,6.6,11.25,6,8,ISO 4762 M6 x 20,E,", "mine,pin,1,25,60,6,0,0,0,ISO 2338 6 m6 x 16,E,"),
            "open into each other",
        ),
        (
            ("mine,screw,2,25,45,6.6,11.25,6,8,ISO 4762 M6 x 20,E,", "mine,pin,1,25,90,6,0,0,0,ISO 2338 6 m6 x 16,E,"),
            None,
        ),
        (
            ("mine,screw,2,25,180,6.6,11.25,6,8,ISO 4762 M6 x 20,E,",),
            "opens into the cable's groove at azimuth 0",
        ),  # the other at 0
    ],
)
def test_holes_of_a_robots_side_stay_holes(rows, expected, tmp_path, monkeypatch):
    copy = tmp_path / "robot_sides.csv"
    copy.write_text(robot_sides.TABLE.read_text() + "".join(f"{row}\n" for row in rows))
    monkeypatch.setattr(robot_sides, "TABLE", copy)
    read = robot_sides.robot_sides.__wrapped__
    if expected is None:
        assert len(read()["mine"]) == len(rows)
        return
    with pytest.raises(FileError, match=rf"robot_sides.csv line \d+ \(mine .*{expected}"):
        read()


@pytest.mark.parametrize(
    "table", [BOUGHT, LED, (lens.TABLE, lens._module, ()), (materials.TABLE, materials._silicone, ())]
)
def test_a_table_that_a_spreadsheet_saved_with_a_byte_order_mark_reads_as_before(table, tmp_path):
    path, make, key = table
    copy = tmp_path / path.name
    copy.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert read_table(copy, make, *key) == read_table(path, make, *key)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda text: text.replace(",", ";"), "has semicolons or tabs between its columns: save it with commas"),
        (lambda text: text.replace(",", "\t"), "has semicolons or tabs"),
        (lambda text: text.replace("board_mm,", "board_mm,board_mm,", 1), "has the column 'board_mm' twice"),
        (lambda text: text.splitlines()[0] + "\n", "has no row"),
        (lambda text: text.replace("M-L180,", "M-L180 ,", 1), "spaces before or after its name"),
        (lambda text: text.replace(",32,", ",3_2,", 1), "board_mm='3_2' is not a positive number"),
        (lambda text: text.replace(",32,", ",\uff13\uff12,", 1), "is not a positive number"),
    ],
)
def test_what_spreadsheets_and_hands_do_to_a_table_is_named(change, expected, tmp_path):
    copy = tmp_path / "cameras.csv"
    text = lens.TABLE.read_text(encoding="utf-8")
    assert change(text) != text
    copy.write_text(change(text), encoding="utf-8")
    with pytest.raises(FileError, match=r"^cameras\.csv") as caught:
        read_table(copy, lens._module)
    assert expected in str(caught.value) and "\n" not in str(caught.value)


def test_every_row_names_files_of_its_own_and_names_without_loss_keep_theirs():
    kept = {"Dragon Skin 30": "Dragon-Skin-30", "iso_9409_1_50_4_m6": "iso-9409-1-50-4-m6"}
    assert {name: file_name(name) for name in kept} == kept
    lost = ["Силикон А", "Силикон Б", "Köraform 42 A", "Küraform 42 A", "K-raform 42 A"]
    named = [file_name(name) for name in lost]
    assert len(set(named)) == len(lost) and named[-1] == "K-raform-42-A"
    assert all(re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9.-]*", name) for name in named)
    assert named == [file_name(name) for name in lost]  # the same in every run
