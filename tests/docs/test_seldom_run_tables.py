"""Pages against the tables of benches that are seldom run: hours, other programs, photos, one machine left alone."""

from __future__ import annotations

from math import sqrt

import numpy as np
from page_tables import cell_of, floats, numbers, page_rows, rounded, rows_of, said, spread, table, wrong

FORCES, TORQUES = ("rmse_fx_n", "rmse_fy_n", "rmse_fz_n"), ("rmse_tx_nm", "rmse_ty_nm", "rmse_tz_nm")


def test_the_photos_say_of_the_pattern_what_the_page_says():
    rings, heights = table("calibrate_rings"), table("calibrate_height")
    assert {row["count"] == row["best_count"] for row in rings} == {True}
    inner = [row for row in rings if int(row["ring"]) <= 7]
    away = [abs(float(row["seen_polar_deg"]) - int(row["ring"]) * 180 / 13) for row in inner]
    pairs = rounded(said("docs/optics.md", r"\(coherence ([\d.]+) to ([\d.]+);"), spread(floats(rings, "coherence")))
    pairs += rounded(
        said(
            "docs/optics.md",
            r"within ([\d.]+) degrees of k 180/13 \(rings 1 to 7, standard errors ([\d.]+) to ([\d.]+)\)",
        ),
        [max(away), *spread(floats(inner, "sem_deg"))],
    )
    free = {photo: rows_of(heights, photo=photo, lens="k1, k2 free") for photo in {row["photo"] for row in heights}}
    slopes = [np.polyfit(floats(rows, "height_mm"), floats(rows, "f_px_at_480_rows"), 1)[0] for rows in free.values()]
    pairs += rounded(
        said("docs/optics.md", r"follows: -([\d.]+) to -([\d.]+) px a mm"), spread(-slope for slope in slopes)
    )
    (percent,) = said("docs/optics.md", r"changes the residual by (\d+) % at most \(endcap_0, endcap_1, wide\)")
    residuals = [floats(rows, "rms_px") for photo, rows in free.items() if photo != "endcap_2"]
    pairs += rounded([percent], [100 * max(max(each) / min(each) - 1 for each in residuals)])
    assert wrong(pairs) == []


def test_the_unit_cell_of_the_gyroid_is_that_of_the_bench():
    cell = cell_of(table("interlock_cell"), tpu_young_mpa="26", voxels="81")
    (row,) = page_rows("docs/design.md", "| Young's modulus, MPa | silicone |")
    names = ("silicone", "reuss", "hashin_shtrikman_low", "series", "parallel", "hashin_shtrikman_high", "voigt")
    pairs = rounded(numbers(" ".join(row[1:])), [float(cell[f"{name}_mpa"]) for name in names])
    softer, stiffer = (cell_of(table("interlock_cell"), tpu_young_mpa=young, voxels="63") for young in ("10", "50"))
    written = said(
        "docs/design.md",
        r"mean is ([\d.]+) times the silicone's modulus \(([\d.]+) times with TPU of 10 MPa, ([\d.]+) times with "
        r"50 MPa\), and Zener's ratio is (\d\.\d+)",
    )
    pairs += rounded(written, [float(each["ratio"]) for each in (cell, softer, stiffer)] + [float(cell["zener"])])
    assert len(pairs) == 11 and wrong(pairs) == []


def test_presses_beside_own_weight_are_those_of_the_bench():
    presses = table("own_weight_presses")
    sideways, upright = (rows_of(presses, pose=pose) for pose in ("sideways", "tip up"))
    turned, kept = page_rows("docs/own_weight.md", "| D = 130, T = 8, rendered pictures, live |")[2:]
    pairs = rounded(numbers(turned[1]), spread(floats(sideways, "kept_n")))
    pairs += rounded(numbers(turned[2]), spread(floats(sideways, "subtracted_n")))
    pairs += rounded(numbers(kept[1]), spread(floats(upright, "kept_n")))
    assert len(pairs) == 6 and wrong(pairs) == []
    assert [row["kept_n"] == row["subtracted_n"] for row in upright] == [True] * len(upright)


def test_an_hour_of_live_is_that_of_the_bench():
    rows = table("live_soak")
    last, settled = rows[-1], [row for row in rows if float(row["time_s"]) > 300]
    (frames, hertz, at_first, later, memory_mb, moved_mb, page_mb, file_gb) = said(
        "docs/live_speed.md",
        r"frames \| ([\d,]+), (\d+) a second \| \| dropped \| (\d+) while .*?, (\d+) in the 59 .*? ([\d.]+) MB "
        r"\(it moved by ([\d.]+) MB\); the page's process ([\d.]+) MB .*? recording \| (\d+) GB",
    )
    memory = spread(floats(settled, "memory_mb"))
    values = [
        float(last["frames"]), float(last["rate_hz"]), float(rows[0]["dropped"]),
        float(last["dropped"]) - float(rows[0]["dropped"]), memory[0], memory[1] - memory[0],
        float(last["page_memory_mb"]), float(last["file_mb"]) / 1000,
    ]  # fmt: skip
    written = [frames.replace(",", ""), hertz, at_first, later, memory_mb, moved_mb, page_mb, file_gb]
    assert wrong(rounded(written, values)) == [] and float(last["lost_to_disk"]) == 0


