"""The protocols: coverage, reproducibility and physics of the loading paths."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from cad.errors import ParameterError
from sensing.simulator.dataset.frames import shard_arrays
from sensing.simulator.dataset.request import DataRequest
from sensing.simulator.protocols.catalogue import load_path
from sensing.simulator.protocols.loading import FRAME_S, PHASES
from sensing.simulator.robot import statics as robot
from sensing.simulator.robot.statics import WEIGHT_N, Stand, prism_mm, random_stand


def test_static_protocol_covers_the_papers_grid() -> None:
    paths = [load_path("static", 3, number, 2) for number in range(120)]
    assert {path.tilt_deg for path in paths} == {10, 20, 30, 40, 50}
    tops = {max(p.target.normal_n for p in path.waypoints if p.target) for path in paths}
    assert tops == {5, 10, 15, 20, 25, 30, 35}
    assert {p.phase for path in paths for p in path.waypoints} == set(PHASES[:6])
    assert load_path("static", 3, 7, 2) == paths[7]
    assert load_path("static", 4, 7, 2) != paths[7]


def test_set_points_go_with_the_design_on_request() -> None:
    """D=250 T=25 in Smooth-Sil 950 bears (25 / 8)^2 of the released load, and is pressed with it."""
    released, design = (DataRequest(1, 250.0, 25.0, protocol="dynamic", loads=name) for name in ("released", "design"))
    pairs = [
        (a.target, b.target)
        for before, after in zip(released.shards()[0], design.shards()[0], strict=True)
        for a, b in zip(before.waypoints, after.waypoints, strict=True)
        if a.target is not None and b.target is not None
    ]
    forces = np.array([(a.normal_n, b.normal_n) for a, b in pairs if a.normal_n is not None])
    assert forces[:, 1] == pytest.approx((25 / 8) ** 2 * forces[:, 0]) and len(forces) > 20
    depths = np.array([(a.depth_mm, b.depth_mm) for a, b in pairs if a.depth_mm is not None])
    assert depths[:, 1] == pytest.approx(125 / 65 * depths[:, 0]) and len(depths) > 5
    same = (DataRequest(1, protocol="dynamic", loads=name).shards() for name in ("released", "design"))
    assert next(same) == next(same)
    with pytest.raises(ParameterError, match="stands carry the weight of one robot"):
        DataRequest(1, protocol="robot", loads="design")


def test_steep_protocol_goes_on_where_the_wide_one_ends() -> None:
    paths = [load_path("steep", 3, number, 1) for number in range(36)]
    assert [int((path.tilt_deg - 45) // 5.5) for path in paths] == list(range(6)) * 6
    tops = [max(p.target.normal_n for p in path.waypoints if p.target) for path in paths]
    assert 36 <= min(tops) < 42 < 68 < max(tops) <= 75
    frictions = [path.friction for path in paths]
    assert 0.2 <= min(frictions) < 0.3 < 1.0 < max(frictions) <= 1.2


def test_wide_protocol_fills_every_stratum_of_tilt_and_load() -> None:
    paths = [load_path("wide", 3, number, 1) for number in range(36)]
    assert [int(path.tilt_deg // 10) for path in paths] == list(range(6)) * 6
    assert len({path.tilt_deg for path in paths}) == 36
    tops = [max(p.target.normal_n for p in path.waypoints if p.target) for path in paths]
    assert 36 <= min(tops) < 40 < 56 < max(tops) <= 60
    for path in paths:
        loads = np.array([p.target.normal_n for p in path.waypoints if p.target and p.phase == "load"])
        assert np.diff(loads).max() < 10  # no gap in the table
    assert load_path("wide", 3, 7, 1) == paths[7] != load_path("wide", 4, 7, 1)
    assert load_path("wide", 3, 7, 5).friction == paths[7].friction  # the same states, labelled at more azimuths


def test_low_forces_dominate_as_in_the_paper() -> None:
    forces = [
        p.target.normal_n if p.target else 0.0
        for number in range(120)
        for p in load_path("static", 0, number, 1).waypoints
    ]
    assert np.mean(np.array(forces) < 17.5) > 0.6 > np.mean(np.array(forces) < 5) > 0.2


def test_a_circle_closes_and_keeps_its_radius() -> None:
    for number in range(10):
        shifts = np.array(
            [p.target.shift_mm for p in load_path("static", 0, number, 1).waypoints if p.phase == "circle"]
        )
        assert np.allclose(shifts[-1], 0, atol=1e-12)
        centre = shifts.mean(axis=0)
        radii = np.linalg.norm(shifts - centre, axis=1)
        assert np.ptp(radii) < 1e-9 and 0.5 <= radii[0] <= 4


def imbalance(stand: Stand) -> tuple[float, float]:
    """Force (N) and moment (N mm, about the centre of mass) that nothing carries."""
    force = stand.force_n + stand.rope_n[:, None] * [0.0, 0.0, 1.0]
    foot = stand.centre_mm * [1.0, 1.0, 0.0]  # of a vertical force any height will do; cables pull at one height
    moment = np.cross(foot - stand.mass_centre_mm * [1, 1, 0], force).sum(axis=0)
    return float(np.linalg.norm(force.sum(axis=0) - [0, 0, WEIGHT_N])), float(np.linalg.norm(moment))


@pytest.mark.parametrize("contacts", [0, 1, 2, 3])
def test_the_robots_forces_and_moments_balance(contacts: int) -> None:
    for seed in range(50):
        stand = random_stand(np.random.default_rng(seed), contacts, 0.6)
        force, moment = imbalance(stand)
        assert force < 1e-9 * WEIGHT_N and moment < 1e-9 * WEIGHT_N * 1000
        assert stand.touching.sum() == contacts and (stand.force_n[~stand.touching] == 0).all()
        normal, pull = stand.force_n[stand.touching, 2], stand.force_n[stand.touching, :2]
        assert (normal > 2).all() and (normal < 65).all() and (stand.rope_n >= 0).all()
        assert (np.linalg.norm(pull, axis=1) <= 0.6 * 0.6 * normal).all()
        heights = stand.centre_mm[:, 2]
        if contacts:  # what touches is lowest, and nothing else is as low
            assert np.abs(heights[stand.touching]).max() < 1e-9 and heights[~stand.touching].min() > 1
        else:
            assert heights.min() == pytest.approx(100)


def test_a_planted_slip_of_the_statics_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    true = robot.supports
    monkeypatch.setattr(robot, "supports", lambda places, centre: true(places, centre + 5.0))
    force, moment = imbalance(random_stand(np.random.default_rng(0), 3, 0.6))
    assert force < 1e-9 < 100 < moment


def test_the_prism_keeps_its_bars() -> None:
    endcaps = prism_mm()
    assert np.allclose(np.linalg.norm(endcaps[1::2] - endcaps[0::2], axis=1), robot.BAR_MM)
    assert np.allclose(
        np.linalg.norm(endcaps[[0, 2, 4]] - endcaps[[2, 4, 0]], axis=1), np.sqrt(3) * robot.RING_RADIUS_MM
    )


@pytest.mark.parametrize("frames", [1, 60, 100])
def test_a_set_holds_all_endcaps_of_its_last_scene(frames: int) -> None:
    paths = [path for shard in DataRequest(frames=frames, protocol="robot").shards() for path in shard]
    assert [(path.scene, path.endcap) for path in paths] == [divmod(k, 6) for k in range(len(paths))]
    assert len(paths) % 6 == 0 and sum(path.frames for path in paths[:-6]) < frames


@pytest.mark.long
def test_solved_endcaps_carry_the_robots_weight() -> None:
    """The labels of a whole scene, in the world: what the residuals of the solved contacts leave, and no more.

    How far below the tolerance a solve stops differs from processor to processor.
    """
    request = DataRequest(frames=1, density="draft", protocol="robot", render="off")
    paths = [load_path("robot", 4, 3 * 6 + endcap, 1) for endcap in range(6)]
    paths = [replace(p, waypoints=(p.waypoints[0], *p.waypoints[-2:-1])) for p in paths]  # in the air, and standing
    arrays = shard_arrays(request, paths)
    assert not len(arrays["refusals"]) and len(arrays["path"]) == 12
    world = np.einsum("nij,nj->ni", arrays["T_world_endcap"][:, :3, :3], arrays["force_n"])
    total = world[1::2].sum(axis=0)
    left_n = float((arrays["residual"] * arrays["normal_n"]).sum())
    assert arrays["residual"].max() <= request.tolerance
    assert abs(total[2] - WEIGHT_N) <= left_n + 1e-4 * WEIGHT_N
    assert np.abs(total[:2]).max() < 0.01 * WEIGHT_N
    assert arrays["contact"][1::2].sum() == 3 and not arrays["contact"][0::2].any()
    assert (world[0::2] == 0).all()


def test_dynamic_frames_move_during_their_exposure() -> None:
    for number in range(12):
        path = load_path("dynamic", 0, number, 2)
        moving = [p for p in path.waypoints if p.begins is not None]
        assert len(moving) > 3 and {p.phase for p in moving} == {("circle", "drag", "impact")[number % 3]}
        times = [p.time_s for p in path.waypoints if p.phase in ("circle", "drag", "impact", "clear")]
        assert np.allclose(np.diff(times), FRAME_S)
        assert 0 < path.exposure_s < FRAME_S and 0 < path.latency_s < 0.1
        assert load_path("dynamic", 0, number, 2) == path


def test_circles_have_their_speed_and_no_step_is_too_long() -> None:
    path = load_path("dynamic", 0, 3, 1)
    moving = [p for p in path.waypoints if p.begins is not None]
    blur = [math.dist(p.begins.shift_mm, p.target.shift_mm) for p in moving if p.begins and p.target]
    assert np.ptp(blur) < 1e-9  # the same chord at every frame: constant speed
    assert 8 <= blur[0] / path.exposure_s <= 60
    travelled = [t.shift_mm for p in moving for t in (*p.via, p.begins) if t is not None]
    assert max(math.dist(a, b) for a, b in itertools.pairwise(travelled)) < 1.7
