"""What a design will feel, figure by figure, each with its source (N, mm, g; by similarity and closed forms)."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import asdict, dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cad import scaling
from cad.materials import DEFAULT_SILICONE, Silicone, silicone
from cad.params import EndcapParams
from sensing.design.bound import Bound, DesignBound
from sensing.simulator.similarity.library import load_library
from sensing.simulator.similarity.node import CAPACITY_DEPTHS, CAPACITY_TILTS_DEG
from sensing.simulator.similarity.ratios import LoadScale, ShellRatios
from sensing.simulator.solid.geometry import ShellGeometry, shell_geometry

Array = NDArray[np.float64]
TILTS_DEG = (10.0, 25.0, 40.0, 50.0)
PARTS = (0.15, 0.5, 0.9)  # of the weights' range, at which bounds are given
ELONGATION_SHARE = 0.5  # E: of the elongation at break, that a cast part may see again and again
GYROID_FRACTION = 0.093  # M: printed volume fraction of TPU in the interlock (facts: 9.3 to 9.4 %)
MEASURED_SHARE = 0.0055  # M: force error of trained weights over the weights' range (bench/similarity.csv)


class Source(Enum):
    """Where a figure comes from."""

    COMPUTED = "computed"
    MEASURED = "measured"
    ESTIMATED = "estimated"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Figure:
    """One line of a study.

    Attributes:
        key: for tables. name: in words. value: None where it is unknown. unit: of the value.
        source: where it comes from. note: how, in a few words.
    """

    key: str
    name: str
    value: float | None
    unit: str
    source: Source
    note: str

    @property
    def text(self) -> str:
        """Value with unit, or a dash."""
        return "–" if self.value is None else f"{self.value:.3g} {self.unit}".strip()


@dataclass(frozen=True)
class LoadCurve:
    """Pressing at one tilt until the model ends: depth, force, patch and strain, NaN past its end.

    Attributes:
        tilt_deg: of the plane. depth_mm, normal_n, patch_mm2, strain: (15,) each.
    """

    tilt_deg: float
    depth_mm: Array
    normal_n: Array
    patch_mm2: Array
    strain: Array

    @property
    def known(self) -> NDArray[np.bool_]:
        """(15,) where the model has an answer."""
        return np.isfinite(self.normal_n)

    def depth_at(self, force_n: float) -> float:
        """Depth under a force; NaN beyond the curve."""
        return self._at(force_n, self.depth_mm)

    def patch_at(self, force_n: float) -> float:
        """Patch under a force; NaN beyond the curve."""
        return self._at(force_n, self.patch_mm2)

    def strain_at(self, force_n: float) -> float:
        """Largest strain under a force; NaN beyond the curve."""
        return self._at(force_n, self.strain)

    @property
    def snap_n(self) -> float | None:
        """Force at which it no longer rises with the depth; None where that was not met."""
        force = self.normal_n[self.known]
        falls = np.flatnonzero(np.diff(force) <= 0)
        if len(falls):
            return float(force[falls[0]])
        return None if len(force) == len(self.normal_n) else float(force[-1]) if len(force) else 0.0

    def force_at_strain(self, strain: float) -> float | None:
        """Force at which the largest strain reaches a value; None where it does not within the curve."""
        over = np.flatnonzero(self.strain[self.known] >= strain)
        return float(self.normal_n[self.known][over[0]]) if len(over) else None

    def _at(self, force_n: float, column: Array) -> float:
        rising = self.known & (np.maximum.accumulate(np.nan_to_num(self.normal_n, nan=np.inf)) <= self.normal_n)
        force = np.concatenate([[0.0], self.normal_n[rising]])
        if not force_n <= force[-1]:
            return math.nan
        return float(np.interp(force_n, force, np.concatenate([[0.0], column[rising]])))


@dataclass(frozen=True)
class Study:
    """One design and silicone.

    Attributes:
        params: the design. silicone: row of cad/materials.csv.
    """

    params: EndcapParams
    silicone: str = DEFAULT_SILICONE

    @cached_property
    def geometry(self) -> ShellGeometry:
        """Its shell."""
        return shell_geometry(self.params.diameter_mm, self.params.wall_mm)

    @cached_property
    def material(self) -> Silicone:
        """Its silicone."""
        return silicone(self.silicone)

    @cached_property
    def shear_mpa(self) -> float:
        """Shear modulus."""
        return self.material.neo_hooke().shear_mpa

    @cached_property
    def range_n(self) -> float:
        """Normal force to which its weights are trained."""
        return LoadScale.of(self.geometry, self.shear_mpa).top_n

    @cached_property
    def curves(self) -> tuple[LoadCurve, ...]:
        """Pressing curves at 0, 25 and 50 degrees."""
        radius = self.geometry.outer_radius_mm
        force = self.shear_mpa * radius**2
        found = load_library().capacity(ShellRatios.of(self.geometry))
        return tuple(
            LoadCurve(tilt, np.array(CAPACITY_DEPTHS) * radius, row[:, 1] * force, row[:, 2] * radius**2, row[:, 3] - 1)
            for tilt, row in zip(CAPACITY_TILTS_DEG, found, strict=True)
        )

    @cached_property
    def bound(self) -> DesignBound:
        """What the dots allow."""
        return DesignBound(self.params, self.geometry, self.shear_mpa)

    @cached_property
    def bounds(self) -> tuple[Bound, ...]:
        """Bounds at :data:`TILTS_DEG` and :data:`PARTS` of the range."""
        return tuple(self.bound.at(tilt, part * self.range_n) for tilt in TILTS_DEG for part in PARTS)

    @cached_property
    def bound_n(self) -> float:
        """Root mean square of the force bounds, an axis."""
        return float(np.sqrt(np.mean([bound.force_n**2 for bound in self.bounds])))

    @property
    def error_n(self) -> float:
        """Force error an axis that trained weights are expected to have."""
        return max(self.bound_n, MEASURED_SHARE * self.range_n)

    @property
    def safe(self) -> tuple[float, str]:
        """(largest safe normal force, what limits it)."""
        limits = [(self.range_n, "the weights' range")]
        allowed = ELONGATION_SHARE * self.material.elongation_percent / 100
        for curve in self.curves:
            if curve.snap_n is not None:
                limits.append((curve.snap_n, f"the shell snaps at {curve.tilt_deg:g} degrees"))
            strained = curve.force_at_strain(allowed)
            if strained is not None:
                limits.append((strained, f"strain at {curve.tilt_deg:g} degrees"))
        return min(limits)

    @cached_property
    def volume_cm3(self) -> float:
        """Silicone of the shell: closed form, the gyroid's part of the interlock taken off."""
        start, top = scaling.FLANGE_THICKNESS_MM, scaling.FLANGE_THICKNESS_MM + scaling.INTERLOCK_DEPTH_MM
        tip = self.params.tip_height_mm
        whole, zone = (self._between(start, height) for height in (tip, min(top, tip)))
        return (whole - GYROID_FRACTION * zone) / 1000

    def _between(self, low_mm: float, high_mm: float) -> float:
        """Volume of the wall between two heights, mm3."""
        centre = self.params.centre_height_mm

        def filled(radius: float) -> float:
            a, b = (min(max(height - centre, -radius), radius) for height in (low_mm, high_mm))
            return math.pi * (radius**2 * (b - a) - (b**3 - a**3) / 3)

        return filled(self.params.outer_radius_mm) - filled(self.params.inner_radius_mm)

    @property
    def mass_g(self) -> float:
        """Of the silicone."""
        return self.volume_cm3 * self.material.density_g_cm3

    def stiffness_n_mm(self, tilt_deg: float) -> float:
        """Secant from first touch to a fifth of the range, at one of the curves' tilts."""
        curve = next(curve for curve in self.curves if curve.tilt_deg == tilt_deg)
        return 0.2 * self.range_n / curve.depth_at(0.2 * self.range_n)


