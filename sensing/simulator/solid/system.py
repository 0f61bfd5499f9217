"""The discrete solid: sparse assembly over free degrees of freedom, and its factorisation (N, mm).

Degrees of freedom ``3 node + axis``. Fixed ones are removed, and the free ones are numbered along the elimination order
of the sparse factorisation, computed once per mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from cad.materials import HyperelasticLaw
from sensing.simulator.solid import elasticity as elastic
from sensing.simulator.solid import multifrontal
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.mesh import HexMesh, Index


@dataclass(frozen=True)
class Solid:
    """A mesh, its law and its free degrees of freedom.

    Attributes:
        mesh, law, data: geometry, material, precomputed element data.
        fixed: boolean mask of fixed degrees of freedom (3 n,).
        equation: number of each degree of freedom among the unknowns, -1 where fixed (3 n,).
        dof: degree of freedom of every unknown (unknowns,).
        slots: position of every element entry in ``pattern.data``, -1 where fixed (e, 81, 81).
        pattern: empty matrix (unknowns, unknowns) in CSC with the union of all element couplings.
        fronts: plan of the factorisation.
        prestress: stress that does not depend on the strain, or None.
    """

    mesh: HexMesh
    law: HyperelasticLaw
    data: elastic.ElementData
    fixed: NDArray[np.bool_]
    equation: Index
    dof: Index
    slots: NDArray[np.int32]
    pattern: sparse.csc_matrix
    fronts: tuple[multifrontal.Front, ...]
    prestress: elastic.Prestress | None = None

    @property
    def unknowns(self) -> int:
        """Number of free degrees of freedom."""
        return int(self.pattern.shape[0])

    def spread(self, free: Array) -> Array:
        """Nodal field (n, 3) of values at the free degrees of freedom (unknowns,), zero where fixed."""
        field = np.zeros(self.equation.size)
        field[self.dof] = free
        return field.reshape(-1, 3)

    def gather(self, field: Array) -> Array:
        """Values (unknowns,) at the free degrees of freedom of a nodal field (n, 3)."""
        return np.asarray(field.reshape(-1)[self.dof])

    def energy_and_force(self, displacement: Array) -> tuple[float, Array]:
        """Stored energy (mJ) and internal nodal forces (n, 3), N, at a displacement (n, 3), mm."""
        local = displacement[self.mesh.cells]
        energy, element_force = elastic.energy_and_force(self.law, self.data, local)
        if self.prestress is not None:
            more, force = self.prestress.energy_and_force(local)
            energy, element_force = energy + more, element_force + force
        return energy, self.nodal(element_force)

    def nodal(self, element_force: Array) -> Array:
        """Sum of element forces (e, 27, 3) at the nodes (n, 3)."""
        return nodal_sum(element_force, self.mesh.cells, len(self.mesh.points))

    def tangent(self, displacement: Array) -> Array:
        """Consistent element tangents (e, 81, 81), N/mm, at a displacement (n, 3), mm."""
        blocks = elastic.tangent(self.law, self.data, displacement[self.mesh.cells])
        return blocks if self.prestress is None else blocks + self.prestress.tangent()

    def assemble(self, blocks: Array) -> sparse.csc_matrix:
        """Sparse matrix from element matrices (e, 81, 81)."""
        values = np.zeros(self.pattern.nnz)
        _scatter_matrix(blocks, self.slots, values)
        return sparse.csc_matrix((values, self.pattern.indices, self.pattern.indptr), shape=self.pattern.shape)


@dataclass(frozen=True)
class Factorisation:
    """Factors of a tangent; ``negative`` counts its negative pivots (0 proves it positive), -1 where unknown."""

    factors: Any
    negative: int

    def solve(self, right: Array) -> Array:
        """Solution for one (n,) or several (n, m) right-hand sides."""
        return np.asarray(self.factors.solve(right))

    def solve_roughly(self, right: Array) -> Array:
        """Solution (n,) to about 1e-6, faster where the factors support it."""
        quick = getattr(self.factors, "solve_roughly", self.factors.solve)
        return np.asarray(quick(right))


def build_solid(mesh: HexMesh, law: HyperelasticLaw, fixed: NDArray[np.bool_]) -> Solid:
    """Number the unknowns along nested dissection and lay out fronts and sparse pattern.

    Args:
        mesh, law: geometry and material.
        fixed: whether each degree of freedom is fixed (n, 3).
    """
    live = np.flatnonzero(~fixed.ravel())
    free = np.full(mesh.points.size, -1, dtype=np.int64)
    free[live] = np.arange(len(live))
    dofs = (3 * mesh.cells[:, :, None] + np.arange(3)).reshape(-1, 81)
    order, fronts = multifrontal.plan(free[dofs], mesh.points[mesh.cells].mean(axis=1), len(live))
    equation = np.full(mesh.points.size, -1, dtype=np.int64)
    equation[live] = order
    pattern, slots = _layout(mesh, equation)
    data = elastic.element_data(mesh)
    return Solid(mesh, law, data, fixed.ravel(), equation, live[np.argsort(order)], slots, pattern, tuple(fronts))


def nodal_sum(forces: Array, numbers: Index, count: int) -> Array:
    """Sum (count, 3) of forces at the nodes.

    Args:
        forces: forces on groups of nodes (g, a, 3), N.
        numbers: numbers of those nodes (g, a).
        count: number of all nodes.
    """
    total = np.zeros((count, 3))
    _scatter_force(forces, numbers, total)
    return total


def factorise(solid: Solid, blocks: Array, symmetric: bool = True) -> Factorisation:
    """Factorise element matrices.

    A symmetric matrix that is not positive goes to SuperLU, whose unpivoted factors count the negative pivots.

    Args:
        solid: solid of the elements.
        blocks: element matrices (e, 81, 81), N/mm.
        symmetric: whether the matrices are symmetric; False takes LU, which leaves ``negative`` unknown.

    Raises:
        numpy.linalg.LinAlgError: an exactly singular matrix, or one that is not finite.
    """
    try:
        return Factorisation(multifrontal.FrontalFactors(list(solid.fronts), blocks, symmetric), 0 if symmetric else -1)
    except multifrontal.NotPositive:
        return factorise_sparse(solid.assemble(blocks))


def factorise_sparse(matrix: sparse.csc_matrix) -> Factorisation:
    """Factorise a symmetric, perhaps indefinite matrix in the given order, without pivoting.

    Raises:
        numpy.linalg.LinAlgError: an exactly singular matrix, or one that is not finite.
    """
    if not np.isfinite(matrix.data).all():
        raise np.linalg.LinAlgError("tangent is not finite")
    try:
        lu = splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True, "Equil": False})
    except RuntimeError as error:
        raise np.linalg.LinAlgError(f"tangent cannot be factorised ({error})") from error
    unpivoted = bool(np.array_equal(lu.perm_r, lu.perm_c))
    return Factorisation(lu, int((lu.U.diagonal() < 0).sum()) if unpivoted else -1)


def _layout(mesh: HexMesh, equation: Index) -> tuple[sparse.csc_matrix, NDArray[np.int32]]:
    dofs = equation[(3 * mesh.cells[:, :, None] + np.arange(3)).reshape(-1, 81)]  # (e, 81)
    count = int(equation.max()) + 1
    rows = np.broadcast_to(dofs[:, :, None], (len(dofs), 81, 81))
    cols = np.broadcast_to(dofs[:, None, :], (len(dofs), 81, 81))
    live = (rows >= 0) & (cols >= 0)
    keys, inverse = np.unique(cols[live] * count + rows[live], return_inverse=True)
    slots = np.full(rows.shape, -1, dtype=np.int32)
    slots[live] = inverse
    indptr = np.searchsorted(keys // count, np.arange(count + 1)).astype(np.int32)
    shape = (count, count)
    pattern = sparse.csc_matrix((np.ones(len(keys)), (keys % count).astype(np.int32), indptr), shape=shape)
    return pattern, slots


@njit(cache=True)
def _scatter_force(forces, numbers, total):  # type: ignore[no-untyped-def]
    for g in range(numbers.shape[0]):
        for a in range(numbers.shape[1]):
            for i in range(3):
                total[numbers[g, a], i] += forces[g, a, i]


@njit(cache=True)
def _scatter_matrix(blocks, slots, values):  # type: ignore[no-untyped-def]
    for e in range(slots.shape[0]):
        for a in range(81):
            for b in range(81):
                if slots[e, a, b] >= 0:
                    values[slots[e, a, b]] += blocks[e, a, b]
