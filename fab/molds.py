"""`python -m fab.molds D=130 T=8`: from two numbers to every file that a lab needs to print and cast an endcap."""

from __future__ import annotations

import argparse
import importlib
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from pathlib import Path

from cad.errors import EndcapError, FileError, ParameterError
from cad.feasible import diameter_range_mm
from cad.mold_layout import JOINT_CLEARANCE_MM, MoldLayout
from cad.params import EndcapParams
from fab.check import Check

ROOT = Path(__file__).resolve().parent.parent
DEFAULTS = {"D": "130", "T": "8", "joint_clearance": f"{JOINT_CLEARANCE_MM:g}", "exports": str(ROOT / "exports")}
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


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="make molds",
        usage="make molds [D=MM] [T=MM] [joint_clearance=MM] [exports=DIR]",
        description="Make the mold, the TPU interface, the base and the assembly of one endcap.",
        epilog=HELP.format(low=diameter_range_mm()[0], high=diameter_range_mm()[1]),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("options", nargs="*", metavar="NAME=VALUE", help=argparse.SUPPRESS)
    arguments, unknown = parser.parse_known_args(argv)
    interrupts: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: _interrupt(interrupts, number))
    try:
        options = parse_options([*arguments.options, *unknown])
        params = EndcapParams(parse_length("D", options["D"]), parse_length("T", options["T"]))
        layout = MoldLayout(params, parse_length("joint_clearance", options["joint_clearance"]))
        require_writable(Path(options["exports"]))
        progress = Progress()
        load_libraries(progress)
        if interrupts:  # a guard round some library's optional import may have swallowed it
            raise KeyboardInterrupt
        return make_molds(layout, Path(options["exports"]), progress)
    except EndcapError as error:
        print(f"make molds: {error}", file=sys.stderr)
        return 1 if isinstance(error, ChecksFailedError) else 2
    except (Exception, KeyboardInterrupt):
        if not interrupts:
            raise
        print("make molds: interrupted; nothing was left behind", file=sys.stderr)
        return 130
    finally:
        signal.signal(signal.SIGINT, before)


def _interrupt(interrupts: list[int], number: int) -> None:
    """Remember a Ctrl-C: while the CAD kernel is loaded it may come out as an ImportError, or not at all."""
    interrupts.append(number)
    raise KeyboardInterrupt


def parse_options(words: Sequence[str], defaults: Mapping[str, str] = DEFAULTS) -> dict[str, str]:
    """Read NAME=VALUE words over the defaults.

    Raises:
        ParameterError: an unknown name, or a word of another form.
    """
    options = dict(defaults)
    for word in words:
        name, equals, value = word.partition("=")
        if not equals or name not in defaults or not value:
            raise ParameterError(
                f"{word!r} is not an option: give {', '.join(f'{n}=...' for n in defaults)}", name=name
            )
        options[name] = value
    return options


def parse_length(name: str, text: str) -> float:
    """Read a length in millimetres.

    Raises:
        ParameterError: not a number.
    """
    try:
        return float(text)
    except ValueError:
        raise ParameterError(
            f"{name}={text} is not a number: give millimetres without a unit, for example D=130 T=8",
            name=name,
            value=text,
        ) from None


def load_libraries(progress: Progress) -> None:
    """Import CAD kernel and mesh libraries, which takes seconds."""
    progress("CAD kernel")
    for module in ("fab.design", "fab.exports", "fab.gates"):
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
    from fab import exports as files
    from fab.design import build_design
    from fab.gates import run_gates

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
        require_passed(checks, layout.params)
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


class ChecksFailedError(EndcapError):
    """A gate did not hold, so the folder was not written."""


def require_passed(checks: Sequence[Check], params: EndcapParams) -> None:
    """Name every check that failed.

    Raises:
        ChecksFailedError: there is one.
    """
    failed = [check for check in checks if not check.ok]
    for check in failed:
        print(f"make molds: check failed: {check.name} = {check.value:.6g}, wanted {check.limit}", file=sys.stderr)
    if failed:
        raise ChecksFailedError(f"{len(failed)} of {len(checks)} checks failed at {params.label}; nothing was written")


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


class Progress:
    """One line for each step on a terminal; silent elsewhere."""

    def __init__(self) -> None:
        self._start = time.monotonic()
        self._shown = sys.stderr.isatty()

    @property
    def seconds(self) -> float:
        """Time since the start."""
        return time.monotonic() - self._start

    def __call__(self, step: str) -> None:
        """Announce a step."""
        if self._shown:
            print(f"\r\033[K[{self.seconds:5.1f} s] {step}", end="", file=sys.stderr, flush=True)

    def end(self) -> None:
        """Clear the line."""
        if self._shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