def test_ends_and_files_that_were_tried_are_those_of_the_bench():
    ends, files = table("robust_ends"), table("robust_files")
    rows = page_rows("docs/live_faults.md", "| tried | cases | bad |")
    tried = {row[0].split(" (")[0].split(",")[0]: (row[1].replace(",", ""), row[2]) for row in rows}
    assert tried["random ends"] == (
        str(sum(int(row["cases"]) for row in ends)),
        str(sum(int(row["bad"]) for row in ends)),
    )
    for kind, name in (("configuration", "mutated configurations"), ("recording", "damaged recordings")):
        found = cell_of(files, kind=kind)
        assert tried[name] == (found["cases"], found["bad"])
    longest = said("docs/live_faults.md", r"signal to end: median [\d.]+ s, longest ([\d.]+) s")
    assert wrong(rounded(longest, [max(floats(ends, "largest_end_s"))])) == []


def test_what_more_cores_bring_is_that_of_the_bench():
    seconds = {int(row["cores"]): float(row["wall_s"]) for row in table("molds_cores")}
    written = said("docs/molds_speed.md", r"two cores \((\d+) s computed, .*? four take (\d+) %, six and more (\d+) %")
    parts = [100 * seconds[cores] / seconds[2] for cores in (4, 6)]
    assert wrong(rounded(written, [seconds[2], *parts])) == [] and seconds[6] == seconds[12]
    (most,) = said("docs/molds_speed.md", r"no line of it has more than (\d+) %")
    assert max(floats(table("molds_where"), "share")) <= float(most) / 100


def test_other_interfaces_print_what_the_page_says():
    rows = table("slice_sizes")
    assert all(not row["refused"] for row in rows)
    values = []
    for form in ("interface_infill", "interface_gyroid"):
        own = rows_of(rows, form=form)
        off = [100 * (float(row["fraction_percent"]) / float(row["gyroid_percent"]) - 1) for row in own]
        values += [-min(off), max(off)]
    values.append(min(float(row["open_percent"]) - (100 - float(row["gyroid_percent"])) for row in rows))
    written = said(
        "docs/printing.md",
        r"prints from ([\d.]+) % of its plastic too little to ([\d.]+) % too much, the mesh from ([\d.]+) % too little "
        r"to ([\d.]+) % too much, .*? is ([\d.]+) points of open",
    )
    assert wrong(rounded(written, values)) == []


def test_similarity_on_pictures_is_that_of_the_bench():
    scores = rows_of(table("similarity_pictures"), score="ours")

    def error(states: str, seed: str, columns: tuple[str, ...]) -> float:
        row = cell_of(scores, states=states, train_seed=seed)
        return sqrt(np.mean([float(row[name]) ** 2 for name in columns]))

    def both(states: str, columns: tuple[str, ...]) -> float:
        return sqrt(np.mean([error(states, seed, columns) ** 2 for seed in "01"]))

    pairs, range_n = [], float(scores[0]["range_n"])
    for row, states in zip(page_rows("docs/design.md", "| weights | error an axis |"), ("library", "own"), strict=True):
        errors = [both(states, FORCES), *(error(states, seed, FORCES) for seed in "01")]
        covered = [100 * float(cell_of(scores, states=states, train_seed=seed)["coverage"]) for seed in "01"]
        pairs += rounded(numbers(" ".join(row[1:])), [*errors, 100 * errors[0] / range_n, *covered])
    ratios = said("docs/design.md", r"two trainings each. Ratios are ([\d.]+) for forces and ([\d.]+) for torques")
    pairs += rounded(ratios, [both("library", part) / both("own", part) for part in (FORCES, TORQUES)])
    assert len(pairs) == 14 and wrong(pairs) == []


def test_streams_that_fail_at_once_cost_what_the_page_says():
    rows = table("robot_outages")
    after = [row for row in rows if float(row["time_s"]) > 15]
    written = said(
        "docs/robot.md",
        r"(\d+) drawn sets\). Ten seconds later bars are up to ([\d.]+) degrees off "
        r"\(stated standard deviations ([\d.]+) to (\d\.\d+)\)",
    )
    values = [len({row["set"] for row in rows}), max(floats(after, "off_deg")), *spread(floats(after, "sd_deg"))]
    assert wrong(rounded(written, values)) == []
