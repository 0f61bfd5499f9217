"""`python -m fab.slice D=130 T=8`: projects for PrusaSlicer and OrcaSlicer, sliced, read back and gated."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cad.errors import ParameterError
from fab.checks.check import require_passed
from fab.command import VARIANT_DEFAULTS, Command, Interrupts, parse_variant
from fab.exports.whole_folder import whole_folder, write_record
from fab.progress import Progress
from fab.variant import Variant
from fab.workers import worker_pool

if TYPE_CHECKING:
    from fab.checks.check import Check
    from fab.slice.projects import Export
    from fab.slice.result import SliceResult

WORKERS = 2
FOLDER = "slice"
RECORD = "slice.json"
HELP = """\
options, as NAME=VALUE:
  D=130 T=8        the design; `make molds` with the same options must have run
  joint_clearance=0.15  material='Smooth-Sil 950'   its variant
  exports=DIR      folder that holds D130_T8/ (default: exports/)
  parts=all        or names with commas, for example parts=interface_infill,base: only these are sliced,
                   and nothing is written
  gcode=no         yes: keep the G-code beside the projects

Writes D130_T8/slice/: <part>.prusa.3mf, <part>.orca.3mf and slice.json, whole, after every gate has held.
exit status: 0 written; 1 a gate failed; 2 bad input, no export, or no PrusaSlicer; 130 interrupted
"""
COMMAND = Command(
    "make slice",
    "[D=MM T=MM] [joint_clearance=MM] [material=NAME] [exports=DIR] [parts=NAMES] [gcode=yes]",
    "Slice every printed part of an endcap with PrusaSlicer and measure the moves.",
    HELP,
    {**VARIANT_DEFAULTS, "parts": "all", "gcode": "no"},
)


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    return COMMAND.run(argv, _act)


def _act(options: dict[str, str], _: Interrupts) -> int:
    variant = parse_variant(options)
    if options["gcode"] not in ("yes", "no"):
        raise ParameterError(f"gcode={options['gcode']} is neither yes nor no", name="gcode")
    return slice_design(variant, Path(options["exports"]), options["parts"], options["gcode"] == "yes")


def slice_design(variant: Variant, exports: Path, parts: str = "all", keep_gcode: bool = False) -> int:
    """Slice an exported design.

    Args:
        variant: what was exported.
        exports: folder that holds ``variant.label``.
        parts: ``all``, or names of projects with commas; then nothing is written.
        keep_gcode: whether the G-code stays beside the projects.

    Returns:
        0.

    Raises:
        ChecksFailedError: a gate did not hold; nothing is left.
        SlicerMissingError: PrusaSlicer is not installed.
        FileError: no export, or a file cannot be read or written.
    """
    from fab.slice.projects import project_names, read_export
    from fab.slice.run import find_slicer, slicer_version

    slicer = find_slicer()
    export = read_export(variant, exports)
    known = project_names(export)
    names = known if parts == "all" else parts.split(",")
    if strangers := sorted(set(names) - set(known)):
        raise ParameterError(
            f"parts={','.join(strangers)} not printed here: choose among {', '.join(known)}", name="parts"
        )
    if parts != "all":
        with tempfile.TemporaryDirectory(prefix="slice-") as scratch:
            checks = _sliced_and_gated(slicer, export, names, Path(scratch), keep_gcode=False)[1]
        print(
            f"{variant.label}: {len(names)} of {len(known)} projects, all {len(checks)} gates held; nothing was written"
        )
        return 0
    with whole_folder(export.folder / FOLDER, RECORD) as folder:
        results, checks = _sliced_and_gated(slicer, export, names, folder, keep_gcode)
        record = {
            "digest": variant.params.digest,
            "manifest_sha256": export.manifest_sha256,
            "slicer": f"PrusaSlicer {slicer_version(slicer)}",
            "projects": [result.record() for result in results],
            "checks": [check.record(6) for check in checks],
        }
        write_record(folder, RECORD, record)
    print(f"{export.folder / FOLDER}: {len(results)} projects in two dialects, all {len(checks)} gates held")
    return 0


def _sliced_and_gated(
    slicer: str, export: Export, names: Sequence[str], folder: Path, keep_gcode: bool
) -> tuple[list[SliceResult], list[Check]]:
    """Slice side by side, print the summary, and insist on the gates."""
    from fab.slice.result import summary

    with Progress() as progress, worker_pool(WORKERS) as workers:
        pending = [workers.submit(_slice_one, slicer, export, name, folder, keep_gcode) for name in names]
        results = []
        for done, (name, future) in enumerate(zip(names, pending, strict=True)):
            progress(f"{name} ({done + 1} of {len(names)})")
            results.append(future.result())
    print(summary(results))
    checks = [check for result in results for check in result.checks]
    require_passed(checks, f"at {export.variant.label}")
    return results, checks


def _slice_one(slicer: str, export: Export, name: str, folder: Path, keep_gcode: bool) -> SliceResult:
    """Work of one process."""
    from fab.slice.projects import build_project
    from fab.slice.result import slice_project

    return slice_project(slicer, build_project(export, name), folder, export.params, keep_gcode)


if __name__ == "__main__":
    sys.exit(main())
