"""Multifrontal factorisation of element matrices by nested dissection (Duff, Reid 1983, doi:10.1145/356044.356047).

The mesh is bisected until a few elements are left; what two halves share is eliminated after both. Every front is a
dense matrix for LAPACK: Cholesky for symmetric matrices, LU with pivoting inside the front for the unsymmetric tangent
of sliding friction. A shell has small separators, so the factorisation takes a quarter of the time of SuperLU, the only
sparse factorisation in scipy (4.5k unknowns 27 against 100 ms, 8.9k 76 against 370 ms, in one run; the bench measures
it again). Element matrices need not be assembled first. Unknowns are numbered in elimination order, so that all maps
are ascending.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from scipy.linalg import blas, lapack

from sensing.simulator.solid.element import Array
from sensing.simulator.solid.mesh import Index

LEAF_ELEMENTS = 4  # elements at which the bisection stops


@dataclass(frozen=True)
class Front:
    """One dense front: its unknowns (pivots first, then the contribution block), and the sources of its entries.

    Attributes:
        variables: unknowns, ascending (k,).
        pivot_count: number of unknowns that are eliminated here.
        elements: numbers of the elements assembled here (a leaf), (count,).
        places: positions of their unknowns in this front, -1 where fixed, (count, 81).
        children: numbers of earlier fronts.
        child_places: positions of their shared unknowns in this front.
    """

    variables: Index
    pivot_count: int
    elements: Index
    places: Index
    children: tuple[int, ...]
    child_places: tuple[Index, ...]


class NotPositive(Exception):
    """A symmetric matrix is not positive definite."""


def dissect(dofs: Index, centroids: Array) -> tuple[Index, list[tuple[int, int, tuple[int, ...]]]]:
    """Order of elements, and fronts as ``(first, last, children)`` over that order, children first."""
    order: list[int] = []
    fronts: list[tuple[int, int, tuple[int, ...]]] = []

    def split(elements: Index) -> int:
        begin = len(order)
        if len(elements) <= LEAF_ELEMENTS:
            order.extend(elements.tolist())
            children: tuple[int, ...] = ()
        else:
            centred = centroids[elements] - centroids[elements].mean(axis=0)
            _, _, axes = np.linalg.svd(centred, full_matrices=False)
            candidates = [np.argsort(centred @ axis, kind="stable") for axis in axes[:2]]
            middle = len(elements) // 2
            shared = [len(np.intersect1d(dofs[elements[c[:middle]]], dofs[elements[c[middle:]]])) for c in candidates]
            best = candidates[int(np.argmin(shared))]
            children = (split(elements[best[:middle]]), split(elements[best[middle:]]))
        fronts.append((begin, len(order), children))
        return len(fronts) - 1

    split(np.arange(len(centroids)))
    return np.array(order), fronts


def plan(dofs: Index, centroids: Array, count: int) -> tuple[Index, list[Front]]:
    """Elimination order of the unknowns, and the fronts.

    Args:
        dofs: free degree of freedom of every element entry, -1 where fixed (e, 81).
        count: number of free degrees of freedom.
        centroids: centroids of the elements (e, 3), mm.

    Returns:
        ``equation`` (count,), the unknown of each free degree of freedom, and the fronts over unknowns.
    """
    order, spans = dissect(dofs, centroids)
    position = np.empty(len(order), dtype=np.int64)
    position[order] = np.arange(len(order))
    first, last = np.full(count, len(order)), np.full(count, -1)
    where = np.broadcast_to(position[:, None], dofs.shape)
    live = dofs >= 0
    np.minimum.at(first, dofs[live], where[live])
    np.maximum.at(last, dofs[live], where[live])
    owner = np.full(count, -1)
    for number, (begin, end, _) in enumerate(spans):  # children first: the smallest span with a dof eliminates it
        owner[(owner < 0) & (first >= begin) & (last < end)] = number
    equation = np.empty(count, dtype=np.int64)
    equation[np.argsort(owner, kind="stable")] = np.arange(count)
    fronts: list[Front] = []
    numbered = np.where(live, equation[np.maximum(dofs, 0)], -1)
    for number, (begin, end, children) in enumerate(spans):
        elements = order[begin:end] if not children else np.zeros(0, dtype=np.int64)
        inputs = [numbered[elements].ravel()] + [fronts[c].variables[fronts[c].pivot_count :] for c in children]
        variables = np.unique(np.concatenate(inputs))
        variables = variables[variables >= 0]
        places = np.where(numbered[elements] >= 0, np.searchsorted(variables, numbered[elements]), -1)
        child_places = tuple(np.searchsorted(variables, fronts[c].variables[fronts[c].pivot_count :]) for c in children)
        pivot_count = int((owner == number).sum())
        fronts.append(Front(variables, pivot_count, elements, places, children, child_places))
    return equation, fronts


class FrontalFactors:
    """Factors of a matrix that is the sum of element matrices.

    Args:
        fronts: fronts of :func:`plan`.
        blocks: element matrices (e, 81, 81), N/mm.
        symmetric: whether the matrix is symmetric: True takes Cholesky, False LU.

    Raises:
        NotPositive: a symmetric matrix with a pivot that is not positive.
    """

    def __init__(self, fronts: list[Front], blocks: Array, symmetric: bool) -> None:
        self.fronts = fronts
        self.symmetric = symmetric
        self.count = sum(front.pivot_count for front in fronts)
        self.parts: list[tuple[Any, ...]] = []
        self._columns: tuple[Any, Index, Index] | None = None
        contributions: dict[int, Array] = {}
        for number, front in enumerate(fronts):
            size, pivot_count = len(front.variables), front.pivot_count
            matrix = np.zeros((size, size), order="F")
            if len(front.elements):
                _add_elements(matrix, blocks, front.elements, front.places)
            for child, places in zip(front.children, front.child_places, strict=True):
                _add_child(matrix, contributions.pop(child), places)
            eliminate = self._cholesky if symmetric else self._lu
            contributions[number] = eliminate(matrix, pivot_count)

    def solve(self, right: Array) -> Array:
        """Solution for one (n,) or several (n, m) right-hand sides."""
        one = right.ndim == 1
        x = np.array(right.reshape(self.count, -1), order="C" if right.ndim > 1 else "F")
        for front, part in zip(self.fronts, self.parts, strict=True):
            pivot_rows, shared = front.variables[: front.pivot_count], front.variables[front.pivot_count :]
            if not len(pivot_rows):
                continue
            first = self._forward(part, x[pivot_rows])
            x[pivot_rows] = first
            if len(shared):
                x[shared] -= part[1] @ first
        for front, part in zip(self.fronts[::-1], self.parts[::-1], strict=True):
            pivot_rows, shared = front.variables[: front.pivot_count], front.variables[front.pivot_count :]
            if not len(pivot_rows):
                continue
            x[pivot_rows] = self._backward(part, x[pivot_rows], x[shared])
        return x[:, 0] if one else np.ascontiguousarray(x)

    def solve_roughly(self, right: Array) -> Array:
        """Solution (n,) to about 1e-6, for iterations that correct it; symmetric factors in single precision, packed.

        The time of a solution is that of reading the factor from memory; with half of the bytes and no call for each
        front it is a quarter of that of :meth:`solve`.
        """
        if self._columns is None:
            parts = [np.concatenate(part[:2]).ravel(order="F").astype(np.float32) for part in self.parts]
            sizes = np.array([(front.pivot_count, len(front.variables)) for front in self.fronts])
            self._columns = np.concatenate(parts), np.concatenate([front.variables for front in self.fronts]), sizes
        solution = right.astype(np.float32)
        values, variables, sizes = self._columns
        _solve_columns(values, variables, sizes, solution)
        return solution.astype(np.float64)

    def _cholesky(self, matrix: Array, pivot_count: int) -> Array:
        if not pivot_count:
            self.parts.append((matrix[:0, :0], matrix[:, :0]))
            return matrix
        lower, info = lapack.dpotrf(matrix[:pivot_count, :pivot_count], lower=1, clean=0)
        if info or not np.isfinite(lower[-1, -1]):  # LAPACK may take NaN for positive
            raise NotPositive
        if pivot_count == len(matrix):
            self.parts.append((lower, matrix[pivot_count:, :pivot_count]))
            return matrix[pivot_count:, pivot_count:]
        below = blas.dtrsm(1.0, lower, matrix[pivot_count:, :pivot_count], side=1, lower=1, trans_a=1)
        contribution = blas.dsyrk(-1.0, below, beta=1.0, c=matrix[pivot_count:, pivot_count:], lower=1)
        self.parts.append((lower, below))
        return np.asarray(contribution)

    def _lu(self, matrix: Array, pivot_count: int) -> Array:
        if not pivot_count:
            self.parts.append((matrix[:0, :0], matrix[:, :0], matrix[:0], np.zeros(0, dtype=np.int32)))
            return matrix
        both, pivots, info = lapack.dgetrf(matrix[:pivot_count, :pivot_count])
        if info > 0:
            raise np.linalg.LinAlgError("exactly singular tangent")
        right = matrix[:pivot_count, pivot_count:]
        order = _permutation(pivots)
        right = np.asfortranarray(right[order])
        if pivot_count == len(matrix):
            self.parts.append((both, matrix[pivot_count:, :pivot_count], right, order))
            return matrix[pivot_count:, pivot_count:]
        right = blas.dtrsm(1.0, both, right, lower=1, diag=1)
        below = blas.dtrsm(1.0, both, matrix[pivot_count:, :pivot_count], side=1, lower=0)
        self.parts.append((both, below, right, order))
        return np.asarray(matrix[pivot_count:, pivot_count:] - below @ right, order="F")

    def _forward(self, part: tuple[Any, ...], right: Array) -> Array:
        if self.symmetric:
            return np.asarray(blas.dtrsm(1.0, part[0], right, lower=1))
        return np.asarray(blas.dtrsm(1.0, part[0], right[part[3]], lower=1, diag=1))

    def _backward(self, part: tuple[Any, ...], pivot_rows: Array, shared: Array) -> Array:
        if self.symmetric:
            return np.asarray(blas.dtrsm(1.0, part[0], pivot_rows - part[1].T @ shared, lower=1, trans_a=1))
        return np.asarray(blas.dtrsm(1.0, part[0], pivot_rows - part[2] @ shared, lower=0))


def _permutation(pivots: Index) -> Index:
    """Row order that results from LAPACK's exchanges."""
    order = np.arange(len(pivots))
    for row, pivot in enumerate(pivots):
        if pivot != row:
            order[row], order[pivot] = order[pivot], order[row]
    return order


