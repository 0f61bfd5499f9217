"""Error-state Kalman filter: prediction by gyroscopes and accelerometers, updates by cable lengths and contacts.

The model is in docs/robot.md.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sensing.robot import contacts
from sensing.robot.between import measured_errors, settle, turn_slopes
from sensing.robot.contact import contact_of
from sensing.robot.history import AnySample
from sensing.robot.inertial import used_over_step
from sensing.robot.kernels import predict_step
from sensing.robot.layout import Layout
from sensing.robot.measurement_kernels import length_slopes, update_step
from sensing.robot.settings import Contacts, KnownContact, Settings
from sensing.robot.silence import give_up, hold, lead, leading, unmeasured, watch
from sensing.robot.state import INCONSISTENT, MEAN_WEIGHT, SILENT_S, State
from sensing.tensegrity.description import GRAVITY_M_S2, Array
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample

LONGEST_STEP_S = 0.01  # of one predict step; longer intervals are divided
LIMIT = 25.0  # normalised innovation squared beyond which a length is rejected (five standard deviations)
MISFIT = 4.0  # mean normalised innovation squared from which the covariance of the shape is increased
FITS = 1.0  # mean normalised innovation squared of lengths that fit: their variance contains errors that stay, too
LOOSE, LOOSE_M = 0.02, 0.005  # E: standard deviations that are then added per sample, rad and m
# Fading mean of squared normalised errors from which contacts contradict the motion. E: tuning runs stay under 2.6,
# with wrong settings below 3.4 (a hard stop in a run that was held out reaches 9); 157 m/s^2 for 10 ms bring it to 94.
CONTRADICTED = 25.0
LOST_RAD, LOST_M_S, LOST_M = 0.1, 1.0, 0.2  # E: standard deviations that are then added
LOST_S = 0.1  # E: s until contacts show a false velocity, which has moved the robot meanwhile
FREE_NOISE = 5.0  # E: noise density of the acceleration of a robot without accelerometer, m/s^2/sqrt(Hz)


class Filter:
    """Predicts and updates a :class:`sensing.robot.state.State`.

    Args:
        layout: indices and geometry of the robot.
        settings: assumptions on sensors and contacts.
    """

    def __init__(self, layout: Layout, settings: Settings) -> None:
        self.layout, self.settings = layout, settings
        self._led = {bar: layout.led_by(bar) for bar in layout.leaders}
        self._lead = {layout.sensor_of_bar[bar] for bar in layout.leaders}  # sensors of the bars that may lead
        self._bar_of = {name: bar for bar, name in enumerate(layout.sensor_of_bar) if name}
        self._endcap_of = {endcap.name: number for number, endcap in enumerate(layout.robot.endcaps)}
        self._walk = np.tile([settings.rate_bias_walk**2, settings.force_bias_walk**2], (layout.bars, 1))
        self._walk[layout.has_force == 0, 1] = 0.0
        rolls = settings.contacts not in (Contacts.BIT_FIXED, Contacts.NONE)
        self._roll = np.full(layout.endcaps, int(rolls), np.int64)

    def take(
        self, state: State, time_s: float, samples: list[AnySample], coming: Sequence[InertialSample] = ()
    ) -> None:
        """Predict the state to a time and update it by all samples of that time.

        Args:
            state: state that is changed.
            time_s: time, s, not before that of the state.
            samples: inertial samples first, then lengths, then endcaps.
            coming: the next inertial samples, of sensors that have none at that time.
        """
        lead(state, leading(state, time_s, self.layout), self.layout)
        layout = self.led(state)
        if state.held_s or unmeasured(state, time_s, layout):
            return self._hold(state, time_s, samples)
        inertial = [*(sample for sample in samples if isinstance(sample, InertialSample)), *coming]
        if time_s - state.time_s > SILENT_S:  # one sample must not cover so long a silence
            self.predict(state, time_s - LONGEST_STEP_S, inertial)
        self.predict(state, time_s, inertial)
        for sample in samples:
            if isinstance(sample, LengthSample):
                self.lengths(state, sample)
            elif isinstance(sample, FootSample):
                contacts.take(state, self._endcap_of[sample.endcap], sample, layout, self.settings)
            elif isinstance(sample, KnownContact):
                state.known[self._endcap_of[sample.endcap]] = sample
        forces = self.settings.contacts in (Contacts.WRENCH, Contacts.KNOWN)  # a bit alone is wrong too often
        if forces and state.consistency[1] > CONTRADICTED:
            self._loosen_motion(state)

    def led(self, state: State) -> Layout:
        """The layout with the leading bar of a state.

        Args:
            state: state of the filter.
        """
        return self._led[state.leader]

    def measures(self, samples: Sequence[AnySample]) -> bool:
        """Whether the inertial sensor of a bar that may lead is among the samples."""
        return any(isinstance(sample, InertialSample) and sample.sensor in self._lead for sample in samples)

    def _hold(self, state: State, time_s: float, samples: list[AnySample]) -> None:
        hold(state, time_s, self.layout)
        for sample in samples:
            if isinstance(sample, InertialSample):
                bar = self._bar_of[sample.sensor]
                state.rate[bar], state.rate_s[bar] = self.layout.sensor_turn[bar] @ sample.rate_rad_s, time_s
            elif isinstance(sample, LengthSample):
                state.lengths_s[np.isfinite(sample.lengths_m)] = time_s
            elif isinstance(sample, FootSample):
                endcap = self._endcap_of[sample.endcap]
                contacts.hear(state, endcap, contact_of(sample, endcap, self.layout, self.settings))

    def predict(self, state: State, time_s: float, samples: Sequence[InertialSample]) -> None:
        """Predict step to a time.

        Args:
            state: state that is changed.
            time_s: time, s, not before that of the state.
            samples: the next inertial sample of each sensor, of that time or later.
        """
        for sample in samples:
            if sample.time_s <= time_s and not np.isfinite(state.rate_s[self._bar_of[sample.sensor]]):
                self._first_rate(state, self._bar_of[sample.sensor])
        used = used_over_step(state, time_s, samples, self.layout)
        if time_s > state.time_s:
            self._move(state, time_s, used.rate - state.rate_bias, used.force - state.force_bias, used.heard)
        state.time_s = time_s
        for sample in samples:
            if sample.time_s == time_s:
                settle(state, self._bar_of[sample.sensor], self.layout, self.settings)

    def _first_rate(self, state: State, bar: int) -> None:
        """Reset the bias of a gyroscope at its first sample: until then it stood for the angular velocity."""
        at = self.layout.rate_bias(bar)
        state.rate_bias[bar], state.covariance[at], state.covariance[:, at] = 0.0, 0.0, 0.0
        state.covariance[at, at] = self.settings.rate_bias_sd**2 * np.eye(3)

    def _move(self, state: State, time_s: float, rate: Array, force: Array, heard: np.ndarray) -> None:
        layout, leader = self.led(state), state.leader
        unknown = ~np.isfinite(state.rate_s)  # without gyroscope, minus its "bias" is the angular velocity
        rate[~heard[0] & ~unknown] = 0.0
        watch(state, time_s - state.time_s, ~heard[0] & ~unknown)
        own = (layout.has_force == 1) & heard[1]
        if state.began_moving:  # a bar may be turned by 180 degrees then, and its acceleration with it
            own &= np.arange(layout.bars) == leader
        has_force = np.where(own, 1, 2 if own[leader] else 0).astype(np.int64)
        noise = self._noise(rate, force[leader], has_force, heard[0], unknown, leader)
        walk, fade = self._walks(rate[heard[0]], unknown)
        step = time_s - state.time_s
        state.rate_bias *= np.exp(-step * fade)[:, None]
        self._forget_softness(state, step)
        count = max(1, int(np.ceil(step / LONGEST_STEP_S - 1e-9)))
        for _ in range(count):
            predict_step(
                state.covariance, state.turn, state.place, state.velocity, state.anchor, state.normal, state.anchored,
                rate, force, has_force, leader, layout.endcap_bar, layout.radius_m, self._roll, noise, walk, fade,
                step / count, GRAVITY_M_S2,
            )  # fmt: skip

    def _forget_softness(self, state: State, step_s: float) -> None:
        """Relax the softness by a stationary Gauss-Markov process, whose variance never exceeds the first one."""
        at, keep = self.layout.softness, float(np.exp(-step_s / self.settings.softness_stays_s))
        state.softness *= keep
        state.covariance[at] *= keep
        state.covariance[:, at] *= keep
        state.covariance[at, at] += (1 - keep**2) * self.settings.softness_sd**2

    def _noise(
        self, rate: Array, force: Array, has_force: np.ndarray, heard: np.ndarray, unknown: np.ndarray, leader: int
    ) -> Array:
        settings = self.settings
        noise = np.empty((self.layout.bars, 3))
        noise[:, 0] = np.where(heard | unknown, settings.rate_noise, self._unknown_rate(rate[heard])) ** 2
        noise[:, 0] += np.where(np.arange(len(noise)) == leader, 0.0, settings.shape_rate_noise**2)
        if not has_force.any():
            noise[:, 1], noise[:, 2] = FREE_NOISE**2, 0.0
            return noise
        accelerates = abs(float(force @ force) ** 0.5 - GRAVITY_M_S2)
        relative = settings.relative_noise + settings.relative_share * accelerates
        noise[:, 1] = np.where(has_force == 1, settings.force_noise, relative) ** 2
        noise[:, 2] = np.where(has_force == 2, settings.force_noise**2, 0.0)
        if has_force[leader] == 1:
            noise[leader, 1:] = 0.0, settings.force_noise**2
        return noise

    def _walks(self, rate: Array, unknown: np.ndarray) -> tuple[Array, Array]:
        """((B, 2) variances of the biases per second, (B,) decay rates of the gyroscope biases, 1/s).

        For a bar without gyroscope, the negative angular velocity takes the place of the bias.
        """
        settings, walk, fade = self.settings, self._walk, np.zeros(len(unknown))
        if unknown.any():
            walk = walk.copy()
            most, share, least = settings.spin_noise, settings.spin_share, settings.spin_least
            walk[unknown, 0] = min(most, least + share * _root_mean_square(rate) if len(rate) > 1 else most) ** 2
            fade[unknown] = 1 / settings.spin_stays_s
        return walk, fade

    def _unknown_rate(self, rate: Array) -> float:
        """Noise of the angular velocity of a bar without gyroscope, from those (n, 3) that are measured.

        Where two bars are at rest, cables let a third one turn only about itself; one alone may be the axis of a roll.
        """
        settings, most = self.settings, self.settings.unknown_rate_noise
        if len(rate) < 2:
            return most
        return min(most, settings.unknown_rate_least + settings.unknown_rate_share * _root_mean_square(rate))

    def lengths(self, state: State, sample: LengthSample) -> None:
        """Update step with the lengths of the cables.

        Args:
            state: state at the sample's time; it is changed.
            sample: lengths of all measured cables.
        """
        layout = self.led(state)
        length, slopes = length_slopes(
            state.turn, state.place, layout.cable_bars, layout.cable_levers, layout.leader, layout.size
        )
        innovation = np.asarray(sample.lengths_m, float) - length
        since = np.clip(state.time_s - state.lengths_s, 1e-3, 1.0)
        spread = self.settings.length_sd_m**2 + self.settings.length_error_m**2 / since
        variance = spread + measured_errors(state, slopes, layout, self.settings)
        expected = np.einsum("ij,jk,ik->i", slopes, state.covariance, slopes) + variance
        misfits = _misfits(innovation**2 / expected, bool(state.rejected))
        if misfits:  # the steps were too long for straight lines, or the first shape was wrong
            self._loosen(state)
        found = np.empty(len(length))
        change = update_step(state.covariance, slopes, innovation, variance, np.inf if misfits else LIMIT, found)
        state.rejected = int((found < -1).sum())
        taken = found[found >= 0]
        if len(taken):
            state.consistency[0] += MEAN_WEIGHT * (float(taken.mean()) - state.consistency[0])
        state.lengths_s[found >= 0] = state.time_s
        state.correct(change)

    def _loosen(self, state: State) -> None:
        """Increase the covariance of the shape where the lengths no longer fit it."""
        for bar in range(self.layout.bars):
            if bar != state.leader:
                turn, place = self.layout.turn(bar), self.layout.place(bar)
                state.covariance[turn, turn] += LOOSE**2 * np.eye(3)
                state.covariance[place, place] += LOOSE_M**2 * np.eye(3)

    def _loosen_motion(self, state: State) -> None:
        """Increase the covariance of pose and velocity once contacts contradict them.

        One broken sample of an inertial sensor gives a velocity of which the covariance does not know; anchors would
        begin anew wherever the robot flies by, for ever. What it has moved meanwhile is a shift of robot and anchors.
        Where that does not help and lengths do not fit either, linear steps would diverge: the pose is held.
        """
        if state.lost and state.consistency[0] > INCONSISTENT:
            give_up(state)
        layout, larger = self.led(state), float(state.consistency[1]) / CONTRADICTED
        shift = np.zeros((layout.size, 3))
        for bar in range(layout.bars):
            slopes, velocity = turn_slopes(state, bar, layout), layout.velocity(bar)
            state.covariance += (0.0 if state.lost else LOST_RAD**2) * slopes @ slopes.T
            state.covariance[velocity, velocity] += larger * LOST_M_S**2 * np.eye(3)
            shift[layout.place(bar)] = np.eye(3)
        for endcap in np.flatnonzero(state.anchored):
            shift[layout.anchor(int(endcap))] = np.eye(3)
        moved_m = LOST_M + LOST_S * float(np.linalg.norm(state.velocity.mean(axis=0)))
        state.covariance += moved_m**2 * shift @ shift.T
        state.consistency[1], state.lost = 1.0, True


def _misfits(ratio: Array, again: bool) -> bool:
    """Whether lengths do not fit the shape, by squared innovations over their variances (C,), NaN for none.

    One length alone that is off, while all others fit, is a jump of its sensor, unless the last sample had one, too.
    """
    ratio = np.sort(ratio[np.isfinite(ratio)])
    jump = not again and len(ratio) > 1 and ratio[-1] > LIMIT and ratio[:-1].mean() < FITS
    return bool(ratio.mean() > MISFIT and not jump)


def _root_mean_square(rate: Array) -> float:
    """Root mean square of angular velocities (n, 3), rad/s."""
    return float(np.sqrt((rate**2).sum() / len(rate)))
