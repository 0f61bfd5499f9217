"""Bond tests: known loads come back, units agree, faults are named by file and line, statistics by other ways."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import f_oneway

from cad.errors import FileError
from fab.bond_tests.__main__ import draw_boxes, main, report
from fab.bond_tests.files import Record, read_record
from fab.bond_tests.results import Specimen, compare, evaluate, holm, initial_peak, mean_interval, mean_peel, summarize

HEADER = ['"Specimen label : A1"', '"Failure type : material"', "", "Time,Extension,Load", "(s),(mm),(N)"]


def rows(displacement, load, rate=10.0):
    return [f'"{x / rate:.4f}","{x:.5f}","{y:.5f}"' for x, y in zip(displacement, load, strict=True)]


def write(path, displacement, load, header=None):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([*(HEADER if header is None else header), *rows(displacement, load)]) + "\n")
    return path


def pull(peak=100.0, n=200):
    x = np.linspace(0, 30, n)
    return x, np.where(x < 25, peak * x / 25, 0.5)


def peel(mean=20.0, peak=35.0, length=420.0, n=1680):
    """A ramp to an initial peak at 20 mm, then a wave of 10 mm about a mean, then apart."""
    x = np.linspace(0, length, n)
    steady = mean * (1 + 0.2 * np.sin(2 * np.pi * (x - 24) / 10))
    fall = np.interp(x, [0, 20, 24], [0, peak, mean])
    return x, np.where(x < 24, fall, np.where(x < length - 5, steady, 0.1))


def test_reads_names_units_and_failure(tmp_path):
    x, y = pull()
    record = read_record(write(tmp_path / "a.csv", x, y))
    assert record.failure == "material"
    assert record.load_n.max() == pytest.approx(y.max(), abs=1e-5)
    assert record.displacement_mm[-1] == pytest.approx(30.0)
    assert record.time_s is not None


@pytest.mark.parametrize(
    ("row", "failure"),
    [
        ("Failure load (N),81.2", ""),
        ("Failure criterion,Load drop 40 %", ""),
        ('"Failure load (N) : 81.2"', ""),
        ("Failures,2", ""),
        ("Failure,cohesive", "cohesive"),
        ("Failure:,cohesive", "cohesive"),
        ("Failure mode,Mixed", "mixed"),
        ('"Failure : adhesive"', "adhesive"),
        ("Failure type: material", "material"),
        ("Failure type,", ""),
    ],
)
def test_only_a_row_of_the_failure_itself_marks_it(tmp_path, row, failure):
    header = [row, '"Operator : Failure, Frank"', *HEADER[2:]]
    assert read_record(write(tmp_path / "a.csv", *pull(), header)).failure == failure
    after = [row, "Failure type : material", *HEADER[2:]]
    assert read_record(write(tmp_path / "b.csv", *pull(), after)).failure == (failure or "material")


@pytest.mark.parametrize(
    ("header", "scale"),
    [
        (["Time (s),Extension (mm),Load (N)"], (1, 1)),
        (["Time (s),Displacement (in),Force (lbf)"], (1 / 25.4, 1 / 4.4482216152605)),
        (["Time (s),Crosshead (cm),Load (kN)"], (0.1, 1e-3)),
        (["Prüfzeit,x", "Time,Extension,Load", "(s),(m),(kgf)"], (1e-3, 1 / 9.80665)),
    ],
)
def test_units_agree(tmp_path, header, scale):
    x, y = peel()
    lines = [f"{a / 10:.6f},{a * scale[0]:.9f},{b * scale[1]:.9f}" for a, b in zip(x, y, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join([*header, *lines]), encoding="utf-8")
    force, bond = mean_peel(read_record(tmp_path / "a.csv"))
    assert force == pytest.approx(mean_peel(Record(tmp_path, x, y, None, ""))[0], rel=1e-4)
    assert bond == pytest.approx(127.0, abs=0.01)


@pytest.mark.parametrize("cell", ["{:.5f}", "{:12.5f}", "{:+.5f}", " {:+.5f} "])
def test_semicolons_and_decimal_commas(tmp_path, cell):
    x, y = pull()
    row = ";".join([cell] * 3)
    lines = [row.format(a / 10, a, b).replace(".", ",") for a, b in zip(x, y, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(["Time (s);Extension (mm);Load (N)", *lines]))
    assert read_record(tmp_path / "a.csv").load_n.max() == pytest.approx(y.max(), abs=1e-5)


@pytest.mark.parametrize(
    ("header", "between"),
    [
        ("Time [s];Extension [mm];Load [N]", ""),
        ("Time;Extension;Load\n[s];[mm];[N]", ""),
        ("Reading;Travel [mm];Load [N]", ""),
        ("Time (s);Displacement (Strain 1) (mm);Load (N)", ""),
        ("Time (s);Extension (mm);Load (N)\n", ""),
        ("Time (s);Extension (mm);Load (N)\n;;", ""),
        ("Time;Extension;Load\n\ns;mm;N\n", ""),
        ("Time (s);Extension (mm);Load (N)", "\r"),
        ("Time / s;Extension / mm;Load / N", ""),
        ("Test time_s;Extension_mm;Load_N", ""),
        ("Zeit;Weg;Kraft\ns;mm;N", ""),
        ("Prüfzeit [s];Traversenweg [mm];Standardkraft [N]", ""),
        ("Zeit in s;Weg in mm;Kraft in N", ""),
    ],
)
@pytest.mark.parametrize("code", ["utf-8-sig", "utf-16", "cp1252"])
def test_dialects_of_other_makers(tmp_path, header, between, code):
    x, y = pull()
    lines = [f"{a / 10:.5f};{a:.5f};{b:.5f}".replace(".", ",") for a, b in zip(x, y, strict=True)]
    text = "\n".join(["Prüfer: Müller, Raum 3", header, *lines, ";;", ""]).replace("\n", between + "\r\n")
    (tmp_path / "a.csv").write_bytes(text.encode(code))
    record = read_record(tmp_path / "a.csv")
    assert record.load_n.max() == pytest.approx(y.max(), abs=1e-5)
    assert len(record.load_n) == len(y)


@pytest.mark.parametrize("cell", ["1,001.33", "0,0000"])
def test_a_comma_in_a_number_is_refused_as_a_comma(tmp_path, cell):
    path = write(tmp_path / "a.csv", *pull())
    path.write_text(path.read_text().replace(path.read_text().split("\n")[99].split(",")[2], f'"{cell}"'))
    with pytest.raises(FileError, match=rf"a\.csv:100: Load='{cell}' is no number: export a decimal point"):
        read_record(path)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda t: t.replace("(N)", "(MPa)"), r"a\.csv:5: unit 'mpa' of column 'Load' is not one of n, kn, lbf, kgf"),
        (lambda t: t.replace("(mm)", "(%)"), r"a\.csv:5: unit '%' of column 'Extension'"),
        (lambda t: t.replace("(s),(mm),(N)\n", ""), r"a\.csv:4: unit 'time'"),
        (lambda t: t.replace("Load", "Stress"), r"a\.csv: no row names a displacement"),
        (lambda t: t.replace("material", "vanished"), r"a\.csv:2: failure=vanished is not one of adhesive"),
        (lambda t: "\n".join(v for k, v in enumerate(t.split("\n")) if not 60 <= k < 80), r"a\.csv:61: .*a gap"),
        (lambda t: t.replace(t.split("\n")[99].split(",")[2], '""'), r"a\.csv:100: Load='' is no number: a gap"),
        (lambda t: "\n".join([*t.split("\n")[:5], *t.split("\n")[80:100], *t.split("\n")[5:80]]), "runs backwards"),
        (lambda t: f"{t}End of test\n", r"a\.csv:206: Time='End of test' is no number: only rows of numbers .* delete"),
        (lambda t: f"{t}Mean,12.5,81.2\n", r"a\.csv:206: Time='Mean' is no number: only rows of numbers"),
        (lambda t: t.replace("Load", "Load / MPa"), r"a\.csv: no row names a displacement"),
        (lambda t: "\n".join(t.split("\n")[:20]), r"a\.csv: 15 rows of numbers, at least 20"),
    ],
)
def test_bad_files_are_refused_by_name_and_line(tmp_path, spoil, message):
    path = write(tmp_path / "a.csv", *pull())
    path.write_text(spoil(path.read_text()))
    with pytest.raises(FileError, match=message):
        read_record(path)


def test_reversed_signs_are_refused(tmp_path):
    x, y = pull()
    with pytest.raises(FileError, match=r"a\.csv:171: load of -99.* N .*sign is reversed"):
        read_record(write(tmp_path / "a.csv", x, -y))
    lines = [f"{a / 10:.4f},{-a:.5f},{b:.5f}" for a, b in zip(x, y, strict=True)]
    (tmp_path / "b.csv").write_text("\n".join([*HEADER, *lines]))
    with pytest.raises(FileError, match=r"b\.csv:205: displacement ends at -30 mm, below its start: its sign"):
        read_record(tmp_path / "b.csv")


def test_mean_peel_is_the_integral_over_the_first_127_mm_of_bond(tmp_path):
    """Piecewise: the fall from the peak and a whole number of waves, in closed form."""
    x, y = peel()
    force, bond = mean_peel(Record(tmp_path, x, y, None, ""))
    exact = ((35 + 20) / 2 * 4 + 20 * 250) / 254
    assert (force, bond) == (pytest.approx(exact, rel=2e-3), pytest.approx(127.0, abs=0.1))
    uneven = np.concatenate([np.arange(0, 800, 8), np.arange(800, len(x))])  # sampled more densely later on
    assert mean_peel(Record(tmp_path, x[uneven], y[uneven], None, ""))[0] == pytest.approx(exact, rel=2e-2)
    late = y + np.where(x > 280, 20.0, 0.0) * (x < 414)  # what comes after 127 mm does not count
    assert mean_peel(Record(tmp_path, x, late, None, ""))[0] == pytest.approx(force, rel=1e-9)


def test_a_specimen_that_tears_early_is_marked(tmp_path):
    x, y = peel(length=150.0, n=600)
    specimen = evaluate(Record(tmp_path / "a.csv", x, y, None, "material"), "peel", "mechanical")
    assert not specimen.complete
    assert specimen.bond_mm == pytest.approx((145 - 20) / 2, abs=0.5)
    assert specimen.force_n == pytest.approx(20.2, rel=0.02)
    with pytest.raises(FileError, match="nothing was peeled"):
        mean_peel(Record(tmp_path / "a.csv", x, x, None, ""))
    assert initial_peak(np.array([0, 1.0, 0.5, 10, 20, 30, 20])) == 5  # a slip of the grips is no peak


def test_a_bond_far_weaker_than_its_first_peak_is_peeled_to_the_end(tmp_path):
    """A specimen has come apart when it holds little of its plateau, not of the peak."""
    x, y = peel(mean=20.0, peak=80.0)
    weak = np.where((x > 150) & (y > 1), 0.3 * y, y)  # 6 N: a third of the plateau, under a tenth of the peak
    specimen = evaluate(Record(tmp_path / "a.csv", x, weak, None, ""), "peel", "mechanical")
    exact = ((80 + 20) / 2 * 4 + 20 * 126 + 6 * 124) / 254
    assert specimen.complete and specimen.force_n == pytest.approx(exact, rel=5e-3)


def specimens(kind, group, forces):
    return [Specimen(f"{k}.csv", kind, group, f, f, "", 0.0, True) for k, f in enumerate(forces)]


def test_intervals_hold_what_they_promise():
    rng = np.random.default_rng(2)
    hits = 0
    for _ in range(1500):
        low, high = mean_interval(rng.normal(10.0, 3.0, size=5))
        hits += low < 10.0 < high
    assert hits / 1500 == pytest.approx(0.95, abs=0.02)
    table = 2.776 * math.sqrt(2.5) / math.sqrt(5)  # Student's t of four degrees of freedom
    assert mean_interval(np.arange(1.0, 6.0)) == pytest.approx((3.0 - table, 3.0 + table), abs=1e-3)
    assert all(math.isnan(v) for v in mean_interval(np.array([1.0])))


def test_comparison_agrees_with_all_permutations():
    first, second = [121.0, 128, 119, 131, 125], [88.0, 117, 101, 79, 124]
    (result,) = compare([*specimens("tensile", "a", first), *specimens("tensile", "b", second)])
    values = np.array(first + second)
    gaps = []
    for chosen in itertools.combinations(range(10), 5):
        inside = np.isin(np.arange(10), chosen)
        gaps.append(abs(values[inside].mean() - values[~inside].mean()))
    exact = np.mean(np.array(gaps) >= abs(result.difference_n) - 1e-9)
    assert result.p_mean == pytest.approx(exact, abs=0.03)
    assert result.ratio == pytest.approx(np.mean(first) / np.mean(second))
    assert result.low_n < result.difference_n < result.high_n
    assert (result.low_n > 0) == (result.p_mean < 0.05)
    swapped = compare([*specimens("tensile", "b", second), *specimens("tensile", "a", first)])[0]
    assert (swapped.difference_n, swapped.p_mean) == (-result.difference_n, pytest.approx(result.p_mean))


def test_welch_by_its_own_formula_and_holm_by_hand():
    a, b = np.array([4.0, 5, 6, 7]), np.array([1.0, 9, 2, 8, 3])
    (result,) = compare([*specimens("peel", "a", a), *specimens("peel", "b", b)])
    se = math.sqrt(a.var(ddof=1) / 4 + b.var(ddof=1) / 5)
    assert (result.low_n + result.high_n) / 2 == pytest.approx(a.mean() - b.mean())
    df = se**4 / ((a.var(ddof=1) / 4) ** 2 / 3 + (b.var(ddof=1) / 5) ** 2 / 4)
    grid = np.linspace(-200, (a.mean() - b.mean()) / se, 2_000_001)  # t density integrated, no library's t
    density = (
        math.gamma((df + 1) / 2) / math.sqrt(df * math.pi) / math.gamma(df / 2) * (1 + grid**2 / df) ** (-(df + 1) / 2)
    )
    tail = np.trapezoid(density, grid)
    assert result.p_mean == pytest.approx(2 * min(tail, 1 - tail), rel=1e-3)
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    away = [np.abs(each - np.median(each)) for each in (a, b)]  # Brown and Forsythe: an analysis of their variance
    assert result.p_spread == pytest.approx(f_oneway(*away).pvalue)


def test_command_from_files_to_figure(tmp_path, capsys):
    rng = np.random.default_rng(3)
    for kind, shape in (("tensile", pull), ("peel", peel)):
        for method, scale in (("mechanical", 1.0), ("sil-poxy", 0.5)):
            for k in range(4):
                x, y = shape()
                write(tmp_path / kind / method / f"{k}.csv", x, y * scale * (1 + 0.05 * rng.normal()))
    assert main([str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "mechanical against sil-poxy" in out
    result = json.loads((tmp_path / "bond_tests.json").read_text())
    assert [c["ratio"] for c in result["comparisons"]] == [pytest.approx(2.0, rel=0.15)] * 2
    assert result["groups"][0]["failures"] == {"material": 4}
    assert (tmp_path / "bond_tests.png").stat().st_size > 10_000
    assert len((tmp_path / "bond_specimens.csv").read_text().splitlines()) == 17
    assert main([str(tmp_path)]) == 0  # its own results do not come back as specimens
    assert main([str(tmp_path / "nothing")]) == 2
    assert "sort your exports" in capsys.readouterr().err


def test_a_specimen_without_a_mark_has_its_own_sign_in_the_picture(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, *_, **__: drawn.append(figure))
    some = specimens("peel", "a", [3.0, 4.0])
    draw_boxes([replace(some[0], failure="adhesive"), replace(some[1], failure="")], tmp_path / "a.png")
    handles, labels = drawn[0].axes[0].get_legend_handles_labels()
    assert labels == ["adhesive", "not marked"]
    assert handles[0].get_marker() != handles[1].get_marker()


def test_groups_of_one_have_no_interval():
    (group,) = summarize(specimens("peel", "a", [5.0, 1.0, 4.0, 2.0, 3.0]))
    assert (group.median_n, group.quartiles_n) == (3.0, (2.0, 4.0)) and group.deviation_n == pytest.approx(2.5**0.5)
    (group,) = summarize(specimens("peel", "a", [3.0]))
    assert (group.count, math.isnan(group.low_n)) == (1, True)
    assert "nan" not in report([group], [])
