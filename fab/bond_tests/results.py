"""Results of bond tests: largest force, mean peel force, statistics of groups, comparisons. Newtons, millimetres.

Peel after ASTM D1876: the mean load over the first 127 mm of bond line after the initial peak. In a T-peel both arms
are peeled off, so 127 mm of bond are 254 mm of crosshead travel (stretch of the arms neglected). The mean is an
integral over travel, so it does not depend on the sampling rate. The paper's specimens have 200 mm of bond.

Statistics: t intervals of means; Welch's test for means (Biometrika 34 (1947) 28, doi:10.1093/biomet/34.1-2.28), which
does not assume equal spread; Brown and Forsythe's for spread (doi:10.1080/01621459.1974.10482955); Mann and Whitney's
for ranks. More than two groups are compared pair by pair, p values after Holm.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy import stats

from cad.errors import FileError
from fab.bond_tests.files import Record

KINDS = ("tensile", "peel")
BOND_MM = 127.0  # S: ASTM D1876, 5 inches of bond line after the initial peak
TRAVEL_RATIO = 2.0  # crosshead travel for each millimetre of bond
PEAK_DROP = 0.10  # the initial peak ends where the load is this share below it
PEAK_SHARE = 0.30  # least initial peak, as a share of the largest load: excludes slip of the grips
TORN_SHARE = 0.10  # below this share of the plateau the specimen has separated
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Specimen:
    """Result of one specimen.

    Attributes:
        name: file name.
        kind: ``tensile`` or ``peel``.
        group: bonding method.
        force_n: largest load (tensile) or mean peel load (peel), N.
        peak_n: largest load, N.
        failure: as marked, or an empty string.
        bond_mm: length of bond over which the mean is taken (peel), mm; 0 for tensile.
        complete: whether the whole 127 mm were peeled (peel); always true for tensile.
    """

    name: str
    kind: str
    group: str
    force_n: float
    peak_n: float
    failure: str
    bond_mm: float
    complete: bool


@dataclass(frozen=True)
class Group:
    """Statistics of one bonding method: forces in N; ``low_n`` to ``high_n`` is the mean's 95 % interval, or NaN."""

    kind: str
    group: str
    count: int
    mean_n: float
    deviation_n: float
    low_n: float
    high_n: float
    median_n: float
    quartiles_n: tuple[float, float]
    failures: dict[str, int]
    incomplete: int


@dataclass(frozen=True)
class Comparison:
    """Comparison of two methods.

    Attributes:
        kind: ``tensile`` or ``peel``.
        first, second: the methods.
        ratio: mean of the first over mean of the second.
        difference_n, low_n, high_n: difference of means, first less second, with its 95 % interval (Welch), N.
        p_mean: of Welch's test of the means.
        p_mean_holm: the same after Holm's correction for several comparisons.
        p_rank: of Mann and Whitney's test of ranks.
        p_spread: of Brown and Forsythe's test of spreads.
    """

    kind: str
    first: str
    second: str
    ratio: float
    difference_n: float
    low_n: float
    high_n: float
    p_mean: float
    p_mean_holm: float
    p_rank: float
    p_spread: float


def evaluate(record: Record, kind: str, group: str) -> Specimen:
    """Result of one specimen.

    Args:
        record: of one test.
        kind: ``tensile`` or ``peel``.
        group: bonding method.

    Raises:
        FileError: a peel record without an initial peak.
    """
    peak = float(record.load_n.max())
    if kind == "tensile":
        return Specimen(record.path.name, kind, group, peak, peak, record.failure, 0.0, True)
    force, bond = mean_peel(record)
    return Specimen(record.path.name, kind, group, force, peak, record.failure, bond, bond >= BOND_MM - 0.5)


def mean_peel(record: Record) -> tuple[float, float]:
    """Mean peel load (N) after the initial peak, and the length of bond (mm) over which it is taken.

    Args:
        record: of one peel test.

    Raises:
        FileError: the load never falls, so nothing was peeled.
    """
    travel, load = record.displacement_mm, record.load_n
    start = initial_peak(load)
    if start is None:
        raise FileError(
            f"{record.path}: the load never falls by {PEAK_DROP:.0%} from a first peak: nothing was peeled; mark it as "
            "a tensile test or leave it out"
        )
    end = min(travel[start] + TRAVEL_RATIO * BOND_MM, travel[last_held(load, start)])
    inside = (travel > travel[start]) & (travel < end)
    x = np.concatenate([[travel[start]], travel[inside], [end]])
    y = np.concatenate([[load[start]], load[inside], [np.interp(end, travel, load)]])
    if end <= travel[start]:
        raise FileError(f"{record.path}: the specimen came apart at its first peak: there is no steady part to average")
    return float(np.trapezoid(y, x) / (end - travel[start])), float((end - travel[start]) / TRAVEL_RATIO)


