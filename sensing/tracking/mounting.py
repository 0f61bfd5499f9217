"""Detects a common motion of all dots: camera, lens or dome have moved in their mount, and nothing touches the skin.

Two models are fitted to the motion of the dots since the reference: a similarity of the picture (shift, rotation,
scale), and rotations and shifts of the camera against the dome with a zoom (:mod:`sensing.tracking.camera_motions`). If
the camera moved, the residual of one of them is almost zero. A similarity leaves at most 0.2 of a lens that shifts or
zooms, but 0.6 to 0.8 of a camera that tilted or shifted sideways: its lens is a fisheye and the skin is not equally
far. The camera's own motions leave at most 0.12 of turns of 0.1 to 3 degrees and shifts of 0.1 to 1 mm. A touch moves
the dots near it otherwise than the others: a similarity leaves 0.7 of it and more (222 presses of 0.5 to 40 N at two
sizes), the camera's motions 0.45 and more (154 presses of a plane, 0.3 to 60 N, D = 130; 0.34 of the same scaled to D =
99). The skin's own weight in another pose may look like the camera's, but its own fit leaves less of it
(:mod:`sensing.tracking.own_weight`); of a camera that turns about a point that one leaves 0.23 and more
(bench/own_weight_leaves.csv).

Units: full-size pixels, radians.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from cad.params import EndcapParams
from sensing.records import DotTracks
from sensing.tracking.camera_motions import CameraMotions, third_largest
from sensing.tracking.motion_kernels import similarity
from sensing.tracking.own_weight import OwnWeight

MOVED_PX = 0.05  # at 480: least motion; ten times that due to the picture's noise, and equal to 0.2 to 0.6 N
SIMILARITY_LEAVES = 0.35  # largest residual over the motion if the mounting moved; between 0.2 (lens) and 0.7 (touch)
CAMERA_LEAVES = 0.25  # the same for motions of the camera; between 0.12 and 0.34
HOPELESS = 1.5  # residual of the least-squares fit over that limit from which the robust fit is not tried
ALIKE = 1.25  # a sag's three parameters fit the noise less than a camera's seven
STILL_PX = 0.15  # at 480: residual without common motion, from which it is a touch; three times that of noise
NOISE_LEAVES = 3.0  # M: third largest motion of some 90 dots that only scatter, over the rms of an axis; 3.2 to 3.4
KNOCK_PX = 0.3  # at 480: from one picture to another under a touch; a turn of the endcap moves the skin by less
LEAST_DOTS = 4  # for a similarity
LEAST_DOTS_OF_CAMERA = 20  # for seven motions


class MotionKind(Enum):
    """Kind of a common motion of all dots."""

    NONE = "none"
    MOUNTING = "mounting"
    CONTACT = "contact"


@dataclass(frozen=True)
class CommonMotion:
    """The common motion that fits the dots since the reference best.

    Attributes:
        shift_px: (2,) x, y of the similarity at the picture's centre.
        turn_rad: its rotation.
        scale: its scale.
        reach_px: size of the motion: for a similarity, the largest displacement within half of the picture's short side
            from its centre; for a camera, the third largest displacement of a dot.
        residual_px: third largest residual of a dot, as one or two dots may be off for other reasons.
        leaves: largest residual over the reach that is not a touch.
        size: (width, height) of the picture, px.
        camera_px: (N, 2) displacement of each dot by the camera; None where the motion is the similarity.
        error_px: standard deviation of an axis of a dot at rest, as the reference has it; 0 where it is unknown.
    """

    shift_px: NDArray[np.float64]
    turn_rad: float
    scale: float
    reach_px: float
    residual_px: float
    leaves: float
    size: tuple[int, int]
    camera_px: NDArray[np.float64] | None = None
    error_px: float = 0.0

    @property
    def moved(self) -> bool:
        """Whether the motion exceeds the noise."""
        return self.reach_px > MOVED_PX * min(self.size) / 480.0

    @property
    def kind(self) -> MotionKind:
        """Cause of the motion: the mounting, a touch, or none."""
        left_px = beyond_noise_px(self.residual_px, self.error_px)
        if self.moved and left_px <= self.leaves * self.reach_px:
            return MotionKind.MOUNTING
        touched = self.moved or left_px > STILL_PX * min(self.size) / 480.0
        return MotionKind.CONTACT if touched else MotionKind.NONE


def beyond_noise_px(residual_px: float, error_px: float) -> float:
    """Excess of the third largest residual of a fit over the noise of the dots, px.

    Args:
        residual_px: left by the fit.
        error_px: standard deviation of an axis of a dot at rest.
    """
    return math.sqrt(max(residual_px**2 - (NOISE_LEAVES * error_px) ** 2, 0.0))


def common_motion(
    tracks: DotTracks,
    params: EndcapParams | None = None,
    motions: CameraMotions | None = None,
    error_px: float = 0.0,
) -> CommonMotion | None:
    """The motion that the dots have in common; None where under four of them are seen.

    Args:
        tracks: the dots.
        params: the design; None takes the released.
        motions: of these dots, if they are known.
        error_px: standard deviation of an axis of a dot at rest.
    """
    live = ~tracks.lost
    if live.sum() < LEAST_DOTS:
        return None
    width, height = tracks.size
    *shift_px, turn, scale, residual_px = similarity(
        tracks.reference_px, tracks.position_px, tracks.lost, (width - 1) / 2, (height - 1) / 2
    )
    shift = np.array(shift_px)
    reach = float(np.linalg.norm(shift)) + (abs(turn) + abs(scale - 1)) * min(tracks.size) / 2
    alike = CommonMotion(shift, turn, scale, reach, residual_px, SIMILARITY_LEAVES, tracks.size, error_px=error_px)
    if alike.kind is MotionKind.NONE:
        return alike
    moved = _moved_camera(tracks, alike, motions or CameraMotions.of(tracks.reference_px, tracks.size, params))
    if moved is None or (alike.kind is MotionKind.MOUNTING and alike.residual_px <= moved.residual_px):
        return alike
    return moved


def _moved_camera(tracks: DotTracks, alike: CommonMotion, motions: CameraMotions) -> CommonMotion | None:
    """The camera's own motion where it explains the dots', else None."""
    used = motions.known & ~tracks.lost
    if used.sum() < LEAST_DOTS_OF_CAMERA:
        return None
    moved = tracks.displacement_px
    quick = motions.of_all(moved)
    left_px = beyond_noise_px(third_largest((moved - quick)[used]), alike.error_px)
    if left_px > HOPELESS * CAMERA_LEAVES * third_largest(quick[used]):
        return None
    camera = motions.of_most(moved, used)
    reach, left = third_largest(camera[used]), third_largest((moved - camera)[used])
    found = replace(alike, reach_px=reach, residual_px=left, leaves=CAMERA_LEAVES, camera_px=camera)
    return found if found.kind is MotionKind.MOUNTING else None


class MountingWatch:
    """Detects that camera or lens have moved since the reference, from a picture without a touch.

    A touch hides it, so the last picture without one counts until the next. Only a knock shows under a touch: all dots
    move as one from one picture to the next and are still there in the one after it. Of what a press changes from one
    picture to another the camera's fit leaves 0.29 and more (12,696 changes along the library's paths, five designs).
    Until the second of the two confirms it the first is in doubt: its camera was knocked, or it alone is shifted. A
    picture says nothing while most dots are hidden: few dots move as one beside any touch. The dots are those of one
    reference.

    Args:
        params: the design; None takes the released.
        reason: to begin with, of a watch before this one.
        error_px: standard deviation of an axis of a dot at rest; 0 where it is unknown.

    Attributes:
        reason: says so, and what to do; empty where nothing has moved.
        doubt: what is wrong with the last picture, if the next one does not show otherwise; else empty.
        motion: what the last picture's dots have in common; None where under four of them are seen.
    """

    def __init__(self, params: EndcapParams | None = None, reason: str = "", error_px: float = 0.0) -> None:
        self.reason, self._params, self._error_px = reason, params, error_px
        self.doubt = ""
        self.motion: CommonMotion | None = None
        self._motions: CameraMotions | None = None
        self._last: DotTracks | None = None  # the picture before this one
        self._before: DotTracks | None = None  # that before a step which the next picture has to confirm

    @property
    def untouched(self) -> bool:
        """Whether the last picture shows a camera that has moved and, as that explains all dots, no touch."""
        return bool(self.reason) and self.motion is not None and self.motion.kind is MotionKind.MOUNTING

    def update(self, tracks: DotTracks, own_weight: OwnWeight | None = None) -> None:
        """The dots of one more picture.

        Args:
            tracks: its dots.
            own_weight: looked for in the same dots: where it explains them, or leaves no more of their motion than the
                mounting does, the endcap was turned; None where it is not looked for.
        """
        if self._motions is None:
            self._motions = CameraMotions.of(tracks.reference_px, tracks.size, self._params)
        motion = self.motion = common_motion(tracks, motions=self._motions, error_px=self._error_px)
        self.doubt = ""
        if motion is None or not tracks.enough:
            return
        knocked = self._knocked(tracks, own_weight)
        if motion.kind is MotionKind.CONTACT:
            if knocked:
                self.reason = (
                    "camera or lens have moved under the touch (all dots as one from one picture to the next): zero "
                    "again when untouched"
                )
            elif self._before is not None:
                self.doubt = "all dots moved as one within one picture: waiting for the next to show whether they stay"
            return
        self.reason = ""
        turned = own_weight is not None and (own_weight.explains or own_weight.left_px <= ALIKE * motion.residual_px)
        if motion.kind is MotionKind.MOUNTING and not turned:
            self.reason = (
                f"camera or lens have moved since the reference (all dots as one, by {motion.reach_px:.2f} px): "
                "zero again when untouched"
            )

    def _knocked(self, tracks: DotTracks, own_weight: OwnWeight | None) -> bool:
        """Whether all dots moved as one a picture ago, and have stayed there."""
        last, before, self._last, self._before = self._last, self._before, tracks, None
        if before is not None and last is not None:  # a picture that is shifted alone is followed by the way back
            return self._is_knock(before, tracks, own_weight) or not self._is_knock(last, tracks, own_weight)
        if last is not None and self._is_knock(last, tracks, own_weight):
            self._before = last
        return False

    def _is_knock(self, before: DotTracks, now: DotTracks, own_weight: OwnWeight | None) -> bool:
        """Whether the mounting explains the motion from one picture to another, and own weight does not."""
        least_px = KNOCK_PX * min(now.size) / 480.0
        moved, lost = now.position_px - before.position_px, before.lost | now.lost
        if np.count_nonzero(~lost) < LEAST_DOTS_OF_CAMERA or third_largest(moved[~lost]) < least_px:
            return False
        step = replace(now, position_px=now.reference_px + moved, lost=lost, stretch=None)
        found = common_motion(step, motions=self._motions, error_px=math.sqrt(2.0) * self._error_px)
        if found is None or found.kind is not MotionKind.MOUNTING or found.reach_px < least_px:
            return False
        return own_weight is None or not own_weight.left_of(step) <= ALIKE * found.residual_px


def without_motion(tracks: DotTracks, motion: CommonMotion) -> DotTracks:
    """Tracks with a common motion taken out, and without their stretch."""
    if motion.camera_px is not None:
        return replace(tracks, position_px=tracks.position_px - motion.camera_px, stretch=None)
    centre = (np.array(tracks.size) - 1) / 2
    arm = tracks.position_px - centre - motion.shift_px
    cos, sin = np.cos(motion.turn_rad) / motion.scale, np.sin(motion.turn_rad) / motion.scale
    back = np.stack([cos * arm[:, 0] + sin * arm[:, 1], -sin * arm[:, 0] + cos * arm[:, 1]], axis=1) + centre
    return replace(tracks, position_px=back, stretch=None)
