"""Tables and ranges that the pages state of methods, optics, speed and simulator, against the benches' tables."""

from __future__ import annotations

import re

import pytest
from page_tables import Rounded, cell_of, numbers, page_rows, rounded, said, spread, table, wrong
from test_architecture import ROOT


def at_50_ms(*motions: str) -> tuple[float, float]:
    """Least and most of the error over that of holding, over some motions."""
    return spread(
        float(row["weighted_over_held"])
        for row in table("prediction")
        if row["delay_ms"] == "50" and row["motion"] in motions
    )


def test_what_prediction_brings_is_that_of_the_bench():
    rows = dict(page_rows("docs/live.md", "| motion | error over that of holding |"))
    slow = at_50_ms("circle under 0.5 Hz", "circle 0.5 to 2 Hz")
    pairs = rounded(numbers(rows["circles under 2 Hz"]), slow)
    pairs += rounded(numbers(rows["ramps"]), at_50_ms("ramps"))
    hardly = "rest, steps, stick-slip, impacts, circles over 5 Hz (hardly predictable)"
    motions = ("rest", "steps", "stick-slip", "impacts", "circle 5 to 12 Hz")
    pairs.append(Rounded(numbers(rows[hardly])[0], at_50_ms(*motions)[1]))
    wrench = said(
        "docs/wrench.md", r"leaves ([\d.]+) to ([\d.]+) of the error .*? and ([\d.]+) to ([\d.]+) at 2 to 5 Hz"
    )
    pairs += rounded(wrench, [*at_50_ms("circle 0.5 to 2 Hz"), *at_50_ms("circle 2 to 5 Hz")])
    assert len(pairs) == 9 and wrong(pairs) == []


def filter_cells(what: str, name: str) -> dict[str, dict[str, float]]:
    """Numbers of the filter's bench by motion and rate."""
    return {
        f"{row['motion']}, {row['rate_hz']} Hz": {key: float(value) for key, value in
                                                  (cell.split("=") for cell in row["numbers"].split())}
        for row in table("filter")
        if (row["what"], row["filter"]) == (what, name)
    }  # fmt: skip


def test_what_the_filter_covers_is_that_of_the_bench():
    covered = (
        r"interval covers (\d+) to (\d+) % of the errors in seven kinds of motion; without the steady models it covers"
    )
    pairs = []
    for name, written in zip(
        ("steady", "without"), _halves(said("docs/wrench.md", covered + r" (\d+) to (\d+) %")), strict=True
    ):
        pairs += rounded(written, spread(100 * cell["covered"] for cell in filter_cells("interval", name).values()))
    ramps = said(
        "docs/wrench.md", r"ramps along z: ([\d.]+) frames instead of ([\d.]+) at 1 N/s, ([\d.]+) instead of ([\d.]+)"
    )
    steady, without = (filter_cells("onset", name) for name in ("steady", "without"))
    for (new, old), rate in zip(_halves(ramps), ("1", "0.05"), strict=True):
        motion = f"ramp {rate} N/s z, 30 Hz"
        pairs += rounded((new, old), (filters[motion]["delay_frames"] for filters in (steady, without)))
    assert len(pairs) == 8 and wrong(pairs) == []
    assert all(cell["delay_frames"] <= without[motion]["delay_frames"] for motion, cell in steady.items())


