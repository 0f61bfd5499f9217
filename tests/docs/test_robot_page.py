"""Page of the robot's accuracy against the runs that the benches wrote."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import pytest
from page_tables import Rounded, Row, floats, numbers, page_rows, rounded, rows_of, said, spread, table, wrong

PAGE = "docs/robot_accuracy.md"
MEDIANS = ("drift_percent", "height_percent", "tilt_deg", "yaw_deg", "endcaps_mm", "nees_place", "nees_turn")
MEANS = ("inside_place", "inside_turn")
RATIO_TERRAINS = ("flat", "rough", "slope", "low_friction")


def column(rows: Sequence[Row], name: str) -> np.ndarray:
    return np.array(floats(rows, name))


def runs(name: str, **wanted: str) -> list[Row]:
    """Runs of a bench's file that have these entries."""
    found = rows_of(table(name), **wanted)
    assert found, wanted
    return found


def significant(written: str, value: float) -> Rounded:
    """A number and its value; a page may write numbers from 100 on with two digits, as 8700."""
    if value < 100:
        return Rounded(written, value)
    return Rounded(written, float(f"{value:.{max(2, len(written.rstrip('0')))}g}"))


def cells(entries: Sequence[str], group: Sequence[Row]) -> list[Rounded]:
    """Medians with their 95 % quantiles, and means, as the tables of the page have them."""
    pairs = []
    for entry, name in zip(entries[: len(MEDIANS)], MEDIANS, strict=True):
        values = column(group, name)
        pairs += [
            significant(*pair)
            for pair in zip(numbers(entry), (np.median(values), np.quantile(values, 0.95)), strict=True)
        ]
    pairs += [
        Rounded(entry, float(column(group, name).mean()))
        for entry, name in zip(entries[len(MEDIANS) :], MEANS, strict=True)
    ]
    return pairs


@pytest.mark.parametrize(("name", "after"), [("robot", "## Tables"), ("robot_six_bar", "## Six bars")])
def test_the_tables_of_runs_are_those_of_the_bench(name, after):
    pairs = []
    rows = page_rows(PAGE, "| terrain | contacts | runs |", after=after)
    for terrain, contacts, count, path_m, *entries in rows:
        group = runs(name, terrain=terrain, contacts=contacts, knob="")
        assert int(count) == len(group)
        pairs += [Rounded(path_m, float(np.median(column(group, "path_m")))), *cells(entries, group)]
    assert wrong(pairs) == []
    kinds = {(row["terrain"], row["contacts"]) for row in table(name) if not row["knob"]}
    assert len(rows) == len(kinds) and len(pairs) == 17 * len(rows)


def test_the_curves_are_those_of_the_bench():
    pairs = []
    for knob, entry in page_rows(PAGE, "| property | level: drift |"):
        for level, drift in re.findall(r"([\d.]+): ([\d.]+)", entry):
            group = [row for row in runs("robot", knob=knob) if np.isclose(float(row["level"]), float(level))]
            pairs.append(significant(drift, float(np.median(column(group, "drift_percent")))))
    assert len(pairs) > 30 and wrong(pairs) == []


def test_what_the_page_says_of_the_runs_is_so():
    terrains = {row["terrain"] for row in runs("robot", knob="", contacts="wrench")}
    drift, tilt, ratio = {}, {}, {}
    for terrain in terrains:
        group = runs("robot", knob="", contacts="wrench", terrain=terrain)
        drift[terrain], tilt[terrain] = (
            float(np.median(column(group, name))) for name in ("drift_percent", "tilt_deg")
        )
        if terrain in RATIO_TERRAINS:
            bit = runs("robot", knob="", contacts="bit_rolling", terrain=terrain)
            ratio[terrain] = drift[terrain] / float(np.median(column(bit, "drift_percent")))
    pairs = rounded(
        said(
            PAGE, r"drifts by ([\d.]+) to ([\d.]+) % of its path, and its tilt is off by ([\d.]+) to ([\d.]+) degrees"
        ),
        [*spread(drift.values()), *spread(tilt.values())],
    )
    pairs += rounded(said("README.md", r"drifts by ([\d.]+) to ([\d.]+) % of the path"), spread(drift.values()))
    share = r"wrench has ([\d.]+) \(flat\), ([\d.]+) \(rough\), ([\d.]+) \(slope\) and ([\d.]+) \(friction 0.3\)"
    pairs += rounded(said(PAGE, share), [ratio[terrain] for terrain in RATIO_TERRAINS])
    yaw = column(runs("robot", knob="", contacts="wrench"), "yaw_10m_deg")
    pairs += rounded(
        said(PAGE, r"off by ([\d.]+) degrees for 10 m \(median of the wrench's (\d+) runs; 95 %: ([\d.]+)\)"),
        [np.median(yaw), len(yaw), np.quantile(yaw, 0.95)],
    )
    six = [
        float(np.median(column(runs("robot_six_bar", contacts="wrench", terrain=t), "drift_percent")))
        for t in RATIO_TERRAINS
    ]
    pairs += rounded(said(PAGE, r"six-bar robot, .*? drifts by ([\d.]+) to ([\d.]+) %"), spread(six))
    assert len(pairs) == 15 and wrong(pairs) == []


