"""Element kernels of the nearly incompressible hyperelastic solid (N, mm, MPa; total Lagrangian).

Mixed element, pressure condensed: W = f(I1b - 3) point by point plus K/2 (J - 1)^2 with J - 1 replaced by its
projection on {1, xi, eta, zeta} over the reference element. That equals hex27 displacement with a discontinuous linear
pressure (Q2/P1, inf-sup stable; Simo, Taylor, Pister 1985, doi:10.1016/0045-7825(85)90033-7), and keeps an energy.

    P   = f' dx/dF + p J F^-T,         x = J^(-2/3) F:F - 3,   dx/dF = 2 J^(-2/3) (F - I1/3 F^-T)
    p_a = K (M^-1 b)_a,                b_a = int psi_a (J - 1),   M_ab = int psi_a psi_b
    K_e = int G^T (dP/dF)|_p G + K B^T M^-1 B,                     B_a = int psi_a J F^-T G
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from cad.materials import HyperelasticLaw
from sensing.simulator.element import Array, shape_hex, volume_rule
from sensing.simulator.mesh import HexMesh


@dataclass(frozen=True)
class ElementData:
    """What the kernels need of the undeformed mesh.

    Attributes:
        gradient: shape gradients by reference position (e, 27 points, 27 nodes, 3), 1/mm.
        rows: the same as (e, 27 nodes, 3 x 27), direction before point, for the force kernel.
        weight: volumes of the Gauss points (e, 27), mm3.
        psi: pressure basis at the Gauss points (27, 4).
        mass_inverse: inverse of the pressure mass matrix (e, 4, 4), 1/mm3.
    """

    gradient: Array
    rows: Array
    weight: Array
    psi: Array
    mass_inverse: Array


def element_data(mesh: HexMesh) -> ElementData:
    """Precompute gradients, volumes and pressure mass of every element."""
    local, rule = volume_rule()
    _, grad = shape_hex(local)
    jacobian = np.einsum("gak,eai->egik", grad, mesh.points[mesh.cells])
    weight = np.linalg.det(jacobian) * rule
    gradient = np.einsum("gak,egki->egai", grad, np.linalg.inv(jacobian))
    psi = np.concatenate([np.ones((27, 1)), local], axis=1)
    mass = np.einsum("eg,ga,gb->eab", weight, psi, psi)
    rows = np.ascontiguousarray(gradient.transpose(0, 2, 3, 1)).reshape(len(gradient), 27, -1)
    return ElementData(np.ascontiguousarray(gradient), rows, weight, psi, np.linalg.inv(mass))


def energy_and_force(law: HyperelasticLaw, data: ElementData, displacement: Array) -> tuple[float, Array]:
    """Stored energy (mJ) and nodal forces (e, 27, 3) of element displacements (e, 27, 3).

    An element turned inside out gives infinite energy, which every line search refuses.
    """
    energy, force = _energy_force(
        displacement, data.rows, data.weight, data.psi, data.mass_inverse,
        law.c10_mpa, law.c20_mpa, law.c30_mpa, law.bulk_mpa,
    )  # fmt: skip
    return float(energy), force


def tangent(law: HyperelasticLaw, data: ElementData, displacement: Array) -> Array:
    """Consistent element tangents (e, 81, 81), symmetric, N/mm; degree of freedom ``3 a + i``."""
    return _tangent(
        displacement, data.gradient, data.weight, data.psi, data.mass_inverse,
        law.c10_mpa, law.c20_mpa, law.c30_mpa, law.bulk_mpa,
    )  # fmt: skip


def deformation_gradient(data: ElementData, displacement: Array) -> Array:
    """F at the Gauss points (e, 27, 3, 3) of element displacements (e, 27, 3)."""
    slopes = (displacement.transpose(0, 2, 1) @ data.rows).reshape(-1, 3, 3, data.weight.shape[1])  # du_i/dX_j, point
    return np.ascontiguousarray(slopes.transpose(0, 3, 1, 2)) + np.eye(3)


@dataclass(frozen=True)
class Prestress:
    """A second Piola-Kirchhoff stress that stands whatever the strain. Its potential (C - 1):Q / 2 is quadratic in u.

    Attributes:
        force: nodal forces at rest (e, 27, 3), N.
        block: their slope by the nodes' displacement, the same in each direction (e, 27, 27), N/mm.
    """

    force: Array
    block: Array

    def energy_and_force(self, displacement: Array) -> tuple[float, Array]:
        """Potential (mJ) and nodal forces (e, 27, 3) of element displacements (e, 27, 3)."""
        rise = self.block @ displacement
        return float((displacement * (self.force + rise / 2)).sum()), self.force + rise

    def tangent(self) -> Array:
        """Element matrices (e, 81, 81)."""
        return np.einsum("eab,ij->eaibj", self.block, np.eye(3)).reshape(len(self.block), 81, 81)


def prestress(stress: Array, data: ElementData) -> Prestress:
    """What a symmetric second Piola-Kirchhoff stress (e, 27, 3, 3), MPa, does to the elements."""
    count, points = data.weight.shape
    weighted = np.ascontiguousarray((stress * data.weight[..., None, None]).transpose(0, 2, 3, 1))  # (e, j, k, point)
    pulled = np.einsum("eajq,ejkq->eakq", data.rows.reshape(count, 27, 3, points), weighted)  # grad N_a . Q
    return Prestress(pulled.sum(axis=3), pulled.reshape(count, 27, -1) @ data.rows.transpose(0, 2, 1))


@njit(cache=True)
def _kinematics(u, gradient, f, g):  # type: ignore[no-untyped-def]
    """F into ``f`` and F^-T into ``g`` (3, 3) from nodal u (27, 3); returns J."""
    for i in range(3):
        for j in range(3):
            total = 1.0 if i == j else 0.0
            for a in range(27):
                total += u[a, i] * gradient[a, j]
            f[i, j] = total
    g[0, 0] = f[1, 1] * f[2, 2] - f[1, 2] * f[2, 1]
    g[0, 1] = f[1, 2] * f[2, 0] - f[1, 0] * f[2, 2]
    g[0, 2] = f[1, 0] * f[2, 1] - f[1, 1] * f[2, 0]
    g[1, 0] = f[2, 1] * f[0, 2] - f[2, 2] * f[0, 1]
    g[1, 1] = f[2, 2] * f[0, 0] - f[2, 0] * f[0, 2]
    g[1, 2] = f[2, 0] * f[0, 1] - f[2, 1] * f[0, 0]
    g[2, 0] = f[0, 1] * f[1, 2] - f[0, 2] * f[1, 1]
    g[2, 1] = f[0, 2] * f[1, 0] - f[0, 0] * f[1, 2]
    g[2, 2] = f[0, 0] * f[1, 1] - f[0, 1] * f[1, 0]
    det = f[0, 0] * g[0, 0] + f[0, 1] * g[0, 1] + f[0, 2] * g[0, 2]
    if det > 0.0:
        for i in range(3):
            for j in range(3):
                g[i, j] /= det
    return det


@njit(cache=True, fastmath={"reassoc", "contract"})
def _energy_force(u, rows, weight, psi, mass_inverse, c10, c20, c30, bulk):  # type: ignore[no-untyped-def]
    """Long inner loops over direction and Gauss point, so that they vectorise: F, F^-T and stress are (3, 3 x 27)."""
    count, points = weight.shape
    force = np.zeros((count, 27, 3))
    f = np.empty((3, 3 * points))
    g = np.empty((3, 3, points))
    stress = np.empty((3, 3 * points))
    det = np.empty(points)
    p = np.empty(points)
    b = np.empty(4)
    energy = 0.0
    for e in range(count):
        for i in range(3):
            for k in range(3 * points):
                f[i, k] = 1.0 if i * points <= k < (i + 1) * points else 0.0
        for a in range(27):
            u0, u1, u2 = u[e, a, 0], u[e, a, 1], u[e, a, 2]
            row = rows[e, a]
            for k in range(3 * points):
                value = row[k]
                f[0, k] += u0 * value
                f[1, k] += u1 * value
                f[2, k] += u2 * value
        for i in range(3):  # cofactors J F^-T, row by row
            one, two = f[(i + 1) % 3], f[(i + 2) % 3]
            for q in range(points):
                g[i, 0, q] = one[points + q] * two[2 * points + q] - one[2 * points + q] * two[points + q]
                g[i, 1, q] = one[2 * points + q] * two[q] - one[q] * two[2 * points + q]
                g[i, 2, q] = one[q] * two[points + q] - one[points + q] * two[q]
        lowest = 1.0
        for q in range(points):
            det[q] = f[0, q] * g[0, 0, q] + f[0, points + q] * g[0, 1, q] + f[0, 2 * points + q] * g[0, 2, q]
            lowest = min(lowest, det[q])
        if not lowest > 0.0:
            return math.inf, force
        for a in range(4):
            b[a] = 0.0
            for q in range(points):
                b[a] += weight[e, q] * psi[q, a] * (det[q] - 1.0)
        p[:] = 0.0
        for a in range(4):
            pressure = 0.0
            for c in range(4):
                pressure += bulk * mass_inverse[e, a, c] * b[c]
            energy += 0.5 * pressure * b[a]
            for q in range(points):
                p[q] += psi[q, a] * pressure
        for q in range(points):
            first = 0.0
            for i in range(3):
                for j in range(3):
                    first += f[i, j * points + q] ** 2
            scale = det[q] ** (-2.0 / 3.0)
            x = scale * first - 3.0
            energy += weight[e, q] * (c10 * x + c20 * x * x + c30 * x * x * x)
            slope = 2 * scale * (c10 + 2 * c20 * x + 3 * c30 * x * x) * weight[e, q]
            along = weight[e, q] * p[q] - slope * first / (3 * det[q])
            for i in range(3):
                for j in range(3):
                    stress[i, j * points + q] = slope * f[i, j * points + q] + along * g[i, j, q]
        for a in range(27):
            row = rows[e, a]
            t0, t1, t2 = 0.0, 0.0, 0.0
            for k in range(3 * points):
                value = row[k]
                t0 += stress[0, k] * value
                t1 += stress[1, k] * value
                t2 += stress[2, k] * value
            force[e, a, 0], force[e, a, 1], force[e, a, 2] = t0, t1, t2
    return energy, force


@njit(cache=True)
def _tangent(u, gradient, weight, psi, mass_inverse, c10, c20, c30, bulk):  # type: ignore[no-untyped-def]
    count = u.shape[0]
    result = np.empty((count, 81, 81))
    f = np.empty((27, 3, 3))
    g = np.empty((27, 3, 3))
    det = np.empty(27)
    pressure = np.empty(4)
    b = np.empty(4)
    volume = np.empty((4, 81))
    s1 = np.empty((3, 3))
    right = np.empty((81, 81))  # [3 q + A, 27 j + c] for one i
    left = np.empty((27, 81))  # [a, 3 q + A]
    moduli = np.empty((27, 3, 3, 3, 3))
    for e in range(count):
        b[:] = 0.0
        volume[:] = 0.0
        for q in range(27):
            det[q] = _kinematics(u[e], gradient[e, q], f[q], g[q])
            for a in range(4):
                b[a] += weight[e, q] * psi[q, a] * (det[q] - 1.0)
            for c in range(27):
                for j in range(3):
                    dj = (
                        weight[e, q]
                        * det[q]
                        * (
                            g[q, j, 0] * gradient[e, q, c, 0]
                            + g[q, j, 1] * gradient[e, q, c, 1]
                            + g[q, j, 2] * gradient[e, q, c, 2]
                        )
                    )
                    for a in range(4):
                        volume[a, 3 * c + j] += psi[q, a] * dj
                left[c, 3 * q] = gradient[e, q, c, 0]
                left[c, 3 * q + 1] = gradient[e, q, c, 1]
                left[c, 3 * q + 2] = gradient[e, q, c, 2]
        for a in range(4):
            pressure[a] = 0.0
            for c in range(4):
                pressure[a] += bulk * mass_inverse[e, a, c] * b[c]
        for q in range(27):
            p = 0.0
            for a in range(4):
                p += psi[q, a] * pressure[a]
            first = 0.0
            for i in range(3):
                for j in range(3):
                    first += f[q, i, j] ** 2
            scale = det[q] ** (-2.0 / 3.0)
            x = scale * first - 3.0
            slope = c10 + 2 * c20 * x + 3 * c30 * x * x
            curve = 2 * c20 + 6 * c30 * x
            for i in range(3):
                for j in range(3):
                    s1[i, j] = 2 * scale * (f[q, i, j] - first / 3 * g[q, i, j])
            for i in range(3):
                for k in range(3):
                    for j in range(3):
                        for m in range(3):
                            same = 1.0 if (i == j and k == m) else 0.0
                            gg = g[q, i, k] * g[q, j, m]
                            swapped = g[q, i, m] * g[q, j, k]
                            second = (
                                2
                                * scale
                                * (
                                    same
                                    - 2.0 / 3.0 * (f[q, i, k] * g[q, j, m] + g[q, i, k] * f[q, j, m])
                                    + 2.0 / 9.0 * first * gg
                                    + first / 3.0 * swapped
                                )
                            )
                            moduli[q, i, k, j, m] = weight[e, q] * (
                                curve * s1[i, k] * s1[j, m] + slope * second + p * det[q] * (gg - swapped)
                            )
        for i in range(3):
            for q in range(27):
                for k in range(3):
                    for j in range(i, 3):
                        m0 = moduli[q, i, k, j, 0]
                        m1 = moduli[q, i, k, j, 1]
                        m2 = moduli[q, i, k, j, 2]
                        for c in range(27):
                            right[3 * q + k, 27 * j + c] = (
                                m0 * gradient[e, q, c, 0] + m1 * gradient[e, q, c, 1] + m2 * gradient[e, q, c, 2]
                            )
            block = np.dot(left, np.ascontiguousarray(right[:, 27 * i :]))  # (27, 27 (3 - i))
            for j in range(i, 3):
                for a in range(27):
                    for c in range(27):
                        value = block[a, 27 * (j - i) + c]
                        result[e, 3 * a + i, 3 * c + j] = value
                        result[e, 3 * c + j, 3 * a + i] = value
        result[e] += bulk * np.dot(volume.T, np.dot(mass_inverse[e], volume))
    return result
