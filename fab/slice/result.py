"""One project sliced and measured, and the gates on what was measured."""

from __future__ import annotations

import dataclasses
import hashlib
import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cad.params import EndcapParams
from fab.checks.check import Check
from fab.slice.gcode import read_gcode
from fab.slice.measure import PrintFigures, ZoneFigures, print_figures, zone_figures
from fab.slice.project_3mf import Project, write_orca, write_prusa
from fab.slice.run import ModelInfo, model_info, slice_to_gcode
from fab.slice.settings import PrintSettings, Region

FRACTION_TOLERANCE = 0.005  # of the zone's volume: 10 +- 0.5 %
FRACTION = 0.10
LEAST_OPEN = 0.90
GRAMS_TOLERANCE = 0.005  # our sum over the moves against the slicer's: a move lost in reading shows here
FIGURES = 6


@dataclass(frozen=True)
class SliceResult:
    """What came out of one project.

    Attributes:
        name: of the project.
        settings: of the part.
        volumes: names of its meshes.
        regions: fillings of volumes that have their own.
        triangles: of all its meshes.
        figures: of the print.
        zone: of the interlock zone; ``None`` for parts without one.
        info: what the slicer saw.
        warnings: what the slicer said while slicing.
        files: written projects, file name -> SHA-256.
    """

    name: str
    settings: PrintSettings
    volumes: tuple[str, ...]
    regions: Mapping[str, Region]
    triangles: int
    figures: PrintFigures
    zone: ZoneFigures | None
    info: ModelInfo
    warnings: tuple[str, ...]
    files: Mapping[str, str]

    @property
    def checks(self) -> list[Check]:
        """The gates."""
        name, figures = self.name, self.figures
        checks = [
            Check(f"{name}.slicer_manifold", float(self.info.is_manifold), low=1),
            Check(f"{name}.slicer_bodies", self.info.bodies, low=len(self.volumes), high=len(self.volumes)),
            Check(f"{name}.slicer_faults", len(self.info.faults), high=0),
            Check(f"{name}.outside_bed_mm", figures.outside_bed_mm, high=0.0),
            Check(f"{name}.empty_layers", figures.empty_layers, high=0),
            Check(f"{name}.grams_error_ratio", figures.grams_error, high=GRAMS_TOLERANCE),
        ]
        if self.zone is not None:
            low, high = FRACTION - FRACTION_TOLERANCE, FRACTION + FRACTION_TOLERANCE
            checks.append(Check(f"{name}.zone_fraction", self.zone.fraction, low, high))
            checks.append(Check(f"{name}.zone_open_share", self.zone.open_share, low=LEAST_OPEN))
        return checks

    def record(self) -> dict[str, Any]:
        """The result as JSON."""
        return {
            "name": self.name,
            "material": self.settings.filament.name,
            "settings": {
                "layer_mm": float(self.settings.prusa()["layer_height"]),
                "speed_mm_s": self.settings.speed_mm_s,
                "support": self.settings.support,
                "brim_mm": self.settings.brim_mm,
                "grow_mm": self.settings.grow_mm,
                "reason": self.settings.reason,
                **dataclasses.asdict(self.settings.region),
            },
            "volumes": list(self.volumes),
            "own_settings": {name: dataclasses.asdict(region) for name, region in self.regions.items()},
            "triangles": self.triangles,
            **_rounded(dataclasses.asdict(self.figures)),
            "zone": _rounded(dataclasses.asdict(self.zone)) if self.zone else None,
            "slicer": dataclasses.asdict(self.info),
            "warnings": list(self.warnings),
            "files": dict(self.files),
        }


def slice_project(slicer: str, project: Project, folder: Path, params: EndcapParams, keep_gcode: bool) -> SliceResult:
    """Write both projects of a part, slice it with PrusaSlicer and measure the moves.

    Args:
        slicer: path of PrusaSlicer's program.
        project: what to print.
        folder: receives ``<name>.prusa.3mf`` and ``<name>.orca.3mf``, and ``<name>.gcode`` if it is kept.
        params: the design.
        keep_gcode: whether the G-code stays.

    Raises:
        FileError: the slicer refused the project, or a file could not be written.
    """
    prusa, orca = folder / f"{project.name}.prusa.3mf", folder / f"{project.name}.orca.3mf"
    write_prusa(project, prusa)
    write_orca(project, orca)
    info = model_info(slicer, prusa)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".gcode-") as scratch:
        gcode = (folder if keep_gcode else Path(scratch)) / f"{project.name}.gcode"
        warnings = slice_to_gcode(slicer, prusa, gcode)
        moves = read_gcode(gcode)
    return SliceResult(
        project.name,
        project.settings,
        tuple(volume.name for volume in project.volumes),
        {volume.name: volume.region for volume in project.volumes if volume.region},
        sum(len(volume.mesh.faces) for volume in project.volumes),
        print_figures(moves, project.settings.filament),
        zone_figures(moves, params) if project.name.startswith("interface") else None,
        info,
        warnings,
        {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in (prusa, orca)},
    )


def summary(results: Sequence[SliceResult]) -> str:
    """One screen: a line for each project, and the sums."""
    lines = [f"{'part':<18}{'time':>8}{'grams':>8}{'USD':>7}{'layers':>8}{'float':>7}  zone"]
    for result in results:
        figures, zone = result.figures, ""
        if result.zone:
            zone = f"{100 * result.zone.fraction:.2f} % filled, {100 * result.zone.open_share:.1f} % open"
        lines.append(
            f"{result.name:<18}{hours(figures.time_s):>8}{figures.grams:8.1f}{figures.cost_usd:7.2f}"
            f"{figures.layers:8d}{figures.floating_starts:7d}  {zone}".rstrip()
        )
    mold = [result.figures for result in results if is_mold(result.name)]
    if not mold:
        return "\n".join(lines)
    lines.append(
        f"mold: {hours(sum(f.time_s for f in mold))}, {sum(f.grams for f in mold):.0f} g, "
        f"{sum(f.cost_usd for f in mold):.2f} USD (the paper: about 8.50)"
    )
    return "\n".join(lines)


def is_mold(name: str) -> bool:
    """Whether a part belongs to the mold."""
    return name.startswith(("cup_", "core_", "hanger"))


def hours(seconds: float) -> str:
    """A duration as hours and minutes."""
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
