"""What each change of the cables does to the mass, by statics alone; and a robot that has no table walks, too."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco")

from standing_robot import feed

import sensing.tensegrity
from cad.errors import ParameterError
from sensing.robot.estimator import RobotEstimator
from sensing.simulator.walk.gait import TippingGait
from sensing.simulator.walk.simulate import simulate_walk
from sensing.simulator.walk.stream import sensor_stream
from sensing.simulator.walk.terrain import Terrain
from sensing.simulator.walk.tips import (
    Tips,
    _edge_slopes,
    centre_of_mass_m,
    endcap_centres,
    hull_faces,
    inside_edge_m,
    load_tips,
    outward,
    with_change,
)  # fmt: skip
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.shape import balanced_shape

ROBOT = load_robot()
SIX_FILE = Path(sensing.tensegrity.__path__[0]) / "six_bar.toml"
SIX = load_robot(SIX_FILE)
STANDING = balanced_shape(ROBOT).T_world_bar
STRETCHED = with_change(ROBOT, np.full(len(ROBOT.cables), 1e-4))  # another mechanism than that of the table


def left_m(robot, face, lifted, change_m) -> float:
    return inside_edge_m(robot, balanced_shape(with_change(robot, change_m), STANDING).T_world_bar, face, lifted)


@pytest.mark.parametrize("tip", load_tips(), ids=lambda tip: f"{tip.face} lifts {tip.lifted}")
def test_every_tip_takes_the_mass_over_its_edge_with_tight_cables(tip):
    edge, after = (tip.face, tip.lifted), balanced_shape(with_change(ROBOT, tip.change_m), STANDING)
    assert left_m(ROBOT, *edge, 0 * tip.change_m) > 0.08
    assert inside_edge_m(ROBOT, after.T_world_bar, *edge) < -0.04
    assert (after.tension_n > 1.0).all()
    assert left_m(ROBOT, *edge, -tip.change_m) > 0.08  # the same change the other way keeps it inside


def test_the_mass_of_the_prism_is_inside_its_ends_by_the_radius_of_their_inner_circle():
    centres, face = endcap_centres(ROBOT, STANDING), (0, 2, 4)
    side = float(np.linalg.norm(centres[0] - centres[2]))
    for lifted in face:
        assert inside_edge_m(ROBOT, STANDING, face, lifted) == pytest.approx(side / (2 * math.sqrt(3)), rel=1e-4)
    np.testing.assert_allclose(centre_of_mass_m(ROBOT, STANDING), STANDING[:, :3, 3].mean(axis=0), atol=1e-12)


def test_faces_are_those_of_the_octahedron_and_the_icosahedron():
    assert hull_faces(endcap_centres(ROBOT, STANDING)) == sorted({tip.face for tip in load_tips()})
    tips = Tips(SIX)
    counts = np.bincount(np.ravel(tips.faces))
    assert len(tips.faces) == 20 and (counts == 5).all()
    centres = endcap_centres(SIX, balanced_shape(SIX).T_world_bar)
    for face in tips.faces:
        assert ((centres - centres[face[0]]) @ outward(centres, face)).max() < 1e-4


@pytest.mark.parametrize(("face", "lifted"), [((0, 2, 4), 2), ((0, 2, 5), 5), ((0, 2, 5), 2)])
def test_the_edges_distance_has_the_slopes_of_shapes_that_are_balanced_anew(face, lifted):
    change = 0.3 * Tips(ROBOT).over(face, lifted).change_m  # away from the symmetric shape
    robot = with_change(ROBOT, change)
    shape, step = balanced_shape(robot, STANDING), 2e-4
    slopes = _edge_slopes(robot, shape, face, lifted)
    for cable, nudge in enumerate(step * np.eye(len(change))):
        ahead, behind = (left_m(ROBOT, face, lifted, change + sign * nudge) for sign in (1, -1))
        assert slopes[cable] == pytest.approx((ahead - behind) / (2 * step), rel=0.01, abs=0.01)


@pytest.mark.parametrize(("face", "lifted"), [((0, 2, 4), 2), ((0, 2, 5), 0), ((0, 2, 5), 2), ((0, 2, 5), 5)])
def test_a_robot_without_a_table_gets_tips_like_those_of_the_table(face, lifted):
    """One edge of each kind that the prism's symmetry has."""
    known, found = Tips(ROBOT).over(face, lifted).change_m, Tips(STRETCHED).over(face, lifted).change_m
    after = balanced_shape(with_change(STRETCHED, found), STANDING)
    assert inside_edge_m(STRETCHED, after.T_world_bar, face, lifted) < -0.04 and (after.tension_n > 1.0).all()
    assert not np.array_equal(known, found)
    assert known @ found / np.linalg.norm(known) / np.linalg.norm(found) > 0.95


def test_a_lighter_robot_on_softer_cables_has_the_same_tips():
    bars = tuple(replace(bar, mass_kg=0.6 * bar.mass_kg) for bar in ROBOT.bars)
    cables = tuple(replace(cable, stiffness_n_m=0.6 * cable.stiffness_n_m) for cable in ROBOT.cables)
    lighter = Tips(replace(ROBOT, bars=bars, cables=cables))
    assert lighter.over((0, 2, 5), 2) is Tips(ROBOT).over((0, 2, 5), 2)


@pytest.mark.long
def test_six_bars_walk_and_are_followed():
    walk = simulate_walk(SIX, Terrain.FLAT, TippingGait(30.0), seed=1, duration_s=6.0)
    assert walk.path_m() > 1.0
    estimator = RobotEstimator(SIX)
    feed(estimator, [arrival.sample for arrival in sensor_stream(walk, SIX, seed=1)])
    found = np.array([bar.T_world_bar for bar in estimator.state().bars])
    lengths = [np.linalg.norm(centres[:, None] - centres, axis=-1) for centres in
               (endcap_centres(SIX, found), endcap_centres(SIX, walk.T_world_bar[-1]))]  # fmt: skip
    assert estimator.state().health.good and np.abs(lengths[0] - lengths[1]).max() < 0.03


@pytest.mark.long
def test_six_bars_stand_as_a_run_begins():
    """Bars in the air spun on for ever, here at 9.5 rad/s, and their estimate began after ten seconds, in motion."""
    walk = simulate_walk(SIX, Terrain.ROUGH, TippingGait(30.0), seed=504, duration_s=3.0)
    standing = walk.velocity[walk.time_s < 1.9][..., 3:]
    assert np.sqrt((standing**2).sum(axis=2).mean(axis=0)).max() < 0.15


def test_a_robot_that_has_no_face_is_refused():
    with pytest.raises(ParameterError, match="2 endcaps span no body with faces to stand on: it cannot walk"):
        Tips(replace(ROBOT, endcaps=ROBOT.endcaps[:2]))


def test_tips_are_computed_once_for_all_runs_of_a_robot(monkeypatch):
    """Two runs of one robot have the same bits as in two processes; another robot has its own tips."""
    heavy = replace(SIX, bars=(replace(SIX.bars[0], mass_kg=2.75), *SIX.bars[1:]))
    face = Tips(SIX).faces[0]
    first, other = Tips(SIX).over(face, face[0]), Tips(heavy).over(face, face[0])
    assert np.abs(first.change_m - other.change_m).max() > 1e-6
    monkeypatch.setattr(Tips, "_change", None)
    assert Tips(load_robot(SIX_FILE)).over(face, face[0]) is first
