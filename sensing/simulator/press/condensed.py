"""Contact condensed on the patch: a stored elastic tangent, and the small dense problem it leaves (N, mm).

With v the patch displacement without contact and C the patch's compliance, the step is the minimum over patch
displacement x and depth d of 1/2 (x - v)' C^-1 (x - v) + contact energy(x, d) - N d, for a frozen friction bound; the
true bound is then iterated. The same two phases as level 1, on a few hundred unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from sensing.simulator.contact.friction import ContactMemory, ContactResponse, ContactSurface, respond
from sensing.simulator.contact.indenter import translation
from sensing.simulator.press.step import StepProblem
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.mesh import Index
from sensing.simulator.solid.shell import ShellModel
from sensing.simulator.solid.system import Factorisation, factorise

PATCH_MARGIN_MM = 2.5  # faces nearer to the body than this belong to the patch
MAX_ITERATIONS = 40  # Newton iterations of one condensed step
TRUE_BELOW = 0.1  # relative error under which the true friction bound replaces the lagged one
LAGGED_AFTER_RISE = 2  # lagged iterations after a true one that did not halve the error


@dataclass(frozen=True)
class StoredTangent:
    """An elastic tangent and the patch condensed on it.

    Attributes:
        depth_mm, shift_mm, normal_n, displacement: the state at which the tangent was taken.
        factor: factorisation of K0.
        surface: contact quadrature of the patch faces, nodes numbered within the patch.
        faces: their numbers on the outer surface.
        nodes: node numbers of the patch (s,).
        live: free degrees of freedom among the 3 s of the patch.
        rows: numbers of their unknowns.
        places: position of every face's degrees of freedom among the live ones, len(live) where fixed (faces, 27).
        response: K0^-1 P' (unknowns, live).
        compliance: P K0^-1 P' (live, live), mm/N.
        stiffness: inverse of ``compliance``, N/mm.
    """

    depth_mm: float
    shift_mm: tuple[float, float]
    normal_n: float
    displacement: Array
    factor: Factorisation
    surface: ContactSurface
    faces: Index
    nodes: Index
    live: Index
    rows: Index
    places: Index
    response: Array
    compliance: Array
    stiffness: Array


class PatchInverse(Protocol):
    """Interface to the inverse of the solid's tangent: see :class:`sensing.simulator.press.secant.SecantInverse`."""

    tangent: StoredTangent
    compliance: Array
    stiffness: Array


@dataclass(frozen=True)
class _Point:
    """One trial of the condensed step."""

    x: Array  # (3 s,)
    depth: float
    contact: ContactResponse
    load: Array  # (3 s,)
    wrong: Array  # x - v - C load (3 s,)
    force_gap: float
    error: float
    potential: float
    slope_by_x: Array  # (live,)


