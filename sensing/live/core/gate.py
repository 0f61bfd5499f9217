"""Plausibility check of each frame: whether its picture and dots give a valid wrench, and whether the filter takes it.

    gate.frozen(frame), gate.judge(likeness, tracks, estimate, predict)

Four properties are checked, all from the frames since the last restart alone, so that a replay gives the same result:

- the picture as a whole: its correlation with the reference (black, white, noise, another scene);
- the dots: how many are followed, and the correlation of each window. A press lowers it little (0.97 at 50 N in
  simulation); a glint, a speck or a damaged block lowers it much;
- the step of the force against the filter's prediction. Where a window's correlation is below ``SURE``, a step is used
  only if the next frame confirms it: damage is in one picture, a press in all that follow. Otherwise a step is a press
  and is used at once;
- whether the picture changes at all.

Forces in N, times in s of the frames' own clock.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sensing.live.core.gate_kernels import best_tear, block_means
from sensing.live.core.state import Event
from sensing.records import DotTracks, Frame, Image, Wrench

SMALL = (30, 40)  # rows and columns in which pictures are compared as a whole
LEAST_SIDE_PX = 120  # least short side to which a picture is subsampled for the comparison
LEAST_LIKENESS = 0.5  # E: correlation of the small pictures; 0.95 under 52 N, 0 of a black one
SURE = 0.98  # correlation of the worst window above which a step needs no confirmation
CLEAR, CLEAR_PER_N, LEAST_CLEAR = 0.985, 0.001, 0.94  # correlation that a dot keeps, less per N of load at D=130 T=8
STEP_N, STEP_OF_FORCE = 0.35, 0.1  # step that needs confirmation, at D=130 T=8, and more of it under load
TORN, TORN_PX, TORN_SIDE = 0.95, 1.0, 4  # explained by a tear; step in px at 480 rows; dots on either side at least
FROZEN_S, FROZEN_FRAMES = 1.0, 5  # a real sensor has noise: the same picture for so long means a camera that hangs
Predict = Callable[[], NDArray[np.float64] | None]
DISTURBED, UNCONFIRMED = "dots_disturbed", "unconfirmed"
OF_THE_MODEL = "the model flags"  # begins the reason of a reading whose model flags it


@dataclass(frozen=True)
class Verdict:
    """Result of the check of one frame.

    Attributes:
        event: GOOD, FLAGGED or why there is no number.
        reason: one line; empty for a good frame.
        flags: flags of its wrench.
        held: whether the filter must not use the estimate until the next frame confirms it.
    """

    event: Event
    reason: str = ""
    flags: frozenset[str] = frozenset()
    held: bool = False


class Gate:
    """Checks the frames of one endcap, in order.

    Args:
        load_scale: scale of its forces (:mod:`sensing.wrench.load_scale`).
    """

    def __init__(self, load_scale: float = 1.0) -> None:
        self._load_scale = load_scale
        self._same: Frame | None = None  # the first of those that are equal
        self._count = 0
        self._held_n: NDArray[np.float64] | None = None

    def frozen(self, frame: Frame) -> float:
        """Time for which the picture has been the same, s; 0 while that is within the limit."""
        if self._same is None or not frame.shows_same(self._same):
            self._same, self._count = frame, 0
        self._count += 1
        same_s = frame.time_s - self._same.time_s
        return same_s if same_s > FROZEN_S and self._count > FROZEN_FRAMES else 0.0

    def judge(self, likeness: float, tracks: DotTracks | None, estimate: Wrench, predict: Predict) -> Verdict:
        """Verdict on one frame.

        Args:
            likeness: correlation of the picture with the reference (:func:`likeness`).
            tracks: dots of the frame; None for methods without dots.
            estimate: wrench of this frame alone.
            predict: returns the (3,) force that the filter predicts, N; None before its first estimate.
        """
        blind = _blind(likeness, tracks, estimate)
        if blind:
            self._held_n = None
            return Verdict(Event.UNSEEN, blind)
        worst = 1.0 if tracks is None else float(np.where(tracks.lost, 0.0, tracks.quality).min())
        torn = 0.0 if tracks is None else torn_row(tracks)
        expected = predict() if torn or worst < SURE else None
        if torn and expected is None:
            self._held_n = None
            return Verdict(Event.UNSEEN, f"{_torn(torn)}; no picture before it says what it would show")
        held = not torn and worst < SURE and self._is_step(estimate.force_n, expected)
        self._held_n = np.array(estimate.force_n) if held else None
        flags = estimate.flags
        reasons = [f"{OF_THE_MODEL} {', '.join(sorted(flags))}"] if flags else []
        if tracks is not None and (count := disturbed_dots(tracks, estimate.force_n, self._load_scale).sum()):
            flags |= {DISTURBED}
            reasons.append(
                f"{count} of {len(tracks.ids)} dots look otherwise than in the reference: glint, dirt, lamp?"
            )
        if torn:
            flags |= {DISTURBED}
            reasons.append(_torn(torn))
        if held:
            flags |= {UNCONFIRMED}
            reasons.append("the force stepped within one frame: waiting for the next to confirm it")
        return Verdict(Event.FLAGGED if flags else Event.GOOD, "; ".join(reasons), flags, held or torn > 0)

    def _is_step(self, force_n: NDArray[np.float64], predicted_n: NDArray[np.float64] | None) -> bool:
        """Whether the force steps away from the prediction and the frame before does not confirm it."""
        if predicted_n is None:
            return False
        step_n = float(np.linalg.norm(force_n - predicted_n))
        if step_n <= STEP_N * self._load_scale + STEP_OF_FORCE * float(np.linalg.norm(predicted_n)):
            return False
        return self._held_n is None or float(np.linalg.norm(force_n - self._held_n)) > step_n / 2


def disturbed_dots(tracks: DotTracks, force_n: NDArray[np.float64], load_scale: float) -> NDArray[np.bool_]:
    """(n,) whether a dot is lost, or looks otherwise than in the reference by more than a press explains.

    Args:
        tracks: dots of the frame.
        force_n: (3,) estimate of the frame, N.
        load_scale: scale of the endcap's forces.
    """
    clear = max(LEAST_CLEAR, CLEAR - CLEAR_PER_N / load_scale * float(np.linalg.norm(force_n)))
    return np.asarray(tracks.lost | (tracks.quality < clear))


def torn_row(tracks: DotTracks) -> float:
    """Row below which all dots moved sideways alike, as in a picture joined from two frames; 0 if there is none.

    A tear between the dots leaves every window intact. The means above and below one row explain all of such
    displacements, but at most 0.8 of those of any press of the simulated robot.
    """
    row, explained, step_x, step_y = best_tear(tracks.reference_px, tracks.position_px, tracks.lost, TORN_SIDE)
    torn = explained > TORN and step_x > TORN_PX * tracks.size[1] / 480 and step_y < 0.1 * step_x
    return float(row) if torn else 0.0


def _torn(row: float) -> str:
    return f"the picture is torn at row {row:.0f}: check cable and USB load"


def small_picture(gray: Image) -> NDArray[np.float32]:
    """(1200,) block means of the picture, without their mean."""
    step = max(1, min(gray.shape) // LEAST_SIDE_PX)  # every pixel would cost ten times as much
    return block_means(gray, step, *SMALL)


def likeness(small: NDArray[np.float32], reference: NDArray[np.float32]) -> float:
    """Correlation of two small pictures, -1..1; 0 for a flat one."""
    size = float(np.linalg.norm(small) * np.linalg.norm(reference))
    return float(small @ reference) / size if size > 1e-6 else 0.0


def _blind(alike: float, tracks: DotTracks | None, estimate: Wrench) -> str:
    """Reason why this picture gives no valid wrench; empty if it does."""
    hint = "is the lamp on, the lens free, the camera the one that was zeroed?"
    if tracks is not None and not tracks.enough:
        return f"{int((~tracks.lost).sum())} of {len(tracks.ids)} dots are seen: {hint}"
    if alike < LEAST_LIKENESS:
        return f"the picture is not that of the reference (correlation {alike:.2f}): {hint}"
    if "missing" in estimate.flags or not np.isfinite(estimate.force_n).all():
        return f"the model gives no number ({', '.join(sorted(estimate.flags))}): {hint}"
    return ""
