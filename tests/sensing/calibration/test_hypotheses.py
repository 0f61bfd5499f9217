"""Calibration that changes nothing the dots do not call for, its covariance, and the file that carries it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from cad.errors import FileError
from cad.params import EndcapParams
from sensing.calibration.dots import pattern_points
from sensing.calibration.fit import STEP, Problem, minimise, numeric_jacobian
from sensing.calibration.from_dots import calibrate_from_dots
from sensing.calibration.misfit import FALSE_ALARM, _statistic, _tolerance, camera_misfit, f_beyond
from sensing.calibration.prior import OTHER_LENS
from sensing.camera.mount import MountedCamera, mount, rotation_matrix
from sensing.camera.nominal import nominal_lens, nominal_mount
from sensing.camera.parameters import NAMES, camera_at, camera_vector

PARAMS, SIZE = EndcapParams(130, 8), (640, 480)
NOMINAL = nominal_mount(PARAMS)
POINTS = pattern_points(PARAMS)[0]


def painted(camera: MountedCamera, seed: int, scatter: float = 1.0) -> np.ndarray:
    """Dots as a hand paints and a finder finds them: scatter on the dome and in the picture, none cut by the frame."""
    rng = np.random.default_rng(seed)
    spots = POINTS + scatter * 0.2 * rng.standard_normal(POINTS.shape)
    pixels = camera.project(spots) + scatter * 0.45 * rng.standard_normal((len(POINTS), 2))
    return pixels[((pixels > 12) & (pixels < [627, 467])).all(axis=1)]


def turned(degrees: float = 1.5) -> MountedCamera:
    return mount(nominal_lens(), (0.2, -0.3, 17.2), rotation_matrix(np.radians(degrees) * np.array([0.6, 0.0, 0.8])))


@pytest.mark.parametrize("scatter", [1.0, 2.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_camera_as_designed_stays_as_designed(seed: int, scatter: float) -> None:
    result = calibrate_from_dots(painted(NOMINAL, seed, scatter), PARAMS, SIZE)
    assert next(iter(result.probabilities)) == "as designed"
    assert np.allclose(camera_vector(result.mounted), camera_vector(NOMINAL), atol=1e-9)
    assert sum(result.probabilities.values()) == pytest.approx(1)


@pytest.mark.parametrize(
    ("camera", "name"),
    [
        (turned(), "mounted otherwise"),
        (mount(replace(nominal_lens(), k=(0, 0, 0, 0)), (0, 0, 17)), "fitted with another lens"),
    ],
)
def test_what_differs_is_found(camera: MountedCamera, name: str) -> None:
    result = calibrate_from_dots(painted(camera, 5), PARAMS, SIZE)
    assert next(iter(result.probabilities)) == name
    inner = POINTS[:60]
    assert np.abs(result.mounted.project(inner) - camera.project(inner)).max() < 0.8


def test_the_covariance_is_that_of_repeated_paintings() -> None:
    """In the directions that the dots determine: 60 paintings scatter as each one's covariance says."""
    camera = turned()
    problem = Problem.of(NOMINAL, OTHER_LENS)
    found = []
    for seed in range(60):
        dots = painted(camera, seed)
        distance = np.linalg.norm(camera.project(POINTS)[:, None] - dots[None], axis=-1)
        index = distance.argmin(axis=0)
        found.append(problem.solve(camera, POINTS[index], dots, scatter=1.0))
    inner = camera.project(POINTS[:45])
    places = np.array([fit.mounted.project(POINTS[:45]) - inner for fit in found]).reshape(60, -1)
    fit = found[0]
    J = np.stack(
        [
            (camera_at(fit.vector + e, NOMINAL).project(POINTS[:45]) - fit.mounted.project(POINTS[:45])).ravel() / h
            for e, h in zip(np.diag(1e-4 * STEP), 1e-4 * STEP, strict=True)
        ],
        axis=1,
    )
    expected = np.sqrt(np.diag(J @ fit.covariance @ J.T).mean())
    assert np.sqrt((places**2).mean()) == pytest.approx(expected, rel=0.2)


def test_minimise_finds_the_minimum_of_plain_and_outlier_costs() -> None:
    rng = np.random.default_rng(1)
    A, truth = rng.normal(size=(40, 3)), np.array([1.0, -2.0, 0.5])
    y = A @ truth + 0.01 * rng.normal(size=40)
    plain, _, information = minimise(lambda v: v @ A.T - y, np.zeros(3), np.ones(3), np.full(40, True))
    assert np.allclose(plain, np.linalg.lstsq(A, y, rcond=None)[0], atol=1e-7)
    assert np.allclose(information, A.T @ A, rtol=1e-6)
    y[:4] += 50
    robust, _, _ = minimise(lambda v: (v @ A.T - y) / 0.01, np.zeros(3), np.ones(3), np.full(40, False))
    assert np.abs(robust - truth).max() < 0.05 < np.abs(np.linalg.lstsq(A, y, rcond=None)[0] - truth).max()


def test_camera_numbers_go_back_and_forth() -> None:
    rng = np.random.default_rng(3)
    for _ in range(5):
        lens = replace(nominal_lens(), fy_px=rng.normal(240, 2))  # pixels that are not square
        camera = mount(lens, rng.normal([0, 0, 17], 1), rotation_matrix(rng.normal(0, 0.2, 3)))
        again = camera_at(camera_vector(camera), camera)
        assert np.allclose(again.project(POINTS[:40]), camera.project(POINTS[:40]), atol=1e-9)