class CondensedStep:
    """The dense problem of one step: compliance from ``inverse``, contact from ``problem``.

    Args:
        problem: the step of the press.
        inverse: compliance and stiffness of the patch.
        last_shift_mm: tangential travel of the body at the last state, along (meridian, lateral), mm.
        converged: relative error under which :meth:`solve` stops.
    """

    def __init__(
        self, problem: StepProblem, inverse: PatchInverse, last_shift_mm: tuple[float, float], converged: float
    ) -> None:
        self.problem = problem
        self.inverse = inverse
        self.converged = converged
        tangent = self.tangent = inverse.tangent
        self.last_shift_mm = last_shift_mm
        self.points = problem.model.solid.mesh.points[tangent.nodes]
        faces, memory = tangent.faces, problem.memory
        self.memory = ContactMemory(memory.traction[faces], memory.position[faces], memory.gap[faces])

    def solve(
        self, plain: Array, patch: Array, depth_mm: float, first: bool
    ) -> tuple[Array, Array, float, float] | None:
        """Patch equilibrium.

        Args:
            plain: unknowns without contact, v over the whole solid (unknowns,), mm.
            patch: first guess of the patch displacement (s, 3), mm.
            depth_mm: first guess of the depth, or the given depth, mm.
            first: whether the guess belongs to the last state, before the body's tangential travel.

        Returns:
            Contact forces (live,), patch displacement (s, 3), depth and slope dN/dd; None where it does not converge.
        """
        free_place = np.zeros(3 * len(self.tangent.nodes))
        free_place[self.tangent.live] = plain[self.tangent.rows]
        x, slope = patch.ravel(), float("nan")
        if first:
            x, depth_mm = self._predict(free_place, x, depth_mm)
        here = self._evaluate(free_place, x, depth_mm)
        lagged, best = (1 if self.problem.friction > 0 else 0), np.inf
        for _ in range(MAX_ITERATIONS):
            if here.error < self.converged:
                return here.load[self.tangent.live], here.x.reshape(-1, 3), here.depth, slope
            symmetric = self.problem.friction == 0 or lagged > 0 or here.error > TRUE_BELOW
            if symmetric:
                lagged -= 1
                found = self._descend(free_place, here)
            else:
                change, depth, slope = self._direction(here.contact, here.wrong, here.force_gap)
                found = self._evaluate(free_place, here.x + change, here.depth + depth)
            if found is None or not np.isfinite(found.error):
                return None
            if not symmetric and found.error > 0.5 * best:
                lagged = LAGGED_AFTER_RISE
            best = min(best, found.error)
            here = found
        return None

    def _descend(self, free_place: Array, here: _Point) -> _Point | None:
        """One lagged Newton iteration with a line search on its potential."""
        friction = self.problem.friction
        bound = friction * here.contact.pressure if friction > 0 else None
        fraction = here.contact.contact_fraction if friction > 0 else None
        frozen = self._evaluate(free_place, here.x, here.depth, bound, fraction) if friction > 0 else here
        change, depth, _ = self._direction(frozen.contact, frozen.wrong, frozen.force_gap)
        slope = float(frozen.slope_by_x @ change[self.tangent.live]) + frozen.force_gap * depth
        step = 1.0
        for _ in range(14):
            trial = self._evaluate(free_place, here.x + step * change, here.depth + step * depth, bound, fraction)
            if trial.potential <= frozen.potential + 1e-4 * step * slope + 1e-11 * abs(frozen.potential):
                break
            if trial.error < 0.5 * frozen.error:
                break
            step /= 2
        else:
            return None
        return self._evaluate(free_place, trial.x, trial.depth) if friction > 0 else trial

    def _predict(self, free_place: Array, x: Array, depth_mm: float) -> tuple[Array, float]:
        """Linear guess: the body's tangential travel enters through the contact tangent of the last state."""
        travel_mm = np.array(
            [0.0, self.problem.shift_mm[0] - self.last_shift_mm[0], self.problem.shift_mm[1] - self.last_shift_mm[1]]
        )
        standing = replace(self.problem, shift_mm=self.last_shift_mm)
        before = CondensedStep(standing, self.inverse, self.last_shift_mm, self.converged)
        here = before._evaluate(free_place, x, depth_mm)
        moved = here.contact.stiffness @ np.tile(self.problem.frame @ travel_mm, 9)
        pushed = _gather(moved, self.tangent)
        live = self.tangent.live
        wrong = here.wrong.copy()
        wrong[live] -= self.inverse.compliance @ pushed[live]
        force_gap = here.force_gap
        if self.problem.normal_n is not None:
            force_gap -= float(pushed.reshape(-1, 3).sum(axis=0) @ self.problem.frame[:, 0])
        change, depth, _ = self._direction(here.contact, wrong, force_gap)
        return x + change, depth_mm + depth

    def _direction(self, contact: ContactResponse, wrong: Array, force_gap: float) -> tuple[Array, float, float]:
        """Newton direction of the patch and the depth, and dN/dd: with A = 1 + C K on the loaded unknowns l,

        A x = -wrong - d C k,        k = K n (n the outward normal at every node),        dN = n' K x + (n' k) d.
        """
        problem, tangent = self.problem, self.tangent
        active = np.flatnonzero((contact.pressure > 0).any(axis=1))
        if not len(active):  # without contact the solid alone determines the patch
            return -wrong, 0.0 if problem.normal_n is None else float("nan"), 0.0
        loaded = np.unique(tangent.places[active])  # among the live unknowns; fixed ones are last and are dropped
        loaded = loaded[loaded < len(tangent.live)]
        place = np.full(len(tangent.live) + 1, -1)
        place[loaded] = np.arange(len(loaded))
        columns = self.inverse.compliance[:, loaded]
        own = columns[loaded]
        matrix = np.eye(len(loaded))
        outward = np.tile(problem.frame[:, 0], 9)
        column, row, kappa = np.zeros(len(loaded)), np.zeros(len(loaded)), 0.0
        for face in active:
            at = place[tangent.places[face]]
            free = at >= 0
            stiffness, at = contact.stiffness[face], at[free]
            matrix[:, at] += own[:, at] @ stiffness[np.ix_(free, free)]
            column[at] += (stiffness @ outward)[free]
            row[at] += (outward @ stiffness)[free]
            kappa += float(outward @ stiffness @ outward)
        here = tangent.live[loaded]
        both = np.linalg.solve(matrix, np.stack([-wrong[here], own @ column], axis=1))
        slope = kappa - float(row @ both[:, 1])
        depth = 0.0 if problem.normal_n is None else (-force_gap - float(row @ both[:, 0])) / slope
        moved = both[:, 0] - depth * both[:, 1]
        change = -wrong
        load = -depth * column  # - K x - d k
        for face in active:
            at = place[tangent.places[face]]
            free = at >= 0
            load[at[free]] -= contact.stiffness[face][np.ix_(free, free)] @ moved[at[free]]
        change[tangent.live] += columns @ load
        change[here] = moved
        return change, depth, slope / problem.model.force_share

    def _evaluate(
        self,
        free_place: Array,
        x: Array,
        depth: float,
        bound: Array | None = None,
        fraction: Array | None = None,
    ) -> _Point:
        problem, tangent = self.problem, self.tangent
        moved = translation(problem.frame, depth, problem.shift_mm)
        contact = respond(
            tangent.surface, self.memory, problem.body, self.points + x.reshape(-1, 3), moved, problem.friction,
            bound, fraction,
        )  # fmt: skip
        load = _gather(contact.force.reshape(-1, 27), tangent)
        live = tangent.live
        apart = x - free_place
        wrong = apart.copy()
        wrong[live] -= self.inverse.compliance @ load[live]
        spring = self.inverse.stiffness @ apart[live]
        target = problem.mesh_force_n
        normal = -float(load.reshape(-1, 3).sum(axis=0) @ problem.frame[:, 0])
        force_gap = 0.0 if target is None else normal - target
        error = float(np.abs(wrong).max()) / max(float(np.abs(x).max()), 1e-3) + abs(force_gap) / (target or 1.0)
        potential = 0.5 * float(apart[live] @ spring) + contact.energy - (target or 0.0) * depth
        return _Point(x, depth, contact, load, wrong, force_gap, error, potential, spring - load[live])


