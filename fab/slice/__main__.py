"""Command `python -m fab.slice D=130 T=8`: projects for PrusaSlicer and OrcaSlicer, sliced, read back and checked."""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cad.errors import ParameterError
from cad.messages import show
from fab.checks.check import require_passed
from fab.command import VARIANT_DEFAULTS, VARIANT_USAGE, Command, Interrupts, parse_variant
from fab.exports.whole_folder import whole_folder, write_record
from fab.progress import Progress
from fab.slice.printers import DEFAULT_PRINTER, Printer, printer, printers
from fab.workers import worker_pool

if TYPE_CHECKING:
    from fab.checks.check import Check
    from fab.slice.projects import Export, Plate
    from fab.slice.result import SliceResult

WORKERS = 2
FOLDER = "slice"
RECORD = "slice.json"
HELP = """\
options, as NAME=VALUE:
  D=130 T=8        the design; `make molds` with the same options must have run
  joint_clearance=0.15  material='Smooth-Sil 950'  robot=  dots=  dot_mm=  gyroid=   its variant
  exports=DIR      folder that holds D130_T8/ (default: exports/)
  printer=NAME     {printers}
                   (default: that of `make molds`, generic256 where it named none; rows of fab/slice/printers.csv)
  plates=nested    parts side by side on as few plates as fit; single: one job for each part
  parts=all        or names with commas, for example parts=interface_infill,base: only these are sliced, each by itself,
                   and nothing is written
  gcode=no         yes: keep the G-code beside the projects (slices anew)
  cache=no         slice everything anew: nothing is taken from earlier runs (~/.cache/endcap-toolkit), or kept

The table has time, plastic and layers of each plate; "float" counts the lines that begin with plastic neither below nor
beside them: over a pocket, in a bridge, in a strand of the gyroid.

Writes D130_T8/slice/: <plate>.prusa.3mf, <plate>.orca.3mf and slice.json, whole, after every gate has held.
exit status: 0 written; 1 a gate failed; 2 bad input, no export, or no PrusaSlicer; 130 interrupted
"""
COMMAND = Command(
    "make slice",
    f"{VARIANT_USAGE} [printer=NAME] [exports=DIR] [plates=single] [parts=NAMES] [gcode=yes] [cache=no]",
    "Slice every printed part of an endcap with PrusaSlicer and measure the moves.",
    lambda: HELP.format(printers=", ".join(printers())),
    {**VARIANT_DEFAULTS, "printer": "", "plates": "nested", "parts": "all", "gcode": "no", "cache": "yes"},
)


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    return COMMAND.run(argv, _act)


def _act(options: dict[str, str], interrupts: Interrupts) -> int:
    variant = parse_variant(options)
    for name in ("gcode", "cache"):
        if options[name] not in ("yes", "no"):
            raise ParameterError(f"{name}={options[name]} is neither yes nor no", name=name)
    if options["plates"] not in ("nested", "single"):
        raise ParameterError(f"plates={options['plates']} is neither nested nor single", name="plates")
    asked = printer(options["printer"]) if options["printer"] else None
    from fab.slice.projects import read_export
    from fab.slice.run import find_slicer

    slicer, export = find_slicer(), read_export(variant, Path(options["exports"]))
    how = SliceOptions(
        asked or printer(str(export.manifest.get("printer", DEFAULT_PRINTER))),
        options["plates"] == "nested",
        options["parts"],
        options["gcode"] == "yes",
        options["cache"] == "yes",
    )
    return slice_design(slicer, export, how, interrupts.raise_swallowed)


@dataclass(frozen=True)
class SliceOptions:
    """Options of slicing an export.

    Attributes:
        printer: on which it is printed.
        is_nested: whether parts share plates.
        parts: ``all``, or names with commas; then each is sliced by itself and nothing is written.
        keep_gcode: whether the G-code stays beside the projects.
        use_cache: whether plates sliced by earlier runs are taken from the cache, and new ones kept there.
    """

    printer: Printer
    is_nested: bool = True
    parts: str = "all"
    keep_gcode: bool = False
    use_cache: bool = True


