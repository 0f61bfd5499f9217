"""Silicones: mixing, density and hyperelastic constants (standard library only: the bottom layer).

The table is ``materials.csv`` in this folder; its last column states the source of each number, with letters and ids of
docs/provenance.md (P paper, M measured, S data sheet, E estimate). Stresses are in MPa = N/mm2, densities in g/cm3,
times in the unit of their names.

Energy per reference volume, with I1b the first invariant of the isochoric right Cauchy-Green tensor:

    neo-Hooke   W = C10 (I1b - 3)
    Yeoh        W = C10 (I1b - 3) + C20 (I1b - 3)^2 + C30 (I1b - 3)^3        (Yeoh 1993, doi:10.5254/1.3538343)
    both        + K/2 (J - 1)^2,  mu = 2 C10,  K = 2 mu (1 + nu) / (3 (1 - 2 nu))

Prony series: G(t) = G_inf + sum_i g_i G_0 exp(-t / tau_i), as relative moduli ``prony_g`` (dimensionless).
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from cad.data_table import number, positive, read_table
from cad.errors import ParameterError
from cad.material_units import require_units

TABLE = Path(__file__).with_name("materials.csv")
DEFAULT_SILICONE = "Smooth-Sil 950"
YEOH_COLUMNS = ("yeoh_c10_mpa", "yeoh_c20_mpa", "yeoh_c30_mpa")  # filled together or not at all
MIX_RATIO = re.compile(r"([0-9]+(?:\.[0-9]+)?)A:([0-9]+(?:\.[0-9]+)?)B by (?:weight|volume or weight)")
MAX_POISSON = 0.49999  # above it K > 5e4 mu, and rounding hides the shear terms in double precision
LEAST_POISSON = 0.48  # M: for rows. Weights and study of any size use 0.49; a press is 1.1 % deeper at 0.48


@dataclass(frozen=True)
class HyperelasticLaw:
    """Constants of the isochoric energy and the bulk modulus (MPa).

    Attributes:
        c10_mpa: energy coefficient C10, MPa.
        c20_mpa: energy coefficient C20, MPa; C20 = C30 = 0 is neo-Hooke.
        c30_mpa: energy coefficient C30, MPa.
        bulk_mpa: bulk modulus K, MPa.

    Raises:
        ParameterError: a constant is not physical (C10 <= 0, K <= 0, or dW/dI1b reaches 0 in 0 <= I1b - 3 <= 1).
    """

    c10_mpa: float
    c20_mpa: float
    c30_mpa: float
    bulk_mpa: float

    def __post_init__(self) -> None:
        for name in ("c10_mpa", "bulk_mpa"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ParameterError(
                    f"{name}={value:g} is not positive and finite: the material would have no stiffness; "
                    "take the constants from cad/materials.csv",
                    name=name,
                    value=value,
                )
        if not all(math.isfinite(c) for c in (self.c20_mpa, self.c30_mpa)) or not self._least_slope() > 0:
            raise ParameterError(
                f"c20_mpa={self.c20_mpa:g}, c30_mpa={self.c30_mpa:g} make the Yeoh stiffness vanish below "
                "I1 - 3 = 1 (a bar stretched by 68 %): raise c20_mpa or c30_mpa",
                name="c20_mpa",
                value=self.c20_mpa,
            )

    @property
    def shear_mpa(self) -> float:
        """Shear modulus of the undeformed material, mu = 2 C10, MPa."""
        return 2 * self.c10_mpa

    @property
    def poisson(self) -> float:
        """Poisson's ratio of the undeformed material."""
        ratio = self.bulk_mpa / self.shear_mpa
        return (3 * ratio - 2) / (6 * ratio + 2)

    @property
    def young_mpa(self) -> float:
        """Young's modulus of the undeformed material, MPa."""
        return 2 * self.shear_mpa * (1 + self.poisson)

    def _least_slope(self) -> float:
        """Least dW/dI1b for I1b - 3 in 0..1, MPa: at an end of the interval or at the vertex of the parabola."""
        turn = -self.c20_mpa / (3 * self.c30_mpa) if self.c30_mpa else 0.0
        places = (0.0, min(max(turn, 0.0), 1.0), 1.0)
        return min(self.c10_mpa + 2 * self.c20_mpa * x + 3 * self.c30_mpa * x * x for x in places)