def stored_tangent(
    model: ShellModel,
    displacement: Array,
    contact: ContactResponse,
    depth_mm: float,
    shift_mm: tuple[float, float],
    normal_n: float,
) -> StoredTangent:
    """Factorise the elastic tangent at a displacement and condense it on the faces near the body.

    Args:
        model: the shell.
        displacement: nodal (n, 3), mm.
        contact: response there; its gaps choose the faces.
        depth_mm, shift_mm, normal_n: depth, tangential travel and force on the whole shell there (mm, N), so that the
            nearest of several tangents can be found.
    """
    solid, whole = model.solid, model.surface
    faces = np.flatnonzero(contact.gap.min(axis=1) < PATCH_MARGIN_MM)
    nodes, inverse = np.unique(whole.nodes[faces], return_inverse=True)
    surface = replace(
        whole, cells=whole.cells[faces], nodes=inverse.reshape(-1, 9).astype(np.int64), area=whole.area[faces]
    )
    equation = solid.equation[(3 * nodes[:, None] + np.arange(3)).ravel()]
    live = np.flatnonzero(equation >= 0)
    rows = equation[live]
    unit = np.zeros((solid.unknowns, len(rows)))
    unit[rows, np.arange(len(rows))] = 1.0
    factor = factorise(solid, solid.tangent(displacement))
    position = np.full(3 * len(nodes), len(live))
    position[live] = np.arange(len(live))
    places = position[(3 * surface.nodes[:, :, None] + np.arange(3)).reshape(-1, 27)]
    response = np.ascontiguousarray(factor.solve(unit))
    compliance = (response[rows] + response[rows].T) / 2
    return StoredTangent(
        depth_mm, shift_mm, normal_n, displacement, factor, surface, faces, nodes, live, rows,
        places, response, compliance,
        np.linalg.inv(compliance),
    )  # fmt: skip


def _gather(face_force: Array, tangent: StoredTangent) -> Array:
    """Sum of face forces (faces, 27) on the patch (3 s,)."""
    place = (3 * tangent.surface.nodes[:, :, None] + np.arange(3)).ravel()
    return np.asarray(np.bincount(place, face_force.ravel(), 3 * len(tangent.nodes)), dtype=float)
