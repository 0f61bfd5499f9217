"""Calls of PrusaSlicer's command line: its report on a project, and its G-code.

PrusaSlicer ends with status 0 even for open meshes and for prints beside the bed, so the status alone is never relied
on. The bed must be given on the command line: version 2.5 does not read it from a project.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from cad.errors import EndcapError, FileError
from fab.slice.printers import Printer, printer
from fab.workers import end_with_parent

NAMES = ("prusa-slicer", "PrusaSlicer", "prusa-slicer-console")
INSTALL = "apt-get install -y --no-install-recommends prusa-slicer"
_FAULTS = ("open_edges", "degenerate_facets", "edges_fixed", "facets_removed", "facets_reversed", "backwards_edges")
_NOISE = ("trace]", "Initializing StaticPrintConfigs")


class SlicerMissingError(EndcapError):
    """PrusaSlicer is not installed."""


@dataclass(frozen=True)
class ModelInfo:
    """Report of ``--info`` on a project.

    Attributes:
        is_manifold: every mesh of it is closed.
        bodies: connected bodies of all its objects.
        faults: counted or repaired by the slicer, ``name = value``.
    """

    is_manifold: bool
    bodies: int
    faults: tuple[str, ...]


def find_slicer() -> str:
    """Path of PrusaSlicer's program.

    Raises:
        SlicerMissingError: it is not installed; the message has the command that installs it.
    """
    for name in NAMES:
        if path := shutil.which(name):
            return path
    raise SlicerMissingError(
        f"PrusaSlicer was not found (looked for {', '.join(NAMES)}): on Debian run `sudo {INSTALL}`, elsewhere install "
        "PrusaSlicer 2.5 or later and put it on PATH"
    )


def slicer_version(slicer: str) -> str:
    """Version of the slicer, for example ``2.5.0``; ``unknown`` where it states none.

    Args:
        slicer: path of PrusaSlicer's program.
    """
    said = subprocess.run([slicer, "--help"], capture_output=True, text=True, check=False, env=_environment()).stdout
    found = re.search(r"PrusaSlicer-(\d+\.\d+\.\d+)", said)
    return found[1] if found else "unknown"


def model_info(slicer: str, project: Path) -> ModelInfo:
    """Read the slicer's report on a project.

    Args:
        slicer: path of PrusaSlicer's program.
        project: the 3MF file.

    Raises:
        FileError: the slicer cannot read the project.
    """
    said = _run(slicer, ["--info", str(project)], project)
    values = re.findall(r"^(\w+) =\s+(\S+)\s*$", said.replace(" = ", " =  "), flags=re.MULTILINE)
    manifold = [value == "yes" for key, value in values if key == "manifold"]
    if not manifold:
        raise FileError(f"{project.name}: the slicer found no mesh in it: write the project again")
    faults = tuple(f"{key} = {value}" for key, value in values if key in _FAULTS and value != "0")
    bodies = sum(int(value) for key, value in values if key == "number_of_parts")
    return ModelInfo(all(manifold), bodies, faults)


def slice_to_gcode(slicer: str, project: Path, gcode: Path, where: Printer | None = None) -> tuple[str, ...]:
    """Slice a project without rearranging its parts.

    Args:
        slicer: PrusaSlicer's program.
        project: the 3MF file.
        gcode: receives the G-code.
        where: the printer; by default any with a 256 mm bed.

    Returns:
        Warnings of the slicer, one a line.

    Raises:
        FileError: the slicer wrote no G-code; its last line of output is in the message.
    """
    bed = ",".join((where or printer()).corners)
    words = ["--loglevel", "2", "--dont-arrange", "--bed-shape", bed, "-g", "-o", str(gcode), str(project)]
    said = _run(slicer, words, project)
    if not gcode.exists():
        raise FileError(f"{project.name}: the slicer made no G-code: {_last_words(said)}")
    steps = ("=>", "Slicing result exported", "Exporting G-code")
    lines = (line.strip() for line in said.splitlines())
    return tuple(line for line in lines if line and not any(mark in line for mark in (*steps, *_NOISE)))


def _run(slicer: str, words: list[str], project: Path) -> str:
    follow = partial(end_with_parent, os.getpid())  # otherwise the slicer would outlive a killed command
    done = subprocess.run(
        [slicer, *words], capture_output=True, text=True, check=False, env=_environment(), preexec_fn=follow
    )
    said = done.stdout + done.stderr
    if done.returncode != 0:
        raise FileError(f"{project.name}: the slicer stopped with status {done.returncode}: {_last_words(said)}")
    return said


def _last_words(said: str) -> str:
    lines = [line.strip() for line in said.splitlines() if line.strip() and not any(n in line for n in _NOISE)]
    return lines[-1] if lines else "it said nothing"


def _environment() -> dict[str, str]:
    """Environment of the slicer, with the C locale for decimal points."""
    return {**os.environ, "LC_ALL": "C"}