def hyperelastic_law(c10_mpa: float, poisson: float, c20_mpa: float = 0.0, c30_mpa: float = 0.0) -> HyperelasticLaw:
    """Law from the energy coefficients and Poisson's ratio.

    Args:
        c10_mpa: energy coefficient C10, MPa.
        poisson: Poisson's ratio of the undeformed material.
        c20_mpa: energy coefficient C20, MPa.
        c30_mpa: energy coefficient C30, MPa.

    Raises:
        ParameterError: Poisson's ratio lies outside 0..0.49999, or a constant is not physical.
    """
    if not 0 <= poisson <= MAX_POISSON:
        raise ParameterError(
            f"poisson={poisson:g} outside 0..{MAX_POISSON:g}: silicone is nearly incompressible, and 0.5 has no "
            "bulk modulus; take 0.49 to 0.4999",
            name="poisson",
            value=poisson,
        )
    bulk = 4 * c10_mpa * (1 + poisson) / (3 * (1 - 2 * poisson))
    return HyperelasticLaw(c10_mpa, c20_mpa, c30_mpa, bulk)


@dataclass(frozen=True)
class Silicone:
    """One row of the table (units in the field names; ``None`` where the source gives no value)."""

    name: str
    density_g_cm3: float
    mix_ratio: str
    pot_life_min: float
    viscosity_pa_s: float
    cure_h: float
    shore: str
    modulus_100_mpa: float
    elongation_percent: float
    poisson: float
    neo_hooke_c10_mpa: float
    yeoh_mpa: tuple[float, float, float] | None
    prony: tuple[tuple[float, float], ...]
    provenance: str

    def neo_hooke(self, poisson: float | None = None) -> HyperelasticLaw:
        """Neo-Hooke law; Poisson's ratio is the table's unless another one is given."""
        return hyperelastic_law(self.neo_hooke_c10_mpa, self.poisson if poisson is None else poisson)

    def yeoh(self, poisson: float | None = None) -> HyperelasticLaw:
        """Yeoh law.

        Raises:
            ParameterError: the table has no Yeoh constants for this silicone.
        """
        if self.yeoh_mpa is None:
            raise ParameterError(
                f"silicone={self.name!r} has no Yeoh constants in cad/materials.csv: use neo_hooke, or add them",
                name="silicone",
                value=self.name,
            )
        c10, c20, c30 = self.yeoh_mpa
        return hyperelastic_law(c10, self.poisson if poisson is None else poisson, c20, c30)

    def prony_series(self) -> tuple[tuple[float, float], ...]:
        """Prony series of the relaxation: pairs of relative modulus g and time constant tau, s.

        Raises:
            ParameterError: the table has no series for this silicone.
        """
        if not self.prony:
            known = ", ".join(name for name, row in silicones().items() if row.prony)
            raise ParameterError(
                f"silicone={self.name!r} has no Prony series in cad/materials.csv: leave rate effects out, add its "
                f"constants, or choose one of {known}",
                name="silicone",
                value=self.name,
            )
        return self.prony


@cache
def silicones() -> dict[str, Silicone]:
    """All rows: name -> silicone.

    Raises:
        FileError: the table is missing or unreadable; the message names the line.
    """
    return read_table(TABLE, _silicone)


def silicone(name: str = DEFAULT_SILICONE) -> Silicone:
    """The silicone with a name.

    Raises:
        ParameterError: the name is unknown; the message lists those in the table.
    """
    try:
        return silicones()[name]
    except KeyError:
        known = ", ".join(silicones())
        raise ParameterError(
            f"silicone={name!r} is not in cad/materials.csv: choose one of {known}, or add a row",
            name="silicone",
            value=name,
        ) from None


