"""Lists of dots and of a board's points that no camera can be found from: one line each, naming what is wrong;
and options beside them that nothing reads."""

import warnings

import numpy as np
import pytest

from cad.errors import FileError, ParameterError
from cad.params import EndcapParams
from sensing import calibrate
from sensing.calibration.dots import CalibrationError, read_dots
from sensing.calibration.from_board import BoardView, calibrate_from_board, find_board, read_views
from sensing.calibration.from_dots import calibrate_from_dots

SIZE = (640, 480)
GRID = np.stack(np.meshgrid(np.arange(4.0), np.arange(4.0)), -1).reshape(-1, 2)


@pytest.mark.parametrize("text", ["nan", "inf", "-inf", "\u0663", "1_0", "", "1e30", "-1e30", "1" * 400])
def test_a_coordinate_that_is_no_place_is_named_by_its_line(tmp_path, text):
    (tmp_path / "dots.csv").write_text(f"u_px,v_px\n1,2\n3,{text}\n", encoding="utf-8")
    with warnings.catch_warnings(), pytest.raises(FileError, match="line 3"):
        warnings.simplefilter("error")
        read_dots(tmp_path / "dots.csv")


@pytest.mark.parametrize("text", ["nan", "inf", "\u0663", "x", "", "1e300"])
def test_a_board_point_that_is_no_number_is_named_by_its_line(tmp_path, text):
    (tmp_path / "board.csv").write_text(f"view,x_mm,y_mm,u_px,v_px\n0,0,0,1,1e-3\n0,1,{text},1,1\n", encoding="utf-8")
    with pytest.raises(FileError, match="line 3"):
        read_views(tmp_path / "board.csv")


@pytest.mark.parametrize("apart_px", [0.0, 1e-9])
def test_dots_that_stand_twice_are_refused(apart_px):
    dots = np.random.default_rng(0).uniform(0, 480, (15, 2))
    with pytest.raises(CalibrationError, match="give each dot once"):
        calibrate_from_dots(np.vstack([dots, dots + apart_px]), EndcapParams(130, 8), SIZE)


@pytest.mark.parametrize(
    ("board_mm", "pixels", "place"),
    [
        (0 * GRID, 50 + 10 * GRID, "on the board"), (GRID * [1, 0], 50 + 10 * GRID, "on the board"),
        (GRID, 0 * GRID, "in the picture"), (GRID, 50 + GRID * [10, 0], "in the picture"),
    ],
)  # fmt: skip
def test_a_view_whose_points_lie_on_one_spot_or_line_is_refused(board_mm, pixels, place):
    good = BoardView(GRID, 50 + 10 * GRID)
    with pytest.raises(CalibrationError, match=f"view 2 of 3: its points lie on one line or spot {place}"):
        calibrate_from_board([good, BoardView(board_mm, pixels), good], SIZE)


@pytest.mark.parametrize("inner", [(0, 0), (1, 1), (2, 6), (9, 101)])
def test_corners_that_no_board_has_are_refused(inner):
    with pytest.raises(ParameterError, match=f"corners={inner[0]}x{inner[1]} outside 3x3"):
        find_board(np.zeros((48, 64, 3), np.uint8), inner, 10.0)


@pytest.mark.parametrize("square_mm", [0.0, -10.0, float("nan"), float("inf")])
def test_a_square_that_is_no_length_is_refused(square_mm):
    with pytest.raises(ParameterError, match=r"square=.* outside 0\.\.1000 mm"):
        find_board(np.zeros((48, 64, 3), np.uint8), (9, 6), square_mm)


@pytest.mark.parametrize(
    "words",
    [
        ("--azimuth-hint", "nan"),
        ("--square", "nan"),
        ("--corners", "0x0"),
        ("--corners", "9x\u0666"),
        ("--size", "big"),
    ],
)
def test_an_option_of_another_form_is_named(words, capsys):
    with pytest.raises(SystemExit) as end:
        calibrate.main(["--photo", "a.jpg", "--out", "c.json", *words])
    assert end.value.code == 2 and f"argument {words[0]}: {words[1]}" in capsys.readouterr().err


def test_lists_that_a_spreadsheet_saved_with_a_byte_order_mark_are_read(tmp_path):
    (tmp_path / "dots.csv").write_text("u_px,v_px\n1,2\n3,4\n", encoding="utf-8-sig")
    assert read_dots(tmp_path / "dots.csv").tolist() == [[1, 2], [3, 4]]
    rows = "".join(f"0,{x},{y},{10 * x},{10 * y}\n" for x in range(4) for y in range(4))
    (tmp_path / "board.csv").write_text(f"view,x_mm,y_mm,u_px,v_px\n{rows}", encoding="utf-8-sig")
    assert len(read_views(tmp_path / "board.csv")) == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--board a.csv b.csv", "--board with a CSV among others: one holds all views"),
        ("--board a.csv --square 8", "--board and CSV with --square: nothing reads it"),
        ("--board a.jpg --size 1280x720", "--board and photos with --size: nothing reads it"),
        ("--board a.jpg --picture f.png", "--board with --picture: it is of --photo and --zero"),
        ("--photo a.jpg --square 8", "--photo with --square: it is of --board"),
    ],
)
def test_what_nothing_reads_is_refused(words, said, tmp_path, capsys):
    """Of several lists of points only the first was read, and a picture that was asked for never came."""
    assert calibrate.main([*words.split(), "--out", str(tmp_path / "camera.json")]) == 2
    assert said in capsys.readouterr().err
