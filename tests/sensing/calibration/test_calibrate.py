"""Calibration against synthetic truth: known cameras, known dots, known boards."""

from __future__ import annotations

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.optimize._numdiff import approx_derivative

from cad.errors import FileError
from cad.identity import identity
from cad.lens import camera_module
from cad.params import EndcapParams
from cad.pattern import parse_rings
from sensing.calibrate import main
from sensing.calibration.dots import CalibrationError, find_dots, pattern_points, read_dots
from sensing.calibration.from_board import BoardView, _grouped_jacobian, calibrate_from_board
from sensing.calibration.from_dots import calibrate_from_dots
from sensing.calibration.prior import OTHER_LENS, MountPrior
from sensing.camera.model import FisheyeCamera
from sensing.camera.mount import MountedCamera, mount, rotation_matrix
from sensing.camera.nominal import nominal_lens, nominal_mount
from sensing.records import Frame
from sensing.simulator.render.cli import main as render
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.settings import Paint, RenderSettings
from sensing.sources.drawn import Drawing, draw_dots
from sensing.tracking.zero import save_zero, single_zero

PARAMS = EndcapParams(130, 8)
SIZE = (640, 480)


def true_camera(azimuth_deg: float = 40.0) -> MountedCamera:
    lens = replace(nominal_lens(), fx_px=243.0, fy_px=243.0, cx_px=325.0, cy_px=236.0, k=(-0.03, -0.008, 0, 0))
    rotation = rotation_matrix([0.03, -0.02, 0]) @ rotation_matrix([0, 0, np.radians(azimuth_deg)])
    return mount(lens, (0.6, -0.4, 17.5), rotation)


def seen_dots(mounted: MountedCamera) -> np.ndarray:
    pixels = mounted.project(pattern_points(PARAMS)[0])
    return pixels[((pixels > 0) & (pixels < [639, 479])).all(1)]


@pytest.mark.parametrize("azimuth_deg", [-85.0, 0.0, 40.0, 170.0])
def test_exact_dots_are_fitted_exactly_from_any_azimuth(azimuth_deg: float) -> None:
    truth = true_camera(azimuth_deg)
    result = calibrate_from_dots(seen_dots(truth), PARAMS, SIZE, azimuth_hint_deg=azimuth_deg + 20)
    assert len(result.residual_px) == len(seen_dots(truth)) > 80
    assert result.rms_px < 0.2  # the priors pull a little
    points = pattern_points(PARAMS)[0][result.pattern_index]
    assert np.abs(result.mounted.project(points) - truth.project(points)).max() < 0.5
    weak = calibrate_from_dots(seen_dots(truth), PARAMS, SIZE, prior=WEAK, azimuth_hint_deg=azimuth_deg + 20)
    assert weak.rms_px < 0.02


WEAK = MountPrior(centre_px=80, k=(1, 1), tilt_deg=20, lateral_mm=10, height_mm=1.5)


def test_unpainted_extra_and_moved_dots_do_no_harm() -> None:
    truth, rng = true_camera(), np.random.default_rng(0)
    dots = seen_dots(truth) + rng.normal(0, 0.7, seen_dots(truth).shape)
    dots = dots[rng.random(len(dots)) > 0.3]
    smeared = rng.random(len(dots)) < 0.08
    dots[smeared] += rng.normal(0, 5, (smeared.sum(), 2))
    found = np.vstack([dots, rng.uniform([20, 20], [620, 460], (12, 2))])
    result = calibrate_from_dots(rng.permutation(found), PARAMS, SIZE, azimuth_hint_deg=40)
    points = pattern_points(PARAMS)[0][: 1 + 6 + 10 + 12 + 16]
    assert np.linalg.norm(result.mounted.project(points) - truth.project(points), axis=1).max() < 1.5
    assert result.median_px < 1.2
    for name, value in (("azimuth_rad", np.radians(40)), ("tilt_x_rad", 0.03), ("pupil_z_mm", 17.5), ("f_px", 243)):
        estimate, sigma, _ = result.values[name]
        assert abs(estimate - value) < 4 * sigma


def test_height_is_left_to_the_prior_and_said_so() -> None:
    """On the axis, pupil height and radial function are one unknown: the report must not claim otherwise."""
    painted = seen_dots(nominal_mount(PARAMS)) + np.random.default_rng(0).normal(0, 0.7, (87, 2))
    result = calibrate_from_dots(painted, PARAMS, SIZE, prior=OTHER_LENS)
    _, sigma, prior = result.values["pupil_z_mm"]
    assert sigma > 0.9 * prior and "mostly the prior" in result.report()
    heights = []
    for height_sigma in (0.01, 30.0):
        wide = MountPrior(height_mm=height_sigma, k=(1, 1))
        heights.append(calibrate_from_dots(seen_dots(nominal_mount(PARAMS)), PARAMS, SIZE, prior=wide).rms_px)
    assert max(heights) < 0.1


