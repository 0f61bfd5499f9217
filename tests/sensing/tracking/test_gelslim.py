"""Parity with the released pipeline, against an independent, literal reading of its steps."""

import cv2
import numpy as np
import pytest
from scipy import signal

from cad.errors import ParameterError
from sensing.records import Frame
from sensing.sources.drawn import Drawing, draw_dots
from sensing.sources.warp import Bump, Displacement, warp_image
from sensing.tracking.gelslim import CHANNELS, GelslimConfig, GelslimField, helmholtz_parts, released_gray

PRESS = Displacement((3.0, -2.0), 0.01, bumps=(Bump((400.0, 300.0), (12.0, 9.0), 60.0),))


@pytest.fixture(scope="module")
def pair():
    image = draw_dots(Drawing())[0]
    return image, warp_image(image, PRESS)


def literal_gray(image: np.ndarray) -> np.ndarray:
    torch = pytest.importorskip("torch")
    tensor = torch.from_numpy(image).permute(2, 0, 1).float()
    height, width = tensor.shape[1:]
    side = min(height, width)
    top, left = (height - side) // 2, (width - side) // 2
    square = tensor[:, top : top + side, left : left + side]
    small = torch.nn.functional.interpolate(square[None], size=(200, 200), mode="area")[0]
    return cv2.cvtColor(small.permute(1, 2, 0).numpy().astype(np.uint8), cv2.COLOR_RGB2GRAY)


