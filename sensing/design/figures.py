"""Figures of a design, each with its source (N, mm, g; by similarity and closed forms)."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import asdict, dataclass, replace
from enum import Enum

import numpy as np

from cad.identity import identity
from cad.lens import camera_module
from cad.pattern import step_deg
from cad.silicone_kits import silicone_usd_kg
from sensing.design.pressed import TILTS_DEG, Study, expected_share
from sensing.design.prints import Prints, estimated_prints
from sensing.records import TABLE_G_M_S2


class Source(Enum):
    """Kind of source of a figure."""

    COMPUTED = "computed"
    MEASURED = "measured"
    ESTIMATED = "estimated"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Figure:
    """One line of a study.

    Attributes:
        key: identifier in tables.
        name: name in words.
        value: value; None where it is unknown.
        unit: unit of the value.
        source: kind of source.
        note: method, in a few words.
    """

    key: str
    name: str
    value: float | None
    unit: str
    source: Source
    note: str

    @property
    def text(self) -> str:
        """Value with three digits and the unit, larger numbers whole; or a dash."""
        if self.value is None:
            return "–"
        digits = f"{self.value:.0f}" if abs(self.value) >= 999.5 else f"{self.value:.3g}"
        return f"{digits} {self.unit}".strip()


def figures(study: Study, prints: Prints | None = None) -> list[Figure]:
    """The figures of a study: range and errors, mass, and the material and time that it takes.

    Args:
        study: study of the design.
        prints: prints from its sliced files; None for estimates.
    """
    lines = [*_loads(study), *_dots(study), *_errors(study), *_rate(study), *_mass(study)]
    lines += _made(study, prints or estimated_prints(study.params))
    return [line if line.value is None or math.isfinite(line.value) else _unknown(line) for line in lines]


def _unknown(line: Figure) -> Figure:
    return replace(line, value=None, source=Source.UNKNOWN, note="the simulator refuses the shell before that load")


def _loads(study: Study) -> list[Figure]:
    safe_n, why = study.safe
    lines = [
        Figure(
            f"stiffness_{curve.tilt_deg:g}_n_mm", f"stiffness at {curve.tilt_deg:g} degrees",
            study.stiffness_n_mm(curve.tilt_deg), "N/mm", Source.COMPUTED, "secant to a fifth of the range",
        )
        for curve in study.curves
    ]  # fmt: skip
    half = 0.5 * study.range_n
    lines += [
        Figure("range_n", "range of the weights", study.range_n, "N", Source.COMPUTED, "35 N at D=130 T=8, as mu T^2"),
        Figure("safe_n", "largest safe load", safe_n, "N", Source.COMPUTED, f"first of snap, strain, range: {why}"),
        Figure(
            "strain_percent", "largest strain at that load", 100 * _strain(study, safe_n), "%", Source.COMPUTED,
            f"of {study.material.elongation_percent:g} % at break; away from the bonded edge",
        ),
        Figure(
            "depth_mm", "depth at the range, 25 degrees", study.curves[1].depth_at(study.range_n), "mm",
            Source.COMPUTED, "",
        ),
        Figure(
            "sag_mm", "sag when turned onto its side", study.sag_mm, "mm", Source.COMPUTED,
            f"by its own weight of {TABLE_G_M_S2 * study.mass_g / 1000:.3g} N, untouched: largest motion of a dot",
        ),
        Figure(
            "patch_mm2", "contact patch at half the range, 25 degrees", study.curves[1].patch_at(half), "mm2",
            Source.COMPUTED, "counted in points of the mesh, to about 30 %",
        ),
    ]  # fmt: skip
    return lines


def _strain(study: Study, force_n: float) -> float:
    return max(curve.strain_at(force_n) for curve in study.curves)


def _dots(study: Study) -> list[Figure]:
    pixels = study.bound.rest_px()
    apart = np.linalg.norm(pixels[:, None] - pixels[None], axis=2) + np.diag(np.full(len(pixels), np.inf))
    pitch_px = float(np.median(apart.min(axis=1)))
    pitch_mm = study.params.inner_radius_mm * math.radians(step_deg(study.params.dot_rings))
    per_n = study.bound.at(25.0, 0.5 * study.range_n).px_per_n
    return [
        Figure("dots", "dots seen", len(pixels), "", Source.COMPUTED, f"whole, in 640 x 480 of {camera_module().name}"),
        Figure("pitch_mm", "pitch of the dots", pitch_mm, "mm", Source.COMPUTED, "between rings, on the inner sphere"),
        Figure("pitch_px", "pitch in the picture", pitch_px, "px", Source.COMPUTED, "median of nearest neighbours"),
        Figure("px_per_n", "displacement by load, 25 degrees", per_n, "px/N", Source.COMPUTED, "rms over the dots"),
    ]


def _errors(study: Study) -> list[Figure]:
    share = 100 * expected_share(study.params.diameter_mm)
    why = f"{share:.2g} % of the range: held-out error, and what pictures add (docs/design.md)"
    if study.error_n == study.bound_n:
        why = f"the bound, more than {share:.2g} % of the range: so few dots show no more"
    lines = [
        Figure(
            f"bound_{tilt:g}_n", f"bound on the force error at {tilt:g} degrees",
            float(np.sqrt(np.mean([b.force_n**2 for b in study.bounds if b.tilt_deg == tilt]))), "N", Source.COMPUTED,
            "Cramer-Rao from the tracker's measured error, one frame, an axis",
        )
        for tilt in TILTS_DEG
    ]  # fmt: skip
    torque = float(np.sqrt(np.mean([np.trace(b.covariance[3:, 3:]) / 3 for b in study.bounds])))
    where = float(
        np.sqrt(np.mean([(b.sigma[3:5] ** 2).sum() / np.linalg.norm(b.wrench[:3]) ** 2 for b in study.bounds]))
    )
    return [
        *lines,
        Figure("bound_nm", "bound on the torque error", torque, "N m", Source.COMPUTED, "about the sphere's centre"),
        Figure(
            "resolution_mm", "bound on the place of contact", 1000 * where, "mm", Source.COMPUTED,
            "torque's bound over the force",
        ),
        Figure(
            "error_n", "force error expected of trained weights", study.error_n, "N", Source.ESTIMATED, why,
        ),
    ]  # fmt: skip


def _rate(study: Study) -> list[Figure]:
    series = study.material.prony
    name, note = "stiffer when fast, at most", "Prony series of cad/materials.csv: order of magnitude"
    if not series:
        return [Figure("rate_percent", name, None, "%", Source.UNKNOWN, "no series for this silicone")]
    total = sum(g for g, _ in series)
    return [Figure("rate_percent", name, 100 * (1 / (1 - total) - 1), "%", Source.ESTIMATED, note)]


def _mass(study: Study) -> list[Figure]:
    return [
        Figure(
            "silicone_cm3", "silicone in the shell", study.volume_cm3, "cm3", Source.COMPUTED,
            "closed form, less the gyroid; without sprues and what stays in the cup",
        ),
        Figure("silicone_g", "its mass", study.mass_g, "g", Source.COMPUTED, "density of the data sheet"),
    ]  # fmt: skip


def _made(study: Study, prints: Prints) -> list[Figure]:
    source = Source.MEASURED if prints.is_sliced else Source.ESTIMATED
    how = "moves of the sliced files" if prints.is_sliced else "closed form, run make slice for the files' own"
    usd_kg = silicone_usd_kg(study.silicone)
    return [
        Figure("print_h", "print hours", prints.time_h, "h", source, f"{how}; {prints.parts}"),
        Figure("print_g", "plastic", prints.grams, "g", source, "the same"),
        Figure("print_usd", "its cost", prints.cost_usd, "$", source, "the same, at prices of a kilogram spool"),
        Figure(
            "cost_usd", "plastic and silicone", prints.cost_usd + usd_kg * study.mass_g / 1000, "$", Source.ESTIMATED,
            f"silicone at {usd_kg:.0f} dollars a kg, its smallest kit; camera, ring and screws are in the bill",
        ),
    ]  # fmt: skip


def blind_direction(study: Study) -> str:
    """The direction of the wrench that the dots determine least, in words."""
    worst = max(study.bounds, key=lambda bound: bound.force_n / bound.normal_n)
    direction = worst.weakest(study.params.outer_radius_mm)
    axes = ("fx", "fy", "fz", "tx", "ty", "tz")
    parts = sorted(zip(np.abs(direction), direction, axes, strict=True), reverse=True)[:2]
    text = " and ".join(f"{value:+.2f} {axis}" for _, value, axis in parts)
    return (
        f"weakest at {worst.tilt_deg:g} degrees and {worst.normal_n:.3g} N, along {text} (contact on azimuth 0); "
        "torque about the plane's normal is not a direction of its own: a plane's patch is too small to carry much"
    )


def as_csv(lines: list[Figure]) -> str:
    """Figures as CSV."""
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(["key", "name", "value", "unit", "source", "note"])
    for line in lines:
        value = "" if line.value is None else f"{line.value:.6g}"
        table.writerow([line.key, line.name, value, line.unit, line.source.value, line.note])
    return out.getvalue()


def as_record(study: Study, lines: list[Figure]) -> dict[str, object]:
    """Study and figures as plain JSON."""
    bounds = [
        {"tilt_deg": b.tilt_deg, "normal_n": b.normal_n, "sigma": b.sigma.tolist(), "wrench": b.wrench.tolist()}
        for b in study.bounds
    ]
    return {
        "design": asdict(study.params), "digest": study.params.digest, "silicone": study.silicone,
        "camera": camera_module().name, "identity": identity(study.params, study.silicone).record(),
        "figures": [asdict(line) | {"source": line.source.value} for line in lines], "bounds": bounds,
        "blind": blind_direction(study),
    }  # fmt: skip