def test_known_lens_makes_height_observable() -> None:
    truth = true_camera()
    prior = MountPrior(height_mm=30)
    held = calibrate_from_dots(seen_dots(truth), PARAMS, SIZE, lens=truth.camera, prior=prior, azimuth_hint_deg=40)
    assert held.values["pupil_z_mm"][0] == pytest.approx(17.5, abs=0.05)
    assert held.values["pupil_z_mm"][1] < 1.0


def test_photo_to_camera_file(tmp_path, capsys) -> None:
    truth = true_camera(20)
    truth.save(tmp_path / "truth.json")
    photo = str(tmp_path / "a.png")
    arguments = ["--camera", str(tmp_path / "truth.json"), "--digit", "4", "--unpainted", "0.1", "--extra", "3"]
    assert render(["--out", photo, "--level", "draft", *arguments]) == 0
    out, picture = tmp_path / "camera.json", tmp_path / "fit.png"
    assert main(["--photo", photo, "--out", str(out), "--picture", str(picture), "--azimuth-hint", "10"]) == 0
    text = capsys.readouterr().out
    assert "residual" in text and picture.exists()
    inner = pattern_points(PARAMS)[0][:60]
    assert np.linalg.norm(MountedCamera.load(out).project(inner) - truth.project(inner), axis=1).max() < 1.5


def test_a_photo_of_other_dots_is_read_with_their_options_and_refused_without(tmp_path, capsys) -> None:
    photo, out = str(tmp_path / "a.png"), tmp_path / "camera.json"
    design = ["--diameter", "150", "--wall", "9", "--dot-rings", "1-6-10-14-18-22-24-26", "--dot-mm", "3.5"]
    assert render(["--out", photo, "--level", "draft", *design]) == 0
    assert main(["--photo", photo, "--out", str(out), *design]) == 0
    matched, found = map(int, re.search(r"dots matched (\d+) of (\d+) found", capsys.readouterr().out).groups())
    assert matched == found > 1 + 6 + 10 + 14 + 18 + 22 + 24  # all rings to the equator's
    out.unlink()
    assert main(["--photo", photo, "--out", str(out), *design[:4]]) == 2 and not out.exists()


@pytest.fixture
def zero_150(tmp_path):
    """A reference of D150 T9."""
    params = EndcapParams(150, 9)
    image = draw_dots(Drawing(specks=0, digit=""), params)[0]
    made_of = identity(params).without("camera", "silicone")
    save_zero(replace(single_zero(Frame(0, 0, "drawn", image=image)), made_of=made_of), tmp_path / "z.npz")
    return tmp_path / "z.npz"


def test_a_camera_of_a_reference_is_made_for_the_reference_s_own_design(zero_150, tmp_path) -> None:
    out = tmp_path / "camera.json"
    assert main(["--zero", str(zero_150), "--out", str(out), "--trust-design"]) == 0
    MountedCamera.load(out, identity(EndcapParams(150, 9)))
    with pytest.raises(FileError, match="D150_T9"):
        MountedCamera.load(out, identity(EndcapParams(130, 8)))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--diameter", "150", "--wall", "8"], "--wall 8: "), (["--diameter", "130"], "--diameter 130: "),
        (["--picture", "p.xyz"], "unknown picture format '.xyz'"),
    ],
)  # fmt: skip
def test_what_disagrees_with_a_reference_or_cannot_be_written_is_refused_first(zero_150, tmp_path, capsys, words, said):
    out = tmp_path / "camera.json"
    assert main(["--zero", str(zero_150), "--out", str(out), *words]) == 2 and not out.exists()
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


def test_finder_is_sub_pixel_on_clean_dots() -> None:
    ink = {"smeared": 0, "roughness": 0, "unevenness": 0, "overflow": 0, "radius_scale": 1, "size_spread": 0}
    clean = Paint(specks=0, jitter_mm=0, seams=False, **ink)
    frame = DomeRenderer(PARAMS, nominal_mount(PARAMS), RenderSettings(mesh=64, texels=1024, paint=clean)).render()
    found = find_dots(frame.image_bgr)
    whole = frame.dots_visible & ((frame.dots_px > 12) & (frame.dots_px < [627, 467])).all(1)
    distance = np.linalg.norm(found[:, None] - frame.dots_px[whole], axis=-1)
    assert np.median(distance.min(0)) < 0.25 and (distance.min(0) < 1.0).mean() > 0.97


