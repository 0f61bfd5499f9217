"""`python -m fab.molds D=130 T=8`: from two numbers to every file that a lab needs to print and cast an endcap."""

from __future__ import annotations

import importlib
import multiprocessing
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from pathlib import Path

from cad.errors import FileError
from cad.feasible import diameter_range_mm
from cad.mold_layout import JOINT_CLEARANCE_MM, MoldLayout
from fab.checks.check import require_passed
from fab.command import EXPORTS, Command, Interrupts, parse_design, parse_length
from fab.progress import Progress

WORKERS = 2  # the gyroid beside the solids, then mesh checks side by side

HELP = """\
options, as NAME=VALUE:
  D=130            outer diameter of the silicone dome, mm ({low:.1f} to {high:g})
  T=8              thickness of its wall, mm (6.5 to a fifth of the radius; see README for the region)
  joint_clearance=0.15   gap of the printed joints, mm a side (0.05 to 0.30): the best step of the fit coupon
  exports=DIR      folder that receives D130_T8/ (default: exports/)

The folder appears whole, after every check has passed, or not at all.
exit status: 0 written; 1 a check failed; 2 bad input or no place to write; 130 interrupted
"""
COMMAND = Command(
    "make molds",
    "[D=MM] [T=MM] [joint_clearance=MM] [exports=DIR]",
    "Make the mold, the TPU interface, the base and the assembly of one endcap.",
    HELP.format(low=diameter_range_mm()[0], high=diameter_range_mm()[1]),
    {"D": "130", "T": "8", "joint_clearance": f"{JOINT_CLEARANCE_MM:g}", "exports": EXPORTS},
)


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    return COMMAND.run(argv, _act)


def _act(options: dict[str, str], interrupts: Interrupts) -> int:
    layout = MoldLayout(parse_design(options), parse_length("joint_clearance", options["joint_clearance"]))
    require_writable(Path(options["exports"]))
    progress = Progress()
    load_libraries(progress)
    interrupts.raise_swallowed()
    return make_molds(layout, Path(options["exports"]), progress)


def load_libraries(progress: Progress) -> None:
    """Import CAD kernel and mesh libraries, which takes seconds."""
    progress("CAD kernel")
    for module in ("fab.design", "fab.exports.writer", "fab.checks.gates"):
        importlib.import_module(module)


def make_molds(layout: MoldLayout, exports: Path, progress: Progress) -> int:
    """Build, write and check one endcap.

    Args:
        layout: the two numbers and the joint clearance.
        exports: folder that receives ``layout.params.label``; it exists.
        progress: told each step.

    Returns:
        0.

    Raises:
        ChecksFailedError: a check failed; nothing is left.
        FileError: the folder cannot be written.
    """
    final = exports / layout.params.label
    # Forked once the libraries are loaded, so that no worker loads them again, and before any of them starts a thread.
    context = multiprocessing.get_context("fork")
    # Ctrl-C reaches every process: a worker dies of it without a word, and this process tidies up.
    with ProcessPoolExecutor(WORKERS, context, signal.signal, (signal.SIGINT, signal.SIG_DFL)) as workers:
        for _ in range(WORKERS):
            workers.submit(os.getpid)
        try:
            return _make(layout, final, workers, progress)
        except BaseException:
            workers.shutdown(wait=False, cancel_futures=True)
            raise
        finally:
            progress.end()


def _make(layout: MoldLayout, final: Path, workers: ProcessPoolExecutor, progress: Progress) -> int:
    """Build, write and check with running workers."""
    from fab.checks.gates import run_gates
    from fab.design import build_design
    from fab.exports import writer as files

    design = build_design(layout, workers, progress)
    with files.whole_folder(final) as folder, finished([]) as pending:
        progress("files")
        files.write_meshes(design, folder)
        pending.append(workers.submit(files.write_pictures, *files.picture_items(design), folder))
        for name, part in design.parts.items():
            if part.role == "printed":
                pending.append(workers.submit(files.write_3mf, design.meshes[name], name, folder / f"{name}.3mf"))
        files.write_solids(design, folder)
        checks = run_gates(design, folder, workers, progress)
        require_passed(checks, f"at {layout.params.label}")
        progress("assembly and pictures")
        files.write_assemblies(design, folder)
        for job in pending:
            job.result()
        files.write_manifest(files.manifest(design, checks, folder), folder)
        count = len(list(folder.iterdir()))
    print(
        f"{final}: {count} files, {len(design.parts)} parts, all {len(checks)} checks passed, {progress.seconds:.0f} s"
    )
    return 0


@contextmanager
def finished(jobs: list[Future[None]]) -> Iterator[list[Future[None]]]:
    """Leave only when no worker writes any more: what is removed afterwards must stay removed."""
    try:
        yield jobs
    finally:
        for job in jobs:
            job.cancel()
        wait(jobs)


def require_writable(folder: Path) -> None:
    """Make the exports folder, or say at once why it cannot be.

    Raises:
        FileError: it cannot be made or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".probe-{os.getpid()}"
        probe.write_bytes(b"\0" * 4096)
        probe.unlink()
    except OSError as error:
        raise FileError(
            f"exports={folder}: {error.strerror or error}: name a folder you may write with exports=DIR"
        ) from error


if __name__ == "__main__":
    sys.exit(main())
