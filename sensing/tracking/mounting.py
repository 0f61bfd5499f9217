"""Whether all dots moved as one: the camera, its lens or the dome in its mount has moved, nothing touches the skin.

A similarity (shift, turn, scale) is fitted to the dots' motion since the reference. A camera that moved leaves almost
nothing of it: on rendered pictures at most 0.2 of the motion, in shifts, turns and zooms of 0.1 to 12 px. A touch moves
the dots near it otherwise than the others, and leaves 0.7 and more (222 presses of 0.5 to 40 N at two sizes); so does
the skin's own weight in another pose (docs/live.md, "Own weight").

Units: full-size pixels, radians.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from sensing.records import DotTracks

MOVED_PX = 0.05  # at 480: motion from which it counts; ten times what the picture's noise makes, 0.2 to 0.6 N
MOUNTING_LEAVES = 0.35  # of the motion, that a similarity leaves of it at most; between 0.2 of a camera, 0.7 of a touch
STILL_PX = 0.15  # at 480: left of no common motion, from which it is a touch; three times what noise makes
LEAST_DOTS = 4


class MotionKind(Enum):
    """What a motion of all dots is."""

    NONE = "none"
    MOUNTING = "mounting"
    CONTACT = "contact"


@dataclass(frozen=True)
class CommonMotion:
    """The similarity motion of all dots since the reference.

    Attributes:
        shift_px: (2,) x, y at the picture's centre. turn_rad: rotation. scale: scale.
        residual_px: third largest dot motion that it leaves; one or two dots may be off for other reasons.
        size: (width, height) of the picture.
    """

    shift_px: NDArray[np.float64]
    turn_rad: float
    scale: float
    residual_px: float
    size: tuple[int, int]

    @property
    def reach_px(self) -> float:
        """How far it moves a dot half of the picture's short side from its centre, at most."""
        arm = min(self.size) / 2
        return float(np.linalg.norm(self.shift_px)) + (abs(self.turn_rad) + abs(self.scale - 1)) * arm

    @property
    def moved(self) -> bool:
        """Whether it is more than noise."""
        return self.reach_px > MOVED_PX * min(self.size) / 480.0

    @property
    def kind(self) -> MotionKind:
        """Of the mounting, of a touch, or none."""
        if self.moved and self.residual_px <= MOUNTING_LEAVES * self.reach_px:
            return MotionKind.MOUNTING
        touched = self.moved or self.residual_px > STILL_PX * min(self.size) / 480.0
        return MotionKind.CONTACT if touched else MotionKind.NONE


def common_motion(tracks: DotTracks) -> CommonMotion | None:
    """The motion that the dots have in common; None where under four of them are seen."""
    live = ~tracks.lost
    if live.sum() < LEAST_DOTS:
        return None
    shift, turn, scale, residual = _fit_similarity(tracks.reference_px[live], tracks.position_px[live], tracks.size)
    return CommonMotion(shift, turn, scale, float(np.sort(residual)[-3]), tracks.size)


class MountingWatch:
    """Says that camera or lens have moved since the reference, once a picture without a touch has shown it.

    A touch hides it, so the last picture without one counts until the next.
    """

    def __init__(self) -> None:
        self.reason = ""

    def update(self, tracks: DotTracks) -> None:
        """The dots of one more picture."""
        motion = common_motion(tracks)
        if motion is None or motion.kind is MotionKind.CONTACT:
            return
        self.reason = ""
        if motion.kind is MotionKind.MOUNTING:
            self.reason = (
                f"camera or lens have moved since the reference (all dots as one, by {motion.reach_px:.2f} px): "
                "zero again when untouched"
            )


def without_motion(tracks: DotTracks, motion: CommonMotion) -> DotTracks:
    """Tracks with a similarity motion taken out."""
    centre = (np.array(tracks.size) - 1) / 2
    arm = tracks.position_px - centre - motion.shift_px
    cos, sin = np.cos(motion.turn_rad) / motion.scale, np.sin(motion.turn_rad) / motion.scale
    back = np.stack([cos * arm[:, 0] + sin * arm[:, 1], -sin * arm[:, 0] + cos * arm[:, 1]], axis=1) + centre
    stretch = None
    if tracks.stretch is not None:
        turn_back = np.array([[cos, sin], [-sin, cos]])
        stretch = turn_back @ (np.eye(2) + tracks.stretch) - np.eye(2)
    return replace(tracks, position_px=back, stretch=stretch)


def _fit_similarity(
    before: NDArray[np.float64], after: NDArray[np.float64], size: tuple[int, int]
) -> tuple[NDArray[np.float64], float, float, NDArray[np.float64]]:
    """(shift at the picture's centre, turn, scale, (N,) residual), robust by two rounds of trimming.

    Complex numbers: after = a before + b with positions from the centre; a = scale exp(i turn); least squares.
    """
    centre = (np.array(size) - 1) / 2
    z = (before - centre) @ np.array([1, 1j])
    w = (after - centre) @ np.array([1, 1j])
    keep = np.ones(len(z), bool)
    for _ in range(3):
        z_mean, w_mean = z[keep].mean(), w[keep].mean()
        arm = z[keep] - z_mean
        a = np.vdot(arm, w[keep] - w_mean) / max(np.vdot(arm, arm).real, 1e-9)
        b = w_mean - a * z_mean
        residual = np.abs(w - (a * z + b))
        keep = residual <= max(2.5 * np.median(residual), 1e-9)
        if keep.sum() < 3:
            break
    return np.array([b.real, b.imag]), float(np.angle(a)), float(abs(a)), residual
