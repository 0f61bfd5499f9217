"""Tables that the pages state of the simulator, of foreign frames and of the bound, against the benches' tables."""

from __future__ import annotations

from math import isnan

from page_tables import Rounded, Row, cell_of, numbers, page_rows, rounded, said, spread, table, wrong

SENSORS = ("other lens", "other law, turned")
CAMERAS = {"calibrated from its rest picture": "calibrated", "the true one": "true camera", "no camera file": ""}


def test_the_errors_on_foreign_frames_are_those_of_the_bench():
    found, pairs, sensor = [row for row in table("foreign") if row["tilt_deg"] == "all"], [], -1
    for name, camera, *written in page_rows("docs/foreign.md", "| sensor | camera | fx, fy, fz N |"):
        sensor += bool(name)
        row = cell_of(found, sensor=SENSORS[sensor], camera=CAMERAS[camera] or camera)
        values = [float(row[key]) for key in ("fx_n", "fy_n", "fz_n", "fz_bias_n", "torque_nm", "covered", "flagged")]
        pairs += rounded(numbers(" ".join(written)), [abs(v) * (100 if k > 4 else 1) for k, v in enumerate(values)])
    assert len(pairs) == 42 and wrong(pairs) == []


def test_what_each_link_costs_is_that_of_the_bench():
    chains = ("our data mesh, exact dots", "CalculiX, exact dots", "picture, true camera")
    rows, pairs = page_rows("docs/foreign.md", "| chain | first sensor: RMSE, bias N |"), []
    for (_, *written), chain in zip(rows[:3], chains, strict=True):
        for text, sensor in zip(written, SENSORS, strict=True):
            row = cell_of(table("foreign_links"), sensor=sensor, chain=chain)
            pairs += rounded(numbers(text), (float(row["fz_n"]), abs(float(row["fz_bias_n"]))))
    for text, sensor in zip(rows[3][1:], SENSORS, strict=True):
        row = cell_of(table("foreign"), sensor=sensor, camera="calibrated", tilt_deg="all")
        pairs += rounded(numbers(text), (float(row["fz_n"]), abs(float(row["fz_bias_n"]))))
    assert len(pairs) == 16 and wrong(pairs) == []


def test_the_forces_of_both_programs_are_those_of_the_bench():
    found, pairs = {(row["what"], row["mesh"]): row for row in table("foreign_forces")}, []
    rows = [
        [("CalculiX", mesh) for mesh in ("draft", "coarse", "middle")], [("CalculiX", "limit")],
        [("ours", mesh) for mesh in ("data", "fine", "reference")],
        [("ours", mesh) for mesh in ("fine, 2 layers", "reference, 2 layers", "converged")],
        [("ours", "reference, 3 layers")], [("ours", "limit"), ("ours", "scatter")],
        [("weights on CalculiX's dots", mesh) for mesh in ("draft", "coarse", "middle")],
        [("weights on our dots", mesh) for mesh in ("data", "fine", "reference", "converged")],
    ]  # fmt: skip
    for (_, *written), meshes in zip(page_rows("docs/foreign.md", "| depth of the plane, mm |"), rows, strict=True):
        for text, depth in zip(written, ("1.5", "3.5", "6.5"), strict=True):
            values = [float(found[mesh][f"force_n_at_{depth}_mm"]) for mesh in meshes]
            if meshes == [("CalculiX", "limit")]:
                values.append(float(found["CalculiX", "order"][f"force_n_at_{depth}_mm"]))
            pairs += rounded(numbers(text), (value for value in values if not isnan(value)))
    assert len(pairs) == 62 and wrong(pairs) == []


def by_load(rows: list[Row], tilt: str) -> list[Row]:
    """Rows of fz at one range of tilts, by load; docs/floor.md leaves out 5 to 10 N."""
    return [row for row in rows if (row["tilt_from_deg"], row["axis"]) == (tilt, "fz_n") and row["load_from_n"] != "5"]


def test_the_bound_and_the_error_are_those_of_the_bench():
    heads = ("Bound of fz, N: history known", "RMSE of fz of the live pipeline on the same frames, N")
    names, pairs = (("bound_known", "bound_unknown", "bound_camera"), ("rmse", "ratio")), []
    for head, columns in zip(heads, names, strict=True):
        for tilt, *written in page_rows("docs/floor.md", "| tilt | 0 to 5 N |", after=head):
            for text, row in zip(written, by_load(table("floor"), tilt.split(" ")[0]), strict=True):
                pairs += rounded(numbers(text), (float(row[name]) for name in columns))
    assert len(pairs) == 150 and wrong(pairs) == []