def test_fewer_gyroscopes_cost_what_the_page_says():
    """The list of what was not reached had 1.4 and 2.6 % where the table of the same page had 1.1 and 1.8."""
    one, two = ([row for row in runs("robot", knob="gyroscopes") if float(row["level"]) == level] for level in (1, 2))
    written = said(
        PAGE,
        r"two of three gyroscopes \(the curve\) it drifts by ([\d.]+) %, with one by ([\d.]+) %.*?"
        r"hold the place (\d+) to (\d+) % and the turn (\d+) to (\d+) %",
    )
    medians = [float(np.median(column(group, "drift_percent"))) for group in (two, one)]
    held = [value for name in MEANS for value in spread(100 * column(two, name))]
    assert wrong(rounded(written, [*medians, *held])) == []


def test_the_runs_from_pictures_are_those_of_the_bench():
    pairs, source = [], ""
    for name, seed, *entries in page_rows(PAGE, "| wrenches of | seed |"):
        source = name or source
        (row,) = runs(
            "robot_pictures", contacts="wrench", seed=seed, knob="pictures" if source == "pictures" else "noise"
        )
        values = [float(row[key]) for key in (*MEDIANS, *MEANS)]
        pairs += rounded(entries, values)
    head = said(PAGE, r"with all that ships, drift by ([\d.]+) and ([\d.]+) %")
    ours = [runs("robot_pictures", seed=seed, knob="pictures")[0] for seed in ("301", "201")]
    pairs += rounded(head, [float(row["drift_percent"]) for row in ours])
    assert len(pairs) == 4 * 9 + 2 and wrong(pairs) == []


def test_the_readings_from_pictures_are_those_of_the_bench():
    places = {"in range": "inside", "beyond": "beyond", "no contact": "free"}
    where, source, pairs = "", "", []
    for place, name, seed, *entries in page_rows(PAGE, "| readings | of | run |"):
        where, source = places.get(place, where), name or source
        (row,) = runs(
            "robot_pictures_readings", seed=seed, where=where, source="pictures" if source == "pictures" else "noise"
        )
        count = int(row["readings"])
        wanted = {
            0: count, 1: float(row["rmse_force_n"]), 4: 100 * float(row["covered"]),
            7: float(row["wrong_bit"]) * count,
        }  # fmt: skip
        if where != "free":
            wanted[3] = float(row["median_force_percent"])
        if source == "pictures" and where != "free":
            wanted[2] = float(row["confirmed_rmse_n"])
        pairs += [significant(entries[k], value) for k, value in wanted.items()]
    assert len(pairs) > 40 and wrong(pairs) == []


def test_the_filter_of_gtsam_drifts_as_the_page_says():
    pairs = []
    for terrain, count, *entries in page_rows(PAGE, "| terrain | runs | drift, % |"):
        group = runs("robot_gtsam", terrain=terrain)
        assert int(count) == len(group)
        for entry, name in zip(entries, (*MEDIANS[:4], "core"), strict=True):
            values = column(group, name)
            pairs += rounded(numbers(entry), (np.median(values), np.quantile(values, 0.95)))
    assert len(pairs) == 40 and wrong(pairs) == []


def test_the_noises_that_score_better_alone_are_those_of_the_tuning():
    rows = table("robot_tune")
    as_it_is = next(float(row["log_score"]) for row in rows if not row["setting"])
    halved = sorted((row for row in rows if row["factor"] == "0.5"), key=lambda row: float(row["log_score"]))[:7]
    gains = [as_it_is - float(row["log_score"]) for row in halved]
    first, first_gain, second, second_gain, *ends = said(
        PAGE,
        r"half their size \(`(\w+)` by ([\d.]+), `(\w+)` by ([\d.]+)\), five more by ([\d.]+) to ([\d.]+); the drift "
        r"is ([\d.]+) to ([\d.]+) % .*? stated too wide with all \(NEES ([\d.]+) to ([\d.]+)\)",
    )
    assert [first, second] == [row["setting"] for row in halved[:2]]
    values = [
        *gains[:2],
        *spread(gains[2:]),
        *spread(column(halved, "drift_percent")),
        *spread(column(halved, "nees_place")),
    ]
    assert wrong(rounded([first_gain, second_gain, *ends], values)) == []
