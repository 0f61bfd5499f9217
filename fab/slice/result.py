"""Result of one sliced project, and the checks of its figures."""

from __future__ import annotations

import dataclasses
import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cad.params import EndcapParams
from fab.cache import Cache
from fab.checks.check import Check
from fab.exports.whole_folder import file_sha256
from fab.slice.measure import PrintFigures, ZoneFigures
from fab.slice.project_3mf import Project, write_both
from fab.slice.region import Region
from fab.slice.run import ModelInfo
from fab.slice.settings import PrintSettings
from fab.slice.sliced import keep_sliced, measure_project, read_sliced, sliced_key

FRACTION_TOLERANCE = 0.005  # of the zone's volume, for example 10 +- 0.5 %
GRAMS_TOLERANCE = 0.005  # our sum over the moves against the slicer's: a move lost in reading shows here
FIGURES = 6
PAPER_MOLD = "the paper, D=130: about 8.50"  # P: what its mold costs, USD


@dataclass(frozen=True)
class PieceResult:
    """Plastic and settings of one part on a plate.

    Attributes:
        name: of the part.
        settings: of the part.
        regions: infill of the volumes that differ from the part.
        grams: of plastic, support and its share of the brims included.
    """

    name: str
    settings: PrintSettings
    regions: Mapping[str, Region]
    grams: float

    def record(self) -> dict[str, Any]:
        """The part as JSON."""
        return {
            "name": self.name,
            "grams": float(f"{self.grams:.{FIGURES}g}"),
            "cost_usd": float(f"{self.grams / 1000 * self.settings.filament.price_usd_kg:.{FIGURES}g}"),
            "settings": {
                "speed_mm_s": self.settings.speed_mm_s,
                "support": self.settings.support,
                "brim_mm": self.settings.brim_mm,
                "grow_mm": self.settings.grow_mm,
                "reason": self.settings.reason,
                **dataclasses.asdict(self.settings.region),
            },
            "own_settings": {name: dataclasses.asdict(region) for name, region in self.regions.items()},
        }


@dataclass(frozen=True)
class SliceResult:
    """Figures of one sliced project.

    Attributes:
        name: of the project.
        pieces: its parts.
        volumes: names of its meshes.
        triangles: of all its meshes.
        figures: of the print.
        zone: of the interlock zone; ``None`` for parts without one.
        fraction: of TPU that the zone should have.
        info: what ``--info`` of the slicer reports.
        warnings: of the slicer.
        files: written projects, file name -> SHA-256.
        is_kept: whether an earlier run sliced the same project.
    """

    name: str
    pieces: tuple[PieceResult, ...]
    volumes: tuple[str, ...]
    triangles: int
    figures: PrintFigures
    zone: ZoneFigures | None
    fraction: float
    info: ModelInfo
    warnings: tuple[str, ...]
    files: Mapping[str, str]
    is_kept: bool = False

    @property
    def mold_share(self) -> float:
        """Fraction of the plastic in parts of the mold."""
        grams = sum(piece.grams for piece in self.pieces)
        return sum(piece.grams for piece in self.pieces if is_mold(piece.name)) / grams if grams else 0.0

    @property
    def checks(self) -> list[Check]:
        """Checks of the figures."""
        name, figures = self.name, self.figures
        checks = [
            Check(f"{name}.slicer_manifold", float(self.info.is_manifold), low=1),
            Check(f"{name}.slicer_bodies", self.info.bodies, low=len(self.volumes), high=len(self.volumes)),
            Check(f"{name}.slicer_faults", len(self.info.faults), high=0),
            Check(f"{name}.outside_bed_mm", figures.outside_bed_mm, high=0.0),
            Check(f"{name}.empty_layers", figures.empty_layers, high=0),
            Check(f"{name}.grams_error_ratio", figures.grams_error, high=GRAMS_TOLERANCE),
            Check(f"{name}.pieces_without_plastic", sum(piece.grams <= 0 for piece in self.pieces), high=0),
        ]
        if self.zone is not None:
            low, high = self.fraction - FRACTION_TOLERANCE, self.fraction + FRACTION_TOLERANCE
            checks.append(Check(f"{name}.zone_fraction", self.zone.fraction, low, high))
            # A cut through what is a share f plastic crosses f of it (Delesse, 1847); more is lines along the boundary.
            checks.append(Check(f"{name}.zone_open_share", self.zone.open_share, low=1.0 - self.fraction))
        return checks

    def record(self) -> dict[str, Any]:
        """The result as JSON."""
        settings = self.pieces[0].settings
        return {
            "name": self.name,
            "material": settings.filament.name,
            "layer_mm": float(settings.prusa()["layer_height"]),
            "pieces": [piece.record() for piece in self.pieces],
            "volumes": list(self.volumes),
            "triangles": self.triangles,
            **_rounded(dataclasses.asdict(self.figures)),
            "zone": _rounded(dataclasses.asdict(self.zone)) if self.zone else None,
            "slicer": dataclasses.asdict(self.info),
            "warnings": list(self.warnings),
            "files": dict(self.files),
        }


