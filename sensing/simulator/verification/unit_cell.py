"""Effective stiffness of a periodic unit cell of two linear elastic phases: the interlock of TPU gyroid and silicone.

    mixed = voxels(gyroid_share(65, 0.093), SILICONE, TPU)
    moduli = effective(mixed)                                   # bulk and the two shear moduli of a cubic cell, MPa

Each voxel is a hexahedron with one Gauss point (the rotated scheme of Willot 2015, doi:10.1016/j.crme.2014.12.005): the
displacement lives at the corners, the strain in the middle, so that a nearly incompressible phase does not lock. The
equilibrium Gamma C (E + e) = 0 of the compatible strain e is solved with conjugate gradients, preconditioned by a
homogeneous medium in Fourier space (Moulinec, Suquet 1998, doi:10.1016/S0045-7825(97)00218-1; Zeman et al. 2010,
doi:10.1016/j.jcp.2010.07.010). Strains have six rows 11 22 33 23 13 12, shear as tensor components.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfftn, rfftn

Array = NDArray[np.float64]
PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))  # tensor indices of the six rows of a strain
COUNTS = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])  # number of tensor components of each row
TOLERANCE, MAX_STEPS = 1e-6, 400  # relative residual and most steps of the conjugate gradients


@dataclass(frozen=True)
class Phase:
    """Moduli of an isotropic solid: numbers, or one for each voxel (MPa)."""

    bulk_mpa: float | Array
    shear_mpa: float | Array

    @staticmethod
    def of(young_mpa: float, poisson: float) -> Phase:
        """Moduli from Young's modulus and Poisson's ratio."""
        return Phase(young_mpa / (3 * (1 - 2 * poisson)), young_mpa / (2 * (1 + poisson)))

    def stress(self, strain: Array) -> Array:
        """(6, ...) stress of a strain (6, ...), MPa."""
        shear = 2 * np.asarray(self.shear_mpa) * strain
        shear[:3] += (np.asarray(self.bulk_mpa) - 2 / 3 * np.asarray(self.shear_mpa)) * strain[:3].sum(axis=0)
        return np.asarray(shear)


@dataclass(frozen=True)
class CubicModuli:
    """Moduli of a cell with cubic symmetry, MPa.

    Attributes:
        bulk_mpa: bulk modulus K.
        along_mpa: shear modulus (C11 - C12) / 2.
        across_mpa: shear modulus C44.
        steps: total number of steps of the conjugate gradients.
    """

    bulk_mpa: float
    along_mpa: float
    across_mpa: float
    steps: int

    @property
    def shear_mpa(self) -> float:
        """Shear modulus averaged over all directions: Hill's mean of Voigt's and Reuss's, MPa."""
        voigt = 0.4 * self.along_mpa + 0.6 * self.across_mpa
        return 0.5 * (voigt + 1 / (0.4 / self.along_mpa + 0.6 / self.across_mpa))

    @property
    def young_mpa(self) -> float:
        """Young's modulus of the averaged moduli, MPa."""
        return 9 * self.bulk_mpa * self.shear_mpa / (3 * self.bulk_mpa + self.shear_mpa)

    @property
    def anisotropy(self) -> float:
        """Zener's ratio, 1 for an isotropic cell."""
        return self.across_mpa / self.along_mpa


def gyroid_share(count: int, fraction: float, inside: int = 3) -> Array:
    """(n, n, n) part of each voxel that a gyroid sheet fills.

    Args:
        count: n, odd.
        fraction: volume fraction of the sheet in the cell.
        inside: points along an edge at which a voxel is sampled.
    """
    fine = count * inside
    x, y, z = np.meshgrid(*(2 * np.pi * (np.arange(fine) + 0.5) / fine,) * 3, indexing="ij", sparse=True)
    level = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
    slope = (
        (np.cos(x) * np.cos(y) - np.sin(z) * np.sin(x)) ** 2
        + (np.cos(y) * np.cos(z) - np.sin(x) * np.sin(y)) ** 2
        + (np.cos(z) * np.cos(x) - np.sin(y) * np.sin(z)) ** 2
    )
    distance = np.abs(level) / np.sqrt(slope)  # to first order, as for the printed sheet
    solid = distance < np.quantile(distance, fraction)
    return np.asarray(solid.reshape((count, inside) * 3).mean(axis=(1, 3, 5)))


def voxels(share: Array, soft: Phase, stiff: Phase, series: bool = False) -> Phase:
    """Moduli of every voxel.

    Args:
        share: volume fraction of the stiff phase in each voxel.
        soft, stiff: the phases.
        series: whether phases that share a voxel act in series (too soft) instead of in parallel (too stiff).
    """

    def mixed(a: float | Array, b: float | Array) -> Array:
        return np.asarray(1 / ((1 - share) / a + share / b) if series else (1 - share) * a + share * b)

    return Phase(mixed(soft.bulk_mpa, stiff.bulk_mpa), mixed(soft.shear_mpa, stiff.shear_mpa))


