"""Force that an endcap reads while nothing touches it: an error, still in the reading under the next touch.

    offset = RestOffset()
    offset.update(estimate, touching)               # every frame that counts
    wrench = offset.widened(wrench)

Lamp, focus, dirt on the lens, a mount that creeps and the skin's own weight change slowly and move the dots by too
little to be distinguished; the network reads it as newtons that its covariance does not hold
(bench/slow_changes.csv: up to 15 standard deviations of a picture without noise). Its cause need not be known: an
untouched endcap carries no load, so what it reads for two seconds is wrong by itself, and the covariance takes its
square. It is not subtracted: a light touch under the contact threshold looks alike. N, N m, s of the frames' own clock.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sensing.records import Wrench

BLOCK_S, LEAST = 1.0, 5  # length of a mean, and readings in it
GAP_S = 1.0  # without a reading: the means begin anew


class RestOffset:
    """Of the frames against one reference.

    A mean counts once the one after it has ended without a touch: what a touch that begins adds is not in it.

    Args:
        begin: (6,) offset to begin with; empty for none.
    """

    def __init__(self, begin: tuple[float, ...] = ()) -> None:
        self._offset = np.array(begin or (0.0,) * 6)
        self._waiting: np.ndarray | None = None
        self._rows: list[np.ndarray] = []
        self._begin_s = self._last_s = float("-inf")

    @property
    def state(self) -> tuple[float, ...]:
        """(6,) force and torque in use, about the sphere's centre; empty where there is none."""
        return tuple(self._offset.tolist()) if self._offset.any() else ()

    def update(self, wrench: Wrench, touching: bool) -> None:
        """One reading that counts.

        Args:
            wrench: of the frame alone, about the sphere's centre.
            touching: whether the endcap is in contact; not where the camera has moved and that explains its force.
        """
        step_s, self._last_s = wrench.time_s - self._last_s, wrench.time_s
        if touching or not 0 < step_s <= GAP_S:
            self._waiting, self._rows = None, []
        if touching:
            return
        if not self._rows:
            self._begin_s = wrench.time_s
        self._rows.append(np.concatenate([wrench.force_n, wrench.torque_nm]))
        if wrench.time_s - self._begin_s >= BLOCK_S and len(self._rows) >= LEAST:
            if self._waiting is not None:
                self._offset = self._waiting
            self._waiting, self._rows = np.mean(self._rows, axis=0), []

    def widened(self, wrench: Wrench) -> Wrench:
        """The wrench with the offset in its covariance."""
        return replace(wrench, covariance=wrench.covariance + np.outer(self._offset, self._offset))
