"""Page of the wrench model against the scores and cells that the evaluation wrote."""

from __future__ import annotations

from math import sqrt

import numpy as np
from page_tables import Rounded, Row, cell_of, numbers, page_rows, rounded, said, spread, table, wrong

WITH_FILE, WITHOUT_FILE, KEPT = "ours", "ours, no camera file", " where not flagged"
OTHERS = tuple(f"sensor{number}" for number in range(91, 99))
FORCES, TORQUES = ("rmse_fx_n", "rmse_fy_n", "rmse_fz_n"), ("rmse_tx_nm", "rmse_ty_nm", "rmse_tz_nm")
PAGE = "docs/wrench_accuracy.md"
RANGE = r"([\d.]+) to ([\d.]+) N"
LOADS = ((0, 10), (10, 20), (20, 30), (30, 40))


def scores(name: str) -> Row:
    """Scores of an evaluation over all its frames in contact."""
    return cell_of(table("wrench_scores"), name=name)


def cells_of(name: str, load_from_n: float, load_to_n: float, tilt_deg: tuple[float, float] = (0, 55)) -> list[Row]:
    """Cells of an evaluation with frames, from one load to another."""
    return [
        row
        for row in table("wrench_cells")
        if row["name"] == f"{WITH_FILE}, {name}"
        and tilt_deg[0] <= float(row["tilt_from_deg"]) < tilt_deg[1]
        and load_from_n <= float(row["load_from_n"]) < load_to_n
        and int(row["frames"])
    ]


def fz_rms(cells: list[Row]) -> float:
    """RMSE of fz over all frames of some cells, N."""
    frames = [int(row["frames"]) for row in cells]
    return float(np.sqrt(np.average([float(row["rmse_fz_n"]) ** 2 for row in cells], weights=frames)))


def cell_spread(name: str, load_from_n: float, load_to_n: float, *tilt_deg: tuple[float, float]) -> tuple[float, float]:
    """Least and largest RMSE of fz of the cells of a test set, N."""
    return spread(float(row["rmse_fz_n"]) for row in cells_of(name, load_from_n, load_to_n, *tilt_deg))


def sensor_spread(load_from_n: float, load_to_n: float) -> tuple[float, float]:
    """Least and largest RMSE of fz of the eight other sensors, N."""
    return spread(fz_rms(cells_of(name, load_from_n, load_to_n)) for name in OTHERS)


def test_the_errors_of_each_sensor_are_its_scores():
    pairs = []
    rows = page_rows(PAGE, "| sensor | RMSE fx")
    for row, name in zip(rows, ("sensor0", *OTHERS), strict=True):
        assert row[0] == ("nominal" if name == "sensor0" else name.removeprefix("sensor"))
        given, found = (scores(f"{camera}, {name}{KEPT}") for camera in (WITH_FILE, WITHOUT_FILE))
        covered = [100 * float(scores(f"{camera}, {name}")["coverage"]) for camera in (WITH_FILE, WITHOUT_FILE)]
        values = [float(given[column]) for column in (*FORCES, *TORQUES, "mixed_mse")] + [covered[0]]
        values += [float(found[column]) for column in FORCES] + [covered[1]]
        pairs += rounded(numbers(" ".join(row[1:]).replace("%", "")), values)
    assert len(pairs) == 9 * 12 and wrong(pairs) == []


def test_the_ranges_at_the_head_of_the_pages_are_those_of_the_cells():
    pairs = []
    for row, load in zip(page_rows("docs/wrench.md", "| on sensors and paths"), ((0, 20), *LOADS[2:]), strict=True):
        least = numbers(row[1].removeprefix(row[0])) + numbers(row[2])
        pairs += rounded(least, cell_spread("sensor0", *load) + sensor_spread(*load))
    head = said(
        PAGE, f"off by {RANGE} to 20 N and by {RANGE} from 20 to 30 N on the nominal sensor, by {RANGE} and {RANGE} on"
    )
    nominal = (*cell_spread("sensor0", 0, 20), *cell_spread("sensor0", 20, 30))
    pairs += rounded(head, [*nominal, *sensor_spread(0, 20), *sensor_spread(20, 30)])
    readme = said("README.md", f"fz is off by {RANGE} at 20 to 30 N and by {RANGE} at 30 to 40 N")
    pairs += rounded(readme, sensor_spread(20, 30) + sensor_spread(30, 40))
    assert len(pairs) == 24 and wrong(pairs) == []


def test_what_other_sensors_reach_is_that_of_the_cells():
    by_load = f"{RANGE} to 10 N, {RANGE} to 20 N, {RANGE} to 30 N,(?: and)? {RANGE} to 40 N"
    number = r"([\d.]+)"
    over = f"over the eight {number}, {number} and {number} N from 10, 20 and 30 N on .*? {number} of {number}"
    values = [value for load in LOADS for value in sensor_spread(*load)]
    pairs = rounded(said(PAGE, f"on the eight other sensors are {by_load}"), values)
    values += [fz_rms([row for name in OTHERS for row in cells_of(name, *load)]) for load in LOADS[1:]]
    cells = [float(row["rmse_fz_n"]) for name in OTHERS for row in cells_of(name, 20, 30)]
    bad = [rmse_n for rmse_n in cells if rmse_n > 0.10]
    goal = said(PAGE, f"each with its own camera .*? {by_load}.*?{over} from 20 to 30 N have {RANGE}")
    pairs += rounded(goal, [*values, len(bad), len(cells), *spread(bad)])
    assert len(pairs) == 23 and wrong(pairs) == []


def test_the_errors_of_other_bodies_are_those_of_their_cells():
    steep = (55, 90)
    places = (("seen911", (0, 55)), ("seen912", (0, 55)), ("seen912", steep), ("seen913", (0, 55)))
    pairs = []
    for row, (name, tilt_deg) in zip(page_rows(PAGE, "| pressed by | RMSE of fz"), places, strict=True):
        for entry, load in zip(row[1:5], ((0, 20), (20, 30), (30, 40), (40, 99)), strict=True):
            least = cell_spread(name, *load, tilt_deg)
            pairs += rounded(numbers(entry), least if " to " in entry else least[:1])
        cells = cells_of(name, 0, 99, tilt_deg)
        far, flagged = (round(sum(float(cell[column]) for cell in cells)) for column in ("far", "far_flagged"))
        assert row[5:] == [str(far), str(flagged) if far else ""]
    assert len(pairs) == 29 and wrong(pairs) == []
    bodies = [row for name in ("seen911", "seen912") for row in cells_of(name, 0, 99, (0, 90))]
    (caught,) = said("README.md", r"caught all (\d+) answers on balls and edges")
    assert int(caught) == sum(float(row["far"]) for row in bodies) == sum(float(row["far_flagged"]) for row in bodies)


def test_the_errors_on_grid_in_motion_and_on_the_robot_are_their_scores():
    pairs = []
    for row, name in zip(page_rows(PAGE, "| test set | fz, N |"), ("static951", "dynamic101", "robot952"), strict=True):
        found = scores(f"{WITH_FILE}, {name}")
        both, three = (
            sqrt(np.mean([float(found[column]) ** 2 for column in columns])) for columns in (FORCES[:2], TORQUES)
        )
        written = numbers(" ".join(row[1:4]))
        pairs += [Rounded(*pair) for pair in zip(written, (float(found["rmse_fz_n"]), both, three), strict=True)]
        mixed, least = float(found["mixed_mse"]), numbers(row[4])[0]
        assert mixed < float(least) if row[4].startswith("under") else Rounded(least, mixed).is_right
    assert len(pairs) == 9 and wrong(pairs) == []
