"""Assumptions of the estimator on sensors and contacts, and the data of endcaps that it uses (m, s, N, rad)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from sensing.tensegrity.description import Array


class Contacts(Enum):
    """Data of endcaps that the estimator uses; all but WRENCH are for comparison."""

    NONE = "none"  # inertial sensors and cable lengths alone
    BIT_FIXED = "bit_fixed"  # contact bit; the sphere's centre is fixed while it touches
    BIT_ROLLING = "bit_rolling"  # contact bit; the sphere rolls on level ground
    WRENCH = "wrench"  # force, normal, friction ratio and their covariance
    KNOWN = "known"  # true contacts of a simulation: normal, and whether they slip


@dataclass(frozen=True)
class KnownContact:
    """True contact of a simulation, for ``Contacts.KNOWN``.

    Attributes:
        time_s: time of a reading of the same endcap, s.
        endcap: name of the endcap.
        holds: whether it touches and does not slip.
        normal: (3,) unit normal, out of the endcap, endcap frame.
    """

    time_s: float
    endcap: str
    holds: bool
    normal: Array


@dataclass(frozen=True)
class Settings:
    """Assumptions of the estimator; E: our estimates, tuned on simulated walks that no published number uses.

    Noises were chosen by the logarithmic score of the stated poses, e' P^-1 e + log det P (Gneiting and Raftery 2007,
    doi:10.1198/016214506000001437), over tuning runs; it penalises a covariance that is too wide or too narrow.

    Attributes:
        contacts: data of the endcaps that are used.
        rate_noise, force_noise: noise densities of gyroscope (rad/s/sqrt(Hz)) and accelerometer (m/s^2/sqrt(Hz)).
        rate_bias_walk, force_bias_walk: random walks of their biases (rad/s, m/s^2 per sqrt(s)).
        rate_bias_sd, force_bias_sd: standard deviations of the biases at the start (rad/s, m/s^2).
        shape_rate_noise: added to the rates of all bars but the leading one, for errors of linear steps in the shape.
        unknown_rate_noise: largest noise of the rate of a bar whose gyroscope is silent (rad/s/sqrt(Hz)).
        unknown_rate_share, unknown_rate_least: where two others or more measure, it is at most this many times their
            rates' root mean square (1/sqrt(Hz)), plus the least (rad/s/sqrt(Hz)): if they are at rest, so is it.
        spin_noise: noise of the angular velocity of a bar without gyroscope (rad/s^2/sqrt(Hz)), part of the state.
        spin_share, spin_least: where two others or more measure, it is at most this many times their root mean square
            rate (1/s/sqrt(Hz)), plus the least.
        spin_stays_s: time constant with which that velocity decays.
        relative_noise, relative_share: acceleration of a bar without accelerometer relative to the bar with one
            (m/s^2/sqrt(Hz)), and its part that grows with the measured acceleration.
        length_sd_m: standard deviation of a cable's length, independent from sample to sample.
        length_error_m: standard deviation of its part that is constant over a second.
        compliance_m_n: yield of an endcap D=130 T=8 under 1 N, m/N; other sizes yield in proportion to D/T^2
            (:meth:`sensing.robot.layout.Layout.compliance_m_n`), and the description may state an endcap's own.
        compliance_share: relative error of it, of each contact independently.
        softness_sd: standard deviation of the relative excess of all domes' yield, which is learned.
        softness_stays_s: time constant with which it is forgotten; the yield also depends on the place of contact.
        yield_delay_s: delay of the yield behind the force: the dome's damping over its stiffness; the description may
            state an endcap's own.
        delay_sd_s: standard deviation of what all domes' delays have in common beside it, which is learned: another
            silicone (0.3 to 10 ms), and stamps at the beginning or end of an exposure of up to 10 ms.
        anchor_sd_m: standard deviation of a contact's position besides the compliance.
        error_stays_s: correlation time of a contact's errors.
        bit_sd_m: standard deviation of the position of a contact of which only the bit is known.
        roll_share: relative error of the rolled distance.
        anchor_walk: random walk of a contact that holds (m/sqrt(s)).
        creep_sd: standard deviation of the creep, which is learned: motion of a contact against the friction force,
            over the arc through which it turns, at a friction ratio of one.
        slip_gain: mean speed of a slipping contact over that of its steady slip (contact, Notes): slips are short, and
            their speeds have a long tail.
        slip_sd_m_s, slip_share: standard deviation of a slipping contact's speed: constant, and as part of the speed.
        slip_across: standard deviation of that speed across the friction force over the one along it.
        spin_lever_m: largest torque about the normal over the normal force.
        normal_sd: standard deviation of a measured normal, rad, that does not average out.
        normal_walk: random walk of the normal, rad/sqrt(s).
        least_force_n: force below which only the contact bit is used.
        start_s: time for which the robot stands still at the start.
        start_limit_s: time after which the estimate begins although the robot moves.
        late_s: delay within which nearly all samples of the start have come; there is no estimate before.
        history_s: largest delay of a sample.
    """

    contacts: Contacts = Contacts.WRENCH
    rate_noise: float = 2.5e-4
    force_noise: float = 2.5e-3
    rate_bias_walk: float = 2e-5
    force_bias_walk: float = 2e-4
    rate_bias_sd: float = 0.01
    force_bias_sd: float = 0.025
    shape_rate_noise: float = 1e-4
    unknown_rate_noise: float = 0.5
    unknown_rate_share: float = 2.0
    unknown_rate_least: float = 0.02
    spin_noise: float = 30.0
    spin_share: float = 60.0
    spin_least: float = 0.1
    spin_stays_s: float = 0.33
    relative_noise: float = 0.5
    relative_share: float = 0.1
    length_sd_m: float = 2e-3
    length_error_m: float = 2.5e-4
    compliance_m_n: float = 2.5e-4
    compliance_share: float = 0.03
    softness_sd: float = 0.2
    softness_stays_s: float = 50.0
    yield_delay_s: float = 0.01
    delay_sd_s: float = 0.005
    anchor_sd_m: float = 1.5e-4
    error_stays_s: float = 0.8
    bit_sd_m: float = 8e-3
    roll_share: float = 0.02
    anchor_walk: float = 5e-4
    creep_sd: float = 0.4
    slip_gain: float = 2.0
    slip_sd_m_s: float = 0.025
    slip_share: float = 1.0
    slip_across: float = 0.3
    spin_lever_m: float = 0.01
    normal_sd: float = 0.025
    normal_walk: float = 0.05
    least_force_n: float = 1.5
    start_s: float = 0.9
    start_limit_s: float = 10.0
    late_s: float = 0.06
    history_s: float = 1.0


DEFAULTS = Settings()
