"""Short held-out runs of the robot with inertial samples at 100 Hz, where the ground is not level: it is followed."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from long_cases import others_long

pytest.importorskip("mujoco")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bench"))

from robot_runs import errors, followed, score

from sensing.robot.settings import Settings
from sensing.simulator.walk.gait import held_out_gait
from sensing.simulator.walk.simulate import simulate_walk
from sensing.simulator.walk.stream import SensorSet, sensor_stream
from sensing.simulator.walk.terrain import Terrain
from sensing.tensegrity.robot_file import load_robot

ROBOT, SEED = load_robot(), 201


@pytest.mark.parametrize("terrain", others_long([Terrain.SLOPE, Terrain.STAIRS]))
def test_a_robot_with_slow_inertial_sensors_is_followed_where_the_ground_is_not_level(terrain):
    walk = simulate_walk(ROBOT, terrain, held_out_gait(SEED), SEED, 8.0)
    assert walk.path_m() > 0.4  # else it would look at a robot that stands
    arrivals = sensor_stream(walk, ROBOT, SensorSet(inertial_hz=100.0), SEED)
    estimates, spent, walls = followed(walk, ROBOT, list(arrivals), Settings())
    for estimate in estimates:
        bars = [(bar.T_world_bar, bar.velocity_m_s, bar.covariance) for bar in estimate.bars]
        assert all(np.isfinite(number).all() for bar in bars for number in bar)
        assert not any("held" in note or "anew" in note for note in estimate.health.notes), estimate.health.notes
    found = score(walk, errors(walk, ROBOT, estimates), (len(walls), spent, walls), ("wrench", "", 0.0))
    assert len(estimates) > 60 and found.drift_percent < 4 and found.tilt_deg < 0.5 and found.endcaps_mm < 10
    assert found.inside_place > 0.8 and found.inside_turn > 0.8
