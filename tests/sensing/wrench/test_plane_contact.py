"""Contact of a plane against wrenches that are composed by hand from its place, its direction and its forces."""

import numpy as np
import pytest

from cad.params import EndcapParams
from sensing.records import Wrench
from sensing.wrench.plane_contact import LAW, LEFT, NO_CONTACT, PlaneContactLaw, pressure_point

PARAMS, SHEAR_MPA = EndcapParams(130, 8), 0.68
CENTRE_MM = np.array([0.0, 0.0, PARAMS.centre_height_mm])
UNIT_N = SHEAR_MPA * 8**2


def composed(tilt_deg, azimuth_deg, push, along, across, spin=5.0):
    """(wrench, centre of pressure in the endcap frame, normal) of a plane: the law written down from its other end."""
    a, b = np.radians([tilt_deg, azimuth_deg])
    outward = np.array([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)])
    meridian = np.array([np.cos(a) * np.cos(b), np.cos(a) * np.sin(b), -np.sin(a)])
    lateral = np.array([-np.sin(b), np.cos(b), 0.0])
    n, x, y = (force / UNIT_N for force in (push, along, across))
    k = LAW[0] + LAW[1] * n**0.5
    beside = (k + LAW[2] * np.sin(a) ** 2) * x + (LAW[4] * np.sin(2 * a) + LAW[8] * np.sin(a)) * n
    height = 65 - 8 * (LAW[5] * n + LAW[6] * n**1.5 + LAW[7] * n**0.5)
    at = height * outward + 8 * beside * meridian + 8 * (k + LAW[3] * np.sin(a) ** 2) * y * lateral
    force = -push * outward + along * meridian + across * lateral
    torque = (np.cross(at, force) + spin * outward) / 1000
    covariance = np.diag(np.array([0.05, 0.05, 0.1, 0.003, 0.003, 0.002]) ** 2)
    return Wrench(0.0, force, torque, "sphere", covariance), at + CENTRE_MM, outward


@pytest.mark.parametrize("tilt_deg", [3, 20, 50])
@pytest.mark.parametrize("forces", [(5, 0, 0), (30, 12, -9), (12, -6, 3)])
def test_place_and_direction_come_back(tilt_deg, forces):
    wrench, at, outward = composed(tilt_deg, 130, *forces)
    found = PlaneContactLaw(PARAMS, SHEAR_MPA).of(wrench)
    assert np.allclose(found.position_mm, at, atol=1e-4) and np.allclose(found.normal, outward, atol=2e-6)
    assert found.friction_use == pytest.approx(np.hypot(*forces[1:]) / forces[0], abs=1e-5)


def test_a_softer_silicone_yields_as_much_under_less():
    wrench, at, outward = composed(25, 10, 20, 8, 3)
    soft = Wrench(0.0, wrench.force_n / 4, wrench.torque_nm / 4, "sphere", wrench.covariance)
    found = PlaneContactLaw(PARAMS, SHEAR_MPA / 4).of(soft)
    assert np.allclose(found.position_mm, at, atol=1e-4) and np.allclose(found.normal, outward, atol=2e-6)


@pytest.mark.parametrize(
    ("diameter_mm", "wall_mm", "push_n", "depth_mm"),
    [(100, 10, 10.94, 1.35), (164, 9, 8.86, 1.99), (250, 6.5, 4.62, 2.55), (250, 25, 68.4, 3.68)],
)
def test_a_plane_at_the_tip_of_another_shell_lies_as_deep_as_it_presses(diameter_mm, wall_mm, push_n, depth_mm):
    """Depths of linear elements of another program (axisymmetric, Fourier series in azimuth, unilateral contact)."""
    params = EndcapParams(diameter_mm, wall_mm)
    push = Wrench(0.0, np.array([0, 0, -push_n]), np.zeros(3), "sphere", np.diag([1e-4] * 3 + [1e-8] * 3))
    found = PlaneContactLaw(params, SHEAR_MPA).of(push)
    off_mm = params.tip_height_mm - found.position_mm[2] - depth_mm
    assert off_mm == pytest.approx(0, abs=0.4 * depth_mm)
    assert abs(off_mm) < 3 * found.position_covariance[2, 2] ** 0.5