@njit(cache=True, fastmath={"reassoc", "contract"})
def _solve_columns(values, variables, sizes, x):  # type: ignore[no-untyped-def]
    """Forward and backward substitution in place; a front is a trapezoid of ``pivot_count`` columns, ``size`` rows."""
    local = np.empty(sizes[:, 1].max(), dtype=np.float32)
    start, place = 0, 0
    for front in range(len(sizes)):
        pivot_count, size = sizes[front]
        if pivot_count:
            for k in range(size):
                local[k] = x[variables[place + k]]
            for c in range(pivot_count):
                column = values[start + c * size : start + (c + 1) * size]
                local[c] /= column[c]
                pivot = local[c]
                tail, below = local[c + 1 : size], column[c + 1 :]
                for k in range(len(below)):  # from 0, otherwise the loop is not vectorised
                    tail[k] -= pivot * below[k]
            for k in range(size):
                x[variables[place + k]] = local[k]
        start += pivot_count * size
        place += size
    for front in range(len(sizes) - 1, -1, -1):
        pivot_count, size = sizes[front]
        start -= pivot_count * size
        place -= size
        if pivot_count:
            for k in range(size):
                local[k] = x[variables[place + k]]
            for c in range(pivot_count - 1, -1, -1):
                column = values[start + c * size : start + (c + 1) * size]
                total = np.float32(0.0)
                tail, below = local[c + 1 : size], column[c + 1 :]
                for k in range(len(below)):
                    total += below[k] * tail[k]
                local[c] = (local[c] - total) / column[c]
            for k in range(pivot_count):
                x[variables[place + k]] = local[k]


@njit(cache=True)
def _add_elements(matrix, blocks, elements, places):  # type: ignore[no-untyped-def]
    for k in range(len(elements)):
        for b in range(81):
            column = places[k, b]
            if column >= 0:
                for a in range(81):
                    if places[k, a] >= 0:
                        matrix[places[k, a], column] += blocks[elements[k], a, b]


@njit(cache=True)
def _add_child(matrix, contribution, places):  # type: ignore[no-untyped-def]
    for b in range(len(places)):
        for a in range(len(places)):
            matrix[places[a], places[b]] += contribution[a, b]
