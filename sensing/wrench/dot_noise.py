"""Covariance of a wrench due to picture noise beyond that of the training data, whether of the camera or of few rows.

    noise = DotNoise(seen, model, zero.error_px)                               # once a reference
    covariance = model.estimate(field).covariance + noise.covariance(tracks)

Notes:
    The network's own covariance covers the noise of its training data and no more, because the network reads single
    fields. The scatter s of a dot is estimated in two ways, and the larger estimate is used:

    - from the frames of the reference, when it is taken. A reference of one picture (the first of a video or folder)
      gives no such estimate;
    - from each frame's windows. One minus the correlation of a window is the noise of picture and reference; the
      window's slopes turn it into a variance of the dot's position. This estimate also covers light that fails later,
      coarse compression and few rows. A dot that has moved is sampled by other pixels, which lowers its correlation in
      the cleanest picture as well; that part is subtracted.

    The network is least linear near rest: its output for a dot's motion of 0.03 px is five times what its slope at rest
    predicts, and noise also shifts the mean of its output. So its slope is not used. Instead fields of a dome at rest
    are drawn with the excess sqrt(s^2 - trained^2), and N = mean(w w') over their wrenches w, which are zero without
    noise. N covers scatter and shift, and is positive semidefinite. Under load the network is more linear, so that N
    is then an upper estimate.
"""

from __future__ import annotations

import math

import numpy as np

from sensing.records import DotTracks
from sensing.tracking.model_input import ModelInput
from sensing.wrench.model import Array, WrenchModel

STILL_PX = 0.0063  # M: an axis of a dot at rest, at 480 rows (bench/tracker_noise.py); the training's too
MOVED_PX = 0.025  # M: windows of clean pictures of moved dots show 0.017 to 0.022 (two sizes), the training has 0.029
KNEE_PX = 0.15  # M: displacement at which a moved dot has half of its full error
DRAWS = 256  # E: statistical error of N about a tenth
LEVELS_PX = (0.0, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32)  # excesses at 480 rows for which N is drawn


def moved_part(far_px: Array) -> Array:
    """Share of the full error of a moved dot at each displacement, px: one half at :data:`KNEE_PX`."""
    return np.asarray(far_px / (KNEE_PX + far_px))


class DotNoise:
    """Covariance due to the excess noise of one sensor, against one reference.

    Args:
        seen: the path from picture to field.
        model: reads the field.
        error_px: standard deviation of an axis of a dot at rest as the reference has it, full-size px; 0 where unknown.
    """

    def __init__(self, seen: ModelInput, model: WrenchModel, error_px: float) -> None:
        self._unit = min(seen.tracker.size) / 480.0
        self._per_loss = seen.tracker.variance_per_loss / self._unit**2
        self._least = (error_px / self._unit) ** 2 - STILL_PX**2
        fields = _fields_of_a_pixel(seen, self._unit)
        wrenches = [model.predict(level * fields)[0] for level in LEVELS_PX[1:]]
        self._squares = np.square(LEVELS_PX)
        self._drawn = np.array([np.zeros((6, 6)), *(w.T @ w / DRAWS for w in wrenches)])

    def excess_px(self, tracks: DotTracks) -> float:
        """Standard deviation of an axis of a dot beyond that of the training, px at 480 rows."""
        return math.sqrt(max(self._least, self._shown(tracks), 0.0))

    def covariance(self, tracks: DotTracks) -> Array:
        """(6, 6) to add to the covariance of a wrench about the sphere's centre; zero where training had as much noise.

        Args:
            tracks: of the frame, against the reference.
        """
        square, last = self.excess_px(tracks) ** 2, self._squares[-1]
        if square == 0.0:
            return np.zeros((6, 6))
        above = int(np.searchsorted(self._squares[1:-1], square)) + 1
        low, high = self._squares[above - 1 : above + 1]
        part = (min(square, last) - low) / (high - low)
        drawn = (1 - part) * self._drawn[above - 1] + part * self._drawn[above]
        return np.asarray(drawn * max(square / last, 1.0))

    def _shown(self, tracks: DotTracks) -> float:
        """Median over the dots of the variance that their windows show beyond the training's, px^2 at 480 rows."""
        live = ~tracks.lost
        if not live.any():
            return 0.0
        moved = tracks.displacement_px[live] / self._unit
        clean = STILL_PX**2 + (MOVED_PX * moved_part(np.hypot(*moved.T))) ** 2
        return float(np.median(self._per_loss[live] * (1.0 - tracks.quality[live]) - clean))


def _fields_of_a_pixel(seen: ModelInput, unit: float) -> Array:
    """(draws, 2 H W) fields of a dome at rest whose dots scatter by a pixel at 480 rows: motions this small add up."""
    tracker, small_px = seen.tracker, LEVELS_PX[-2] * unit
    rng, rest, count = np.random.default_rng(0), tracker.reference_px, len(tracker.reference_px)
    sure, lost = np.ones(count), np.zeros(count, bool)
    fields = [
        seen.field(DotTracks(0.0, np.arange(count), rest, rest + moved, sure, lost, tracker.size)).channels.ravel()
        for moved in small_px * rng.standard_normal((DRAWS, count, 2))
    ]
    return np.array(fields, np.float64) / LEVELS_PX[-2]
