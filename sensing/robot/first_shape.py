"""Shape and attitude of a robot that stands at the start, from its first measurements.

Notes:
    The poses minimise squared residuals by Gauss-Newton steps, from the ends that the description states. Residuals
    are those of cable lengths; of gravity in the bars' accelerometers; of the balance of each bar under its weight,
    its contacts and its cables. The tensions are unknowns with priors at the stated rest lengths; the forces are
    scaled to carry the weight, so that a silicone of another stiffness does not matter. The force on a silent endcap
    is unknown, and so is then that scale: both are solved for beside the tensions. Lengths alone do not determine
    the shape: at the symmetric prism one motion does not change them to first order, and a bar that turns about its
    own axis does not change the length of a cable on that axis. The covariance contains these motions.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sensing.robot.contact import Contact
from sensing.robot.layout import Layout
from sensing.robot.settings import Settings
from sensing.tensegrity.description import GRAVITY_M_S2, Array
from sensing.tensegrity.shape import cable_lengths, moved, rotation_of, standing_poses
from sensing.tensegrity.vectors import cross

GUESS_SD_M, GUESS_SD, SPIN_SD = 0.1, 0.3, 1.0  # E: of the stated ends; of a bar's rotation; of one about its axis
LEVEL_SD = 0.15  # E: rad, of the ground at the start, where only its normal is known
BALANCE_SD_N, BALANCE_SD_NM = 2.0, 0.5  # E: of the balance of forces and torques of one bar
SILENT_SHARE, SCALE_SD = 1 / 3, 0.3  # E: of the force on a silent endcap, over the weight; of the scale of the others
MEANS = 4.0  # E: by this factor means over the start are more accurate than one sample
REST_SD_M = 0.005  # E: of a rest length, which a motor may have changed
OPEN_SD_M, REACH_M = 0.03, 0.4  # E: along the motion that the lengths do not determine; half a bar
FIXED_SD = 1e-5  # of the origin and the heading, which are set by convention
ROUNDS, STEP, HALVED = 15, 1e-6, 5  # Gauss-Newton steps; step of the finite differences, m and rad; halvings of a step
# First guesses; those that are followed; squared residual above which a guess costs no more.
SPINS, STARTS, MOST_SQUARE = 12, 3, 100.0
DOUBTED_STARTS = 8  # guesses that are followed where an endcap is silent, because there are more solutions then
DOUBT = 4.0  # E: divisor of the squared residuals of several solutions, since their errors are not independent
LEAST_ACROSS = 0.1  # E: part of gravity across a bar below which it does not show how the bar is turned about its axis
UNBALANCED = 25.0  # E: sum of squared residuals of the balance above which the forces do not fit the robot,
UNBALANCED_KG = 12.0  # of this mass or less; forces of a heavier one are off by more newtons


class _Descent(NamedTuple):
    """End of a descent: sum of squared residuals, guess (B, 4, 4), step (6 B,) from it, Jacobian of the residuals."""

    cost: float
    guess: Array
    step: Array
    jacobian: Array


class FirstShape:
    """Residuals of the shape, each over its standard deviation, and the poses that minimise their squares.

    Args:
        lengths: (C,) lengths of the measured cables, m; NaN where unknown.
        force: (B, 3) specific forces of the bars' accelerometers, bar axes, m/s2; NaN for a bar without.
        contacts: contacts of the endcaps by number.
        layout, settings: indices and assumptions of the estimator.
    """

    def __init__(
        self, lengths: Array, force: Array, contacts: dict[int, Contact], layout: Layout, settings: Settings
    ) -> None:
        self.layout = layout
        self.contacts = {k: c for k, c in contacts.items() if c.known and c.touching}
        heard = [k for k, c in contacts.items() if c.touching is False or np.isfinite(c.force_n).all()]
        self.silent = sorted(set(range(layout.endcaps)) - set(heard))  # each may carry a load that balances the others
        self.lengths = lengths
        self.measured = [row for row, cable in enumerate(layout.robot.cables) if cable.measured]
        self.length_sd = max(settings.length_sd_m / MEANS, settings.length_error_m)
        self.force_sd = settings.force_bias_sd / GRAVITY_M_S2
        measured = {bar: row for bar, row in enumerate(force) if np.isfinite(row).all()}
        self.ups = {bar: row / np.linalg.norm(row) for bar, row in measured.items()}
        self.up = self.ups.pop(layout.leader, None)  # the leader's, in two components: first guesses try its turns
        self.compliance = [layout.compliance_m_n(endcap, settings) for endcap in range(layout.endcaps)]
        self.guess = self._guess(0.0)

    def _guess(self, spin: float) -> Array:
        """The stated shape, lying, after a rotation of the leader about its own axis, rad."""
        poses, leader = standing_poses(self.layout.robot), self.layout.leader
        if self.up is None:
            return poses
        poses[leader, :3, :3] = poses[leader, :3, :3] @ rotation_of(np.array([0.0, 0.0, spin]))
        up = poses[leader, :3, :3] @ self.up
        axis = cross(up, [0.0, 0.0, 1.0])
        size = float(np.linalg.norm(axis))
        turn = rotation_of(axis / max(size, 1e-9) * math.atan2(size, up[2]))
        heading = math.atan2(*poses[leader, 1::-1, 2])
        poses[:, :3] = turn @ poses[:, :3]
        turned = heading - math.atan2(*poses[leader, 1::-1, 2])  # of two guesses that look alike one more sample may
        poses[:, :3] = rotation_of(np.array([0.0, 0.0, turned])) @ poses[:, :3]  # choose: their headings are one
        return self._spun(poses)

    def _spun(self, poses: Array) -> Array:
        """Poses with the other bars turned about their axes: normals point down, and measured gravity too."""
        down: dict[int, list[Array]] = {}
        for endcap, contact in self.contacts.items():
            down.setdefault(int(self.layout.endcap_bar[endcap]), []).append(contact.normal)
        for bar, normals in down.items():
            if bar != self.layout.leader:
                x, y = np.sum(normals, axis=0)[:2]
                wanted = -poses[bar, 2, :2]  # of the world's z, in bar axes
                angle = math.atan2(wanted[1], wanted[0]) - math.atan2(y, x)
                poses[bar, :3, :3] = poses[bar, :3, :3] @ rotation_of(np.array([0.0, 0.0, angle]))
        for bar, up in self.ups.items():
            if math.hypot(up[0], up[1]) > LEAST_ACROSS:
                angle = math.atan2(poses[bar, 2, 1], poses[bar, 2, 0]) - math.atan2(up[1], up[0])
                poses[bar, :3, :3] = poses[bar, :3, :3] @ rotation_of(np.array([0.0, 0.0, angle]))
        return poses

    def solved(self) -> tuple[Array, Array]:
        """(poses, covariance of their steps): the best of several starts, since there are several solutions."""
        count = SPINS if self.contacts else 1
        guesses = [self._guess(spin) for spin in np.linspace(0, 2 * math.pi, count, endpoint=False)]
        guesses.sort(key=self._cost)
        starts = guesses[: DOUBTED_STARTS if self.silent else STARTS]
        found = sorted((self._descended(guess) for guess in starts), key=lambda one: one.cost)
        _, self.guess, step, jacobian = found[0]
        poses = moved(self.guess, step)
        others = np.zeros((len(step), len(step)))
        if self.silent:  # turns may be open: where they are, their axes are those of the poses, not those of the guess
            others = _spread_over([(one.cost, moved(one.guess, one.step)) for one in found])
            self.guess, step = poses, np.zeros(len(step))
            jacobian = self._slopes(step, self.residuals(step))
        motion = self._open_motion(poses)
        spread = np.linalg.inv(jacobian.T @ jacobian) + OPEN_SD_M**2 * np.outer(motion, motion)
        return poses, spread + others

    def balances(self, poses: Array) -> bool:
        """Whether bars in these poses are in equilibrium under the endcaps' wrenches with some likely tensions."""
        if not self.contacts:
            return True
        off = self._balance(poses, *cable_lengths(self.layout.robot, poses))
        heavier = max(1.0, float(self.layout.mass_kg.sum()) / UNBALANCED_KG)
        return float(off @ off) < UNBALANCED * heavier**2

    def _cost(self, guess: Array) -> float:
        self.guess = guess
        value = self.residuals(np.zeros(6 * len(guess)))
        return float(np.minimum(value**2, MOST_SQUARE).sum())

    def _descended(self, guess: Array) -> _Descent:
        """The descent from a guess by Gauss-Newton steps, each shortened until the cost falls."""
        self.guess, step = guess, np.zeros(6 * len(guess))
        value = self.residuals(step)
        cost, jacobian = float(value @ value), np.zeros((len(value), len(step)))
        for _ in range(ROUNDS):
            jacobian = self._slopes(step, value)
            change = np.linalg.lstsq(jacobian, -value, rcond=None)[0]
            change *= min(1.0, 0.3 / max(float(np.abs(change).max()), 1e-12))
            for _ in range(HALVED):
                tried = self.residuals(step + change)
                if float(tried @ tried) < cost:
                    break
                change = change / 2
            else:
                break
            gained, cost = cost - float(tried @ tried), float(tried @ tried)
            step, value = step + change, tried
            if gained < 1e-3 * cost:
                break
        return _Descent(cost, guess, step, jacobian)

    def _slopes(self, step: Array, value: Array) -> Array:
        return np.array([(self.residuals(step + STEP * e) - value) / STEP for e in np.eye(len(step))]).T

    def _open_motion(self, poses: Array) -> Array:
        """(6 B,) motion by a metre that changes the cables least; along it two shapes can have the same lengths."""
        jacobian = cable_lengths(self.layout.robot, poses)[1][self.measured]
        first = 6 * self.layout.leader
        others = [k for k in range(jacobian.shape[1]) if not first <= k < first + 6]
        rows = np.array(jacobian[:, others])
        spins = np.zeros((len(others), len(poses) - 1))
        for column, bar in enumerate(b for b in range(len(poses)) if b != self.layout.leader):
            spins[6 * column + 3 : 6 * column + 6, column] = poses[bar, :3, 2]
        across = np.eye(len(others)) - spins @ spins.T
        metres = np.tile(np.repeat([1.0, REACH_M], 3), len(poses) - 1)  # a rotation counts as the motion of a bar's end
        _, motions = np.linalg.eigh(across @ (rows.T @ rows / np.outer(metres, metres)) @ across + spins @ spins.T)
        motion = np.zeros(jacobian.shape[1])
        motion[others] = motions[:, 0] / metres
        return motion

    def residuals(self, step: Array) -> Array:
        """(M,) residuals at poses that lie a step from the guess."""
        poses = moved(self.guess, step)
        cables = cable_lengths(self.layout.robot, poses)
        parts = [np.nan_to_num((cables[0][self.measured] - self.lengths) / self.length_sd)]
        parts += [self._near_guess(step)]
        if self.up is not None:
            parts.append((poses[self.layout.leader, :3, :3] @ self.up)[:2] / self.force_sd)
        parts += [(poses[bar, :3, :3] @ up - [0.0, 0.0, 1.0]) / self.force_sd for bar, up in self.ups.items()]
        if self.contacts:
            parts.append(self._level_ground(poses))
        if self.contacts:
            parts.append(self._balance(poses, *cables))
        return np.concatenate(parts)

    def _near_guess(self, step: Array) -> Array:
        """(6 B,) residuals of the steps; rotations in bar axes, the leader's in world axes, whose heading is fixed."""
        steps = step.reshape(-1, 6).copy()
        steps[:, :3] /= GUESS_SD_M
        steps[:, 3:] = np.einsum("bji,bj->bi", self.guess[:, :3, :3], steps[:, 3:]) / [GUESS_SD, GUESS_SD, SPIN_SD]
        leader = self.layout.leader
        steps[leader] = step[6 * leader : 6 * leader + 6] / [FIXED_SD, FIXED_SD, FIXED_SD, GUESS_SD, GUESS_SD, FIXED_SD]
        return np.asarray(steps.ravel())

    def _balance(self, poses: Array, lengths: Array, jacobian: Array) -> Array:
        """(6 B + C,) residuals of forces and torques on each bar, about its centre of mass, and of best tensions."""
        layout, cables = self.layout, self.layout.robot.cables
        centre = poses[:, :3, 3] + np.einsum("bij,bj->bi", poses[:, :3, :3], layout.reference_m + layout.mass_lever)
        loads, carried = self._contact_loads(poses, centre)
        weight = float(layout.mass_kg.sum()) * GRAVITY_M_S2
        if not self.silent:
            loads *= weight / max(carried, weight / 4)
        known = loads.copy()
        known[:, 2] -= layout.mass_kg * GRAVITY_M_S2
        pulls = -jacobian.reshape(len(cables), len(poses), 6)  # a cable pulls against its lengthening
        pulls[..., 3:] += np.cross(poses[:, :3, 3] - centre, pulls[..., :3])
        stiffness = np.array([cable.stiffness_n_m for cable in cables])
        stated = stiffness * np.maximum(0.0, lengths - [cable.rest_m for cable in cables])
        sds = stiffness * REST_SD_M
        if self.silent:  # further unknowns: scale of the loads and forces on silent endcaps
            pushes = self._silent_loads(poses, centre)
            pulls = np.concatenate([pulls, loads[None], pushes])
            stated = np.concatenate([stated, np.zeros(1 + len(pushes))])
            sds = np.concatenate([sds, [SCALE_SD], np.full(len(pushes), SILENT_SHARE * weight)])
        spread = np.tile(np.repeat([BALANCE_SD_N, BALANCE_SD_NM], 3), len(poses))
        rows = np.concatenate([pulls.reshape(len(pulls), -1).T / spread[:, None], np.diag(1 / sds)])
        wanted = np.concatenate([-known.ravel() / spread, stated / sds])
        return np.asarray(rows @ np.linalg.lstsq(rows, wanted, rcond=None)[0] - wanted)

    def _contact_loads(self, poses: Array, centre: Array) -> tuple[Array, float]:
        """((B, 6) forces of the reporting contacts on each bar and torques about its centre, N, N m; N upward)."""
        loads, carried = np.zeros((len(poses), 6)), 0.0
        for endcap, contact in self.contacts.items():
            bar = self.layout.endcap_bar[endcap]
            turn = poses[bar, :3, :3]
            force = turn @ contact.force_n
            point = self._centre(poses, endcap) + turn @ (self.layout.radius_m[endcap] * contact.normal)
            loads[bar] += np.concatenate([force, cross(point - centre[bar], force)])
            carried += float(force[2])
        return loads, carried

    def _silent_loads(self, poses: Array, centre: Array) -> Array:
        """(3 S, B, 6) loads on the bars by 1 N along each world axis at the lowest point of each silent endcap."""
        loads = np.zeros((len(self.silent), 3, len(poses), 6))
        for pushes, endcap in zip(loads, self.silent, strict=True):
            bar = self.layout.endcap_bar[endcap]
            arm = self._centre(poses, endcap) - [0.0, 0.0, self.layout.radius_m[endcap]] - centre[bar]
            for push, axis in zip(pushes, np.eye(3), strict=True):
                push[bar] = np.concatenate([axis, cross(arm, axis)])
        return loads.reshape(-1, len(poses), 6)

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
        """Height of the ground, m: below the endcaps that touch, else below the lowest."""
        layout = self.layout
        low = [self._centre(poses, k)[2] - layout.radius_m[k] for k in range(layout.endcaps)]
        yields = {k: self.compliance[k] * float(np.linalg.norm(c.force_n)) for k, c in self.contacts.items()}
        return float(np.mean([low[k] + by for k, by in yields.items()])) if yields else min(low)


def _spread_over(found: list[tuple[float, Array]]) -> Array:
    """(6 B, 6 B) second moment of several solutions about the first, weighted by their likelihood.

    Args:
        found: (cost, poses (B, 4, 4)) of each, the best one first.
    """
    best, poses = found[0]
    likely = np.exp([(best - cost) / (2 * DOUBT) for cost, _ in found])
    away = np.empty((len(found), len(poses), 6))
    for row, (_, other) in zip(away, found, strict=True):
        row[:, :3] = other[:, :3, 3] - poses[:, :3, 3]
        row[:, 3:] = [_vector_of(there[:3, :3] @ here[:3, :3].T) for there, here in zip(other, poses, strict=True)]
    rows = away.reshape(len(found), -1)
    return np.asarray(rows.T @ (likely[:, None] * rows) / likely.sum())


def _vector_of(turn: Array) -> Array:
    """(3,) rotation vector, rad, of a rotation by less than half a turn."""
    twice = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    size = float(np.linalg.norm(twice))
    return np.asarray(twice * (math.atan2(size, float(np.trace(turn)) - 1) / size if size > 1e-12 else 0.5))
