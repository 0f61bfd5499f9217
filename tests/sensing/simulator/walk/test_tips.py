"""tips.csv by statics alone: what each change of the cables does to the mass, without the simulation or its gait."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco")

from sensing.simulator.walk.gait import Tip, endcap_centres, load_tips
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.shape import Shape, balanced_shape

ROBOT = load_robot()
STANDING = balanced_shape(ROBOT).T_world_bar


def shape_after(change_m: np.ndarray) -> Shape:
    cables = zip(ROBOT.cables, change_m, strict=True)
    robot = replace(ROBOT, cables=tuple(replace(cable, rest_m=cable.rest_m + change) for cable, change in cables))
    return balanced_shape(robot, STANDING)


def inside_edge_m(tip: Tip, shape: Shape) -> float:
    """Distance of the mass, seen along the face's normal, from the edge that stays; negative beyond it."""
    centres = endcap_centres(ROBOT, shape.T_world_bar)
    first, second = (centres[number] for number in tip.face if number != tip.lifted)
    along = (second - first) / np.linalg.norm(second - first)
    inward = centres[tip.lifted] - first
    inward -= (inward @ along) * along
    mass = np.array([bar.mass_kg for bar in ROBOT.bars])
    poses = zip(shape.T_world_bar, ROBOT.bars, strict=True)
    middle = [pose[:3, :3] @ bar.centre_of_mass_m + pose[:3, 3] for pose, bar in poses]
    return float((mass @ np.array(middle) / mass.sum() - first) @ inward / np.linalg.norm(inward))


@pytest.mark.parametrize("tip", load_tips(), ids=lambda tip: f"{tip.face} lifts {tip.lifted}")
def test_every_tip_takes_the_mass_over_its_edge_with_tight_cables(tip):
    before, after = shape_after(np.zeros(len(ROBOT.cables))), shape_after(tip.change_m)
    assert inside_edge_m(tip, before) > 0.08 and inside_edge_m(tip, after) < -0.04
    assert (after.tension_n > 1.0).all()
    assert inside_edge_m(tip, shape_after(-tip.change_m)) > 0.08  # the same change the other way keeps it inside