def test_covariances_are_those_of_many_draws():
    wrench, _, _ = composed(30, -60, 15, 5, -2)
    law = PlaneContactLaw(PARAMS, SHEAR_MPA)
    found, rng = law.of(wrench), np.random.default_rng(0)
    noise = rng.multivariate_normal(np.zeros(6), wrench.covariance, 4000)
    drawn = [
        law.of(Wrench(0.0, wrench.force_n + e[:3], wrench.torque_nm + e[3:], "sphere", wrench.covariance))
        for e in noise
    ]
    left = 8 * np.array(LEFT)  # what the law leaves moves the normal, hardly the centre
    places = np.cov(np.array([d.position_mm for d in drawn]).T)
    assert 2 * found.position_sd_mm**2 == pytest.approx(np.trace(places), rel=0.1)
    normals = np.trace(np.cov(np.array([d.normal for d in drawn]).T)) + (left**2).sum() / 60**2
    assert np.trace(found.normal_covariance) == pytest.approx(normals, rel=0.15)
    assert found.normal_sd_deg == pytest.approx(np.degrees(np.sqrt(normals / 2)), rel=0.1)
    tilted = (1 + found.friction_use**2) * left @ np.abs([5, -2]) / np.hypot(5, 2) / 60  # and with it the use
    spread = np.hypot(np.std([d.friction_use for d in drawn]), tilted)
    assert found.friction_use_sd == pytest.approx(spread, rel=0.1)


@pytest.mark.parametrize(
    ("diameter_mm", "wall_mm", "x_mm", "y_mm", "depth_ratio"),
    [
        (130, 8, 0.35, 0.07, 0.18 / 3.97),
        (180, 15, 0.60, 0.35, 0.48 / 5.80),
        (250, 6.5, 0.82, 0.12, 0.82 / 5.17),
        (250, 25, 1.01, 0.92, 0.98 / 8.38),
    ],
)
def test_the_covariance_holds_what_the_law_leaves_of_other_shells(diameter_mm, wall_mm, x_mm, y_mm, depth_ratio):
    """Rms of ``python bench/bench_contact.py shells``, as docs/contact.md has them."""
    params, radius_mm = EndcapParams(diameter_mm, wall_mm), diameter_mm / 2
    push = composed(30, 0, 15, 0, 0)[0]
    scale = (wall_mm / 8) ** 2
    exact = Wrench(0.0, scale * push.force_n, scale * radius_mm / 65 * push.torque_nm, "sphere", np.zeros((6, 6)))
    found = PlaneContactLaw(params, SHEAR_MPA).of(exact)
    place = found.position_mm - [0.0, 0.0, params.centre_height_mm]
    height_mm = float(found.normal @ place)
    away = np.array([found.normal[2], 0.0, -found.normal[0]])
    held_mm = {
        axis: height_mm * np.sqrt(along @ found.normal_covariance @ along)
        for axis, along in (("x", away), ("y", np.array([0.0, 1.0, 0.0])))
    }
    assert held_mm["x"] > 0.9 * x_mm and held_mm["y"] > 0.9 * y_mm
    depth_sd_mm = np.sqrt(found.normal @ found.position_covariance @ found.normal)
    assert depth_sd_mm > 0.9 * depth_ratio * (radius_mm - height_mm)


def test_a_pose_turns_z_to_the_normal():
    from scipy.spatial.transform import Rotation

    wrench, at, outward = composed(35, 200, 10, 2, -1)
    found = PlaneContactLaw(PARAMS, SHEAR_MPA).of(wrench)
    position, quaternion, covariance = found.pose()
    assert np.allclose(1000 * position, at, atol=1e-4)
    across = np.trace(covariance[:3, :3]) - outward @ covariance[:3, :3] @ outward
    assert 1000 * np.sqrt(across / 2) == pytest.approx(found.position_sd_mm)
    assert np.allclose(Rotation.from_quat(quaternion).apply([0, 0, 1]), outward, atol=2e-6)
    assert np.trace(covariance[3:, 3:]) == pytest.approx(np.trace(found.normal_covariance) + np.pi**2 / 3, rel=1e-6)
    assert outward @ covariance[3:, 3:] @ outward == pytest.approx(np.pi**2 / 3)
    moved = np.cross(outward, [0.3, -0.5, 0.2])  # of the normal, by a turn about the axis across both
    about = np.cross(outward, moved)
    assert about @ covariance[3:, 3:] @ about == pytest.approx(moved @ found.normal_covariance @ moved, rel=1e-4)


def test_no_push_no_place():
    law, zero = PlaneContactLaw(PARAMS, SHEAR_MPA), np.zeros(3)
    for force in (zero, np.array([0, 0, -0.5]), np.full(3, np.nan)):
        assert np.isnan(law.of(Wrench(0.0, force, zero, "sphere", np.eye(6))).normal).all()
    unknown = law.of(Wrench(0.0, np.array([0, 0, -9.0]), zero, "sphere"))  # no covariance: a place, no spread
    assert unknown.normal[2] == pytest.approx(1) and np.isnan(unknown.normal_sd_deg)
    assert np.isnan(NO_CONTACT.position_sd_mm)


def test_pressure_point_is_on_the_plane_and_explains_the_torque():
    wrench, at, outward = composed(40, 75, 18, -7, 6, spin=12.0)
    height = float((at - CENTRE_MM) @ outward)
    point = pressure_point(wrench.force_n, 1000 * wrench.torque_nm, outward, height)
    assert np.allclose(point + CENTRE_MM, at)