def test_rendered_and_real_pictures_are_those_of_the_bench():
    found, pairs = table("look"), []
    kinds = [[row for row in found if row["picture"].startswith(kind)] for kind in ("endcap", "rendered")]
    zones = list(dict.fromkeys(row["zone_px"] for row in found))
    rows = {row[0]: row[1:] for row in page_rows("docs/optics.md", "| | photos (three) | rendered (three seeds) |")}
    places = "dots off the pattern, px rms, inner / middle / outer zone"
    for title, name in (("dot area, px, inner / middle / outer zone", "area_px"),
                        ("green value at a dot's centre", "centre"), (places, "place_rms_px")):  # fmt: skip
        for text, kind in zip(rows[title], kinds, strict=True):
            ends = [spread(float(row[name]) for row in kind if row["zone_px"] == zone) for zone in zones]
            pairs += rounded(numbers(text.replace("..", " ")), (end for pair in ends for end in pair))
    for text, kind in zip(rows["spread of that from dot to dot"], kinds, strict=True):
        pairs += rounded(numbers(text.replace("..", " ")), spread(float(row["centre_spread"]) for row in kind))
    assert len(pairs) == 40 and wrong(pairs) == []


def test_the_simulators_rates_and_mesh_errors_are_those_of_the_bench():
    found = {(row["curve"], row["setting"]): row for row in table("simulator")}
    rates = said(
        "docs/simulator.md",
        r"level 2 answers (\d+) states a second \(1e-3\) and level 3 (\d+), in .*? level 3 answers (\d+)",
    )
    (default,) = (row for row in table("reduced") if (row["modes"], row["cubature"]) == ("50", "0.002"))
    seconds = [float(found["level", name]["seconds"]) for name in ("2, 1e-3", "3")]
    pairs = rounded(rates, [1 / seconds[0], 1 / seconds[1], float(default["states_s"])])
    data, fine, double = (found["mesh", name] for name in ("data", "fine", "data, 2 layers"))
    errors = said(
        "docs/simulator.md",
        r"the same elements in the plane, it is ([\d.]+) and ([\d.]+) % off there, and ([\d.]+) % at 2 N"
        r".*? `fine`, with smaller elements but also one layer, is ([\d.]+), ([\d.]+) and ([\d.]+) % off",
    )
    cells = [double["error_5n"], double["error_10n"], double["error_2n"]]
    cells += [fine[f"error_{load}n"] for load in (2, 5, 10)]
    pairs += rounded(errors, (100 * float(cell) for cell in cells))
    ends = said(
        "docs/simulator.md",
        r"The `data` mesh is (\d+) to (\d+) % off the converged one up to 10 N, and ([\d.]+) % at 35 N",
    )
    up_to_10 = spread(100 * float(data[f"error_{load}n"]) for load in (2, 5, 10))
    pairs += rounded(ends, [*up_to_10, 100 * float(data["error_35n"])])
    pairs += rounded(said("docs/simulator.md", r"takes (\d+) elements"), [float(default["elements"])])
    assert len(pairs) == 13 and wrong(pairs) == []


def test_what_the_library_leaves_is_that_of_the_bench():
    """The page had errors of a library of ten shells and another blend, while twelve had shipped for a week."""
    found, page = table("library"), "docs/design.md"
    nodes = [row for row in found if row["study"] == "nodes"]
    most = max((row["nodes"] for row in nodes), key=int)
    assert {row["nodes"] for row in found if row["study"].startswith("study") or row["study"] == "mesh"} == {
        most,
        str(int(most) + 1),
    }
    ends = said(page, r"is off by ([\d.]+) to ([\d.]+) % with five others, and by ([\d.]+) to ([\d.]+) % with eleven")
    pairs = rounded(ends[:2], spread(float(row["surface_percent"]) for row in nodes if row["nodes"] == "5"))
    pairs += rounded(ends[2:], spread(float(row["surface_percent"]) for row in nodes if row["nodes"] == most))
    meshes = said(
        page, r"are off by ([\d.]+) % on paths solved on `draft`, ([\d.]+) % on `data` and ([\d.]+) % on `fine`"
    )
    pairs += rounded(meshes, (float(row["force_percent"]) for row in found if row["study"] == "mesh"))
    figures = said(
        page,
        r"stiffness within ([\d.]+) %, pixels per newton ([\d.]+) %, bounds ([\d.]+) %, largest strain ([\d.]+) %, .*? "
        r"within ([\d.]+) %",
    )
    for written, kind in zip(figures, ("stiffness", "px_per_n", "bound", "strain", "patch"), strict=True):
        off = [abs(float(row["off_percent"])) for row in found if row["study"].startswith(f"study: {kind}")]
        pairs.append(Rounded(written, max(off)))
    by_case = {(r["nodes"], r["paths"]): float(r["force_percent"]) for r in found if r["study"] == "nodes and paths"}
    errors = said(
        page,
        r"off by ([\d.]+) % of the range an axis with eleven other shells .*? With seven shells it is ([\d.]+) %, "
        r"with five ([\d.]+) %; with eight paths ([\d.]+) %, with four ([\d.]+) %"
        r".*? the shell's own full simulation are off by ([\d.]+) %",
    )
    cases = ((most, "16"), ("7", "16"), ("5", "16"), (most, "8"), (most, "4"), ("0", "16"))
    pairs += rounded(errors, (by_case[case] for case in cases))
    assert len(pairs) == 18 and wrong(pairs) == []