def initial_peak(load: np.ndarray) -> int | None:
    """Row of the first maximum from which the load falls by a tenth; None where it never does.

    Args:
        load: (n,), N.
    """
    highest = np.maximum.accumulate(load)
    fallen = (load < (1 - PEAK_DROP) * highest) & (highest >= PEAK_SHARE * load.max())
    if not fallen.any():
        return None
    return int(np.argmax(load[: int(np.argmax(fallen))]))


def last_held(load: np.ndarray, start: int) -> int:
    """Last row after the initial peak at which the specimen still carries load.

    Args:
        load: (n,), N.
        start: row of the initial peak.
    """
    plateau = float(np.median(load[start:][load[start:] > TORN_SHARE * load[start]]))
    return start + int(np.flatnonzero(load[start:] > TORN_SHARE * plateau)[-1])


def summarize(specimens: Sequence[Specimen]) -> list[Group]:
    """Statistics of each kind and group, in order of first occurrence.

    Args:
        specimens: of all groups.
    """
    groups = []
    for kind, name in dict.fromkeys((s.kind, s.group) for s in specimens):
        members = [s for s in specimens if (s.kind, s.group) == (kind, name)]
        forces = np.array([s.force_n for s in members])
        low, high = mean_interval(forces)
        marks = [s.failure for s in members if s.failure]
        quartiles = (float(np.percentile(forces, 25)), float(np.percentile(forces, 75)))
        groups.append(
            Group(
                kind,
                name,
                len(members),
                float(forces.mean()),
                float(forces.std(ddof=1)) if len(forces) > 1 else math.nan,
                low,
                high,
                float(np.median(forces)),
                quartiles,
                {mark: marks.count(mark) for mark in dict.fromkeys(marks)},
                sum(not s.complete for s in members),
            )
        )
    return groups


def mean_interval(values: np.ndarray) -> tuple[float, float]:
    """Two-sided 95 % t interval of a mean; NaN for fewer than two values.

    Args:
        values: (n,).
    """
    if len(values) < 2:
        return math.nan, math.nan
    half = stats.t.ppf((1 + CONFIDENCE) / 2, len(values) - 1) * values.std(ddof=1) / math.sqrt(len(values))
    return float(values.mean() - half), float(values.mean() + half)


def compare(specimens: Sequence[Specimen]) -> list[Comparison]:
    """Compare each pair of groups of one kind with at least two specimens each.

    Args:
        specimens: of all groups.
    """
    found = []
    for kind in dict.fromkeys(s.kind for s in specimens):
        forces: Mapping[str, np.ndarray] = {
            name: np.array([s.force_n for s in specimens if (s.kind, s.group) == (kind, name)])
            for name in dict.fromkeys(s.group for s in specimens if s.kind == kind)
        }
        pairs = [(a, b) for a, b in combinations(forces, 2) if min(len(forces[a]), len(forces[b])) > 1]
        tests = [stats.ttest_ind(forces[a], forces[b], equal_var=False) for a, b in pairs]
        adjusted = holm([float(test.pvalue) for test in tests])
        for (a, b), test, p_holm in zip(pairs, tests, adjusted, strict=True):
            interval = test.confidence_interval(CONFIDENCE)
            found.append(
                Comparison(
                    kind,
                    a,
                    b,
                    float(forces[a].mean() / forces[b].mean()),
                    float(forces[a].mean() - forces[b].mean()),
                    float(interval.low),
                    float(interval.high),
                    float(test.pvalue),
                    p_holm,
                    float(stats.mannwhitneyu(forces[a], forces[b]).pvalue),
                    float(stats.levene(forces[a], forces[b], center="median").pvalue),
                )
            )
    return found


def holm(p_values: Sequence[float]) -> list[float]:
    """p values adjusted for several tests (Holm, Scand. J. Statist. 6 (1979) 65).

    Args:
        p_values: of the single tests.
    """
    order = np.argsort(p_values)
    adjusted, highest = [0.0] * len(p_values), 0.0
    for rank, k in enumerate(order):
        highest = max(highest, min(1.0, (len(p_values) - rank) * p_values[k]))
        adjusted[k] = highest
    return adjusted
