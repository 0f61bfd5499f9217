"""By how much a pattern can be turned and look alike, and which of its turns a picture shows.

A ring of n dots maps onto itself after 360 / n degrees, so a camera found with a dense ring one dot off still has most
of its dots on blobs. All turns that map some ring onto itself are compared; of those under which as many dots lie on
blobs the one nearest to the expected azimuth counts. The released pattern (counts all even) repeats after 180 degrees,
one of 6, 12, 18 and 24 dots after 60, one whose counts have no common divisor never.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sensing.calibration.dots import neighbour_ratio, spacing_px
from sensing.calibration.search import DOUBT, Scores
from sensing.camera.model import Array
from sensing.camera.mount import MountedCamera, rotation_matrix
from sensing.camera.parameters import camera_vector

SAME_DEG = 2.0  # turns that lie this near to each other are one: no ring has as many as 180 dots
HALF_TURN_DEG = 180.0  # after which the released dots look alike; a half turn is seen when mounting
REACH, MOST_PX = 0.3, 8.0  # of the distance to its neighbour, at most px at 480 rows: so far may a dot lie from a blob


@dataclass(frozen=True)
class Turn:
    """The turn that a picture shows.

    Attributes:
        angle_rad: by which the camera is to be turned about the endcap's axis; 0 where it is right.
        repeats_deg: smallest turn after which the seen dots look alike; 360 where none does.
        away_deg: of the camera then turned, from the expected azimuth.
    """

    angle_rad: float
    repeats_deg: float
    away_deg: float

    @property
    def is_doubtful(self) -> bool:
        """Whether another turn that looks alike may well be the true one: it is not even three times as far away."""
        if self.repeats_deg < HALF_TURN_DEG - SAME_DEG:
            return True
        return self.repeats_deg < 360.0 and abs(self.away_deg) > self.repeats_deg / 4


def best_turn(
    mounted: MountedCamera, blobs_px: Array, points: Array, rings: NDArray[np.intp], azimuth_hint_deg: float
) -> Turn:
    """Compare the turns of a camera that has most dots on blobs.

    Args:
        mounted: the camera.
        blobs_px: (m, 2) found dots.
        points: (n, 3) of the pattern, endcap frame, mm.
        rings: (n,) their ring numbers.
        azimuth_hint_deg: expected turn of the camera about its axis.
    """
    angles = turns_of(rings[mounted.sees(points) & (rings > 0)], rings)
    scores = _scores(mounted, blobs_px, points, angles)
    alike = angles[scores >= scores.max() - DOUBT]
    away = _wrapped(camera_vector(mounted)[7] + alike - np.radians(azimuth_hint_deg))
    nearest = np.abs(away).argmin()
    gaps = np.degrees(np.diff(np.append(alike, alike[0] + 2 * np.pi)))
    repeats_deg = float(gaps[gaps > SAME_DEG].min(initial=360.0))
    return Turn(float(_wrapped(alike[nearest])), repeats_deg, float(np.degrees(away[nearest])))


def turned(mounted: MountedCamera, angle_rad: float) -> MountedCamera:
    """The camera turned about the endcap's axis: it sees the pattern as it did the one turned the other way."""
    turn = np.eye(4)
    turn[:3, :3] = rotation_matrix([0.0, 0.0, angle_rad])
    return replace(mounted, T_camera_endcap=mounted.T_camera_endcap @ turn)


def turns_of(seen: NDArray[np.intp], rings: NDArray[np.intp]) -> Array:
    """Ascending angles from 0 below 2 pi after which some seen ring maps onto itself.

    Args:
        seen: ring numbers of the dots that are seen.
        rings: (n,) those of the whole pattern.
    """
    counts = np.unique(np.bincount(rings)[np.unique(seen)])
    shares = [np.arange(count) / count for count in counts]
    return 2 * np.pi * np.unique(np.concatenate([[0.0], *shares]).round(9))


def _scores(mounted: MountedCamera, blobs_px: Array, points: Array, angles: Array) -> Array:
    """How many dots lie on blobs after each turn, each counting less the farther it lies from one."""
    size = mounted.camera.width_px, mounted.camera.height_px
    usual, most = REACH * spacing_px(blobs_px), MOST_PX * min(size) / 480
    maps = Scores(blobs_px, size, min(usual, most))
    ratio = np.minimum(neighbour_ratio(mounted, points), max(most / usual, 1.0))
    across = (points[:, 0] + 1j * points[:, 1]) * np.exp(1j * angles)[:, None]  # turned points, as from a turned camera
    height = np.broadcast_to(points[:, 2], across.shape)
    pixels = mounted.project(np.stack([across.real, across.imag, height], axis=-1))
    return np.asarray(maps.of(np.where(np.isfinite(pixels), pixels, -1.0), ratio))


def _wrapped(angle_rad: Array) -> Array:
    return np.asarray((angle_rad + np.pi) % (2 * np.pi) - np.pi)
