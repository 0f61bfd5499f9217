"""The largest error of one weight that the poses of a weighing would not have shown, and what it does to the gain.

    missed = unnoticed(poses)                  # of poses that agree
    missed.weight_part, missed.gain_part       # 0.12, 0.07: 12 % of a weight, 7 % of the gain

The stated deviation of a gain holds for weights that are right to their own deviation. A weight that is wrong by more,
because a plate was forgotten or another weight was typed, shows only where it makes the poses contradict one another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from sensing.weighing.gain import Pose, WeighingError, fit_gain

LARGEST = 0.5  # of a weight; errors beyond it are not looked at
STEPS = 10  # halvings of the interval: to 0.05 % of a weight


@dataclass(frozen=True)
class Unnoticed:
    """Largest errors that pass.

    Attributes:
        weight_part: of one weight, as a part of it.
        gain_part: of the gain that such a weight leads to, as a part of the gain.
    """

    weight_part: float
    gain_part: float


def unnoticed(poses: Sequence[Pose]) -> Unnoticed:
    """Largest error of a single weight, too light or too heavy, with which these poses still make a gain.

    Args:
        poses: poses that agree (:func:`sensing.weighing.gain.fit_gain` takes them).
    """
    right = fit_gain(poses).gain
    found = Unnoticed(0.0, 0.0)
    for number in range(len(poses)):
        for sign in (-1.0, 1.0):
            part, gain = _largest(poses, number, sign, right)
            found = Unnoticed(max(found.weight_part, part), max(found.gain_part, abs(gain / right - 1)))
    return found


def _largest(poses: Sequence[Pose], number: int, sign: float, right: float) -> tuple[float, float]:
    """(largest part of a weight by which it may be wrong, the gain then); ``right`` is the gain without an error."""
    low, high, gain = 0.0, LARGEST, right
    for _ in range(STEPS):
        middle = (low + high) / 2
        try:
            gain = fit_gain(_changed(poses, number, 1 + sign * middle)).gain
            low = middle
        except WeighingError:
            high = middle
    return low, gain


def _changed(poses: Sequence[Pose], number: int, factor: float) -> list[Pose]:
    """The poses, one of them with another weight."""
    return [replace(pose, load_n=factor * pose.load_n) if k == number else pose for k, pose in enumerate(poses)]
