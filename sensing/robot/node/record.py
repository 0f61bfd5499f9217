"""An estimate as text and numbers, for lines of JSON, comparisons with recordings, and the page."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from sensing.robot.estimate import RobotEstimate
from sensing.tensegrity.description import Array, TensegrityRobot


@dataclass(frozen=True)
class Report:
    """One estimate of a run.

    Attributes:
        estimate: estimate of the robot.
        truth: (B, 4, 4) m, true poses of the bars in the estimate's world; None where they are unknown.
        path_m: length of the path of the centre of mass so far, along the ground, m.
    """

    estimate: RobotEstimate
    truth: Array | None
    path_m: float

    def true_centre_m(self, robot: TensegrityRobot) -> Array | None:
        """(3,) true centre of mass, m."""
        if self.truth is None:
            return None
        total = np.zeros(3)
        for bar, pose in zip(robot.bars, self.truth, strict=True):
            total += bar.mass_kg * (pose[:3, :3] @ bar.centre_of_mass_m + pose[:3, 3])
        return total / robot.mass_kg

    def drift_m(self, robot: TensegrityRobot) -> float | None:
        """Distance of estimated and true centre of mass, m."""
        true = self.true_centre_m(robot)
        return None if true is None else float(np.linalg.norm(self.estimate.centre_of_mass_m - true))


def estimate_record(estimate: RobotEstimate) -> dict[str, Any]:
    """The whole estimate as plain data; arrays as lists, NaN as None (m, s, N, rad)."""
    return {
        "time_s": estimate.time_s,
        "measured_s": estimate.measured_s,
        "centre_of_mass_m": _plain(estimate.centre_of_mass_m),
        "centre_of_mass_covariance": _plain(estimate.centre_of_mass_covariance),
        "friction": _plain(estimate.friction),
        "friction_sd": _plain(estimate.friction_sd),
        "softness": _plain(estimate.softness),
        "softness_sd": _plain(estimate.softness_sd),
        "delay_s": _plain(estimate.delay_s),
        "delay_sd_s": _plain(estimate.delay_sd_s),
        "bars": [
            {
                "name": bar.name, "T_world_bar": _plain(bar.T_world_bar), "velocity_m_s": _plain(bar.velocity_m_s),
                "rate_rad_s": _plain(bar.rate_rad_s), "covariance": _plain(bar.covariance),
                "rate_covariance": _plain(bar.rate_covariance),
            }
            for bar in estimate.bars
        ],
        "endcaps": [
            {
                "name": endcap.name, "state": endcap.hold.word, "holds": _plain(endcap.hold.holds),
                "rolls": _plain(endcap.hold.rolls), "slips": _plain(endcap.hold.slips),
                "free": _plain(endcap.hold.free), "centre_m": _plain(endcap.centre_m),
                "covariance": _plain(endcap.covariance), "contact_m": _plain(endcap.contact_m),
                "normal": _plain(endcap.normal), "normal_sd_rad": _plain(endcap.normal_sd_rad),
                "force_n": _plain(endcap.force_n), "friction_ratio": _plain(endcap.friction_ratio),
                "friction_ratio_sd": _plain(endcap.friction_ratio_sd),
            }
            for endcap in estimate.endcaps
        ],
        "health": {
            "good": estimate.health.good, "notes": list(estimate.health.notes),
            "lengths_consistency": _plain(estimate.health.lengths_consistency),
            "anchors_consistency": _plain(estimate.health.anchors_consistency),
            "weight_ratio": _plain(estimate.health.weight_ratio),
            "rejected": estimate.health.rejected, "ignored": estimate.health.ignored,
        },
    }  # fmt: skip


def estimate_text(estimate: RobotEstimate) -> str:
    """The estimate as one line of JSON, from which every number is restored to the bit."""
    return json.dumps(estimate_record(estimate), allow_nan=False, separators=(",", ":"))


def report_text(report: Report, robot: TensegrityRobot) -> str:
    """A line for programs: the estimate with the length of the path, and the truth where it is known."""
    true = report.true_centre_m(robot)
    more = {
        "path_m": report.path_m,
        "true_centre_of_mass_m": None if true is None else _plain(true),
        "drift_m": report.drift_m(robot),
    }
    return json.dumps(estimate_record(report.estimate) | more, allow_nan=False, separators=(",", ":"))


def _plain(value: Any) -> Any:
    """Lists and floats of a value; None for a number that is not finite."""
    values = np.asarray(value, float)
    if values.ndim:
        return [_plain(each) for each in values]
    return float(values) if np.isfinite(values) else None