def literal_field(before: np.ndarray, after: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    flow = cv2.calcOpticalFlowFarneback(literal_gray(before), literal_gray(after), None, 0.5, 3, 45, 3, 5, 1.2, 0)
    pooled = np.zeros((8, 8, 2), np.float32)
    for i in range(8):
        for j in range(8):
            pooled[i, j] = flow[25 * i : 25 * i + 25, 25 * j : 25 * j + 25].reshape(-1, 2).mean(axis=0)
    return np.moveaxis(cv2.resize(pooled, shape[::-1]), 2, 0)


@pytest.mark.parametrize("size", [(480, 640), (720, 1280), (200, 200), (201, 333), (90, 140), (500, 300)])
def test_gray_is_bit_equal_at_any_size(size):
    image = np.random.default_rng(0).integers(0, 256, (*size, 3), dtype=np.uint8)
    assert (released_gray(image) == literal_gray(image)).all()


@pytest.mark.parametrize("shape", [(30, 30), (18, 18), (13, 18)])
def test_field_agrees_with_the_literal_pipeline(pair, shape):
    field = GelslimField(Frame(0, 0, "a", image=pair[0]), GelslimConfig(shape)).update(Frame(0, 1, "b", image=pair[1]))
    assert np.abs(field.channels - literal_field(*pair, shape)).max() < 1e-3
    assert np.abs(field.channels).max() > 1  # a press is seen at all


def test_blue_and_red_are_exchanged_as_in_the_released_code():
    blue = np.zeros((480, 640, 3), np.uint8)
    blue[:, :, 0] = 200
    assert released_gray(blue)[0, 0] == round(0.299 * 200)


def test_derived_and_change_channels(pair):
    worker = GelslimField(Frame(0, 0, "a", image=pair[0]), GelslimConfig((18, 18), CHANNELS))
    worker.update(Frame(0.0, 0, "a", image=pair[0]))
    field = worker.update(Frame(0.5, 1, "b", image=pair[1]))
    u, v = literal_field(*pair, (18, 18))
    expected = {
        "div": np.gradient(u, axis=1) + np.gradient(v, axis=0),
        "curl": np.gradient(v, axis=1) - np.gradient(u, axis=0),
        "du": u,
        "dvdt": v / 0.5,
    }
    for name, value in expected.items():
        assert np.abs(field.channel(name) - value).max() < 1e-3, name


def literal_channels(u: np.ndarray, v: np.ndarray) -> dict[str, np.ndarray]:
    """div, curl and Helmholtz parts cell by cell, by sums over all pairs of cells."""
    height, width = u.shape

    def slope(f: np.ndarray, i: int, j: int, down: bool) -> float:
        n, k = (height, i) if down else (width, j)
        low, high = max(k - 1, 0), min(k + 1, n - 1)
        return float(f[high, j] - f[low, j] if down else f[i, high] - f[i, low]) / (high - low)

    cells = [(i, j) for i in range(height) for j in range(width)]
    div, curl, potential, stream = (np.zeros(u.shape) for _ in range(4))
    for i, j in cells:
        div[i, j] = slope(u, i, j, False) + slope(v, i, j, True)
        curl[i, j] = slope(v, i, j, False) - slope(u, i, j, True)
    rows, columns = np.mgrid[:height, :width]
    for i, j in cells:
        radius = np.hypot(rows - i, columns - j)
        radius[i, j] = 0.5
        green = np.log(radius) / (2 * np.pi)
        potential[i, j], stream[i, j] = (green * div).sum(), (green * curl).sum()
    parts = {name: np.zeros(u.shape) for name in ("sol_u", "sol_v", "irr_u", "irr_v")}
    for i, j in cells:
        parts["irr_u"][i, j], parts["irr_v"][i, j] = slope(potential, i, j, False), slope(potential, i, j, True)
        parts["sol_u"][i, j], parts["sol_v"][i, j] = -slope(stream, i, j, True), slope(stream, i, j, False)
    return parts | {"div": div, "curl": curl}


@pytest.mark.parametrize("shape", [(30, 30), (18, 18)])
def test_every_channel_agrees_with_the_literal_pipeline(pair, shape):
    start, end = pair
    middle = warp_image(start, PRESS.scaled(0.4))
    worker = GelslimField(Frame(0, 0, "a", image=start), GelslimConfig(shape, CHANNELS))
    worker.update(Frame(0.10, 0, "m", image=middle))
    field = worker.update(Frame(0.14, 1, "b", image=end))
    u, v = literal_field(start, end, shape)
    du, dv = literal_field(middle, end, shape)
    expected = {"u": u, "v": v, "du": du, "dv": dv, "dudt": du / 0.04, "dvdt": dv / 0.04} | literal_channels(u, v)
    assert set(expected) == set(CHANNELS)
    for name, value in expected.items():
        assert np.abs(field.channel(name) - value).max() < 1e-3, name


def test_helmholtz_parts_agree_with_a_direct_convolution():
    rng = np.random.default_rng(3)
    u, v = (cv2.GaussianBlur(rng.normal(size=(30, 26)), (0, 0), 2) for _ in range(2))
    y, x = np.mgrid[-29:30, -25:26]
    radius = np.hypot(x, y)
    radius[29, 25] = 0.5
    green = np.log(radius) / (2 * np.pi)
    div = np.gradient(u, axis=1) + np.gradient(v, axis=0)
    curl = np.gradient(v, axis=1) - np.gradient(u, axis=0)
    potential, stream = (signal.convolve2d(f, green, mode="full")[29:59, 25:51] for f in (div, curl))
    solenoidal, irrotational = helmholtz_parts(u, v)
    assert np.allclose(irrotational[0], np.gradient(potential, axis=1), atol=1e-10)
    assert np.allclose(irrotational[1], np.gradient(potential, axis=0), atol=1e-10)
    assert np.allclose(solenoidal[0], -np.gradient(stream, axis=0), atol=1e-10)
    assert np.allclose(solenoidal[1], np.gradient(stream, axis=1), atol=1e-10)


def test_helmholtz_splits_a_source_from_a_vortex():
    y, x = np.mgrid[-15:15, -15:15] + 0.5
    bump = np.exp(-(x**2 + y**2) / 32)
    source, vortex = (x * bump, y * bump), (-y * bump, x * bump)
    (sol_u, _), (irr_u, _) = helmholtz_parts(*source)
    assert (
        np.abs(sol_u).max() < 0.01 * np.abs(source[0]).max()
        and np.abs(irr_u - source[0]).max() < 0.1 * np.abs(source[0]).max()
    )
    (sol_u, _), (irr_u, _) = helmholtz_parts(*vortex)
    assert (
        np.abs(irr_u).max() < 0.01 * np.abs(source[0]).max()
        and np.abs(sol_u - vortex[0]).max() < 0.1 * np.abs(vortex[0]).max()
    )


def test_bad_configuration_is_named():
    with pytest.raises(ParameterError, match="channels=w"):
        GelslimConfig(channels=("u", "w"))
    with pytest.raises(ParameterError, match="1x30 outside 2x2"):
        GelslimConfig(shape=(1, 30))