def _halves(written: tuple[str, ...]) -> list[tuple[str, ...]]:
    return [written[: len(written) // 2], written[len(written) // 2 :]]


CHANGES = {  # title in docs/live.md: change of the bench
    "lamp dims on one side": "one side dims", "gradient of the lamp": "lamp gradient",
    "all LEDs dim, fixed exposure": "all dim", "haze": "haze", "haze on one side": "haze one side",
    "40 spots of dust": "dust", "defocus, radius of the disc": "defocus", "picture larger": "zoom",
    "drop of water that shifts dots": "drop",
}  # fmt: skip


def test_what_changes_slowly_is_that_of_the_bench():
    found, pairs = table("slow_changes"), []
    rows = page_rows("docs/live_faults.md", "| change | largest without a flag at rest |")
    assert {CHANGES[row[0]] for row in rows} == {row["change"] for row in found}
    for title, level, *written, flagged in rows:
        rest = [row for row in found if (row["change"], row["state"]) == (CHANGES[title], "rest")]
        clear = [row for row in rest if row["flagged"] == "0"][-1]
        percent = 100 if clear["unit"] == "part" else 1
        pairs.append(Rounded(numbers(level)[0], percent * float(clear["level"])))
        pairs += rounded(written, (float(clear[name]) for name in ("error_n", "sds_alone", "sds")))
        later = next((row for row in rest if row["flagged"] != "0"), None)
        assert (later is None) == (flagged == "–"), title
        if later is not None:
            pairs.append(Rounded(numbers(flagged)[0], percent * float(later["level"])))
            pairs.append(Rounded(numbers(flagged)[-1], float(later["error_n"])))
            count = {"six": "6", "five": "5", "four": "4"}[next(iter(re.findall(r"\((\w+) of six\)", flagged)), "six")]
            assert later["flagged"] == count, title
    assert len(pairs) == 46 and wrong(pairs) == []
    loaded = max(float(row["sds"]) for row in found if row["state"] == "load" and row["flagged"] == "0")
    limit = said("docs/live_faults.md", r"none of these unflagged readings is off by over ([\d.]+) standard deviations")
    assert Rounded(limit[0], loaded).is_right


def test_what_the_stages_of_a_frame_cost_is_that_of_the_bench():
    """The page left a stage out and did not say so: its stages did not add up to its whole frame."""
    head, *_ = (line for line in (ROOT / "docs/live_speed.md").read_text(encoding="utf-8").splitlines()
                if line.startswith("| | decode | track |"))  # fmt: skip
    stages = [cell.strip() for cell in head.strip("|").split("|")][1:]
    found = {row["stage"]: row for row in table("stages") if row["method"] == "dots"}
    own = {stage: found["all" if stage == "whole frame" else stage] for stage in stages}
    assert set(found) - {"drift"} == {"all" if stage == "whole frame" else stage for stage in stages}
    milliseconds, ratios = page_rows("docs/live_speed.md", "| | decode | track |")
    pairs = rounded(milliseconds[1:], (float(row["mean_ms"]) for row in own.values()))
    pairs += rounded(ratios[1:], (float(row["ratio"]) for row in own.values()))
    between, drift = said("docs/live_speed.md", r"between the stages \(([\d.]+) ms\), and `drift`, .*? \(([\d.]+) ms\)")
    left = sum(
        float(row["mean_ms"]) * (1 if stage == "all" else -1) for stage, row in found.items() if stage != "drift"
    )
    pairs += rounded((between, drift), (left, float(found["drift"]["mean_ms"])))
    assert wrong(pairs) == []


def test_the_cameras_of_live_are_those_of_the_bench():
    found, outputs, rate, step, threads, pairs = table("live"), "none", "30", "0", "1", []
    for words, *written in page_rows("docs/live_speed.md", "| six cameras | process, of a core |"):
        if "the same" not in words:
            rate, step = words[:2], str(int("in step" in words))
            threads = "2" if "two threads" in words else "1"
        outputs = "page" if "viewer" in words else outputs if "the same" in words else "none"
        outputs = "page and recording of dots" if "dots recorded" in words else outputs
        outputs = "page and recording, full" if "full pictures" in words else outputs
        row = cell_of(found, model="default", method="dots", endcaps="6", workers=threads, outputs=outputs,
                      rate_hz=rate, in_step=step)  # fmt: skip
        names = ("core_share", "loop_share", "page_share", "p50_ms", "p99_ms", "dropped", "idle_share")
        values = [float(row[name]) * (100 if name == "idle_share" else 1) for name in names]
        pairs += [Rounded(numbers(cell)[0], value) for cell, value in zip(written, values, strict=True) if cell]
    assert len(pairs) == 86 and wrong(pairs) == []


def test_the_errors_of_the_field_methods_are_those_of_the_bench():
    found, pairs = [row for row in table("fields") if row["level"] == "all"], []
    for kind, frames, dots, themselves, released, spent in page_rows("docs/fields.md", "| | frames | `dots` mean"):
        if kind == "both":
            continue
        ours, theirs = (cell_of(found, pictures=kind.removesuffix("s"), method=name) for name in ("dots", "gelslim"))
        assert frames == ours["frames"]
        for text, row in ((dots, ours), (released, theirs)):
            pairs += rounded(numbers(text), (float(row["mean_px"]), float(row["failed_percent"])))
        clean = cell_of(
            [row for row in table("fields") if row["level"] == "clean"], pictures=ours["pictures"], method="dots"
        )
        pairs += rounded(numbers(themselves), (float(row["dot_mean_px"]) for row in (ours, clean)))
        times = [float(row["ms_p20"]) for row in (ours, theirs)]
        pairs += rounded(numbers(spent), [*times, times[0] / times[1]])
    assert len(pairs) == 18 and wrong(pairs) == []


def test_what_the_levels_of_the_renderer_cost_is_that_of_the_bench():
    found = {row["name"]: row for row in table("render") if row["study"] == "level"}
    pairs = []
    for name, *written in page_rows("docs/optics.md", "| level | frame, ms"):
        row = found[name.removesuffix(" (default)")]
        pairs += rounded(written, (float(row[key]) for key in ("frame_ms", "light_error_pct", "dot_shift_px")))
    assert len(pairs) == 9 and wrong(pairs) == []


def test_what_rate_effects_change_is_that_of_the_bench():
    found = {row["motion"]: row for row in table("rate_effects")}
    names = ("marker_change_mean_percent", "marker_change_largest_percent", "force_change_mean_percent",
             "force_change_largest_percent", "ratio", "step_error_percent")  # fmt: skip
    pairs = []
    rows = page_rows("docs/simulator.md", "| motion | inner surface, mean / most |")
    for (_, *written), motion in zip(rows, ("circle", "stick-slip", "impact"), strict=True):
        pairs += rounded(numbers(" ".join(written)), (float(found[motion][name]) for name in names))
    assert len(pairs) == 18 and wrong(pairs) == []


@pytest.mark.parametrize(("place", "own"), [(0, False), (1, True)])
def test_what_designs_are_calibrated_to_is_that_of_the_bench(place: int, own: bool):
    released = "1-6-10-12-16-18-20"
    found = [row for row in table("designs") if ((row["dots"], row["dot_mm"]) != (released, "4.0")) == own]
    rows = {row[0]: numbers(row[1 + place]) for row in page_rows("docs/optics.md", "| | 24 sizes, released dots |")}
    values = {
        name: sorted(abs(float(row[name])) for row in found)
        for name in found[0]
        if name.endswith(("px", "found", "deg"))
    }
    middle = {name: (column[(len(column) - 1) // 2] + column[len(column) // 2]) / 2 for name, column in values.items()}
    pairs = [Rounded(rows["calibrated"][0], sum(row["status"] == "0" for row in found))]
    pairs.append(Rounded(rows["azimuth off, at most"][0], values["azimuth_error_deg"][-1]))
    for title, name, end in (
        ("camera off at the dots, median (at most)", "camera_error_px", -1),
        ("dots found by calibration, median (least)", "calibration_found", 0),
        ("dots found by the tracker, median (least)", "tracker_found", 0),
        ("tracker off, median (at most)", "tracker_error_px", -1),
    ):
        pairs += rounded(rows[title], (middle[name], values[name][end]))
    assert len(found) == 24 and wrong(pairs) == []
