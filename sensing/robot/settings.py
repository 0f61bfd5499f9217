"""Assumptions of the estimator on sensors and contacts, and the data of endcaps that it uses (m, s, N, rad)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from sensing.tensegrity.description import Array


class Contacts(Enum):
    """Data of endcaps that the estimator uses; all but WRENCH are for comparison."""

    NONE = "none"  # inertial sensors and cable lengths alone
    BIT_FIXED = "bit_fixed"  # whether it touches; the sphere's centre stays where it is
    BIT_ROLLING = "bit_rolling"  # whether it touches; the sphere rolls on level ground
    WRENCH = "wrench"  # force, normal, friction ratio and their covariance
    KNOWN = "known"  # true contacts of a simulation: normal, and whether it slips


@dataclass(frozen=True)
class KnownContact:
    """True contact of a simulation, for ``Contacts.KNOWN``.

    Attributes:
        time_s: of a reading of the same endcap.
        endcap: its name.
        holds: whether it touches and does not slip.
        normal: (3,) unit, out of the endcap, endcap frame.
    """

    time_s: float
    endcap: str
    holds: bool
    normal: Array


@dataclass(frozen=True)
class Settings:
    """Assumptions of the estimator; E: our estimates, tuned on simulated walks that no published number uses.

    Noises were chosen by the logarithmic score of the stated poses, e' P^-1 e + log det P (Gneiting and Raftery 2007,
    doi:10.1198/016214506000001437), over tuning runs: a covariance too wide loses by it as one too narrow does.

    Attributes:
        contacts: what of the endcaps is used.
        rate_noise, force_noise: of gyroscope (rad/s/sqrt(Hz)) and accelerometer (m/s^2/sqrt(Hz)).
        rate_bias_walk, force_bias_walk: of their biases (rad/s, m/s^2 per sqrt(s)).
        rate_bias_sd, force_bias_sd: of the biases at the start.
        shape_rate_noise: added to the rates of all bars but the leading one, for what linear steps leave of the shape.
        unknown_rate_noise: of a bar whose gyroscope is silent (rad/s/sqrt(Hz)), at most.
        unknown_rate_share, unknown_rate_least: where two others or more measure, it is at most this many times their
            rates' root mean square (1/sqrt(Hz)), and so much more (rad/s/sqrt(Hz)): where they stand, it stands, too.
        spin_noise: of the angular velocity of a bar without gyroscope (rad/s^2/sqrt(Hz)), which is a part of the state.
        spin_share, spin_least: where two others or more measure, it is at most this many times their root mean square
            rate (1/s/sqrt(Hz)), and so much more.
        spin_stays_s: time in which that velocity decays.
        relative_noise, relative_share: acceleration of a bar without accelerometer less that of the bar with one
            (m/s^2/sqrt(Hz)), and the part of it that grows with the measured acceleration.
        length_sd_m: of a cable's length, independent from sample to sample.
        length_error_m: what stays for a second.
        compliance_m_n: by which an endcap yields under a newton.
        compliance_share: error of it, as a part, of each contact alone.
        softness_sd: of the part by which all domes yield more, which is learned.
        softness_stays_s: time in which it is forgotten: what domes yield depends on where they are pressed, too.
        yield_delay_s: by which the yielding lags the force: the dome's damping over its stiffness.
        anchor_sd_m: of a contact beside the compliance.
        error_stays_s: how long errors of a contact stay.
        bit_sd_m: of a contact of which only the bit is known.
        roll_share: error of the rolled distance, as a part of it.
        anchor_walk: by which a contact that holds creeps (m/sqrt(s)).
        creep_sd: of the creep, which is learned: by what part of the arc through which it turns a contact creeps
            against the friction force, at a friction ratio of one.
        slip_gain: by which the mean speed of a contact that slips exceeds that of its steady slip (contact, Notes):
            slips are short and have a long tail.
        slip_sd_m_s, slip_share: error of the speed of a contact that slips, and the part of the speed on top.
        slip_across: standard deviation of that speed across the friction force over the one along it.
        spin_lever_m: torque about the normal that a newton of push holds.
        normal_sd: error of a measured normal that does not average out.
        normal_walk: rad/sqrt(s).
        least_force_n: below it nothing is known of a contact but that it touches.
        start_s: how long the robot stands still at the start.
        start_limit_s: after which the estimate begins though it moves.
        late_s: within which nearly all samples of the start have come; there is no estimate before.
        history_s: how late a sample may come.
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
