"""Frames of wrenches: power is the same in every frame, and known cases have known signs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.frames import (
    ACTION,
    REACTION,
    FtMount,
    T_sphere_endcap,
    inverse,
    pose,
    wrench_adjoint,
    wrench_in,
)
from sensing.live.core.endcap_config import EndcapConfig
from sensing.records import Wrench

numbers = st.floats(-50, 50)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)
poses = st.builds(lambda r, p: pose(Rotation.from_rotvec(r).as_matrix(), p), vectors, vectors)
sixes = st.tuples(*[numbers] * 6).map(np.array)


@given(poses, sixes, sixes)
@settings(max_examples=60, deadline=None)
def test_power_is_the_same_in_every_frame(T, wrench, twist):
    """A twist is that of one moving point: v' = R v + p x R w, w' = R w."""
    velocity, turning = T[:3, :3] @ twist[:3], T[:3, :3] @ twist[3:]
    moved = np.concatenate([velocity + np.cross(T[:3, 3] / 1000, turning), turning])
    reported = wrench_adjoint(T) @ wrench @ moved
    assert reported == pytest.approx(wrench @ twist, abs=1e-7)


@given(poses, poses)
@settings(max_examples=30, deadline=None)
def test_adjoints_compose_and_invert(T_ab, T_bc):
    assert np.allclose(wrench_adjoint(T_ab @ T_bc), wrench_adjoint(T_ab) @ wrench_adjoint(T_bc), atol=1e-9)
    assert np.allclose(wrench_adjoint(inverse(T_ab)) @ wrench_adjoint(T_ab), np.eye(6), atol=1e-9)


def test_a_moment_is_that_of_forces_at_points():
    """Independent of the adjoint: the torque of a few forces, each taken about the new origin."""
    rng = np.random.default_rng(0)
    T = pose(Rotation.random(rng=rng).as_matrix(), rng.normal(size=3) * 40)
    points_mm, forces = rng.normal(size=(4, 3)) * 60, rng.normal(size=(4, 3))
    torque = np.cross(points_mm / 1000, forces).sum(axis=0)
    reported = wrench_in(Wrench(0.0, forces.sum(axis=0), torque), T, "joint")
    moved, turned = points_mm @ T[:3, :3].T + T[:3, 3], forces @ T[:3, :3].T
    assert np.allclose(reported.torque_nm, np.cross(moved / 1000, turned).sum(axis=0), atol=1e-12)
    assert reported.frame == "joint"


def test_a_push_along_a_radius_has_no_torque_about_the_sphere():
    params = EndcapParams(130, 8)
    outward = np.array([np.sin(0.5), 0.0, np.cos(0.5)])
    touch_mm = params.outer_radius_mm * outward + [0, 0, params.centre_height_mm]
    force = -7.0 * outward
    at_endcap = Wrench(0.0, force, np.cross(touch_mm / 1000, force))
    assert np.linalg.norm(at_endcap.torque_nm) > 0.1
    assert np.abs(wrench_in(at_endcap, T_sphere_endcap(params), "sphere").torque_nm).max() < 1e-12


def test_a_sensor_under_the_plane_reads_the_weight_it_carries():
    """The endcap stands on its tip on a sensor whose z points up: pressed with 5 N it reads -5 N."""
    params = EndcapParams(130, 8)
    upside_down = np.diag([1.0, -1.0, -1.0])
    mount = FtMount(pose(upside_down, (0, 0, params.tip_height_mm)), REACTION)
    wrench = mount.on_endcap([0, 0, -5.0, 0, 0, 0], 1.0)
    assert np.allclose(wrench.force_n, [0, 0, -5.0])  # on the endcap, against its tip
    assert np.allclose(mount.reading(wrench), [0, 0, -5.0, 0, 0, 0])
    above = FtMount(np.eye(4), ACTION, tare=np.array([0, 0, 1.0, 0, 0, 0]))
    assert np.allclose(above.on_endcap([0, 0, -4.0, 0, 0, 0], 0.0).force_n, [0, 0, -5.0])


def test_covariance_goes_along():
    rng = np.random.default_rng(2)
    T = pose(Rotation.random(rng=rng).as_matrix(), (10, 20, 30))
    root = rng.normal(size=(6, 6)) * 0.1
    samples = rng.multivariate_normal(np.zeros(6), root @ root.T, 20000)
    reported = wrench_in(Wrench(0.0, np.zeros(3), np.zeros(3), covariance=root @ root.T), T, "ft")
    drawn = np.cov((samples @ wrench_adjoint(T).T).T)
    assert np.abs(drawn - reported.covariance).max() < 0.04 * np.abs(reported.covariance).max()


@pytest.mark.parametrize("bad", [np.eye(3), np.diag([1, 1, -1, 1]), np.full((4, 4), np.nan), 2 * np.eye(4)])
def test_what_is_no_rigid_transform_is_named(bad):
    with pytest.raises(ParameterError, match=r"T_ft_endcap .* no rigid transform"):
        wrench_in(Wrench(0.0, np.zeros(3), np.zeros(3)), bad, "ft")


def test_a_sign_that_is_neither_is_refused():
    with pytest.raises(ParameterError, match="reads=2"):
        FtMount(np.eye(4), 2)


def test_a_rotation_of_too_few_digits_asks_for_more():
    T = np.eye(4)
    T[:2, :2] = [[0.7071, -0.7071], [0.7071, 0.7071]]
    with pytest.raises(ParameterError, match=r"T_robot_endcap of left .*seven digits"):
        EndcapConfig("left", "0", T_robot_endcap=T)
    T[:2, :2] = [[0.7071068, -0.7071068], [0.7071068, 0.7071068]]
    assert np.array_equal(EndcapConfig("left", "0", T_robot_endcap=T).T_robot_endcap, T)


@pytest.mark.parametrize("reads", [ACTION, REACTION])
def test_what_a_sensor_reads_without_contact_is_no_load_whatever_its_sign(reads):
    tare = np.array([1.0, -2.0, 3.0, 0.1, 0.2, -0.3])
    mount = FtMount(pose(np.eye(3), (0.0, 0.0, 20.0)), reads, tare)
    untouched, pressed = (mount.on_endcap(tare + reads * np.array([0, 0, z, 0, 0, 0]), 0.0) for z in (0.0, -5.0))
    assert untouched.force_n == pytest.approx(np.zeros(3)) and untouched.torque_nm == pytest.approx(np.zeros(3))
    assert pressed.force_n == pytest.approx([0.0, 0.0, -5.0])
    assert mount.reading(pressed) == pytest.approx(tare + reads * np.array([0, 0, -5.0, 0, 0, 0]))
