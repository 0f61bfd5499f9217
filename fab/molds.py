"""Command `python -m fab.molds D=130 T=8`: every file that a lab needs to print and cast an endcap of two sizes."""

from __future__ import annotations

import gc
import importlib
import sys
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cad.errors import FileError, ParameterError
from cad.feasible import diameter_range_mm
from cad.materials import silicones
from cad.messages import LOG, show
from cad.robot_sides import robot_sides
from cad.whole_file import probe_folder
from fab.cache import Cache
from fab.camera_view import few_dots_words
from fab.checks.check import require_passed
from fab.command import VARIANT_DEFAULTS, VARIANT_USAGE, Command, Interrupts, parse_variant
from fab.exports.whole_folder import whole_folder
from fab.pot_life import short_pot_life_words
from fab.progress import Progress
from fab.variant import Variant
from fab.workers import processes_with_room, worker_pool

if TYPE_CHECKING:
    from fab.checks.check import Check
    from fab.design import Design
    from fab.slice.printers import Printer

MOST_WORKERS = 4  # more gain little (bench/bench_molds_cores.py), as this process then takes longest
RECORD = "manifest.json"

HELP = """\
options, as NAME=VALUE:
  D=130            outer diameter of the silicone dome, mm ({low:.1f} to {high:g})
  T=8              thickness of its wall, mm (6.5 to a fifth of the radius; see README for the region)
  dots=1-6-10-12-16-18-20   dots of each ring from tip to equator, mirrored beyond it
  dot_mm=4         diameter of a dot (2.9 to 8)
  gyroid=0.1       fraction of TPU in the gyroid zone (0.08 to 0.12)
  joint_clearance=0.15   gap of the printed joints, mm a side: the best step of the fit coupon
                   (0.05 to about 0.21; the widest, by the leak, depends on size and silicone and is stated at once)
  material='Smooth-Sil 950'   silicone: {materials}
  robot=iso_9409_1_50_4_m6   what the arm adapter is screwed to: {robots}
  printer=generic256   refuses at once what its bed is too small for, and is noted for slices, page and build sheet:
                   {printers}
  exports=DIR      folder that receives D130_T8/ (default: exports/)
  cache=no         make everything anew: nothing is taken from earlier runs (~/.cache/endcap-toolkit/molds), or kept

Give D and T together. Every other choice has a folder of its own (D130_T8_c0.2, D130_T8_blank).
The files appear all together, after every check has passed, or not at all; a later run replaces the files that
manifest.json lists, and keeps everything else in the folder.
exit status: 0 written; 1 a check failed; 2 bad input or no place to write; 130 interrupted; 143 ended by SIGTERM
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    from fab.slice.printers import DEFAULT_PRINTER

    command = Command(
        "make molds",
        f"{VARIANT_USAGE} [printer=NAME] [exports=DIR] [cache=no]",
        "Make the mold, the TPU interface, the base and the assembly of one endcap.",
        _help,
        {**VARIANT_DEFAULTS, "printer": DEFAULT_PRINTER, "cache": "yes"},
    )
    return command.run(argv, _act)


def _help() -> str:
    from fab.slice.printers import printers

    low, high = diameter_range_mm()
    names: dict[str, Iterable[str]] = {"materials": silicones(), "robots": robot_sides(), "printers": printers()}
    return HELP.format(low=low, high=high, **{name: ", ".join(rows) for name, rows in names.items()})


def _act(options: dict[str, str], interrupts: Interrupts) -> int:
    variant, exports = parse_variant(options), Path(options["exports"])
    if options["cache"] not in ("yes", "no"):
        raise ParameterError(f"cache={options['cache']} is neither yes nor no", name="cache")
    from fab.slice.footprints import require_printer
    from fab.slice.printers import DEFAULT_PRINTER, printer

    where = printer(options["printer"])
    require_printer(variant.layout, where)
    for words in filter(None, (few_dots_words(variant.params), short_pot_life_words(variant.layout))):
        LOG.warning(f"make molds: {words}")
    asked = None if where.name == DEFAULT_PRINTER else where
    written = export(variant, exports, options["cache"] == "yes", interrupts, asked)
    show(f"{written.folder}: {written.summary}, {written.seconds:.1f} s")
    return 0


@dataclass(frozen=True)
class Written:
    """Result of an export: its folder, a summary of its files, and the time in seconds."""

    folder: Path
    summary: str
    seconds: float


def export(
    variant: Variant,
    exports: Path,
    use_cache: bool = True,
    interrupts: Interrupts | None = None,
    where: Printer | None = None,
) -> Written:
    """Make, check and write all files of a variant; if this fails, nothing is written.

    Args:
        variant: that is made.
        exports: folder that receives ``variant.label``.
        use_cache: whether the cache is read and written.
        interrupts: signals received; None for Python's own handling.
        where: the printer; None for none in particular.

    Raises:
        ChecksFailedError: a check failed.
        FileError: the folder cannot be written.
    """
    require_writable(exports)
    final = exports / variant.label
    interrupts = interrupts or Interrupts()
    check_interrupt = interrupts.raise_swallowed
    with Progress(check_interrupt) as progress, whole_folder(final, RECORD, check_interrupt) as folder:
        summary = cached_molds(variant, folder, interrupts, progress, use_cache, where)
    return Written(final, summary, progress.seconds)


def cached_molds(
    variant: Variant,
    folder: Path,
    interrupts: Interrupts,
    progress: Progress,
    use_cache: bool,
    where: Printer | None = None,
) -> str:
    """Restore a variant from the cache, if nothing that it depends on has changed, or make it.

    Args:
        variant: that is made.
        folder: empty; receives every file.
        interrupts: signals received.
        progress: called with the name of each step as it begins.
        use_cache: whether the cache is read and written.
        where: the printer; None for none in particular.

    Returns:
        Summary of the files.
    """
    cache = Cache()
    key = cache.key("molds", variant.identity | ({"printer": where.name} if where else {}))
    progress("cache")
    if use_cache and (values := cache.restore(key, folder)):
        return f"{values['summary']} (unchanged, from the cache)"
    load_libraries(progress)
    interrupts.raise_swallowed()
    # Forked once the libraries are loaded, so that no worker loads them again, and before one starts a thread.
    with worker_pool(worker_count()) as workers:
        summary = make_molds(variant, folder, workers, progress, cache if use_cache else None, where)
    if use_cache:
        progress("cache")
        cache.store(key, folder, sorted(path.name for path in folder.iterdir()), {"summary": summary})
    return summary


def worker_count() -> int:
    """Number of further processes that share the work: two, or as many as cores and memory allow."""
    return max(2, min(processes_with_room(), MOST_WORKERS))


def load_libraries(progress: Progress) -> None:
    """Import CAD kernel and mesh libraries, which takes seconds.

    Args:
        progress: called with the name of the step.
    """
    progress("CAD kernel")
    collects = gc.isenabled()
    gc.disable()
    try:
        for module in ("fab.design", "fab.exports.writer", "fab.checks.gates"):
            importlib.import_module(module)
    finally:
        if collects:
            gc.enable()
    gc.freeze()  # none of it becomes garbage, and each process would search it anew


def make_molds(
    variant: Variant,
    folder: Path,
    workers: Executor,
    progress: Progress,
    cache: Cache | None = None,
    where: Printer | None = None,
) -> str:
    """Build, write and check one endcap.

    Args:
        variant: that is made.
        folder: empty; receives every file.
        workers: processes that share the work.
        progress: called with the name of each step as it begins.
        cache: of results that do not depend on the clearance.
        where: the printer; None for none in particular.

    Returns:
        Summary of the files.

    Raises:
        ChecksFailedError: a check failed.
    """
    from fab.checks.gates import start_gates
    from fab.design import build_design
    from fab.exports import writer as files
    from fab.exports.index_page import write_index
    from fab.exports.part_3mf import write_3mf
    from fab.exports.preview_parts import preview_glb
    from fab.kept import SAME_AT_EVERY_CLEARANCE, kept_file

    design = build_design(variant.layout, workers, progress, cache=cache, robot=variant.robot)
    progress("files")
    files.write_meshes(design, folder)
    pending: list[Future[None]] = [workers.submit(files.write_pictures, *files.picture_items(design), folder)]
    for name, part in design.parts.items():
        if part.role == "printed":
            keeper = cache if name in SAME_AT_EVERY_CLEARANCE else None
            path = folder / f"{name}.3mf"
            pending.append(workers.submit(kept_file, keeper, "3MF", design.meshes[name], path, write_3mf))
    files.write_solids(design, folder)
    gates = start_gates(design, folder, workers, cache)
    progress("assemblies, preview")  # while the workers check
    files.write_assemblies(design, folder)
    preview = preview_glb(design, files.exploded_offsets_mm(design))
    checks = [*gates.checks(progress), *_bed_checks(design, where)]
    require_passed(checks, f"at {variant.words}")
    progress("pictures")
    for job in pending:
        job.result()
    progress("page")
    content = files.manifest(design, checks, folder) | ({"printer": where.name} if where else {})
    write_index(variant, content, checks, preview, folder)
    files.write_manifest(content, folder)
    return f"{len(list(folder.iterdir()))} files, {len(design.parts)} parts, all {len(checks)} checks passed"


def _bed_checks(design: Design, where: Printer | None) -> list[Check]:
    """Check the room that each printed part leaves on the printer's bed, besides the limit of all sizes (256 mm)."""
    from fab.checks.check import Check
    from fab.slice.pose import standing
    from fab.slice.printers import room_left_mm

    if where is None:
        return []
    printed = [name for name, part in design.parts.items() if part.role == "printed"]
    hulls = {name: standing(name, design.meshes[name].convex_hull) for name in printed}
    return [
        Check(f"{name}.room_on_{where.name}_mm", room_left_mm(hull, where), low=0.0) for name, hull in hulls.items()
    ]


def require_writable(folder: Path) -> None:
    """Make the exports folder before long work begins.

    Args:
        folder: of the exports.

    Raises:
        FileError: the folder cannot be made or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe_folder(folder)
    except OSError as error:
        raise FileError(
            f"exports={folder}: {error.strerror or error}: name a folder you may write with exports=DIR"
        ) from error


if __name__ == "__main__":
    sys.exit(main())
