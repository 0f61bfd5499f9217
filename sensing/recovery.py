"""Finds the dots again when they have jumped too far to be followed (one-frame jumps, a picture after darkness).

Every dot looks for windows like its own within reach; several may fit, because dots look alike. A rigid motion that
many dots agree on (or no motion at all) picks one each; from these the field grows to the others, each new dot taking
the candidate nearest to what its neighbours predict. So a swap of identities needs a whole patch to jump by a dot
spacing, not one dot.

Units: pixels of the working (reduced) picture.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sensing.field_operator import FieldOperator
from sensing.patch_kernels import correlation_map
from sensing.patches import Patches
from sensing.records import Image

STRIDE = 2
LEAST_CORRELATION = 0.6
CANDIDATES = 4
AGREE_PX = 4.0  # a candidate within this of the prediction is taken
GROW_PX = 10.0  # the same while growing: narrow bumps surprise their neighbours; half a dot spacing is 11
ROUNDS = 8
TRIALS = 150


def recover(
    image: Image,
    patches: Patches,
    operator: FieldOperator,
    reach: int,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """((N, 2) coarse displacements, to 1 or 2 px; (N,) bool, True where a window was found, else predicted)."""
    count = len(patches.centre)
    which = np.arange(count)
    maps = correlation_map(
        image, patches.centre, patches.half, patches.texture, patches.weight, patches.energy, which, reach, STRIDE
    )
    place, score = _candidates(maps)
    start = _agreed_motion(patches.centre.astype(float), place, score, rng)
    chosen, error = _nearest(place, score, start)
    return _grown(operator, place, score, chosen, error < AGREE_PX)


def regrow(
    image: Image,
    patches: Patches,
    operator: FieldOperator,
    moved: NDArray[np.float64],
    live: NDArray[np.bool_],
    reach: int,
) -> NDArray[np.float64]:
    """(N, 2) coarse displacements with the lost dots searched for near their neighbours' prediction; live ones stay."""
    lost = np.flatnonzero(~live)
    maps = correlation_map(
        image, patches.centre, patches.half, patches.texture, patches.weight, patches.energy, lost, reach, STRIDE
    )
    place, score = np.zeros((len(live), CANDIDATES, 2)), np.zeros((len(live), CANDIDATES))
    place[lost], score[lost] = _candidates(maps)
    place[live, 0], score[live, 0] = moved[live], 1.0
    return _grown(operator, place, score, moved, live)[0]


def _grown(
    operator: FieldOperator,
    place: NDArray[np.float64],
    score: NDArray[np.float64],
    chosen: NDArray[np.float64],
    live: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """From the live dots outward: each takes the candidate nearest to what the others predict, if near enough."""
    count = len(live)
    for _ in range(ROUNDS):
        if live.sum() < 3:
            return np.zeros((count, 2)), np.zeros(count, bool)
        predicted = operator.filled(np.where(live[:, None], chosen, 0.0), live)
        predicted[live] -= _left_out(operator, chosen, live)
        chosen, error = _nearest(place, score, predicted)
        grown = error < GROW_PX
        if (grown == live).all():
            break
        live = grown
    return operator.filled(np.where(live[:, None], chosen, 0.0), live), live


def _left_out(
    operator: FieldOperator, displacement: NDArray[np.float64], live: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Leave-one-out residual of the live dots among the live dots."""
    return operator.left_out(operator.filled(np.where(live[:, None], displacement, 0.0), live))[live]


def _candidates(maps: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N, C, 2) displacements and (N, C) correlations of the highest local maxima; unused places score 0."""
    count, n, _ = maps.shape
    framed = np.pad(maps, ((0, 0), (1, 1), (1, 1)), constant_values=-1)
    neighbours = [
        framed[:, 1 + dy : 1 + dy + n, 1 + dx : 1 + dx + n] for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dx or dy
    ]
    peak = np.where(maps >= np.maximum.reduce(neighbours), maps, 0).reshape(count, -1)
    order = np.argsort(-peak, axis=1)[:, :CANDIDATES]
    score = np.take_along_axis(peak, order, axis=1).astype(float)
    place = np.stack([order % n - n // 2, order // n - n // 2], axis=2) * float(STRIDE)
    return place, np.where(score > LEAST_CORRELATION, score, 0.0)


def _agreed_motion(
    centre: NDArray[np.float64],
    place: NDArray[np.float64],
    score: NDArray[np.float64],
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """(N, 2) rigid motion that most dots have a candidate for; rest is the first guess and wins ties."""
    best = np.zeros_like(centre)
    best_votes = _votes(place, score, best) * 1.05
    dots = np.flatnonzero(score.max(axis=1) > 0)
    if len(dots) < 4:
        return best
    for _ in range(TRIALS):
        i, j = rng.choice(dots, 2, replace=False)
        a, b = rng.choice(CANDIDATES, 2)
        if score[i, a] == 0 or score[j, b] == 0:
            continue
        motion = _rigid(centre, centre[[i, j]], centre[[i, j]] + [place[i, a], place[j, b]])
        if motion is None:
            continue
        votes = _votes(place, score, motion)
        if votes > best_votes:
            best, best_votes = motion, votes
    return best


def _votes(place: NDArray[np.float64], score: NDArray[np.float64], motion: NDArray[np.float64]) -> float:
    near = ((place - motion[:, None]) ** 2).sum(axis=2) < AGREE_PX**2
    return float((near * score).max(axis=1).sum())


def _rigid(
    centre: NDArray[np.float64], before: NDArray[np.float64], after: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """(N, 2) displacement of the turn and shift that take two points to two others; None if it stretches."""
    arm, new_arm = complex(*(before[1] - before[0])), complex(*(after[1] - after[0]))
    if abs(arm) < 40 or not 0.93 < abs(new_arm) / abs(arm) < 1.07:
        return None
    turn = new_arm / arm / abs(new_arm / arm)
    z = (centre[:, 0] + 1j * centre[:, 1] - complex(*before.mean(axis=0))) * turn + complex(*after.mean(axis=0))
    return np.stack([z.real, z.imag], axis=1) - centre


def _nearest(
    place: NDArray[np.float64], score: NDArray[np.float64], target: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N, 2) candidate of each dot nearest to the target, and (N,) how far it is from it."""
    distance = np.linalg.norm(place - target[:, None], axis=2) + np.where(score > 0, 0, 1e6)
    best = distance.argmin(axis=1)
    row = np.arange(len(place))
    return place[row, best], distance[row, best]
