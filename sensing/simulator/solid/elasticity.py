"""Elements of the nearly incompressible hyperelastic solid (N, mm, MPa; total Lagrangian).

Mixed element, pressure condensed: W = f(I1b - 3) point by point plus K/2 (J - 1)^2 with J - 1 replaced by its
projection on {1, xi, eta, zeta} over the reference element. That equals hex27 displacement with a discontinuous linear
pressure (Q2/P1, inf-sup stable; Simo, Taylor, Pister 1985, doi:10.1016/0045-7825(85)90033-7), and keeps an energy.

    P   = f' dx/dF + p J F^-T,         x = J^(-2/3) F:F - 3,   dx/dF = 2 J^(-2/3) (F - I1/3 F^-T)
    p_a = K (M^-1 b)_a,                b_a = int psi_a (J - 1),   M_ab = int psi_a psi_b
    K_e = int G^T (dP/dF)|_p G + K B^T M^-1 B,                     B_a = int psi_a J F^-T G
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cad.materials import HyperelasticLaw
from sensing.simulator.solid import elasticity_kernels as elastic_kernels
from sensing.simulator.solid.element import Array, shape_hex, volume_rule
from sensing.simulator.solid.mesh import HexMesh


@dataclass(frozen=True)
class ElementData:
    """Data of the undeformed mesh for the kernels.

    Attributes:
        gradient: shape gradients by reference position (e, 27 points, 27 nodes, 3), 1/mm.
        rows: the same as (e, 27 nodes, 3 x 27), direction before point, for the force kernel.
        weight: reference volumes of the Gauss points (e, 27), mm3.
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
    """Stored energy (mJ) and nodal forces (e, 27, 3), N.

    An inverted element gives infinite energy, which every line search refuses.

    Args:
        law: hyperelastic constants.
        data: the undeformed elements.
        displacement: displacement of their nodes (e, 27, 3), mm.
    """
    energy, force = elastic_kernels.energy_force(
        displacement, data.rows, data.weight, data.psi, data.mass_inverse,
        law.c10_mpa, law.c20_mpa, law.c30_mpa, law.bulk_mpa,
    )  # fmt: skip
    return float(energy), force


def tangent(law: HyperelasticLaw, data: ElementData, displacement: Array) -> Array:
    """Consistent element tangents (e, 81, 81), symmetric, N/mm; degree of freedom ``3 a + i``.

    Args:
        law: hyperelastic constants.
        data: the undeformed elements.
        displacement: displacement of their nodes (e, 27, 3), mm.
    """
    return elastic_kernels.tangent(
        displacement, data.gradient, data.weight, data.psi, data.mass_inverse,
        law.c10_mpa, law.c20_mpa, law.c30_mpa, law.bulk_mpa,
    )  # fmt: skip


def deformation_gradient(data: ElementData, displacement: Array) -> Array:
    """Deformation gradient F (e, 27, 3, 3) at the Gauss points, for displacements of the nodes (e, 27, 3), mm."""
    slopes = (displacement.transpose(0, 2, 1) @ data.rows).reshape(-1, 3, 3, data.weight.shape[1])  # du_i/dX_j, point
    return np.ascontiguousarray(slopes.transpose(0, 3, 1, 2)) + np.eye(3)


@dataclass(frozen=True)
class Prestress:
    """A second Piola-Kirchhoff stress Q independent of the strain; its potential (C - 1):Q / 2 is quadratic in u.

    Attributes:
        force: nodal forces of the undeformed elements (e, 27, 3), N.
        block: derivative of the forces by the nodal displacement, the same in each direction (e, 27, 27), N/mm.
    """

    force: Array
    block: Array

    def energy_and_force(self, displacement: Array) -> tuple[float, Array]:
        """Potential (mJ) and nodal forces (e, 27, 3), N, for displacements of the elements' nodes (e, 27, 3), mm."""
        rise = self.block @ displacement
        return float((displacement * (self.force + rise / 2)).sum()), self.force + rise

    def tangent(self) -> Array:
        """Element matrices (e, 81, 81), N/mm."""
        return np.einsum("eab,ij->eaibj", self.block, np.eye(3)).reshape(len(self.block), 81, 81)


def prestress(stress: Array, data: ElementData) -> Prestress:
    """Forces and tangents of the elements under a symmetric second Piola-Kirchhoff stress (e, 27, 3, 3), MPa."""
    count, points = data.weight.shape
    weighted = np.ascontiguousarray((stress * data.weight[..., None, None]).transpose(0, 2, 3, 1))  # (e, j, k, point)
    pulled = np.einsum("eajq,ejkq->eakq", data.rows.reshape(count, 27, 3, points), weighted)  # grad N_a . Q
    return Prestress(pulled.sum(axis=3), pulled.reshape(count, 27, -1) @ data.rows.transpose(0, 2, 1))
