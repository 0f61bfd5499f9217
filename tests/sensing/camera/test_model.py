"""The camera model against itself (round trip, differences), closed forms and OpenCV where that is valid."""

from __future__ import annotations

import json
import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cad.errors import FileError, ParameterError
from sensing.camera.model import FisheyeCamera, monotonic_half_angle_deg
from sensing.camera.mount import MountedCamera, mount, rotation_matrix

CAMERA = FisheyeCamera(640, 480, 246.0, 244.0, 318.0, 243.5, (-0.045, 0.004, -0.001, 0.0001), 100.0)


def random_points(count: int, half_angle_deg: float, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    theta = np.radians(half_angle_deg) * rng.random(count)
    phi = 2 * np.pi * rng.random(count)
    distance = rng.uniform(5, 90, count)
    unit = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    return unit * distance[:, None]


def test_round_trip_past_180_degrees() -> None:
    points = random_points(5000, 99.9)
    rays = CAMERA.unproject(CAMERA.project(points))
    assert np.abs(rays - points / np.linalg.norm(points, axis=-1, keepdims=True)).max() < 1e-11
    assert (points[:, 2] < 0).sum() > 300  # the claim is about half angles over 90 degrees


def test_axis_and_limits() -> None:
    assert np.allclose(CAMERA.project([0, 0, 1.0]), [318.0, 243.5])
    assert np.allclose(CAMERA.unproject([318.0, 243.5]), [0, 0, 1])
    behind = np.radians(100.1)
    assert np.isnan(CAMERA.project([math.sin(behind), 0, math.cos(behind)])).all()
    assert np.isnan(CAMERA.project([0, 0, -1.0])).all() and np.isnan(CAMERA.project([0, 0, 0.0])).all()
    assert np.isnan(CAMERA.unproject([5000.0, 0])).all()


def test_equidistant_closed_form() -> None:
    camera = FisheyeCamera(100, 100, 50, 50, 0, 0, max_half_angle_deg=170)
    theta = np.radians([1, 45, 90, 135, 169])
    points = np.stack([np.sin(theta), 0 * theta, np.cos(theta)], -1)
    assert np.allclose(camera.project(points)[:, 0], 50 * theta, atol=1e-12)


def test_agrees_with_opencv_in_front() -> None:
    points = random_points(2000, 80.0)
    matrix = np.array([[246.0, 0, 318.0], [0, 244.0, 243.5], [0, 0, 1]])
    theirs, _ = cv2.fisheye.projectPoints(points[None], np.zeros(3), np.zeros(3), matrix, np.array(CAMERA.k))
    assert np.abs(theirs[0] - CAMERA.project(points)).max() < 1e-8


def test_jacobians_by_central_differences() -> None:
    points = np.vstack([random_points(200, 99.0, 1), [[0, 0, 30.0], [1e-12, 0, 5.0], [20.0, 0, 0], [0, -7.0, 1e-9]]])
    by_point, by_parameter = CAMERA.jacobians(points)
    for axis in range(3):
        step = np.eye(3)[axis] * 1e-5
        difference = (CAMERA.project(points + step) - CAMERA.project(points - step)) / 2e-5
        assert np.abs(difference - by_point[..., axis]).max() < 1e-5
    fields = CAMERA.parameters
    for index in range(8):
        step = np.zeros(8)
        step[index] = 1e-6
        difference = (
            with_parameters(fields + step).project(points) - with_parameters(fields - step).project(points)
        ) / 2e-6
        assert np.nanmax(np.abs(difference - by_parameter[..., index])) < 1e-5


def with_parameters(values: np.ndarray) -> FisheyeCamera:
    return FisheyeCamera(640, 480, *values[:4], tuple(values[4:]), 100.0)


@settings(max_examples=50, deadline=None)
@given(st.floats(-0.05, 0.05), st.floats(-0.005, 0.005), st.floats(60, 120))
def test_inverse_for_any_valid_lens(k1: float, k2: float, angle: float) -> None:
    angle = min(angle, 0.97 * monotonic_half_angle_deg((k1, k2, 0, 0)))
    camera = FisheyeCamera(640, 480, 240, 240, 320, 240, (k1, k2, 0, 0), angle)
    points = random_points(50, 0.999 * angle)
    assert np.abs(camera.project(camera.unproject(camera.project(points))) - camera.project(points)).max() < 1e-8


def test_where_the_lens_folds() -> None:
    assert monotonic_half_angle_deg((-1 / 3, 0, 0, 0)) == pytest.approx(np.degrees(1.0))
    assert monotonic_half_angle_deg((0, 0, 0, 0)) == monotonic_half_angle_deg((0.1, 5e-324, 0, 0)) == 180
    assert monotonic_half_angle_deg((1e-300, -1e-310, 0, -1 / 9)) == pytest.approx(np.degrees(1.0))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("k", [(-0.2, 0.01, 0.0, 0.0), (-0.1, 0.0, 0.0, 0.0), (0.05, -0.03, 0.0, 0.0)])
def test_the_very_edge_of_a_view_that_ends_where_the_lens_folds_has_a_ray(k) -> None:
    """There the radius is flat: a step over no slope was no number."""
    lens = FisheyeCamera(640, 480, 247.0, 247.0, 319.5, 239.5, k, monotonic_half_angle_deg(k))
    angle = np.linspace(0.0, lens.max_half_angle, 500)
    rays = np.stack([np.sin(angle), np.zeros(500), np.cos(angle)], axis=-1)
    assert lens.unproject(lens.project(rays)) == pytest.approx(rays, abs=1e-6)


def test_area_resize_moves_pixels_as_it_should() -> None:
    points = random_points(100, 60)
    small, size = CAMERA.resized(200, 150), np.array([CAMERA.width_px, CAMERA.height_px])
    assert np.allclose((small.project(points) + 0.5) / (200, 150), (CAMERA.project(points) + 0.5) / size)


def test_mounted_camera_round_trip_and_file(tmp_path) -> None:
    rotation = rotation_matrix([0.02, -0.03, 1.2])
    assert np.allclose(rotation, cv2.Rodrigues(np.array([0.02, -0.03, 1.2]))[0])
    mounted = mount(CAMERA, [0.4, -0.7, 17.0], rotation)
    points = np.array([[10, 5, 90.0], [-50, 3, 20.0]])
    assert np.allclose(mounted.pupil_endcap_mm, [0.4, -0.7, 17.0])
    rays = mounted.rays_endcap(mounted.project(points))
    along = points - mounted.pupil_endcap_mm
    assert np.allclose(rays, along / np.linalg.norm(along, axis=1, keepdims=True))
    mounted.save(tmp_path / "camera.json")
    again = MountedCamera.load(tmp_path / "camera.json")
    assert again.camera == CAMERA and np.array_equal(again.T_camera_endcap, mounted.T_camera_endcap)


def test_the_picture_ends_at_the_centres_of_its_outer_pixels_on_all_four_sides() -> None:
    mounted = mount(CAMERA, [0.0, 0.0, 17.0])
    for margin in (0.0, 30.0):
        low, high = margin, np.array([639.0, 479.0]) - margin
        for inside, away in ((True, 0.2), (False, -0.2)):
            edges = [(low + away, 240), (high[0] - away, 240), (320, low + away), (320, high[1] - away)]
            points = mounted.pupil_endcap_mm + 60 * mounted.rays_endcap(np.array(edges))
            assert (mounted.sees(points, margin) == inside).all()


def test_a_pixel_is_followed_to_where_its_ray_leaves_the_sphere() -> None:
    mounted, centre = mount(CAMERA, [0.4, -0.7, 17.0], rotation_matrix([0.02, -0.03, 1.2])), np.array([1.0, 2.0, 38.0])
    outward = random_points(50, 70.0)
    points = centre + 57.0 * outward / np.linalg.norm(outward, axis=1, keepdims=True)
    assert np.allclose(mounted.on_sphere(mounted.project(points), centre, 57.0), points, atol=1e-9)
    with np.errstate(invalid="ignore"):
        assert np.isnan(mounted.on_sphere(np.array([[20.0, 240.0]]), [0, 0, 200.0], 10.0)).all()  # it misses


@pytest.mark.parametrize("size_px", [(640, 360), (1280, 480)])
def test_pictures_that_differ_in_one_side_alone_are_refused(size_px) -> None:
    mount(CAMERA, [0, 0, 17.0]).require_size((640, 480))
    with pytest.raises(ParameterError, match=f"the pictures have {size_px[0]}x{size_px[1]}"):
        mount(CAMERA, [0, 0, 17.0]).require_size(size_px)


@pytest.mark.parametrize("fault", ["shape", "not symmetric", "negative variance", "correlated by more than one", "NaN"])
def test_what_is_no_covariance_is_refused(fault) -> None:
    sd = 10.0 ** np.linspace(-8, 1, 11)  # units differ: each number counts against its own deviation
    covariance = np.outer(sd, sd) * (0.5 * np.eye(11) + 0.5)
    good = mount(CAMERA, [0, 0, 17.0])
    assert MountedCamera(CAMERA, good.T_camera_endcap, covariance).covariance is not None
    covariance[0, 1] *= {"not symmetric": 1.1}.get(fault, 1.0)
    covariance[:2, :2] *= {"correlated by more than one": [[1.0, 2.1], [2.1, 1.0]]}.get(fault, 1.0)
    covariance[0, 0] *= {"negative variance": -1.0, "NaN": np.nan}.get(fault, 1.0)
    with pytest.raises(ParameterError, match="a 11x11 covariance"):
        MountedCamera(CAMERA, good.T_camera_endcap, covariance[1:] if fault == "shape" else covariance)


def test_bad_input_is_refused(tmp_path) -> None:
    with pytest.raises(ParameterError, match="fx_px=-1"):
        FisheyeCamera(640, 480, -1, 240, 320, 240)
    with pytest.raises(ParameterError, match="max_half_angle_deg=95 over 57"):
        FisheyeCamera(640, 480, 240, 240, 320, 240, (-1 / 3, 0, 0, 0))
    with pytest.raises(ParameterError, match="last axis must have 3"):
        CAMERA.project([1.0, 2.0])
    with pytest.raises(ParameterError, match="rigid"):
        MountedCamera(CAMERA, np.diag([1.0, 1, -1, 1]))
    with pytest.raises(FileError, match="cannot read"):
        MountedCamera.load(tmp_path / "none.json")
    (tmp_path / "bad.json").write_text(json.dumps({"format": "other"}))
    with pytest.raises(FileError, match="not a camera file"):
        MountedCamera.load(tmp_path / "bad.json")
    with pytest.raises(FileError, match="No such file or directory"):
        mount(CAMERA, [0, 0, 17.0]).save(tmp_path / "missing" / "camera.json")