def test_dots_of_a_hundred_and_fifty_pixels_are_found_as_in_a_smaller_picture() -> None:
    """The median of such a picture overflowed OpenCV's counters: wrong first, and from 300 px of window on an error."""
    large, seen = EndcapParams(101, 10, parse_rings("1-5-9-12"), 8.0), []
    for width, height in ((1280, 720), (1920, 1080)):
        drawing = Drawing(size=(width, height), centre_px=(width / 2 - 0.5, height / 2 - 0.5), specks=0, digit="")
        seen.append((find_dots(draw_dots(drawing, large)[0], large) + 0.5) / height)
    apart = np.linalg.norm(seen[0][:, None] - seen[1], axis=-1)
    assert len(seen[0]) == len(seen[1]) > 15 and 480 * apart.min(axis=1).max() < 0.3


def board_views(lens: FisheyeCamera, count: int, noise_px: float) -> tuple[list[BoardView], np.ndarray]:
    rng = np.random.default_rng(2)
    board = np.stack(np.meshgrid(np.arange(9) * 10.0, np.arange(7) * 10.0), -1).reshape(-1, 2)
    views = []
    while len(views) < count:
        lean = rng.uniform(-0.9, 0.9, 3)
        pan = rotation_matrix(np.append(rng.uniform(-1.2, 1.2, 2), 0.0))
        points = np.column_stack([board - [40, 30], np.zeros(len(board))]) @ rotation_matrix(lean).T
        points[:, 2] += rng.uniform(50, 90)
        pixels = lens.project(points @ pan.T)
        if np.isfinite(pixels).all():
            views.append(BoardView(board, pixels + rng.normal(0, noise_px, pixels.shape)))
    return views, board


def test_board_recovers_the_lens() -> None:
    lens = FisheyeCamera(640, 480, 246.0, 244.0, 322.0, 236.0, (-0.035, -0.004, 0.0005, 0.0))
    views, _ = board_views(lens, 12, 0.0)
    exact = calibrate_from_board(views, SIZE)
    assert exact.rms_px < 1e-3
    rays = np.stack([np.sin(t := np.radians(np.arange(5, 90, 5))), 0 * t, np.cos(t)], -1)
    assert np.abs(exact.camera.project(rays) - lens.project(rays)).max() < 0.05
    noisy = calibrate_from_board(board_views(lens, 12, 0.3)[0], SIZE)
    assert noisy.rms_px == pytest.approx(0.3 * np.sqrt(2), rel=0.1)
    assert np.abs(noisy.camera.project(rays[:14]) - lens.project(rays[:14])).max() < 1.0


def test_a_lens_from_a_board_sees_as_far_as_its_module(monkeypatch) -> None:
    views, _ = board_views(nominal_lens(), 4, 0.0)
    monkeypatch.setenv("ENDCAP_CAMERA", "ELP-USBFHD01M-L170")
    assert calibrate_from_board(views, SIZE).camera.max_half_angle_deg == camera_module().max_half_angle_deg == 88.0


def test_grouped_jacobian_is_the_full_one() -> None:
    owner = np.repeat([0, 1, 2], [2, 3, 2])

    def residual(vector: np.ndarray) -> np.ndarray:
        poses = vector[8:].reshape(3, 6)[owner]
        shared = np.sin(vector[:8] * np.arange(1, 9)).sum()
        return np.stack([shared + (poses**2).sum(1), shared * np.cos(poses).sum(1)], -1).ravel()

    vector = np.random.default_rng(0).normal(0, 1, 26)
    J = _grouped_jacobian(residual, vector, owner)
    assert np.allclose(J, approx_derivative(residual, vector, method="3-point"), atol=1e-6)


def board_photo(lens: FisheyeCamera, R: np.ndarray, t: np.ndarray) -> np.ndarray:
    """A chessboard of 10 x 7 squares of 10 mm with soft edges, traced ray by ray."""
    rays = lens.unproject(np.stack(np.meshgrid(np.arange(640), np.arange(480)), -1)) @ R
    start = -R.T @ t
    reach = -start[2] / rays[..., 2]
    x, y = (start[axis] + reach * rays[..., axis] for axis in (0, 1))
    on_paper = (reach > 0) & (np.abs(x - 40) < 60) & (np.abs(y - 25) < 45)
    on_board = (np.abs(x - 40) < 50) & (np.abs(y - 25) < 35)
    light = np.where(on_board, np.tanh(-6 * np.sin(np.pi * x / 10) * np.sin(np.pi * y / 10)), 1.0)
    gray = np.where(on_paper, 128 + 95 * light, 110).astype(np.uint8)
    return cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR)


