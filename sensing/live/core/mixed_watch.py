"""Whether pictures hold a part of those before them: noise reduction over time (3DNR, DNR), or blended frames.

    watch = MixedWatch()
    watch.update(tracks, likeness)      # every frame; watch.reason says so

Such a camera shows dots late, and a fast press is read too low: by 3 to 8 N of 19 N. Each window still correlates well,
so nothing else shows it. The noise does: it scatters each dot on its own, anew in each picture, and the correlation
r(L) of a dot's places L frames apart is

    r(L) = 0 of independent pictures     a^L where a picture holds a part a of the one before     r(1) = 1/2 of pairs

1. What moves skin or camera is smooth over the dots. Displacements are split into a polynomial of second degree in x
   and y, and what that leaves to each dot alone. An interval counts while the polynomial has no more energy than noise
   gives it.
2. From what each dot is left a polynomial of fifth degree in time is taken off, by a projection R. That alone makes
   r(L) = tr(R S R) / tr(R) of independent pictures (S shifts by L frames), which is taken off, too.
3. Of mixed pictures r(2) is then at most 0.08. Light that changes moves the dots of coarse JPEGs for several frames, so
   r(1) - 2 max(0, r(2)) is what counts, in the mean over the dots, each alike: a few that flicker change little. In a
   film of n > 2 pictures that is shown over and over both are -1/(n - 1).

JPEG and whole gray values lower it (bench/mixed.csv, docs/live_faults.md). Pictures that come twice do not count, as in
:mod:`sensing.live.core.still_watch`.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from sensing.records import DotTracks

Array = NDArray[np.float64]
FLAG = "mixed"
FRAMES = 32  # of an interval
TIME_DEGREE, PLACE_DEGREE = 5, 2
LEAST_DOTS = 24  # four times the terms of the polynomial in x and y
LEAST_PX = 1e-3  # at 480 rows: scatter of the median dot; pictures drawn without noise have less
QUIET = 3.0  # M: energy of the polynomial over that of noise: 0.8 to 2.4; 6 to 40 of a drift by 0.001 px a frame
MIXED = 0.11  # M: r(1) - 2 max(0, r(2)): 0.03 at most of independent pictures; see bench/mixed.csv
FEWEST, MOST = 3, 8  # intervals whose mean decides: the deviation of one is 0.03


def _left_by_polynomial() -> Array:
    """(FRAMES, FRAMES) projection on what a polynomial in time leaves."""
    times = np.vander(np.linspace(-1.0, 1.0, FRAMES), TIME_DEGREE + 1)
    basis = np.linalg.qr(times)[0]
    return np.asarray(np.eye(FRAMES) - basis @ basis.T)


_LEFT = _left_by_polynomial()
_OF_FIT = {lag: float(np.trace(_LEFT @ np.eye(FRAMES, k=lag) @ _LEFT) / np.trace(_LEFT)) for lag in (1, 2)}


class MixedWatch:
    """Of the frames since a reference.

    Args:
        reason: known from frames before a restart; empty for none.

    Attributes:
        reason: says so, and what to do; empty where nothing shows it. Pressed dots hide it, so it stays until the next
            reference.
    """

    def __init__(self, reason: str = "") -> None:
        self.reason = reason
        self._places: list[tuple[Array, NDArray[np.bool_]]] = []
        self._likeness = float("nan")
        self._found: deque[float] = deque(maxlen=MOST)

    def update(self, tracks: DotTracks, likeness: float) -> None:
        """One frame.

        Args:
            tracks: its dots.
            likeness: of its picture with the reference: the same number twice is the same picture.
        """
        before, self._likeness = self._likeness, likeness
        if self.reason or before == likeness:
            return
        self._places.append((tracks.position_px, tracks.lost))
        if len(self._places) < FRAMES:
            return
        places, lost = zip(*self._places, strict=True)
        self._places = []
        seen = ~np.any(lost, axis=0)
        found = memory_of_noise(np.array(places)[:, seen], tracks.reference_px[seen], LEAST_PX * tracks.size[1] / 480)
        if found is None:
            return
        self._found.append(found)
        mean = float(np.mean(self._found))
        if len(self._found) >= FEWEST and mean > MIXED:
            self.reason = (
                f"each picture holds a part of those before (its noise correlates with theirs by {mean:.2f}), which "
                "shows fast presses late: switch noise reduction over time (3DNR, DNR) and blending of frames off"
            )


def memory_of_noise(places_px: Array, reference_px: Array, least_px: float) -> float | None:
    """Correlation of the dots' noise from one frame to the next, less twice that over two frames where it is positive.

    Args:
        places_px: (FRAMES, n, 2) in frames in a row.
        reference_px: (n, 2) of the same dots in the reference.
        least_px: scatter of the median dot under which there is no noise.

    Returns:
        The mean over the dots; None of fewer than :data:`LEAST_DOTS`, without noise, or where something moves.
    """
    if len(reference_px) < LEAST_DOTS:
        return None
    moved, smooth = places_px - places_px.mean(axis=0), _polynomials(reference_px)
    scatter = np.sqrt((_split(moved, smooth)[1] ** 2).mean(axis=(0, 2)))[:, None]
    if np.median(scatter) < least_px or not scatter.all():
        return None
    together, alone = _split(moved / scatter, smooth / scatter)  # dots at the edge scatter more than others
    terms, others = smooth.shape[1], len(scatter) - smooth.shape[1]
    if (together**2).sum() / terms > QUIET * (alone**2).sum() / others:
        return None
    noise = np.einsum("st,tnc->snc", _LEFT, alone)
    return _correlation(noise, 1) - 2 * max(0.0, _correlation(noise, 2))


def _correlation(noise: Array, lag: int) -> float:
    """Mean over the dots, so many frames apart, without what the polynomial in time makes of it."""
    of_dots = (noise[lag:] * noise[:-lag]).sum(axis=(0, 2)) / (noise**2).sum(axis=(0, 2))
    return float(of_dots.mean()) - _OF_FIT[lag]


def _polynomials(reference_px: Array) -> Array:
    """(n, 6) of the place in the picture."""
    places = reference_px - reference_px.mean(axis=0)
    x, y = (places / np.abs(places).max()).T
    powers = [(i, j) for i in range(PLACE_DEGREE + 1) for j in range(PLACE_DEGREE + 1 - i)]
    return np.stack([x**i * y**j for i, j in powers], axis=1)


def _split(moved: Array, terms: Array) -> tuple[Array, Array]:
    """(t, n, 2) displacements as what these terms fit to them, and what they leave."""
    basis = np.linalg.qr(terms)[0]
    together = np.einsum("nm,tmc->tnc", basis, np.einsum("nm,tnc->tmc", basis, moved))
    return together, moved - together
