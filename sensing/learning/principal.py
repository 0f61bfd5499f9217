"""Principal fields: directions in which fields vary most with the contact, relative to the variation between sensors.

Notes:
    With T the second moments of the fields of all samples, and N those of the differences between views of one state
    (several domain-randomised sensors have each), the directions v with the largest v'(T - N)v / v'Tv come first: this
    part of the variance along v is due to the contact, the rest to paint, camera and tracking. If no state has several
    views (own recordings) N is unknown, and the directions of largest variance come first. Moments contain all
    symmetric copies. Nothing is centred, so that zero stays zero. A direction differs from the field that it
    represents: parts z = P x give the field A z, A = T P' (P T P')^-1, the least squares of the samples on their parts.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from sensing.learning.samples import Samples
from sensing.learning.symmetry import COUNT, symmetric_gram
from sensing.wrench.tensors import PATTERN

Array = NDArray[np.float64]
Weights = dict[str, NDArray[np.float32]]
BLOCK = 8192  # samples at a time: a large set as doubles would fill the memory
NOTHING = 1e-9  # of the largest variance; a direction below it consists of rounding


def principal_fields(samples: Samples, count: int) -> Array:
    """(count, 2 H W) directions, or fewer, scaled so that each part P x has variance 1 over the samples.

    Args:
        samples: samples of one design, with square fields.
        count: largest number of directions.

    Raises:
        ParameterError: fields that are all zero.
    """
    return leading(*second_moments(samples), count)


def leading(total: Array, noise: Array, count: int) -> Array:
    """(count, D) directions, or fewer, with the largest part of ``total`` (D, D) that is not ``noise`` (D, D).

    Args:
        total: second moments of the fields.
        noise: second moments of the noise in the fields; zero where it is unknown.
        count: largest number of directions.

    Raises:
        ParameterError: moments that are all zero.
    """
    values, vectors = np.linalg.eigh(total)
    keep = values > NOTHING * max(float(values[-1]), 1e-30)
    if not keep.any():
        raise ParameterError(
            "fields are all zero: nothing to learn from; were the frames pressed at all?", name="fields"
        )
    white = vectors[:, keep] / np.sqrt(values[keep])
    if not noise.any():
        return np.ascontiguousarray(white[:, ::-1][:, :count].T)
    _, turns = np.linalg.eigh(white.T @ noise @ white)
    return np.ascontiguousarray((white @ turns[:, :count]).T)  # least noise first


def pattern_tensor(principal: NDArray[np.float32], samples: Samples, start: Weights | None) -> Weights:
    """``pattern`` (2 H W, K) of weights by its name: the fields that the principal parts represent.

    Args:
        principal: (K, 2 H W) directions.
        samples: samples of one design, with square fields.
        start: tensors of the weights that were fine-tuned, whose pattern is kept unless there are more directions now;
            None without such weights.
    """
    if start is not None and len(start["principal"]) == len(principal):
        return {name: start[name] for name in PATTERN if name in start}
    directions = principal.astype(float)
    image = second_moments(samples)[0] @ directions.T
    return {"pattern": (image @ np.linalg.pinv(directions @ image, hermitian=True)).astype(np.float32)}


def second_moments(samples: Samples) -> tuple[Array, Array]:
    """((D, D) moments of all fields, (D, D) of differences between views), means over samples and symmetric copies."""
    size, side = 2 * samples.fields[0, 0].size, samples.fields.shape[2]
    total, noise, compared = np.zeros((size, size)), np.zeros((size, size)), 0
    for rows in same_states(samples):
        count, views = rows.shape
        fields = samples.take(rows.ravel()).inputs
        total += fields.T @ fields
        if views > 1:
            fields = fields.reshape(count, views, size)
            off = (fields - fields.mean(axis=1, keepdims=True)).reshape(-1, size)
            noise += off.T @ off * (views / (views - 1))
            compared += len(off)
    total, noise = (symmetric_gram(part, side) / COUNT for part in (total, noise))
    return total / max(len(samples), 1), noise / max(compared, 1)


def same_states(samples: Samples) -> list[NDArray[np.intp]]:
    """Rows of the samples in blocks (S, V): S states, each with the views of V sensors."""
    keys = [np.unique(column, return_inverse=True)[1] for column in (samples.path, samples.azimuth_deg, samples.time_s)]
    _, number, views = np.unique(np.stack(keys, axis=1), axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(number.ravel(), kind="stable")
    starts = np.cumsum(views) - views
    found: list[NDArray[np.intp]] = []
    for count in np.unique(views):
        rows = order[starts[views == count][:, None] + np.arange(count)]
        found += np.array_split(rows, max(1, rows.size // BLOCK))
    return found
