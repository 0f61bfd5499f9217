"""Finds the dots again after a jump that is too large for tracking (within one frame, or after a dark picture).

For every dot, places whose window correlates with its own are searched within reach; there may be several, because
dots look alike. The rigid motion that most dots have a candidate for (as in RANSAC: Fischler and Bolles 1981), or no
motion, selects one candidate of each dot; from these the field grows to the others, each of which takes the candidate
nearest to the prediction from its neighbours. Identities can therefore only be exchanged if a whole patch of dots jumps
by a dot spacing.

Units: pixels of the picture searched, but for what :class:`WideSearch` takes and gives: pixels of the working picture.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from sensing.decode import working_reduction
from sensing.tracking.field.operator import FieldOperator
from sensing.tracking.patch_kernels import MARGIN, framed
from sensing.tracking.patches import cut_patches
from sensing.tracking.search_kernels import best_rigid_motion, correlation_map

STRIDE = 2  # px of the reduced picture between the places that are compared
LEAST_CORRELATION = 0.6  # E: of a candidate
CANDIDATES = 4  # highest local maxima kept for each dot
AGREE_PX = 4.0  # a candidate within this of the prediction is taken
GROW_PX = 10.0  # the same while growing: neighbours predict narrow bumps badly; half a dot spacing is 11
ROUNDS = 8  # most rounds of growing
TRIALS = 600  # random pairs of dots, each a hypothesis of the rigid motion
SHORTEST_PX = 40.0  # pairs nearer than this do not determine a rotation
STRETCH = 0.07  # pairs whose distance changes by more than this share are rejected


class WideSearch:
    """Search for windows far from their last place, in a picture reduced to about half of 640 x 480.

    Args:
        image: framed reference of :func:`sensing.tracking.patch_kernels.smoothed`, working size.
        position: (N, 2) dots at rest, working pixels.
        half: half width of the tracker's windows, working pixels.
        operator: field operator of the same dots.
    """

    def __init__(
        self, image: NDArray[np.float32], position: NDArray[np.float64], half: int, operator: FieldOperator
    ) -> None:
        height, width = (side - 2 * MARGIN for side in image.shape)
        self._factor = working_reduction((width, height))
        self._operator = operator
        reduced = self._reduced(image)
        place = (position - (self._factor - 1) / 2) / self._factor
        self._patches = cut_patches(reduced, place, max(4, round(half / self._factor)))
        self._reach = int(np.ceil(0.06 * min(height, width) / self._factor / 2)) * 2  # a jump of 25 px at 480, and more

    def all(self, image: NDArray[np.float32]) -> NDArray[np.float64]:
        """(N, 2) coarse displacements of all dots in a framed working picture, to 1 or 2 px of the reduced one."""
        everything = np.arange(len(self._patches.centre))
        place, score = _candidates(self._maps(image, everything))
        centre = self._patches.centre.astype(float)
        start = _agreed_motion(centre, place, score, np.random.default_rng(0))
        chosen, error = _nearest(place, score, start)
        return _grown(self._operator, place, score, chosen, error < AGREE_PX)[0] * self._factor

    def lost(
        self, image: NDArray[np.float32], moved: NDArray[np.float64], live: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """(N, 2) displacements with the lost dots searched for near their neighbours' prediction; live ones stay.

        Args:
            image: framed working picture.
            moved: (N, 2) displacements, working pixels.
            live: (N,) dots that are not lost.
        """
        gone = np.flatnonzero(~live)
        place, score = np.zeros((len(live), CANDIDATES, 2)), np.zeros((len(live), CANDIDATES))
        place[gone], score[gone] = _candidates(self._maps(image, gone))
        place[live, 0], score[live, 0] = moved[live] / self._factor, 1.0
        return _grown(self._operator, place, score, moved / self._factor, live)[0] * self._factor

    def _maps(self, image: NDArray[np.float32], which: NDArray[np.int64]) -> NDArray[np.float32]:
        p = self._patches
        return correlation_map(
            self._reduced(image), p.centre, p.half, p.texture, p.weight, p.energy, which, self._reach, STRIDE
        )

    def _reduced(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """The framed picture by the means of factor x factor pixels, framed again; an odd last line is left out."""
        if self._factor == 1:
            return image
        inside, f = image[MARGIN:-MARGIN, MARGIN:-MARGIN], self._factor
        height, width = (side // f for side in inside.shape)
        result = framed(height, width)
        whole = inside[: height * f, : width * f]
        result[MARGIN:-MARGIN, MARGIN:-MARGIN] = cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA)
        return result


def _grown(
    operator: FieldOperator,
    place: NDArray[np.float64],
    score: NDArray[np.float64],
    chosen: NDArray[np.float64],
    live: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Grow from the live dots: each other dot takes the candidate nearest to its prediction, if near enough."""
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
    dots = np.flatnonzero(score.max(axis=1) > 0)
    if len(dots) < 4:
        return np.zeros_like(centre)
    picks = np.column_stack(
        [dots[rng.integers(len(dots), size=(TRIALS, 2))], rng.integers(CANDIDATES, size=(TRIALS, 2))]
    )
    middle = centre.mean(axis=0)
    turn, x, y = best_rigid_motion(centre - middle, place, score, picks, AGREE_PX, SHORTEST_PX, STRETCH)
    z = (centre - middle) @ np.array([1, 1j]) * (np.exp(1j * turn) - 1) + complex(x, y)
    return np.stack([z.real, z.imag], axis=1)


def _nearest(
    place: NDArray[np.float64], score: NDArray[np.float64], target: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N, 2) candidate of each dot nearest to the target, and (N,) how far it is from it."""
    distance = np.linalg.norm(place - target[:, None], axis=2) + np.where(score > 0, 0, 1e6)
    best = distance.argmin(axis=1)
    row = np.arange(len(place))
    return place[row, best], distance[row, best]
