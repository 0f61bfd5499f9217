"""Time, mass and cost of printing parts and mold: from the sliced files if they exist, else estimated."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from cad.errors import FileError
from cad.lens import camera_setting
from cad.params import EndcapParams
from cad.plain_numbers import plain

SLICES = Path("slice", "slice.json")  # beside the study; make slice writes it
SECOND_FORM = "interface_gyroid"  # one of the two forms of the interface, of which only one is printed
MOLD_RADIUS_MM, MOLD_GRAMS = 65.0, 514.0  # M at D=130 T=8 by make slice; E: mass in proportion to R^2
MOLD_START_H, PLA_GRAMS_H = 3.1, 20.3  # E: within 5 % of nine sliced sizes; an Ender-3 takes 6 % longer
PLA_USD_KG = 20.0  # E: of a spool of one kilogram
INTERFACE_GRAMS, INTERFACE_H = 23.8, 3.02  # M at D=130 T=8 (bench/slice.csv, "infill"); E: in proportion to R
TPU_USD_KG = 35.0  # E


@dataclass(frozen=True)
class Prints:
    """Time, mass and cost of all prints.

    Attributes:
        time_h, grams, cost_usd: totals of all plates.
        parts: the parts, in words.
        is_sliced: whether the numbers are from sliced files.
        manifest_sha256: digest of the manifest of the export that was sliced.
    """

    time_h: float
    grams: float
    cost_usd: float
    parts: str
    is_sliced: bool
    manifest_sha256: str = ""


def prints_of(params: EndcapParams, export: Path) -> Prints:
    """Prints of a design, from sliced files or estimated.

    Args:
        params: design.
        export: folder of its export; ``slice/slice.json`` in it is used, unless the molds were made again after it.

    Raises:
        FileError: that file cannot be read, or belongs to another design.
    """
    path = export / SLICES
    if not path.exists():
        return estimated_prints(params)
    found, manifest = sliced_prints(params, path), export / "manifest.json"
    is_older = manifest.exists() and hashlib.sha256(manifest.read_bytes()).hexdigest() != found.manifest_sha256
    return estimated_prints(params) if is_older else found


def sliced_prints(params: EndcapParams, path: Path) -> Prints:
    """Totals of all plates of a sliced export.

    Args:
        params: design.
        path: path of ``slice.json``.

    Raises:
        FileError: it cannot be read, or belongs to another design.
    """
    named = {"D": plain(params.diameter_mm), "T": plain(params.wall_mm), **params.option_words}
    words = " ".join(f"{name}={value}" for name, value in named.items())
    again = f"run {camera_setting()}make slice {words} again, or move it away"
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        digest, projects = record["digest"], [p for p in record["projects"] if p["name"] != SECOND_FORM]
        pieces = [piece for project in projects for piece in project["pieces"]]
        time_h = sum(float(project["time_s"]) for project in projects) / 3600
        grams, cost = (sum(float(piece[name]) for piece in pieces) for name in ("grams", "cost_usd"))
        names = sorted({str(piece["name"]) for piece in pieces})
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FileError(f"{path}: not what make slice writes ({error}): {again}") from error
    if digest != params.digest:
        raise FileError(f"{path}: belongs to another design than {params.label}: {again}")
    parts = f"{len(names)} parts on {len(projects)} plates, mold included"
    return Prints(time_h, grams, cost, parts, True, str(record.get("manifest_sha256", "")))


def estimated_prints(params: EndcapParams) -> Prints:
    """Mold and interface by closed forms: thin walls of PLA scale with R squared, the interface's ring with R."""
    ratio = params.outer_radius_mm / MOLD_RADIUS_MM
    mold_grams, ring_grams = _mold_grams(params), INTERFACE_GRAMS * ratio
    return Prints(
        MOLD_START_H + mold_grams / PLA_GRAMS_H + INTERFACE_H * ratio, mold_grams + ring_grams,
        mold_usd(params) + TPU_USD_KG * ring_grams / 1000, "mold and interface; base and stand not counted", False,
    )  # fmt: skip


def mold_usd(params: EndcapParams) -> float:
    """Estimated cost of the PLA in the mold, USD: 10.28 at D=130 (the paper: about 8.50, MAT13)."""
    return PLA_USD_KG * _mold_grams(params) / 1000


def _mold_grams(params: EndcapParams) -> float:
    return MOLD_GRAMS * (params.outer_radius_mm / MOLD_RADIUS_MM) ** 2
