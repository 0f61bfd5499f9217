"""Command `python -m fab.bond_tests DIR`: bond strengths from files of a testing machine, as the paper reports them."""

from __future__ import annotations

import argparse
import csv
import io
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path

from cad.errors import EndcapError, FileError
from cad.extras import program
from cad.messages import LOG, show
from cad.whole_file import drafted, put_file
from fab.bond_tests.files import read_record
from fab.bond_tests.results import KINDS, Comparison, Group, Specimen, compare, evaluate, summarize

LAYOUT = "tensile/METHOD/*.csv or peel/METHOD/*.csv"
TABLE = "bond_specimens.csv"
MOST_NAMED = 5  # files in the warning of those left out
HELP = """\
DIR holds one folder for each test and bonding method, with one CSV file for each specimen:

  DIR/tensile/mechanical/*.csv    DIR/tensile/sil-poxy/*.csv
  DIR/peel/mechanical/*.csv       DIR/peel/sil-poxy/*.csv

Files are raw data as the machine exports them (Instron Bluehill and alike): load and displacement, units in the
header; a row "Failure type : material" (adhesive, cohesive, material or mixed) above the numbers marks the failure.
Tensile: largest load. Peel: mean load over 127 mm of bond after the initial peak (ASTM D1876).

writes bond_specimens.csv, bond_tests.json and bond_tests.png
exit status: 0 written; 2 bad input, named by file and line; 130 interrupted
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog=program("python -m fab.bond_tests"),
        description="Bond strengths from load-displacement files: statistics, tests and box plots.",
        epilog=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder of tests, see below")
    parser.add_argument("--out", type=Path, help="where to write (default: DIR)")
    arguments = parser.parse_args(argv)
    try:
        specimens = read_folder(arguments.folder)
        if left := left_out(arguments.folder):
            names = ", ".join(left[:MOST_NAMED]) + (", ..." if len(left) > MOST_NAMED else "")
            LOG.warning(f"bond_tests: {len(left)} CSV files are left out, not in {LAYOUT}: {names}")
        groups, comparisons = summarize(specimens), compare(specimens)
        write_results(specimens, groups, comparisons, arguments.out or arguments.folder)
    except EndcapError as error:
        LOG.error(f"bond_tests: {error}")
        return 2
    except KeyboardInterrupt:
        LOG.error("bond_tests: interrupted")
        return 130
    show(report(groups, comparisons))
    return 0


def read_folder(folder: Path) -> list[Specimen]:
    """Specimens of a folder, sorted by test, method and file name.

    Args:
        folder: with ``tensile/METHOD/*.csv`` and ``peel/METHOD/*.csv``, in upper or lower case.

    Raises:
        FileError: no files, or one that is refused.
    """
    specimens = [evaluate(read_record(path), kind, path.parent.name) for kind, path in _records(folder)]
    if not specimens:
        raise FileError(f"{folder}: no files like {LAYOUT}: sort your exports that way")
    return specimens


def left_out(folder: Path) -> list[str]:
    """CSV files below a folder that :func:`read_folder` does not read, except the command's own table.

    Args:
        folder: of the tests.

    Returns:
        Paths relative to the folder, sorted.
    """
    read = {path for _, path in _records(folder)}
    others = {path for path in folder.rglob("*") if path.suffix.lower() == ".csv" and path.name != TABLE}
    return sorted(str(path.relative_to(folder)) for path in others - read)


def _records(folder: Path) -> list[tuple[str, Path]]:
    """Kind of test and CSV file of each specimen; machines also write ``.CSV``."""
    found = []
    for kind in KINDS:
        methods = (path for path in folder.glob("*/*") if path.parent.name.lower() == kind and path.is_dir())
        for method in sorted(methods):
            found += [(kind, path) for path in sorted(method.iterdir()) if path.suffix.lower() == ".csv"]
    return found


