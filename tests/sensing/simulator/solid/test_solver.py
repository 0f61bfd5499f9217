"""The multifrontal solver against an independent one."""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from cad.materials import silicone
from sensing.simulator.solid import multifrontal
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.mesh import MeshDensity
from sensing.simulator.solid.shell import shell_model
from sensing.simulator.solid.system import factorise

RNG = np.random.default_rng(2)


@pytest.fixture(scope="module")
def solid():
    return shell_model(shell_geometry(130, 8), silicone().neo_hooke(), MeshDensity(4, 6, 1), half=True).solid


def test_symmetric_and_unsymmetric_factors_solve_what_superlu_solves(solid) -> None:
    blocks = solid.tangent(RNG.normal(0, 0.01, solid.mesh.points.shape))
    right = RNG.normal(size=(solid.unknowns, 3))
    for symmetric in (True, False):
        if not symmetric:
            blocks = blocks + RNG.normal(0, 0.02, blocks.shape) * np.abs(blocks).mean()
        matrix = solid.assemble(blocks)
        factor = factorise(solid, blocks, symmetric)
        assert factor.negative == (0 if symmetric else -1)
        exact = spsolve(matrix, right)
        assert np.abs(factor.solve(right) - exact).max() < 1e-9 * np.abs(exact).max()
        assert np.abs(factor.solve(right[:, 0]) - exact[:, 0]).max() < 1e-9 * np.abs(exact).max()


def test_negative_pivots_are_counted(solid) -> None:
    blocks = solid.tangent(np.zeros_like(solid.mesh.points))
    with pytest.raises(multifrontal.NotPositive):
        multifrontal.FrontalFactors(list(solid.fronts), -blocks, True)
    assert factorise(solid, -blocks).negative == solid.unknowns


def test_every_unknown_is_eliminated_once(solid) -> None:
    own = np.concatenate([front.variables[: front.pivot_count] for front in solid.fronts])
    assert np.array_equal(np.sort(own), np.arange(solid.unknowns))
    assert solid.fronts[-1].pivot_count == len(solid.fronts[-1].variables)


def test_what_cannot_be_factorised_says_so(solid) -> None:
    for blocks in (np.zeros((len(solid.mesh.cells), 81, 81)), np.full((len(solid.mesh.cells), 81, 81), np.nan)):
        with pytest.raises(np.linalg.LinAlgError):
            factorise(solid, blocks)