def slice_design(
    slicer: str, export: Export, how: SliceOptions, check_interrupt: Callable[[], None] = lambda: None
) -> int:
    """Slice an exported design.

    Args:
        slicer: PrusaSlicer's program.
        export: folder of `make molds`, as read.
        how: printer, plates and parts.
        check_interrupt: raises KeyboardInterrupt where a library swallowed one.

    Returns:
        0.

    Raises:
        ChecksFailedError: a check failed; nothing is left.
        FileError: a file cannot be read or written.
        ParameterError: a part does not fit the printer's bed.
    """
    from fab.slice.projects import project_names, single_plates

    known = project_names(export)
    names = known if how.parts == "all" else how.parts.split(",")
    if unknown := sorted(set(names) - set(known)):
        raise ParameterError(
            f"parts={','.join(unknown)} not printed here: choose among {', '.join(known)}", name="parts"
        )
    if how.parts != "all":
        with tempfile.TemporaryDirectory(prefix="slice-") as scratch:
            plates = single_plates(names)
            checks = _sliced_and_gated(
                slicer, export, plates, Path(scratch), replace(how, keep_gcode=False), check_interrupt
            )[1]
        label = export.variant.label
        show(f"{label}: {len(names)} of {len(known)} parts, all {len(checks)} gates held; nothing was written")
        return 0
    plates = _side_by_side(export, how.printer, check_interrupt) if how.is_nested else single_plates(names)
    with whole_folder(export.folder / FOLDER, RECORD, check_interrupt) as folder:
        results, checks = _sliced_and_gated(slicer, export, plates, folder, how, check_interrupt)
        write_record(folder, RECORD, _record(slicer, export, how.printer, results, checks))
    kept = sum(result.is_kept for result in results)
    words = f" ({kept} unchanged, from the cache)" if kept else ""
    show(f"{export.folder / FOLDER}: {len(results)} projects in two dialects{words}, all {len(checks)} gates held")
    return 0


def _record(
    slicer: str, export: Export, where: Printer, results: Sequence[SliceResult], checks: Sequence[Check]
) -> dict[str, Any]:
    """Content of ``slice.json``."""
    from fab.slice.run import slicer_version

    return {
        "printer": {**asdict(where), "size": where.size},
        "digest": export.params.digest,
        "manifest_sha256": export.manifest_sha256,
        "slicer": f"PrusaSlicer {slicer_version(slicer)}",
        "projects": [result.record() for result in results],
        "checks": [check.record(6) for check in checks],
    }


def _side_by_side(export: Export, where: Printer, check_interrupt: Callable[[], None]) -> list[Plate]:
    """Nest the parts on plates."""
    from fab.slice.projects import nested_plates

    with Progress(check_interrupt) as progress:
        progress("parts side by side on plates")
        return nested_plates(export, where)


def _sliced_and_gated(
    slicer: str,
    export: Export,
    plates: Sequence[Plate],
    folder: Path,
    how: SliceOptions,
    check_interrupt: Callable[[], None],
) -> tuple[list[SliceResult], list[Check]]:
    """Slice the plates in parallel, print the summary, and raise if a check failed."""
    from fab.slice.projects import GYROID
    from fab.slice.result import summary

    first = sorted(plates, key=lambda plate: plate.name != GYROID)  # the longest, which one process would end alone
    with Progress(check_interrupt) as progress, worker_pool(WORKERS) as workers:
        pending = {plate.name: workers.submit(_timed, slicer, export, plate, folder, how) for plate in first}
        results = []
        for done, plate in enumerate(plates):
            progress(f"{plate.name} ({done + 1} of {len(plates)})")
            result, seconds = pending[plate.name].result()
            results.append(result)
            progress.done(seconds)
    show(summary(results, how.parts == "all"))
    checks = [check for result in results for check in result.checks]
    require_passed(checks, f"at {export.variant.label}")
    return results, checks


def _timed(slicer: str, export: Export, plate: Plate, folder: Path, how: SliceOptions) -> tuple[SliceResult, float]:
    """Result of one plate, and the seconds that it took."""
    began = time.monotonic()
    result = _slice_one(slicer, export, plate, folder, how)
    return result, time.monotonic() - began


def _slice_one(slicer: str, export: Export, plate: Plate, folder: Path, how: SliceOptions) -> SliceResult:
    """Build, write, slice and measure one plate."""
    from fab.cache import Cache
    from fab.slice.projects import build_project
    from fab.slice.result import slice_project

    project = build_project(export, plate, how.printer)
    return slice_project(slicer, project, folder, export.params, how.keep_gcode, Cache() if how.use_cache else None)


if __name__ == "__main__":
    sys.exit(main())
