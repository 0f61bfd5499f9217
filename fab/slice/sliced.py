"""Cached output of the slicer for one project: its report, its warnings and the figures of the moves.

A project whose bytes, slicer and code are those of an earlier run is not sliced again; its figures are cached.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache as once
from pathlib import Path

from cad.params import EndcapParams
from fab.cache import Cache
from fab.exports.whole_folder import file_sha256
from fab.slice.gcode import read_gcode
from fab.slice.measure import PrintFigures, ZoneFigures, print_figures, zone_figures
from fab.slice.project_3mf import Project
from fab.slice.run import ModelInfo, model_info, slice_to_gcode, slicer_version


@dataclass(frozen=True)
class Sliced:
    """Output of the slicer.

    Attributes:
        info: its report on the project.
        warnings: of the slicer.
        figures: of the print.
        zone: of the interlock zone; ``None`` for parts without one.
        shares: fraction of the plastic in each part of the plate.
        is_kept: whether an earlier run sliced it.
    """

    info: ModelInfo
    warnings: tuple[str, ...]
    figures: PrintFigures
    zone: ZoneFigures | None
    shares: Mapping[str, float]
    is_kept: bool = False


def measure_project(slicer: str, project: Project, written: Path, gcode: Path, params: EndcapParams) -> Sliced:
    """Slice a written project and measure the moves.

    Args:
        slicer: path of PrusaSlicer's program.
        project: one plate.
        written: its 3MF file.
        gcode: receives the G-code.
        params: the design.

    Raises:
        FileError: the slicer refused the project, or a file could not be written.
    """
    info = model_info(slicer, written)
    warnings = slice_to_gcode(slicer, written, gcode, project.printer)
    moves = read_gcode(gcode)
    figures = print_figures(moves, project.settings.filament, project.printer)
    zone = zone_figures(moves, params, project.printer) if has_zone(project) else None
    return Sliced(info, warnings, figures, zone, moves.piece_shares())


def sliced_key(cache: Cache, slicer: str, project: Project, sha256: str, params: EndcapParams) -> str:
    """Key of a sliced project: the digest of everything that its figures depend on.

    Args:
        cache: that will hold it.
        slicer: path of PrusaSlicer's program.
        project: one plate.
        sha256: of its 3MF file.
        params: the design.
    """
    depends_on = {
        "project": sha256,
        "printer": asdict(project.printer),
        "filament": asdict(project.settings.filament),
        "design": params.digest if has_zone(project) else "",
        "slicer": _slicer_digest(slicer),
    }
    return cache.key("slice", depends_on)


def read_sliced(cache: Cache, key: str) -> Sliced | None:
    """Read the output for the same project from the cache; ``None`` where there is none.

    Args:
        cache: of earlier runs.
        key: of the project.
    """
    if (entry := cache.read(key)) is None:
        return None
    values = entry[1]
    info, figures, zone = values["info"], values["figures"], values["zone"]
    return Sliced(
        ModelInfo(**{**info, "faults": tuple(info["faults"])}),
        tuple(values["warnings"]),
        PrintFigures(**{**figures, "extent_mm": tuple(figures["extent_mm"])}),
        ZoneFigures(**zone) if zone else None,
        values["shares"],
        is_kept=True,
    )


def keep_sliced(cache: Cache, key: str, sliced: Sliced) -> None:
    """Store the output for later runs.

    Args:
        cache: that holds it.
        key: of the project.
        sliced: output of the slicer.
    """
    cache.keep(key, {}, {name: value for name, value in asdict(sliced).items() if name != "is_kept"})


def has_zone(project: Project) -> bool:
    """Whether a project prints the interface with its interlock zone."""
    return project.name.startswith("interface")


@once
def _slicer_digest(slicer: str) -> str:
    """SHA-256 of the program and of its version: a wrapper script may start another program."""
    content = f"{file_sha256(Path(slicer))} {slicer_version(slicer)}"
    return hashlib.sha256(content.encode()).hexdigest()
