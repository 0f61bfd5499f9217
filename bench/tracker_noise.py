"""What the tracker's dots are off by on rendered frames: a law of displacement, and of the distance of two dots.

    noise = measured_noise(LabelledSet("exports/nominal"))
    noise.covariance(at_px, far_px)                          # (2n, 2n) px^2

Ink lies beside its nominal place, at rest as under load: displacement is compared with displacement. Lost dots do not
count, and an error counts as at most five median-based deviations. Pixels of the full-size picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import nnls

from sensing.records_labelled import LabelledSet
from sensing.tracking.tracker import DotTracker
from sensing.wrench.dot_noise import moved_part

Array = np.ndarray
NEAR_PX = 12.0  # a found dot is the labelled one within this distance
FAR_PX = (0.0, 0.03, 0.1, 0.2, 0.4, 1.0, 3.0, 6.0, 12.0, 40.0)  # errors between two of these count together
APART_PX = (0.0, 55.0, 80.0, 110.0, 150.0, 200.0, 300.0)  # and distances between dots
LARGEST = 5.0  # an error counts as at most so many median-based deviations
FEWEST = 50  # errors between two displacements


@dataclass(frozen=True)
class Noise:
    """The tracker's error: standard deviation of a dot that has moved, and how two dots go together.

    Attributes:
        still_px, moving_px, share: sd^2 = still^2 + (moving moved_part(far))^2 + (share far)^2, the law of
            :func:`sensing.wrench.dot_noise.moved_part`.
        alike, length_px: correlation of one axis of two dots, alike exp(-distance / length).
    """

    still_px: float
    moving_px: float
    share: float
    alike: float
    length_px: float

    def sd(self, far_px: Array) -> Array:
        """Standard deviation of one axis at displacements, px."""
        parts = (self.still_px**2, (self.moving_px * moved_part(far_px)) ** 2, (self.share * far_px) ** 2)
        return np.sqrt(sum(parts))

    def covariance(self, at_px: Array, far_px: Array) -> Array:
        """(2n, 2n) of dots at (n, 2) that have moved by (n,): x, y of each in turn."""
        apart = np.linalg.norm(at_px[:, None] - at_px[None], axis=2)
        alike = self.alike * np.exp(-apart / self.length_px)
        np.fill_diagonal(alike, 1.0)
        sd = self.sd(far_px)
        return np.kron(alike * sd * sd[:, None], np.eye(2))


def measured_noise(data: LabelledSet) -> Noise:
    """Errors of the tracker's dots against the truth, as a law of displacement and distance."""
    at, far, error = _tracked(data)
    binned = []
    for low, high in pairwise(FAR_PX):
        part = error[(far >= low) & (far < high)]
        part = part[np.isfinite(part).all(axis=1)]
        if len(part) >= FEWEST:
            top = LARGEST * 1.4826 * np.median(np.abs(part))
            middle = np.median(far[(far >= low) & (far < high)])
            binned.append((middle, np.sqrt((np.clip(part, -top, top) ** 2).mean()), len(part)))
    middle, sd, count = np.array(binned).T
    print("displacement px, rms error px, dots:", *(f"{m:.2f} {s:.4f} {n:.0f};" for m, s, n in binned))
    terms = np.column_stack([np.ones_like(middle), moved_part(middle) ** 2, middle**2])
    weight = np.sqrt(count) / sd**2
    still, moving, share = np.sqrt(nnls(terms * weight[:, None], weight * sd**2)[0])
    law = Noise(still, moving, share, 0.0, 1.0)
    return Noise(still, moving, share, *_alikeness(at, error / np.maximum(law.sd(far), 1e-6)[..., None]))


def _alikeness(at: Array, scaled: Array) -> tuple[float, float]:
    """(alike, length) of an exponential law through the mean products of two dots' scaled errors, by distance."""
    first, second = np.triu_indices(at.shape[1], 1)
    scaled = np.clip(scaled, -LARGEST, LARGEST)
    product = (scaled[:, first] * scaled[:, second]).mean(axis=2)  # not a number where a dot was not found
    apart = np.linalg.norm(at[:, first] - at[:, second], axis=2)
    total, middles, means, counts = np.nanmean(scaled**2), [], [], []
    for low, high in pairwise(APART_PX):
        use = (apart >= low) & (apart < high) & np.isfinite(product)
        middles.append(float(apart[use].mean()))
        means.append(float(product[use].mean() / total))
        counts.append(int(use.sum()))
    print("distance px, correlation:", *(f"{m:.0f} {c:.3f};" for m, c in zip(middles, means, strict=True)))
    lengths = np.geomspace(15, 1000, 60)
    fits = []
    for length in lengths:
        shape = np.exp(-np.array(middles) / length)
        alike = float(np.clip((shape @ means) / (shape @ shape), 0.0, 0.99))
        fits.append((float(((np.array(means) - alike * shape) ** 2).sum()), alike, float(length)))
    _, alike, length = min(fits)
    return alike, length


def _tracked(data: LabelledSet) -> tuple[Array, Array, Array]:
    """Places (f, d, 2), displacements (f, d) and tracker's errors (f, d, 2) of all dots, NaN where it has none."""
    at, far, errors, now = [], [], [], None
    for item in data.frames():
        run = item.path, float(item.labels["azimuth_deg"])
        if run != now:
            tracker, now, rest = DotTracker(item.reference), run, item.dots_px  # a run begins with a frame apart
            match = _matched(tracker.reference_px, rest)
        tracks, moved = tracker.update(item.frame), item.dots_px - rest
        good = (match >= 0) & ~tracks.lost
        error = np.full(rest.shape, np.nan)
        error[match[good]] = tracks.displacement_px[good] - moved[match[good]]
        at.append(rest)
        far.append(np.linalg.norm(moved, axis=1))
        errors.append(np.where(item.dots_visible[:, None], error, np.nan))
    return np.array(at), np.array(far), np.array(errors)


def _matched(found_px: Array, rest_px: Array) -> Array:
    """Number of the labelled dot at each found one; -1 where none is near."""
    apart = np.linalg.norm(found_px[:, None] - rest_px[None], axis=2)
    apart = np.where(np.isnan(apart), np.inf, apart)
    return np.where(apart.min(axis=1) < NEAR_PX, apart.argmin(axis=1), -1)