def effective(cell: Phase) -> CubicModuli:
    """Moduli of a cell of voxels with cubic symmetry."""
    steps = 0

    def mean(*strain: float) -> Array:
        nonlocal steps
        stress, more = mean_stress(cell, np.array(strain, dtype=float))
        steps += more
        return stress

    bulk = float(mean(1, 1, 1, 0, 0, 0)[:3].mean() / 3)
    along = mean(1, -0.5, -0.5, 0, 0, 0)
    return CubicModuli(bulk, float(along[0] - along[1:3].mean()) / 3, float(mean(0, 0, 0, 0, 0, 1)[5]) / 2, steps)


def mean_stress(cell: Phase, strain: Array) -> tuple[Array, int]:
    """((6,) mean stress, steps) of a cell under a mean strain.

    Args:
        cell: moduli of (n, n, n) voxels, n odd.
        strain: (6,) mean strain, shear as tensor components.
    """
    shape = np.shape(cell.shear_mpa)
    around = Phase(float(np.median(cell.bulk_mpa)), float(np.median(cell.shear_mpa)))
    project = _green(shape[0], around)

    def inner(a: Array, b: Array) -> float:
        return float(np.einsum("r,rxyz,rxyz->", COUNTS, a, b, optimize=True))

    total = np.broadcast_to(np.asarray(strain, dtype=float)[:, None, None, None], (6, *shape)).copy()
    rest = -project(cell.stress(total))
    way, size = rest.copy(), inner(rest, around.stress(rest))
    goal = TOLERANCE**2 * inner(total, around.stress(total))
    steps = 0
    while size > goal and steps < MAX_STEPS:
        stress = cell.stress(way)
        length = size / inner(way, stress)
        total += length * way
        rest -= length * project(stress)
        new = inner(rest, around.stress(rest))
        way = rest + new / size * way
        size, steps = new, steps + 1
    return cell.stress(total).mean(axis=(1, 2, 3)), steps


def _green(count: int, around: Phase) -> Callable[[Array], Array]:
    """Function from a stress (6, n, n, n) to the compatible strain without mean that it causes in a homogeneous medium.

    On the rotated grid all three frequencies have one common factor, so only the direction of their tangents matters.
    """
    tangent = np.tan(np.pi * np.fft.fftfreq(count))
    axes = np.meshgrid(tangent, tangent, tangent[: count // 2 + 1], indexing="ij")
    direction = np.array(axes)
    length = np.linalg.norm(direction, axis=0)
    direction /= np.where(length > 0, length, 1.0)  # zero at the mean, which stays out
    shear, first = float(around.shear_mpa), float(around.bulk_mpa) - 2 / 3 * float(around.shear_mpa)
    factor = (first + shear) / (first + 2 * shear)

    def project(stress: Array) -> Array:
        wave = rfftn(stress, axes=(1, 2, 3))
        pull = np.zeros_like(wave[:3])
        for row, (i, j) in enumerate(PAIRS):
            pull[i] += wave[row] * direction[j]
            if i != j:
                pull[j] += wave[row] * direction[i]
        along = factor * (pull * direction).sum(axis=0)
        for row, (i, j) in enumerate(PAIRS):
            wave[row] = (
                0.5 * (pull[i] * direction[j] + pull[j] * direction[i]) - along * direction[i] * direction[j]
            ) / shear
        return np.asarray(irfftn(wave, s=stress.shape[1:], axes=(1, 2, 3)))

    return project


def hashin_shtrikman(fraction: float, soft: Phase, stiff: Phase) -> tuple[Phase, Phase]:
    """(lower, upper) bounds of an isotropic composite (Hashin, Shtrikman 1963, doi:10.1016/0022-5096(63)90060-7).

    Args:
        fraction: volume fraction of the stiff phase.
        soft, stiff: the phases; the stiff one has the larger bulk and shear modulus.
    """

    def bound(share: float, base: Phase, other: Phase) -> Phase:
        k, g = float(base.bulk_mpa), float(base.shear_mpa)
        bulk = k + share / (1 / (float(other.bulk_mpa) - k) + 3 * (1 - share) / (3 * k + 4 * g))
        more = 6 * (1 - share) * (k + 2 * g) / (5 * g * (3 * k + 4 * g))
        return Phase(bulk, g + share / (1 / (float(other.shear_mpa) - g) + more))

    return bound(fraction, soft, stiff), bound(1 - fraction, stiff, soft)