def report(groups: Sequence[Group], comparisons: Sequence[Comparison]) -> str:
    """Results as text, a line for each group and each comparison.

    Args:
        groups: statistics of the groups.
        comparisons: of pairs of groups.
    """
    lines = []
    for g in groups:
        failures = ", ".join(f"{count} {mark}" for mark, count in g.failures.items())
        notes = "; ".join(filter(None, [failures, f"{g.incomplete} peeled less than 127 mm" if g.incomplete else ""]))
        spread = f" [{g.low_n:.1f}, {g.high_n:.1f}]  s {g.deviation_n:.1f}  median {g.median_n:.1f}"
        lines.append(
            f"{g.kind:8} {g.group:14} n={g.count}  mean {g.mean_n:.1f} N"
            + (spread if g.count > 1 else ", no interval of a single specimen")
            + (f"  ({notes})" if notes else "")
        )
    for c in comparisons:
        lines.append(
            f"{c.kind:8} {c.first} against {c.second}: {c.ratio:.2f} times, {c.difference_n:+.1f} N "
            f"[{c.low_n:.1f}, {c.high_n:.1f}], p={c.p_mean_holm:.2g} (means, Welch), {c.p_rank:.2g} (ranks), "
            f"{c.p_spread:.2g} (spread)"
        )
    return "\n".join(lines)


def write_results(
    specimens: Sequence[Specimen], groups: Sequence[Group], comparisons: Sequence[Comparison], folder: Path
) -> None:
    """Write table, statistics and box plots; no file is ever left incomplete.

    Args:
        specimens: rows of the table.
        groups: statistics of the groups.
        comparisons: of pairs of groups.
        folder: made if it is missing.

    Raises:
        FileError: the folder cannot be written.
    """
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow([field.name for field in fields(Specimen)])
    writer.writerows([list(asdict(s).values()) for s in specimens])
    content = {"groups": [asdict(g) for g in groups], "comparisons": [asdict(c) for c in comparisons]}
    text = json.dumps(_plain(content), indent=1, allow_nan=False)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, data in ((TABLE, table.getvalue()), ("bond_tests.json", text + "\n")):
            put_file(folder / name, data.encode())
        with drafted(folder / "bond_tests.png") as draft:
            draw_boxes(specimens, draft)
    except OSError as error:
        raise FileError(f"{folder}: {error.strerror or error}: name a folder you may write with --out") from error


def draw_boxes(specimens: Sequence[Specimen], path: Path) -> None:
    """Draw the paper's figure: box plots of largest tensile and mean peel force, each specimen as a dot.

    Args:
        specimens: of both tests or of one.
        path: of the PNG file.
    """
    from matplotlib.figure import Figure

    kinds = [kind for kind in KINDS if any(s.kind == kind for s in specimens)]
    figure = Figure(figsize=(4.6 * len(kinds), 4.2), layout="constrained")
    marks = {"": "x", "adhesive": "o", "cohesive": "s", "material": "^", "mixed": "D"}
    labels = {"tensile": "max tensile force, N", "peel": "mean peel force, N"}
    for k, kind in enumerate(kinds):
        axes = figure.add_subplot(1, len(kinds), k + 1)
        names = list(dict.fromkeys(s.group for s in specimens if s.kind == kind))
        is_marked = any(s.failure for s in specimens if s.kind == kind)
        forces = [[s.force_n for s in specimens if (s.kind, s.group) == (kind, name)] for name in names]
        axes.boxplot(forces, tick_labels=names, widths=0.5, showfliers=False, medianprops={"color": "tab:red"})
        for place, name in enumerate(names, start=1):
            members = [s for s in specimens if (s.kind, s.group) == (kind, name)]
            for j, s in enumerate(members):
                shift = 0.16 * ((j + 0.5) / len(members) - 0.5)
                seen = axes.get_legend_handles_labels()[1]
                label = s.failure or ("not marked" if is_marked else "")
                name = label if label not in seen else ""
                axes.plot(place + shift, s.force_n, marks[s.failure], ms=5, color="0.25", alpha=0.8, label=name)
        axes.set_ylabel(labels[kind])
        axes.set_ylim(0, None)
        axes.set_title(f"({'ab'[k]}) {kind}")
        if axes.get_legend_handles_labels()[0]:
            axes.legend(title="failure", fontsize=8)
    figure.savefig(path, dpi=120, metadata={"Software": None})


def _plain(value: object) -> object:
    """Copy of a value with None for NaN, which JSON does not have."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and value != value else value


if __name__ == "__main__":
    sys.exit(main())