def slice_project(
    slicer: str, project: Project, folder: Path, params: EndcapParams, keep_gcode: bool, cache: Cache | None = None
) -> SliceResult:
    """Write both projects of a part, slice it with PrusaSlicer and measure the moves.

    Args:
        slicer: path of PrusaSlicer's program.
        project: one plate.
        folder: receives ``<name>.prusa.3mf`` and ``<name>.orca.3mf``, and ``<name>.gcode`` if ``keep_gcode``.
        params: the design.
        keep_gcode: whether the G-code stays; then the project is sliced again.
        cache: with figures of earlier runs; ``None`` slices again.

    Raises:
        FileError: the slicer refused the project, or a file could not be written.
    """
    prusa, orca = write_both(project, folder)
    files = {path.name: file_sha256(path) for path in (prusa, orca)}
    key = sliced_key(cache, slicer, project, files[prusa.name], params) if cache else ""
    sliced = read_sliced(cache, key) if cache and not keep_gcode else None
    with tempfile.TemporaryDirectory(dir=folder, prefix=".gcode-") as scratch:
        gcode = (folder if keep_gcode else Path(scratch)) / f"{project.name}.gcode"
        sliced = sliced or measure_project(slicer, project, prusa, gcode, params)
    result = SliceResult(
        project.name,
        _piece_results(project, sliced.shares, sliced.figures.grams),
        tuple(volume.name for volume in project.volumes),
        sum(len(volume.mesh.faces) for volume in project.volumes),
        sliced.figures,
        sliced.zone,
        params.gyroid,
        sliced.info,
        sliced.warnings,
        files,
        sliced.is_kept,
    )
    if cache and not sliced.is_kept and all(check.ok for check in result.checks):
        keep_sliced(cache, key, sliced)
    return result


def _piece_results(project: Project, shares: Mapping[str, float], grams: float) -> tuple[PieceResult, ...]:
    """Result of each part of a plate; a part alone on its plate has all grams."""
    alone = len(project.pieces) == 1
    return tuple(
        PieceResult(
            piece.name,
            piece.settings,
            {volume.name: volume.region for volume in piece.volumes if volume.region},
            grams if alone else grams * shares.get(piece.name, 0.0),
        )
        for piece in project.pieces
    )


def summary(results: Sequence[SliceResult], is_whole: bool = True) -> str:
    """Table with a line for each project, its parts, and the sums.

    Args:
        results: of the projects.
        is_whole: whether they include the whole mold, which is then compared with the paper's.
    """
    width = max(18, *(len(result.name) + 1 for result in results))
    lines = [f"{'plate':<{width}}{'time':>8}{'grams':>8}{'USD':>7}{'layers':>8}{'float':>7}  "]
    for result in results:
        figures, words = result.figures, ", ".join(piece.name for piece in result.pieces)
        if result.zone:
            words = f"{100 * result.zone.fraction:.2f} % filled, {100 * result.zone.open_share:.1f} % open"
        lines.append(
            f"{result.name:<{width}}{hours(figures.time_s):>8}{figures.grams:8.1f}{figures.cost_usd:7.2f}"
            f"{figures.layers:8d}{figures.floating_starts:7d}  {words if words != result.name else ''}".rstrip()
        )
    mold = [(result.figures, result.mold_share) for result in results if result.mold_share]
    if not mold:
        return "\n".join(lines)
    time_s, grams, cost = (
        sum(getattr(figures, name) * share for figures, share in mold) for name in ("time_s", "grams", "cost_usd")
    )
    name, paper = ("mold", f" ({PAPER_MOLD})") if is_whole else ("of the mold", "")
    lines.append(f"{name}: {hours(time_s)}, {grams:.0f} g, {cost:.2f} USD{paper}")
    return "\n".join(lines)


def is_mold(name: str) -> bool:
    """Whether a part belongs to the mold.

    Args:
        name: of the part.
    """
    return name.startswith(("cup_", "core_", "hanger"))


def hours(seconds: float) -> str:
    """A duration as hours and minutes, for example ``2 h 05``.

    Args:
        seconds: of it.
    """
    if not math.isfinite(seconds):
        return "?"
    minutes = round(seconds / 60)
    return f"{minutes // 60} h {minutes % 60:02d}"


def _rounded(values: dict[str, Any]) -> dict[str, Any]:
    def figure(value: Any) -> Any:
        if isinstance(value, float):
            return float(f"{value:.{FIGURES}g}")
        return [figure(item) for item in value] if isinstance(value, tuple) else value

    return {key: figure(value) for key, value in values.items()}