@pytest.mark.parametrize("view_deg", [70.0, 108.0])
def test_a_camera_that_is_fitted_sees_as_far_as_its_module(view_deg: float) -> None:
    """A dark rim holds no dots that could be missing, and a wider lens shows them beside the camera."""
    camera = replace(NOMINAL, camera=replace(NOMINAL.camera, max_half_angle_deg=view_deg))
    again = camera_at(camera_vector(camera), camera)
    assert again.camera.max_half_angle_deg == view_deg
    assert np.array_equal(again.sees(POINTS), camera.sees(POINTS))


def test_the_same_dots_in_a_picture_of_twice_the_size_are_seen_by_the_same_camera() -> None:
    dots, large = painted(turned(), 5), (1280, 960)
    one, two = calibrate_from_dots(dots, PARAMS, SIZE), calibrate_from_dots(2 * dots + 0.5, PARAMS, large)
    assert two.probabilities == pytest.approx(one.probabilities, abs=1e-4)
    expected = camera_vector(replace(one.mounted, camera=one.mounted.camera.resized(*large)))
    deviation = np.array([two.values[name][1] for name in NAMES])
    assert (np.abs(camera_vector(two.mounted) - expected) <= 0.01 * deviation + 1e-9).all()
    in_px = np.array([2.0, 2.0, 2.0] + [1.0] * 8)
    assert deviation == pytest.approx(in_px * [one.values[name][1] for name in NAMES], rel=1e-2)
    assert two.misplaced_px == pytest.approx(one.misplaced_px, rel=1e-2) and two.most_px > 1.9 * one.most_px
    designed = painted(NOMINAL, 5)
    found = camera_misfit(designed, SIZE, PARAMS), camera_misfit(2 * designed + 0.5, large, PARAMS)
    assert found[0].statistic == pytest.approx(found[1].statistic, rel=1e-3) and found[0].fits and found[1].fits


# --- the test of the assumed camera -------------------------------------------------------------------------------
@pytest.mark.long
def test_false_alarms_come_at_the_stated_rate() -> None:
    """Cameras drawn within tolerance: p-values are uniform (few are small), so FALSE_ALARM is what it says."""
    rng, root = np.random.default_rng(7), np.linalg.cholesky(_tolerance(NOMINAL))
    p_values = []
    for seed in range(300):
        camera = camera_at(camera_vector(NOMINAL) + root @ rng.standard_normal(len(NAMES)), NOMINAL)
        dots = painted(camera, 1000 + seed)
        distance = np.linalg.norm(camera.project(POINTS)[:, None] - dots[None], axis=-1)
        p_values.append(_statistic(NOMINAL, POINTS[distance.argmin(axis=0)], dots)[1])
    p = np.sort(p_values)
    assert np.abs(p - (np.arange(300) + 0.5) / 300).max() < 0.12  # Kolmogorov, 0.094 at 1 %; weights cost a little
    assert (p < FALSE_ALARM).sum() <= 3


@pytest.mark.parametrize("seed", range(4))
def test_a_good_camera_is_not_refused_and_a_turned_one_is_named(seed: int) -> None:
    good = camera_misfit(painted(NOMINAL, seed, 1.5), SIZE, PARAMS)
    assert good.fits and good.reason == "" and good.found is None
    bad = camera_misfit(painted(turned(), seed), SIZE, PARAMS)
    assert not bad.fits and "camera turned by 1." in bad.reason
    assert bad.found is not None
    assert camera_misfit(painted(turned(), seed), SIZE, PARAMS, bad.found.mounted).fits


def test_another_lens_and_another_sensors_calibration_are_named() -> None:
    other = mount(replace(nominal_lens(), k=(0, 0, 0, 0)), (0, 0, 17))
    assert "another lens" in camera_misfit(painted(other, 1), SIZE, PARAMS).reason
    found = calibrate_from_dots(painted(turned(), 2), PARAMS, SIZE).mounted
    assert not camera_misfit(painted(turned(-1.5), 3), SIZE, PARAMS, found).fits
    rubbish = camera_misfit(np.random.default_rng(0).uniform(0, 480, (60, 2)), SIZE, PARAMS)
    assert not rubbish.fits and "not where this camera sees them" in rubbish.reason


@pytest.mark.parametrize(("T", "p"), [(1.0, 0.44865225), (2.0, 0.03130170), (3.0, 0.00114848)])
def test_f_distribution(T: float, p: float) -> None:
    assert f_beyond(T, 11, 165) == pytest.approx(p, rel=1e-3)


# --- the file ---------------------------------------------------------------------------------------------------------
def test_the_file_keeps_the_covariance_and_old_files_still_load(tmp_path) -> None:
    camera = calibrate_from_dots(painted(turned(), 1), PARAMS, SIZE).mounted
    camera.save(tmp_path / "new.json")
    assert np.array_equal(MountedCamera.load(tmp_path / "new.json").covariance, camera.covariance)
    record = json.loads((tmp_path / "new.json").read_text())
    old = {**record, "format": "endcap-camera-1"}
    del old["covariance"]
    (tmp_path / "old.json").write_text(json.dumps(old))
    assert MountedCamera.load(tmp_path / "old.json").covariance is None
    for wrong in ([[1.0]], (-np.eye(11)).tolist(), [[1.0, 2.0], [3.0]]):
        (tmp_path / "bad.json").write_text(json.dumps({**record, "covariance": wrong}))
        with pytest.raises(FileError, match=r"bad\.json: not a camera file"):
            MountedCamera.load(tmp_path / "bad.json")


def test_numeric_jacobian_is_exact_for_squares() -> None:
    at = np.array([1.0, 2.0])
    assert np.allclose(numeric_jacobian(lambda v: v**2, at, np.ones(2)), np.diag(2 * at))
