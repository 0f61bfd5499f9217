"""The inverse of the elastic tangent along a path: a stored inverse with secant updates from the passes since (N, mm).

Symmetric rank-one updates (Conn, Gould, Toint 1991, doi:10.1007/BF01594934): a pass that moved by s and changed the
internal force by y corrects H to H + w w' / (w' y), w = s - H y, so that H y = s. The patch compliance
C = P H P' and its inverse follow by the same rank one. An update that would make C indefinite is left out: the shell is
stable, so its compliance is positive.
"""

from __future__ import annotations

import numpy as np

from sensing.simulator.press.condensed import StoredTangent
from sensing.simulator.solid.element import Array

MAX_UPDATES = 24  # updates after which a new step begins from the stored inverse
LEAST_COSINE = 1e-6  # between w and y; an update below it consists of round-off


class SecantInverse:
    """H, its patch compliance and stiffness.

    Attributes:
        tangent: the stored tangent.
        compliance: C (live, live), mm/N.
        stiffness: inverse of ``compliance``, N/mm.
    """

    def __init__(self, tangent: StoredTangent) -> None:
        self.tangent = tangent
        self.compliance = tangent.compliance
        self.stiffness = tangent.stiffness
        self._updates = np.zeros((0, len(tangent.response)))
        self._scales = np.zeros(0)

    def solve(self, force: Array) -> Array:
        """H applied to forces (unknowns,): displacement (unknowns,), mm."""
        found = self.tangent.factor.solve_roughly(force)
        return np.asarray(found + (self._scales * (self._updates @ force)) @ self._updates)

    def push(self, load: Array) -> Array:
        """H P' load (unknowns,) of forces on the patch (live,)."""
        weights = self._scales * (self._updates[:, self.tangent.rows] @ load)
        return np.asarray(self.tangent.response @ load + weights @ self._updates)

    def learn(self, moved: Array, changed: Array, solved: Array, solved_after: Array, force_after: Array) -> Array:
        """Update the inverse H with one pass.

        Args:
            moved: s (unknowns,), change of the displacement.
            changed: y (unknowns,), change of the force.
            solved: H applied to the force before the pass.
            solved_after: H applied to ``force_after``.
            force_after: (unknowns,) force after the pass.

        Returns:
            The updated H applied to ``force_after``.
        """
        w = moved - (solved_after - solved)
        along = float(w @ changed)
        if (
            abs(along) <= LEAST_COSINE * float(np.linalg.norm(w) * np.linalg.norm(changed))
            or len(self._scales) >= 2 * MAX_UPDATES
        ):
            return solved_after
        local = w[self.tangent.rows]
        spring = self.stiffness @ local
        rise = along + float(local @ spring)
        if not rise / along > LEAST_COSINE:
            return solved_after
        self.compliance = self.compliance + np.outer(local / along, local)
        self.stiffness = self.stiffness - np.outer(spring / rise, spring)
        self._updates = np.vstack([self._updates, w])
        self._scales = np.append(self._scales, 1 / along)
        return np.asarray(solved_after + w * (float(w @ force_after) / along))

    @property
    def full(self) -> bool:
        """Whether a new step should begin from the stored inverse again."""
        return len(self._scales) >= MAX_UPDATES