def test_board_photos_to_lens(tmp_path, capsys) -> None:
    lens = replace(nominal_lens(), fx_px=240.0, fy_px=241.0, cx_px=323.0)
    rng, paths = np.random.default_rng(5), []
    for number in range(6):
        lean = rotation_matrix(rng.uniform(-0.5, 0.5, 3))
        pan = rotation_matrix([rng.uniform(-0.3, 0.3), rng.uniform(-0.7, 0.7), 0.0])
        shift = pan @ (lean @ [-40.0, -25, 0] + [0, 0, 75.0])
        paths.append(str(tmp_path / f"{number}.png"))
        cv2.imwrite(paths[-1], board_photo(lens, pan @ lean, shift))
    out = tmp_path / "lens.json"
    assert main(["--board", *paths, "--out", str(out)]) == 0
    assert "residual 0." in capsys.readouterr().out
    found = MountedCamera.load(out).camera
    rays = np.stack([np.sin(t := np.radians(np.arange(5, 65, 5))), 0 * t, np.cos(t)], -1)
    assert np.abs(found.project(rays) - lens.project(rays)).max() < 1.5  # six small photos: corners to 0.1 px


def test_a_squeezed_picture_is_not_only_called_another_design(tmp_path, capsys) -> None:
    picture = np.full((480, 640), 200, np.uint8)
    for x, y in nominal_mount(PARAMS).project(pattern_points(PARAMS)[0]):
        cv2.circle(picture, (round(16 * x), round(16 * y)), 16 * 7, 40, -1, cv2.LINE_AA, 4)
    cv2.imwrite(str(tmp_path / "a.png"), cv2.resize(picture, (640, 461), interpolation=cv2.INTER_AREA))
    assert main(["--photo", str(tmp_path / "a.png"), "--out", str(tmp_path / "c.json")]) == 2
    said = capsys.readouterr().err
    assert "is the picture squeezed" in said and said.count("\n") == 1 and not (tmp_path / "c.json").exists()


def test_bad_input_is_one_clear_line(tmp_path, capsys) -> None:
    (tmp_path / "dots.csv").write_text("u_px,v_px\n1,2\n3,x\n")
    with pytest.raises(FileError, match="line 3"):
        read_dots(tmp_path / "dots.csv")
    with pytest.raises(CalibrationError, match="3 dots found, at least 20"):
        calibrate_from_dots(np.zeros((3, 2)), PARAMS, SIZE)
    with pytest.raises(CalibrationError, match=r"at least 7 needed: this lens sees 4 of .* \(1-3-4\): more"):
        calibrate_from_dots(np.zeros((4, 2)), EndcapParams(99.46, 9.94, (1, 3, 4)), SIZE)
    rng = np.random.default_rng(0)
    with pytest.raises(CalibrationError, match="pattern not recognised"):
        calibrate_from_dots(rng.uniform(0, 480, (90, 2)), PARAMS, SIZE)
    with pytest.raises(CalibrationError, match="need 3 or more"):
        calibrate_from_board([], SIZE)
    lens = nominal_lens()
    views, _ = board_views(lens, 4, 0.0)
    shuffled = [BoardView(view.board_mm[::5], rng.permutation(view.pixels[::5])) for view in views]
    with pytest.raises(CalibrationError):
        calibrate_from_board(shuffled, SIZE)
    (tmp_path / "text.jpg").write_text("no image")
    (tmp_path / "empty.jpg").touch()
    cv2.imwrite(str(tmp_path / "black.png"), np.zeros((480, 640), np.uint8))
    (tmp_path / "cut.png").write_bytes((tmp_path / "black.png").read_bytes()[:-30])
    out = str(tmp_path / "camera.json")
    for arguments, words in (
        (["--photo", str(tmp_path / "black.png"), "--out", out], "gray value 0 of 255 (at least 50): more light"),
        (["--photo", str(tmp_path / "cut.png"), "--out", out], "decoded: it is damaged or cut, copy it again"),
        (["--photo", str(tmp_path / "empty.jpg"), "--out", out], "empty.jpg: an empty file"),
        (["--photo", "none.jpg", "--out", out], "none.jpg: cannot read"),
        (["--photo", str(tmp_path / "text.jpg"), "--out", out], "no picture"),
        (["--board", "none.csv", "--out", out], "none.csv: cannot read"),
        (["--board", "none.jpg", "--out", out, "--corners", "1x1"], "corners=1x1 outside 3x3..100x100"),
        (["--board", "none.jpg", "--out", out, "--square", "0"], "square=0 outside 0..1000 mm"),
        (["--board", "none.jpg", "--out", out, "--square", "-10"], "square=-10 outside 0..1000 mm"),
    ):
        assert main(arguments) == 2
        error = capsys.readouterr().err
        assert words in error and error.count("\n") == 1
    assert not (tmp_path / "camera.json").exists()
