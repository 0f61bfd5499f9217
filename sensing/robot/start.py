"""The first state: shape and attitude of a robot that stands still, with their covariance.

Notes:
    Poses near the ends that the description states, by Gauss and Newton's steps on: cable lengths; gravity in the
    leading bar's accelerometer; where the endcaps' forces are known, that they carry the robot (their sum is vertical
    and its torque about the centre of mass is none, as parts of the weight, so that the scale of the forces does not
    matter). Lengths alone do not fix the shape: at the symmetric prism one motion leaves them as they are to first
    order, and no bar that turns about its own axis changes the length of a cable on that axis. What they leave open
    keeps the width of the first guess, so that the covariance says it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sensing.robot.contact import Contact
from sensing.robot.layout import Layout
from sensing.robot.settings import Settings
from sensing.robot.state import State
from sensing.tensegrity.description import GRAVITY_M_S2, Array
from sensing.tensegrity.shape import cable_lengths, moved, standing_poses

GUESS_SD_M, GUESS_SD = 0.1, 0.3  # E: of the stated ends, of a bar's turn
LEVEL_SD = 0.15  # E: of the ground at the start, where only its normal is known
BALANCE_SD = 0.02  # E: of the sum of forces and its torque, parts of the weight (and m)
OPEN_SD_M, REACH_M = 0.05, 0.4  # E: along the motion that the lengths leave open; half a bar
FIXED_SD = 1e-5  # of what a convention sets: origin and heading
STILL_RATE = 0.05  # rad/s: a gyroscope that shows more at the start is not at rest
SPEED_SD = 0.01  # m/s at rest
ROUNDS, STEP = 30, 1e-6


@dataclass
class Gathered:
    """Means of what was measured while the robot stands.

    Attributes:
        first_s: time of the first sample; NaN before. rate, force: (B, 3) sums, bar axes. lengths: (C,) sums.
        counts: (B, 2) of rates and forces. length_counts: (C,). squares: (B,) sums of squared rates.
    """

    first_s: float
    rate: Array
    force: Array
    counts: Array
    lengths: Array
    length_counts: Array
    squares: Array
    contacts: dict[int, Contact] = field(default_factory=dict)

    def copy(self) -> Gathered:
        """One that can be changed on its own."""
        arrays = [self.rate, self.force, self.counts, self.lengths, self.length_counts, self.squares]
        return Gathered(self.first_s, *[array.copy() for array in arrays], dict(self.contacts))


def nothing_gathered(layout: Layout) -> Gathered:
    """Before the first sample."""
    bars, cables = layout.bars, len(layout.cable_bars)
    return Gathered(
        np.nan, np.zeros((bars, 3)), np.zeros((bars, 3)), np.zeros((bars, 2)), np.zeros(cables), np.zeros(cables),
        np.zeros(bars),
    )  # fmt: skip


def begin(state: State, gathered: Gathered, layout: Layout, settings: Settings) -> None:
    """Set the first state.

    Args:
        state: empty, of the time, is changed. gathered: while the robot stood. layout, settings: of the estimator.
    """
    problem = _Problem(gathered, layout, settings)
    poses, spread = problem.solved()
    shift = -poses[:, :3, 3].mean(axis=0)
    shift[2] = -problem.ground(poses)
    poses[:, :3, 3] += shift
    state.turn = np.ascontiguousarray(poses[:, :3, :3])
    state.place = np.ascontiguousarray(poses[:, :3, 3] + np.einsum("bij,bj->bi", state.turn, layout.reference_m))
    still = gathered.squares <= STILL_RATE**2 * np.maximum(gathered.counts[:, 0], 1)
    counted = np.maximum(gathered.counts[:, :1], 1)
    state.rate_bias = np.where(still[:, None], gathered.rate / counted, 0.0)
    _set_covariance(state, spread, still & (gathered.counts[:, 0] > 0), counted[:, 0], layout, settings)


def _set_covariance(
    state: State, spread: Array, still: np.ndarray, counted: Array, layout: Layout, settings: Settings
) -> None:
    bars, size = layout.bars, layout.size
    slopes = np.zeros((size, 6 * bars))
    leader = 6 * layout.leader + 3
    for bar in range(bars):
        arm = state.turn[bar] @ layout.reference_m[bar]
        slopes[layout.turn(bar), 6 * bar + 3 : 6 * bar + 6] = np.eye(3)
        slopes[layout.place(bar), 6 * bar : 6 * bar + 3] = np.eye(3)
        slopes[layout.place(bar), 6 * bar + 3 : 6 * bar + 6] += _minus_cross(arm)
        slopes[layout.place(bar), leader : leader + 3] -= _minus_cross(state.place[bar])
    state.covariance = slopes @ spread @ slopes.T
    mean_sd = settings.rate_noise * np.sqrt(1 / max(settings.start_s, 0.01)) + 1e-4
    for bar in range(bars):
        at = layout.velocity(bar)
        state.covariance[at, at] += SPEED_SD**2 * np.eye(3)
        at = layout.rate_bias(bar)
        state.covariance[at, at] += (mean_sd if still[bar] else settings.rate_bias_sd) ** 2 * np.eye(3)
        if layout.has_force[bar]:
            at = layout.force_bias(bar)
            state.covariance[at, at] += settings.force_bias_sd**2 * np.eye(3)


def _minus_cross(arm: Array) -> Array:
    x, y, z = arm
    return np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])


class _Problem:
    """Residuals of the shape, each over its standard deviation."""

    def __init__(self, gathered: Gathered, layout: Layout, settings: Settings) -> None:
        self.layout = layout
        self.guess = standing_poses(layout.robot)
        self.contacts = {k: c for k, c in gathered.contacts.items() if c.known and c.touching}
        with np.errstate(invalid="ignore", divide="ignore"):
            self.lengths = gathered.lengths / gathered.length_counts
            force = gathered.force[layout.leader] / gathered.counts[layout.leader, 1]
        self.cables = [cable for cable in layout.robot.cables if cable.measured]
        self.length_sd = settings.length_sd_m
        self.force_sd = settings.force_bias_sd / GRAVITY_M_S2
        self.up = force / np.linalg.norm(force) if np.isfinite(force).all() else None
        self.compliance = settings.compliance_m_n
        if self.up is not None:
            self._level()

    def _level(self) -> None:
        """Turn the guess so that the leader's accelerometer agrees; the heading of the guess stays."""
        up = self.guess[self.layout.leader, :3, :3] @ self.up
        axis = np.cross(up, [0.0, 0.0, 1.0])
        size = float(np.linalg.norm(axis))
        if size < 1e-9:
            return
        step = np.zeros((len(self.guess), 6))
        step[:, 3:] = axis / size * np.arctan2(size, up[2])
        centre = self.guess[:, :3, 3].mean(axis=0)
        turned = moved(self.guess, step.ravel())
        turn = turned[0, :3, :3] @ self.guess[0, :3, :3].T
        turned[:, :3, 3] = centre + (self.guess[:, :3, 3] - centre) @ turn.T
        self.guess = turned

    def solved(self) -> tuple[Array, Array]:
        """(poses, covariance of their steps)."""
        step = np.zeros(6 * len(self.guess))
        jacobian = np.zeros((0, len(step)))
        for _ in range(ROUNDS):
            value = self.residuals(step)
            columns = [
                (self.residuals(step + STEP * e) - self.residuals(step - STEP * e)) / (2 * STEP)
                for e in np.eye(len(step))
            ]
            jacobian = np.array(columns).T
            change = np.linalg.lstsq(jacobian, -value, rcond=None)[0]
            change *= min(1.0, 0.3 / max(float(np.abs(change).max()), 1e-12))
            step = step + change
            if np.abs(change).max() < 1e-7:
                break
        poses = moved(self.guess, step)
        return poses, np.linalg.inv(jacobian.T @ jacobian) + self._open_motion(poses)

    def _open_motion(self, poses: Array) -> Array:
        """Covariance of the motion that changes the cables least: lengths curve along it, and have two solutions."""
        jacobian = cable_lengths(self.layout.robot, poses, self.cables)[1]
        first = 6 * self.layout.leader
        others = [k for k in range(jacobian.shape[1]) if not first <= k < first + 6]
        rows = np.array(jacobian[:, others])
        spins = np.zeros((len(others), len(poses) - 1))
        for column, bar in enumerate(b for b in range(len(poses)) if b != self.layout.leader):
            spins[6 * column + 3 : 6 * column + 6, column] = poses[bar, :3, 2]
        across = np.eye(len(others)) - spins @ spins.T
        metres = np.tile(np.repeat([1.0, REACH_M], 3), len(poses) - 1)  # a turn counts as what it moves an end by
        _, motions = np.linalg.eigh(across @ (rows.T @ rows / np.outer(metres, metres)) @ across + spins @ spins.T)
        motion = np.zeros(jacobian.shape[1])
        motion[others] = motions[:, 0] / metres
        return OPEN_SD_M**2 * np.outer(motion, motion)

    def residuals(self, step: Array) -> Array:
        """(M,) at poses that lie a step from the guess."""
        poses = moved(self.guess, step)
        length = cable_lengths(self.layout.robot, poses, self.cables)[0]
        parts = [np.nan_to_num((length - self.lengths) / self.length_sd)]
        sd = np.tile(np.repeat([GUESS_SD_M, GUESS_SD], 3), len(self.guess))
        first = 6 * self.layout.leader
        sd[first : first + 3], sd[first + 5] = FIXED_SD, FIXED_SD
        parts.append(step / sd)
        if self.up is not None:
            parts.append((poses[self.layout.leader, :3, :3] @ self.up)[:2] / self.force_sd)
        if self.contacts:
            parts += [self._balance(poses), self._level_ground(poses)]
        return np.concatenate(parts)

    def _balance(self, poses: Array) -> Array:
        """(5,) of the sum of the forces, sideways, and of its torque about the centre of mass, parts of the weight."""
        total, torque = np.zeros(3), np.zeros(3)
        layout = self.layout
        lever = np.array([bar.centre_of_mass_m for bar in layout.robot.bars])
        masses = poses[:, :3, 3] + np.einsum("bij,bj->bi", poses[:, :3, :3], lever)
        centre = layout.mass_kg @ masses / layout.mass_kg.sum()
        for endcap, contact in self.contacts.items():
            pose = poses[layout.endcap_bar[endcap]]
            force = pose[:3, :3] @ contact.force_n
            outward = layout.radius_m[endcap] * contact.normal
            point = self._centre(poses, endcap) + pose[:3, :3] @ outward
            total += force
            torque += np.cross(point - centre, force)
        weight = max(float(np.linalg.norm(total)), 1.0)
        return np.concatenate([total[:2], torque]) / weight / BALANCE_SD

    def _level_ground(self, poses: Array) -> Array:
        turn = poses[:, :3, :3]
        normals = [turn[self.layout.endcap_bar[k]] @ contact.normal for k, contact in self.contacts.items()]
        return np.concatenate([normal[:2] for normal in normals]) / LEVEL_SD

    def _centre(self, poses: Array, endcap: int) -> Array:
        bar = self.layout.endcap_bar[endcap]
        return np.asarray(
            poses[bar, :3, 3] + poses[bar, :3, :3] @ (self.layout.endcap_lever[endcap] + self.layout.reference_m[bar])
        )

    def ground(self, poses: Array) -> float:
        """Height of the ground: below the endcaps that touch, else below the lowest."""
        layout = self.layout
        low = [self._centre(poses, k)[2] - layout.radius_m[k] for k in range(layout.endcaps)]
        yields = {k: self.compliance * float(np.linalg.norm(c.force_n)) for k, c in self.contacts.items()}
        return float(np.mean([low[k] + by for k, by in yields.items()])) if yields else min(low)