def mix_parts(mix_ratio: str) -> tuple[float, float]:
    """Parts by weight of A and B, read from the table's text, for example ``100A:10B by weight``.

    Raises:
        ParameterError: the text has another form, or a part is 0.
    """
    found = MIX_RATIO.fullmatch(mix_ratio)
    part_a, part_b = (float(found[1]), float(found[2])) if found else (0.0, 0.0)
    if not (0 < part_a < math.inf and 0 < part_b < math.inf):
        raise ParameterError(
            f"mix_ratio={mix_ratio!r} is not of the form '100A:10B by weight' or '1A:1B by volume or weight' with both "
            "parts above 0: the parts are weighed, so take the ratio by weight from the data sheet",
            name="mix_ratio",
            value=mix_ratio,
        )
    return part_a, part_b


def _silicone(row: dict[str, str]) -> Silicone:
    made = Silicone(
        name=row["name"],
        density_g_cm3=positive(row, "density_g_cm3"),
        mix_ratio=row["mix_ratio"],
        pot_life_min=positive(row, "pot_life_min"),
        viscosity_pa_s=positive(row, "viscosity_pa_s"),
        cure_h=positive(row, "cure_h"),
        shore=row["shore"],
        modulus_100_mpa=positive(row, "modulus_100_mpa"),
        elongation_percent=positive(row, "elongation_percent"),
        poisson=positive(row, "poisson"),
        neo_hooke_c10_mpa=positive(row, "neo_hooke_c10_mpa"),
        yeoh_mpa=_yeoh(row),
        prony=_prony(row),
        provenance=row["provenance"],
    )
    mix_parts(made.mix_ratio)  # refuses here, with its row, a ratio that cannot be weighed
    made.neo_hooke()  # and constants that are not physical
    if made.poisson < LEAST_POISSON:
        raise ValueError(
            f"poisson={made.poisson:g} outside {LEAST_POISSON:g}..{MAX_POISSON:g}: weights and study of any size are "
            "made with 0.49 and would be off by more than 1 %; silicone is nearly incompressible: take 0.49 if unsure"
        )
    if made.yeoh_mpa is not None:
        made.yeoh()
    require_units(made)
    return made


def _yeoh(row: dict[str, str]) -> tuple[float, float, float] | None:
    """The three Yeoh constants of a row, MPa; None where all are empty."""
    if not any(row[column] for column in YEOH_COLUMNS):
        return None
    if missing := [column for column in YEOH_COLUMNS if not row[column]]:
        raise ValueError(f"{missing[0]}='': Yeoh's law has three constants: give all of them (0 where unused) or none")
    c10, c20, c30 = YEOH_COLUMNS
    return positive(row, c10), number(row, c20), number(row, c30)


def _prony(row: dict[str, str]) -> tuple[tuple[float, float], ...]:
    """Pairs (g, tau_s) of a row; empty where both columns are empty."""
    moduli, times = _positives(row, "prony_g"), _positives(row, "prony_tau_s")
    if len(moduli) != len(times):
        raise ValueError(
            f"prony_g={row['prony_g']!r} and prony_tau_s={row['prony_tau_s']!r} have {len(moduli)} and {len(times)} "
            "numbers: each relative modulus has one time, separated by semicolons"
        )
    if sum(moduli) >= 1:
        raise ValueError(
            f"prony_g={row['prony_g']!r}: relative moduli add up to less than 1, for what does not relax keeps the rest"
        )
    return tuple(zip(moduli, times, strict=True))


def _positives(row: dict[str, str], column: str) -> list[float]:
    """Numbers of a cell, which semicolons separate; empty where the cell is empty."""
    return [positive({column: part}, column) for part in row[column].split(";")] if row[column] else []
