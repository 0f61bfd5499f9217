"""Branch switching at an unstable equilibrium: a shell that buckles follows its softest mode (N, mm).

A symmetric press of a thin shell has equilibria past its buckling load that no real shell shows. Newton finds them; the
negative pivots of their tangent reveal them. The configuration is perturbed along the eigenvector of the
lowest eigenvalue and solved again: with an indefinite tangent the step is shifted until it descends, so it ends in a
minimum.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigsh

from sensing.simulator.press import newton
from sensing.simulator.press.state import Refusal
from sensing.simulator.press.step import Iterate, Solution, StepProblem
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.system import factorise_sparse

PUSHES = (0.03, -0.03, 0.15, -0.15)  # perturbations of the point that moves most, in units of the wall T
MODES = 3  # eigenvalues nearest to zero that are computed; the lowest of them is taken


def softest_mode(problem: StepProblem, here: Iterate) -> tuple[float, Array]:
    """Lowest eigenvalue near zero of the symmetric tangent (N/mm), and its field (n, 3), largest entry 1."""
    bound = problem.friction * here.contact.pressure if problem.friction > 0 else None
    fraction = here.contact.contact_fraction if problem.friction > 0 else None
    frozen = newton.evaluate(problem, here.displacement, here.depth_mm, bound, fraction)
    solid = problem.model.solid
    matrix = solid.assemble(newton.tangent(problem, here.displacement, frozen.contact))
    factor = factorise_sparse(matrix)
    inverse = LinearOperator(matrix.shape, matvec=factor.solve, dtype=float)
    start = np.random.default_rng(0).normal(size=matrix.shape[0])
    values, vectors = eigsh(matrix, k=MODES, sigma=0.0, OPinv=inverse, v0=start)
    field = solid.spread(vectors[:, int(values.argmin())])
    return float(values.min()), field / field.ravel()[int(np.abs(field).argmax())]


def leave(problem: StepProblem, unstable: Solution) -> Solution | None:
    """A stable equilibrium beside an unstable one, or None where none is found."""
    value, mode = softest_mode(problem, unstable.iterate)
    if value >= 0:
        return None
    wall = problem.model.geometry.wall_mm
    for push in PUSHES:
        pushed = unstable.iterate.displacement + push * wall * mode
        try:
            found = newton.solve(problem, pushed, unstable.iterate.depth_mm)
        except Refusal:
            continue
        if found.negative_pivots == 0:
            return found
    return None
