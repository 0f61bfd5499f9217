"""Where the processor time of `make molds` goes: everything in one process on one core, by the functions that do it.

    python bench/bench_molds_where.py            D=130 T=8
    python bench/bench_molds_where.py 150 9      yours

Writes bench/molds_where.csv: what, processor seconds, share of the whole. The profiler costs a few per cent; shares
hold from computer to computer better than seconds.
"""

from __future__ import annotations

import argparse
import cProfile
import csv
import os
import pstats
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.sizes import Inline
from fab.command import VARIANT_DEFAULTS, parse_variant
from fab.molds import load_libraries, make_molds
from fab.variant import Variant

TABLE = Path(__file__).with_name("molds_where.csv")
# What no other line holds, and the function, in its file, that does it and nothing else.
PIECES = {
    "sweeps of steps past silicone, balance of volumes": ("fab/checks/gates.py", "demold_gates"),
    "sweeps of other steps, screws on their way": ("fab/checks/gates.py", "mold_gates"),
    "pictures": ("fab/exports/writer.py", "write_pictures"),
    "cup, base, hardware: solids and meshes": ("fab/packed.py", "packed_group"),
    "core, shell: solids": ("fab/design.py", "build_core_solids"),
    "interface: solid": ("cad/interface.py", "build_interface"),
    "core, shell, hanger: meshes": ("fab/design.py", "build_design"),
    "interface with its gyroid: mesh": ("fab/kept.py", "kept_interface_mesh"),
    "gyroid's imprint in the shell": ("fab/design.py", "imprinted"),
    "files of each part, read back": ("fab/checks/gates.py", "_file_checks"),
    "gyroid and nuts": ("fab/checks/gates.py", "_interface_checks"),
    "overlaps of the assemblies": ("fab/checks/gates.py", "_overlap_checks"),
    "wall, bumps, leak, air": ("fab/checks/gates.py", "cavity_gates"),
    "ways out of core and cup": ("fab/checks/gates.py", "extraction_gates"),
    "joints, screw axes": ("fab/checks/gates.py", "solid_gates"),
    "through holes, walls, overhangs, beds": ("fab/checks/gates.py", "print_gates"),
    "3MF": ("fab/exports/part_3mf.py", "write_3mf"),
    "STL": ("fab/exports/writer.py", "write_meshes"),
    "STEP": ("fab/exports/writer.py", "write_solids"),
    "assemblies": ("fab/exports/writer.py", "write_assemblies"),
    "preview of the page": ("fab/exports/preview_parts.py", "preview_glb"),
}
INSIDE = {  # of these the rest counts, once those that run inside of them are taken off
    "core, shell, hanger: meshes": (
        "cup, base, hardware: solids and meshes",
        "core, shell: solids",
        "interface: solid",
        "interface with its gyroid: mesh",
        "gyroid's imprint in the shell",
    ),
}


def main() -> None:
    """Measure and write."""
    variant = variant_on_one_core(__doc__, "bench_molds_where.py")
    load_libraries(print)
    profile = cProfile.Profile(time.process_time)
    with tempfile.TemporaryDirectory(prefix="molds-") as folder:
        start = time.process_time()
        profile.runcall(make_molds, variant, Path(folder), Inline(), print)
        all_s = time.process_time() - start
    rows = where(pstats.Stats(profile), all_s)
    with TABLE.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(("what", "cpu_s", "share"))
        writer.writerows((what, f"{seconds:.2f}", f"{seconds / all_s:.3f}") for what, seconds in rows)
    for what, seconds in rows:
        print(f"{seconds:6.1f} s {100 * seconds / all_s:5.1f} %  {what}")


def variant_on_one_core(description: str | None, program: str) -> Variant:
    """The size of the command line, D=130 T=8 unless typed; from here on this process keeps to one core.

    Args:
        description: of the program. program: its name.
    """
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter, prog=program
    )
    parser.add_argument("D", nargs="?", default="130")
    parser.add_argument("T", nargs="?", default="8")
    options = parser.parse_args()
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:1])
    return parse_variant({**VARIANT_DEFAULTS, "D": options.D, "T": options.T})


def where(stats: pstats.Stats, all_s: float) -> list[tuple[str, float]]:
    """(what, processor seconds) in falling order, and last what is left of the seconds of all."""
    spent = {
        what: sum(
            entry[3]
            for (file, _, name), entry in stats.stats.items()  # type: ignore[attr-defined]
            if name == function and file.endswith(path)
        )
        for what, (path, function) in PIECES.items()
    }
    for what, others in INSIDE.items():
        spent[what] -= sum(spent[other] for other in others)
    rows = sorted(spent.items(), key=lambda row: -row[1])
    return [*rows, ("everything else", all_s - sum(spent.values()))]


if __name__ == "__main__":
    sys.exit(in_one_line(main))
