"""Newton for one step of frictional contact, the normal force as a bordered unknown (N, mm).

Two phases. Lagged: the friction bound mu p is frozen at the last iterate, so that the step is symmetric and has a
potential; an energy line search holds it, and an indefinite tangent is shifted until it is positive. True: the real
bound, unsymmetric tangent, quadratic convergence, line search on the residual.

    [K   k ] [du]     [r          ]        k = df/dd,  kappa = dN/dd,  N = normal force,  d = depth
    [k'  kappa] [dd] = -[N - N_target]
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from sensing.simulator.contact.friction import ContactResponse
from sensing.simulator.press.state import Refusal
from sensing.simulator.press.step import Iterate, Solution, StepProblem
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.system import Factorisation, Solid, factorise, factorise_sparse, nodal_sum

TOLERANCE = 1e-9  # residual over contact force
FLOOR_N = 1.0  # N, contact force below which the residual counts in absolute terms
FLOOR_PER_BULK_MM2 = 1.5e-3  # mm2, the same over the largest bulk modulus: ten times the round-off of its forces
MAX_ITERATIONS = 40  # iterations of both phases
TRUE_BELOW = 0.05  # relative residual under which the true friction bound takes over
LAGGED_AFTER_FAILURE = 3  # lagged iterations after a line search that failed with the true bound
MAX_SHIFTS = 12  # largest number of diagonal shifts of an indefinite tangent, each four times the last
ARMIJO = 1e-4  # fraction of the linear decrease of the potential that a line search requires (Armijo's condition)


@dataclass(frozen=True)
class _Direction:
    change: Array  # (n, 3), mm
    depth_mm: float
    slope: float  # derivative of the potential along the direction, mJ
    negative: int
    stiffness: float


def evaluate(
    problem: StepProblem,
    displacement: Array,
    depth_mm: float,
    bound: Array | None = None,
    fraction: Array | None = None,
) -> Iterate:
    """Forces, potential and error of a configuration.

    Args:
        problem: the step.
        displacement: nodal displacement (n, 3), mm.
        depth_mm: depth of the body, mm.
        bound, fraction: ``bound`` and ``contact_fraction`` of :func:`sensing.simulator.contact.friction.respond`.
    """
    model = problem.model
    energy, internal = model.solid.energy_and_force(displacement)
    contact = problem.contact(displacement, depth_mm, bound, fraction)
    external = nodal_sum(contact.force, model.surface.nodes, len(internal))
    residual = model.solid.gather(internal - external)
    normal = -float(external.sum(axis=0) @ problem.frame[:, 0])
    target = problem.mesh_force_n
    gap = 0.0 if target is None else normal - target
    potential = energy + contact.energy - (0.0 if target is None else target * depth_mm)
    floor = max(FLOOR_N, FLOOR_PER_BULK_MM2 * model.solid.law.bulk_mpa * model.interlock)
    scale = max(float(np.linalg.norm(external)), target or 0.0, floor)
    error = float(np.hypot(np.linalg.norm(residual), gap)) / scale
    return Iterate(
        displacement, depth_mm, contact, internal, potential, residual, gap, error if np.isfinite(error) else np.inf
    )


def solve(problem: StepProblem, displacement: Array, depth_mm: float) -> Solution:
    """Equilibrium from a first guess.

    Args:
        problem: the step.
        displacement: first guess of the nodal displacement (n, 3), mm.
        depth_mm: first guess of the depth, mm.

    Raises:
        Refusal: ``unconverged`` or ``unstable``, with the residual and the depth at which the iteration stopped.
    """
    here = evaluate(problem, displacement, depth_mm)
    negative, stiffness, lagged_left = -1, float("nan"), 1
    errors = [here.error]
    while here.error >= TOLERANCE or negative < 0:
        if len(errors) > MAX_ITERATIONS:
            raise Refusal(
                "unconverged",
                f"out of balance by {here.error:.1e} of the load after {MAX_ITERATIONS} iterations at depth "
                f"{here.depth_mm:.3f} mm",
            )
        if lagged_left > 0 or problem.friction == 0 or here.error > TRUE_BELOW:
            here, negative, stiffness = _lagged_iteration(problem, here)
            lagged_left -= 1
        else:
            direction = _direction(problem, here, symmetric=False)
            stiffness = direction.stiffness
            found = _search_residual(problem, here, direction)
            if found is None:
                lagged_left = LAGGED_AFTER_FAILURE
            else:
                here = found
        errors.append(here.error)
    return Solution(here, negative, stiffness, len(errors) - 1, tuple(errors))


def predict(problem: StepProblem, displacement: Array, depth_mm: float, travel: Array) -> tuple[Array, float]:
    """First guess of a step from a converged state: the linear response to the body's travel (3,).

    Args:
        problem: the step; its ``shift_mm`` must still be that of the converged state.
        displacement, depth_mm: the converged state, in contact.
        travel: (3,) translation of the body over the step, mm, without the depth where the force is given.

    Returns:
        Displacement (n, 3) and depth after the linear step; where the depth is given, the caller adds its change.
    """
    here = evaluate(problem, displacement, depth_mm, problem.friction * problem.contact(
        displacement, depth_mm, None, None).pressure if problem.friction > 0 else None)  # fmt: skip
    moved = (here.contact.stiffness @ np.tile(travel, 9)).reshape(-1, 9, 3)  # dr/dt = -stiffness
    pushed = nodal_sum(moved, problem.model.surface.nodes, len(displacement))
    force_gap = here.force_gap
    if problem.normal_n is not None:
        force_gap -= float(pushed.sum(axis=0) @ problem.frame[:, 0])
    linear = replace(here, residual=here.residual - problem.model.solid.gather(pushed), force_gap=force_gap)
    direction = _direction(problem, linear, symmetric=True)
    return displacement + direction.change, depth_mm + direction.depth_mm


def tangent(problem: StepProblem, displacement: Array, contact: ContactResponse) -> Array:
    """Element matrices (e, 81, 81) of solid and contact; the outer face's nodes are the last nine of an element.

    Args:
        problem: the step.
        displacement: nodal (n, 3), mm.
        contact: response there.
    """
    blocks = problem.model.solid.tangent(displacement)
    active = np.flatnonzero((contact.pressure > 0).any(axis=1))
    blocks[problem.model.surface.cells[active], 54:, 54:] += contact.stiffness[active]
    return blocks


def _lagged_iteration(problem: StepProblem, here: Iterate) -> tuple[Iterate, int, float]:
    bound = problem.friction * here.contact.pressure if problem.friction > 0 else None
    fraction = here.contact.contact_fraction if problem.friction > 0 else None
    frozen = evaluate(problem, here.displacement, here.depth_mm, bound, fraction) if problem.friction > 0 else here
    direction = _direction(problem, frozen, symmetric=True)
    step = 1.0
    for _ in range(14):
        trial = evaluate(
            problem, here.displacement + step * direction.change, here.depth_mm + step * direction.depth_mm,
            bound, fraction,
        )  # fmt: skip
        round_off = 1e-12 * abs(frozen.potential)
        enough = trial.potential <= frozen.potential + ARMIJO * step * direction.slope + round_off
        if enough or trial.error < max(0.5 * frozen.error, TOLERANCE):  # here energies differ by rounding only
            break
        step /= 2
    else:
        raise Refusal(
            "unconverged",
            f"no descent along the Newton direction at depth {here.depth_mm:.3f} mm (out of balance by "
            f"{here.error:.1e} of the load)",
        )
    if problem.friction > 0:
        trial = evaluate(problem, trial.displacement, trial.depth_mm)
    return trial, direction.negative, direction.stiffness


def _search_residual(problem: StepProblem, here: Iterate, direction: _Direction) -> Iterate | None:
    for step in (1.0, 0.5, 0.25, 0.125):
        trial = evaluate(
            problem, here.displacement + step * direction.change, here.depth_mm + step * direction.depth_mm
        )
        if trial.error < (1 - 0.1 * step) * here.error:
            return trial
    return None


def _direction(problem: StepProblem, here: Iterate, symmetric: bool) -> _Direction:
    solid = problem.model.solid
    blocks = tangent(problem, here.displacement, here.contact)
    try:
        factor, negative = _positive(solid, blocks) if symmetric else (factorise(solid, blocks, symmetric=False), -1)
    except np.linalg.LinAlgError as error:
        raise Refusal("unconverged", f"{error} at depth {here.depth_mm:.3f} mm") from error
    column, row, kappa = border(problem, here.contact)
    if problem.normal_n is None:
        free = factor.solve(-here.residual)
        schur = kappa - float(row @ factor.solve(column))
        depth = 0.0
    else:
        both = factor.solve(np.stack([-here.residual, column], axis=1))
        schur = kappa - float(row @ both[:, 1])
        if symmetric and not schur > 1e-9 * max(kappa, 1e-12):
            raise Refusal(
                "unstable",
                f"the force no longer rises with the depth at {here.depth_mm:.3f} mm (slope {schur:.2g} N/mm): the "
                "shell snaps or has lost contact; control the depth instead of the force",
            )
        depth = (-here.force_gap - float(row @ both[:, 0])) / schur
        free = both[:, 0] - depth * both[:, 1]
    slope = float(here.residual @ free) + here.force_gap * depth
    return _Direction(solid.spread(free), depth, slope, negative, schur / problem.model.force_share)


def border(problem: StepProblem, contact: ContactResponse) -> tuple[Array, Array, float]:
    """Column dr/dd over the unknowns, row dN/du and slope dN/dd at fixed shell."""
    outward = np.tile(problem.frame[:, 0], 9)
    columns = (contact.stiffness @ outward).reshape(-1, 9, 3)
    rows = (outward @ contact.stiffness).reshape(-1, 9, 3)
    model = problem.model
    count = len(model.solid.mesh.points)
    nodal_column, nodal_row = (nodal_sum(part, model.surface.nodes, count) for part in (columns, rows))
    slope = float(columns.reshape(-1, 3).sum(axis=0) @ problem.frame[:, 0])
    return model.solid.gather(nodal_column), model.solid.gather(nodal_row), slope


def _positive(solid: Solid, blocks: Array) -> tuple[Factorisation, int]:
    """Factors of the tangent, shifted along its diagonal until it is positive; negative pivots before the shift."""
    factor = factorise(solid, blocks)
    negative = factor.negative
    if negative == 0:
        return factor, 0
    matrix = solid.assemble(blocks)
    shift = 1e-4 * float(np.abs(matrix.diagonal()).mean())
    for _ in range(MAX_SHIFTS):
        factor = factorise_sparse((matrix + shift * sparse.identity(matrix.shape[0], format="csc")).tocsc())
        if factor.negative == 0:
            return factor, negative
        shift *= 4
    raise Refusal("unconverged", f"the tangent stays indefinite ({negative} negative pivots) under any small shift")
