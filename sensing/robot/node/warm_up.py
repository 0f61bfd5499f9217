"""Loads the estimator's compiled code before a live run; on a new computer it is compiled then, which takes a while.

If it were compiled with the first samples of a run, the inertial sensor would seem silent during that time.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cad.messages import announced
from sensing.robot.estimator import RobotEstimator
from sensing.robot.settings import DEFAULTS
from sensing.tensegrity.description import GRAVITY_M_S2, TensegrityRobot
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample
from sensing.tensegrity.shape import cable_lengths, standing_poses

PATIENCE_S = 1.5  # s; a longer warm-up is announced
STEP_S, STANDS_S = 0.01, DEFAULTS.start_s + 0.3  # s, interval of the samples; time for which the robot stands


def warm_up(robot: TensegrityRobot, say: Callable[[str], object]) -> None:
    """Estimate a standing robot for a moment, with every kind of sample and contacts that begin, hold and end.

    Args:
        robot: robot of the run.
        say: function that takes a line, called from another thread, if this takes long.
    """
    text = "loading the estimator: half a minute where it must be compiled, once on this computer"
    with announced(text, PATIENCE_S, say):
        _stand(RobotEstimator(robot), robot)


def _stand(estimator: RobotEstimator, robot: TensegrityRobot) -> None:
    poses = standing_poses(robot)
    up, lengths = np.array([0.0, 0.0, robot.mass_kg * GRAVITY_M_S2]), cable_lengths(robot, poses)[0]
    measured = [place for place, cable in enumerate(robot.cables) if cable.measured]
    turns = [poses[robot.bar_number(e.bar), :3, :3] @ e.T_bar_endcap[:3, :3] for e in robot.endcaps]
    for k in range(round(STANDS_S / STEP_S)):
        time_s = k * STEP_S
        for sensor in robot.sensors:
            axes = poses[robot.bar_number(sensor.bar), :3, :3] @ sensor.T_bar_imu[:3, :3]
            force = axes.T @ [0.0, 0.0, GRAVITY_M_S2] if sensor.accelerometer else None
            estimator.imu(InertialSample(time_s, sensor.name, np.zeros(3), force))
        estimator.lengths(LengthSample(time_s, lengths[measured]))
        for endcap, axes in zip(robot.endcaps, turns, strict=True):
            touches = bool(axes[2, 2] < 0) and k % 20 != 0  # its tip points down
            push = axes.T @ up / 3 * touches
            estimator.reading(FootSample(time_s, endcap.name, push, np.zeros(3), 0.01 * np.eye(6), touches))
        estimator.state()