def figures(study: Study) -> list[Figure]:
    """The lines of a study: what it will feel, what it weighs."""
    lines = [*_loads(study), *_dots(study), *_errors(study), *_rate(study), *_mass(study)]
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
            "patch_mm2", "contact patch at half the range, 25 degrees", study.curves[1].patch_at(half), "mm2",
            Source.COMPUTED, "Gauss points in contact",
        ),
    ]  # fmt: skip
    return lines


def _strain(study: Study, force_n: float) -> float:
    return max(curve.strain_at(force_n) for curve in study.curves)


def _dots(study: Study) -> list[Figure]:
    pixels = study.bound.rest_px()
    apart = np.linalg.norm(pixels[:, None] - pixels[None], axis=2) + np.diag(np.full(len(pixels), np.inf))
    pitch_px = float(np.median(apart.min(axis=1)))
    pitch_mm = study.params.inner_radius_mm * math.radians(180 / 13)
    per_n = study.bound.at(25.0, 0.5 * study.range_n).px_per_n
    return [
        Figure("dots", "dots seen", len(pixels), "", Source.COMPUTED, "whole, in 640 x 480"),
        Figure("pitch_mm", "pitch of the dots", pitch_mm, "mm", Source.COMPUTED, "between rings, on the inner sphere"),
        Figure("pitch_px", "pitch in the picture", pitch_px, "px", Source.COMPUTED, "median of nearest neighbours"),
        Figure("px_per_n", "displacement by load, 25 degrees", per_n, "px/N", Source.COMPUTED, "rms over the dots"),
    ]


def _errors(study: Study) -> list[Figure]:
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
            "error_n", "force error expected of trained weights", study.error_n, "N", Source.ESTIMATED,
            f"{100 * MEASURED_SHARE:.2g} % of the range, as measured at other designs (docs/design.md)",
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


def blind_direction(study: Study) -> str:
    """What the dots show least, in words."""
    worst = max(study.bounds, key=lambda bound: bound.force_n / bound.normal_n)
    direction = worst.weakest()
    axes = ("fx", "fy", "fz", "tx", "ty", "tz")
    parts = sorted(zip(np.abs(direction), direction, axes, strict=True), reverse=True)[:2]
    text = " and ".join(f"{value:+.2f} {axis}" for _, value, axis in parts)
    return (
        f"weakest at {worst.tilt_deg:g} degrees and {worst.normal_n:.3g} N, along {text} (contact on azimuth 0); "
        "torque about the plane's normal is not a direction of its own: a plane's patch is too small to carry much"
    )


def as_csv(lines: list[Figure]) -> str:
    """Figures as a table."""
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(["key", "name", "value", "unit", "source", "note"])
    for line in lines:
        value = "" if line.value is None else f"{line.value:.6g}"
        table.writerow([line.key, line.name, value, line.unit, line.source.value, line.note])
    return out.getvalue()


def as_record(study: Study, lines: list[Figure]) -> dict[str, object]:
    """Study as plain JSON."""
    bounds = [
        {"tilt_deg": b.tilt_deg, "normal_n": b.normal_n, "sigma": b.sigma.tolist(), "wrench": b.wrench.tolist()}
        for b in study.bounds
    ]
    return {
        "design": asdict(study.params), "digest": study.params.digest, "silicone": study.silicone,
        "figures": [asdict(line) | {"source": line.source.value} for line in lines], "bounds": bounds,
        "blind": blind_direction(study),
    }  # fmt: skip
