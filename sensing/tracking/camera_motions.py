"""How dots move in the picture when the camera turns or shifts against the dome, or its lens zooms.

Where a dot is seen says its ray, the ray its place on the undeformed skin, and that how it moves: seven small motions,
of the first order. The camera of the design is taken for all: a turn about its axis changes nothing, some degrees of
tilt or another lens change the motions by a few percent.

Units: full-size pixels, mm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cad.params import EndcapParams
from sensing.camera.nominal import nominal_mount

Array = NDArray[np.float64]
RELEASED = EndcapParams(130.0, 8.0)  # used where the endcap is unknown
MOTIONS = 7  # three turns, three shifts, zoom
ROUNDS = 3  # of fitting, each without what the last one left


@dataclass(frozen=True)
class CameraMotions:
    """The motions of some dots.

    Attributes:
        by_motion: (N, 2, 7) px, each motion of about 1 px; zero for a dot that the design's camera does not see on the
            skin.
        known: (N,) whether it does.
        to_motion: (7, 2 N) fit to all dots alike.
    """

    by_motion: Array
    known: NDArray[np.bool_]
    to_motion: Array

    @classmethod
    def of(cls, place_px: Array, size: tuple[int, int], params: EndcapParams | None = None) -> CameraMotions:
        """Those of dots at (N, 2) in an undeformed picture.

        Args:
            place_px: of the dots.
            size: (width, height) of the picture.
            params: the design; None takes the released.

        Raises:
            ParameterError: a picture that stands upright.
        """
        design = params or RELEASED
        mounted = nominal_mount(design, *size)
        on_skin = mounted.on_sphere(place_px, (0.0, 0.0, design.centre_height_mm), design.inner_radius_mm)
        known: NDArray[np.bool_] = np.asarray(np.isfinite(on_skin).all(axis=1))
        points = mounted.to_camera(np.where(known[:, None], on_skin, (0.0, 0.0, design.tip_height_mm)))
        by_point, by_lens = mounted.camera.jacobians(points)
        turned = np.cross(np.eye(3), points[:, None])  # (N, 3 axes, 3): how a point moves with each turn
        zoomed = by_lens[..., 0] + by_lens[..., 1]
        by_motion = np.concatenate([by_point @ turned.transpose(0, 2, 1), by_point, zoomed[..., None]], axis=2)
        by_motion[~known] = 0.0
        by_motion /= np.maximum(np.sqrt((by_motion**2).sum(axis=1).mean(axis=0)), 1e-12)
        return cls(by_motion, known, np.linalg.pinv(by_motion.reshape(-1, MOTIONS), rcond=1e-6))

    def of_all(self, moved_px: Array) -> Array:
        """(N, 2) the camera's share of a motion (N, 2) of the dots, fitted to all of them alike: quick."""
        return self.by_motion @ (self.to_motion @ moved_px.ravel())

    def of_most(self, moved_px: Array, used: NDArray[np.bool_]) -> Array:
        """The same, robust by rounds of trimming.

        Args:
            moved_px: (N, 2).
            used: (N,) dots to fit to.
        """
        keep = used = used & self.known
        motion = np.zeros(moved_px.shape)
        for _ in range(ROUNDS):
            rows = self.by_motion[keep].reshape(-1, MOTIONS)
            normal = rows.T @ rows + 1e-9 * np.eye(MOTIONS)  # its condition is under 3e3 at every size
            motion = self.by_motion @ np.linalg.solve(normal, rows.T @ moved_px[keep].ravel())
            left = np.linalg.norm(moved_px - motion, axis=1)
            keep = used & (left <= max(2.5 * float(np.median(left[used])), 1e-9))
            if keep.sum() <= MOTIONS:
                break
        return motion


def third_largest(moved: Array) -> float:
    """Of the lengths of (n, 2) motions: one or two dots may be off for other reasons."""
    return float(np.partition(np.hypot(moved[:, 0], moved[:, 1]), -3)[-3])
