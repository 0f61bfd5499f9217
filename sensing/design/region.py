"""The whole region of designs that can be made: figures over (D, T), the Pareto front, and the inverse question.

The bound takes nearly all of the time and goes with the shear modulus: it is computed in one silicone and scaled.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from cad.feasible import diameter_range_mm, wall_range_mm
from cad.materials import silicones
from cad.params import EndcapParams
from cad.silicone_kits import silicone_usd_kg
from sensing.design.pressed import Study, expected_share
from sensing.design.prints import mold_usd

Progress = Callable[[int, int], None]
DIAMETERS, WALLS = 20, 10  # numbers of diameters, and of walls at each; evenly spaced


@dataclass(frozen=True)
class Place:
    """One design and silicone of the map.

    Attributes:
        diameter_mm, wall_mm, silicone: the design and its silicone.
        range_n: range of the weights, N.
        safe_n: largest safe load, N.
        limit: reason of that limit.
        stiffness_n_mm: stiffness at 25 degrees, N/mm.
        bound_n: Cramér-Rao bound of the force, an axis, N.
        mass_g: mass of the silicone, g.
        cost_usd: cost of silicone, by the gram of its smallest kit, and mold (estimated), USD.
        sag_mm: motion of a dot by the skin's own weight where the endcap is turned from tip up onto its side, mm.
        pareto: whether no other place has more range, a smaller bound in percent of it and less mass.
    """

    diameter_mm: float
    wall_mm: float
    silicone: str
    range_n: float
    safe_n: float
    limit: str
    stiffness_n_mm: float
    bound_n: float
    mass_g: float
    cost_usd: float
    sag_mm: float
    pareto: bool = False

    @property
    def error_n(self) -> float:
        """Expected force error of trained weights, an axis, N."""
        return max(self.bound_n, expected_share(self.diameter_mm) * self.range_n)

    @property
    def label(self) -> str:
        """Name in words."""
        return f"D={self.diameter_mm:g} T={self.wall_mm:g} {self.silicone}"


def place_of(study: Study, bound_n: float | None = None) -> Place:
    """A study's figures for the map.

    Args:
        study: study of one design.
        bound_n: force bound, N; None computes it.
    """
    safe_n, limit = study.safe
    params = study.params
    cost_usd = silicone_usd_kg(study.silicone) * study.mass_g / 1000 + mold_usd(params)
    return Place(
        params.diameter_mm, params.wall_mm, study.silicone, study.range_n, safe_n, limit,
        study.stiffness_n_mm(25.0), study.bound_n if bound_n is None else bound_n, study.mass_g, cost_usd,
        study.sag_mm,
    )  # fmt: skip


def in_every_silicone(params: EndcapParams, bound_mm2: float) -> list[Place]:
    """The places of a shell.

    Args:
        params: design.
        bound_mm2: its force bound over the shear modulus, N/MPa, which all silicones share.
    """
    studies = [Study(params, name) for name in silicones()]
    return [place_of(study, bound_mm2 * study.shear_mpa) for study in studies]


def grid(diameters: int = DIAMETERS, walls: int = WALLS) -> list[tuple[float, float]]:
    """(D, T) over the region that can be made, rounded to 0.1 mm inside it.

    Args:
        diameters: number of diameters, from the smallest to the largest.
        walls: number of walls at each.
    """
    low, high = diameter_range_mm()
    places = []
    for diameter in np.linspace(math.ceil(low * 10 + 1) / 10, high, diameters):
        d = round(float(diameter), 1)
        thin, thick = wall_range_mm(d)
        for wall in np.linspace(thin, math.floor(thick * 10) / 10, walls):
            t = round(float(wall), 1)
            if thin <= t <= thick and (d, t) not in places:
                places.append((d, t))
    return places


def survey(designs: Sequence[tuple[float, float]], progress: Progress | None = None) -> list[Place]:
    """Places of designs, in every silicone.

    Args:
        designs: (D, T) of each design, mm.
        progress: called with (designs done, designs in all).
    """
    found: list[Place] = []
    for count, (diameter, wall) in enumerate(designs, 1):
        usual = Study(EndcapParams(diameter, wall))
        found += in_every_silicone(usual.params, usual.bound_n / usual.shear_mpa)
        if progress is not None:
            progress(count, len(designs))
    return [replace(place, pareto=bool(best)) for place, best in zip(found, pareto(found), strict=True)]


def pareto(places: Sequence[Place]) -> NDArray[np.bool_]:
    """(N,) whether no other place is better in range, bound in percent of it, and mass at once."""
    goals = np.array([[-p.range_n, p.bound_n / p.range_n, p.mass_g] for p in places])
    beaten = [bool(((goals <= goal).all(axis=1) & (goals < goal).any(axis=1)).any()) for goal in goals]
    return ~np.array(beaten, dtype=bool)


@dataclass(frozen=True)
class Choice:
    """One answer to the inverse question: a place, and what it is best in."""

    place: Place
    why: str


def choose(places: Sequence[Place], load_n: float, error_n: float) -> list[Choice]:
    """Three designs that bear a load with an error: the lightest, the most exact, the smallest.

    Args:
        places: places of the map.
        load_n: normal force that the design has to bear, N.
        error_n: largest expected force error of weights, an axis, N.

    Raises:
        ParameterError: no place does; the message names the nearest.
    """
    bears = _bearing(places, load_n, error_n)
    good = [place for place in bears if place.error_n <= error_n]
    if not good:
        best = min(bears, key=lambda place: place.error_n)
        raise ParameterError(
            f"error={error_n:g} N at load={load_n:g} N: no design is expected to do so well; the least is "
            f"{best.error_n:.3g} N with {best.label} (the dots alone would allow {best.bound_n:.3g} N)",
            name="error",
            value=error_n,
        )
    wishes: list[tuple[str, Callable[[Place], float]]] = [
        ("lightest", lambda place: place.mass_g),
        ("most exact", lambda place: place.error_n),
        ("smallest", lambda place: place.diameter_mm),
    ]
    chosen: list[Choice] = []
    for word, key in wishes:
        left = [place for place in good if all(place != choice.place for choice in chosen)]
        if left:
            place = sorted(sorted(left, key=lambda p: p.mass_g), key=key)[0]
            others = "" if key(place) <= min(map(key, good)) else " but for those above,"
            chosen.append(Choice(place, _why(word + others, place, len(good))))
    return chosen


def require_possible(designs: Sequence[tuple[float, float]], load_n: float, error_n: float) -> None:
    """Refuse impossible loads and shares at once, which do not need the bounds that the map computes in minutes.

    Args:
        designs: (D, T) of each design, mm.
        load_n, error_n: as in :func:`choose`.

    Raises:
        ParameterError: no design bears the load, or all that do have larger errors even with perfect dots.
    """
    plain = [place for design in designs for place in in_every_silicone(EndcapParams(*design), 0.0)]
    bears = _bearing(plain, load_n, error_n)
    best = min(bears, key=lambda place: place.error_n)
    if best.error_n > error_n:
        raise ParameterError(
            f"error={error_n:g} N at load={load_n:g} N: no design is expected to do so well; trained weights err by "
            f"{best.error_n:.3g} N at least, with {best.label}",
            name="error",
            value=error_n,
        )


def _bearing(places: Sequence[Place], load_n: float, error_n: float) -> list[Place]:
    """Places that bear a load; refuses invalid numbers, and a load that no place bears."""
    for name, value in (("load", load_n), ("error", error_n)):
        if not (math.isfinite(value) and value > 0):
            raise ParameterError(f"{name}={value:g}: give newtons, more than 0", name=name, value=value)
    bears = [place for place in places if place.safe_n >= load_n]
    if not bears:
        most = max(places, key=lambda place: place.safe_n)
        raise ParameterError(
            f"load={load_n:g} N: no design bears it; the most is {most.safe_n:.4g} N with {most.label}",
            name="load",
            value=load_n,
        )
    return bears


def _why(word: str, place: Place, count: int) -> str:
    return (
        f"{word} of {count} designs that do: bears {place.safe_n:.4g} N ({place.limit}), {place.error_n:.2g} N "
        f"expected (dots allow {place.bound_n:.2g}), {place.stiffness_n_mm:.3g} N/mm, {place.mass_g:.3g} g of silicone "
        f"that sags by {place.sag_mm:.2g} mm when turned onto its side"
    )


def as_csv(places: Sequence[Place]) -> str:
    """The map as CSV."""
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    names = list(Place.__dataclass_fields__)
    table.writerow([*names, "error_n"])
    for place in places:
        values = [getattr(place, name) for name in names]
        table.writerow([f"{v:.5g}" if isinstance(v, float) else v for v in [*values, place.error_n]])
    return out.getvalue()
