"""Ridge regression from fields to wrenches, without an intercept: zero shear gives exactly zero.

Notes:
    W = argmin sum |W x - w|^2 + lambda |W|^2 (Hoerl, Kennard 1970, doi:10.1080/00401706.1970.10488634), lambda chosen
    by leaving whole paths out. The symmetries of the square give eight copies of every sample. Solved by the
    eigenvalues of X'X; lambda is at least 1e-10 of the largest, so duplicated or constant samples do no harm.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from sensing.learning.symmetry import symmetric_moments

Array = NDArray[np.float64]
SHARES = 10.0 ** np.arange(-10.0, 0.5)  # candidates of lambda over the largest eigenvalue
UNITS = np.array([0.15] * 3 + [0.02] * 3)  # N and N m: the target errors, which give all axes the same weight
FOLDS = 5  # groups of paths in the choice of lambda
ALONE = 1e-4  # lambda over the largest eigenvalue with a single path


def fit_ridge(inputs: Array, wrenches: Array, path: NDArray, side: int) -> tuple[Array, float]:
    """Weights (6, 2 side side), and the chosen lambda over the largest eigenvalue.

    Args:
        inputs: (N, 2 side side) fields, px.
        wrenches: (N, 6) labels, N and N m.
        path: (N,) identity of each sample's loading path.
        side: number of cells along a side of the field.

    Raises:
        ParameterError: shapes that do not fit, no samples, or numbers that are not finite.
    """
    if inputs.ndim != 2 or inputs.shape[1] != 2 * side * side or wrenches.shape != (len(inputs), 6) or not len(inputs):
        raise ParameterError(
            f"inputs {inputs.shape}, wrenches {wrenches.shape}: need (N, {2 * side * side}) and (N, 6), N at least 1",
            name="inputs",
            value=inputs.shape,
        )
    if not (np.isfinite(inputs).all() and np.isfinite(wrenches).all()):
        raise ParameterError("inputs or wrenches that are not finite: drop those samples", name="inputs")
    names = np.unique(path)
    if len(names) < 2:
        gram, moment = symmetric_moments(inputs, wrenches, side)
        return _solve(gram, moment, np.array([ALONE]))[0], ALONE
    folds = np.array_split(np.random.default_rng(0).permutation(names), min(FOLDS, len(names)))
    rows = [np.isin(path, fold) for fold in folds]
    parts = [symmetric_moments(inputs[out], wrenches[out], side) for out in rows]
    gram, moment = (np.sum([part[k] for part in parts], axis=0) for k in (0, 1))
    errors = np.zeros(len(SHARES))
    for out, part in zip(rows, parts, strict=True):
        for k, weights in enumerate(_solve(gram - part[0], moment - part[1], SHARES)):
            errors[k] += (((inputs[out] @ weights.T - wrenches[out]) / UNITS) ** 2).sum()
    share = float(SHARES[errors.argmin()])
    return _solve(gram, moment, np.array([share]))[0], share


def _solve(gram: Array, moment: Array, shares: Array) -> list[Array]:
    values, vectors = np.linalg.eigh(gram)
    top = float(values[-1])
    if not top > 0:
        return [np.zeros(moment.T.shape) for _ in shares]
    turned = vectors.T @ moment
    return [(vectors @ (turned / (np.maximum(values, 0) + share * top)[:, None])).T for share in shares]
