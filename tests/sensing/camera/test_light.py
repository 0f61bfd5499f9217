"""Light of pictures whose grays are known."""

import numpy as np
import pytest

from sensing.camera.light import light_of


def disc(gray: int, white: int = 0) -> np.ndarray:
    """A lit circle of one gray with so many white rows in its middle; black beside it."""
    rows, columns = np.indices((240, 320))
    picture = np.where(np.hypot(columns - 159.5, rows - 119.5) < 115, gray, 0).astype(np.uint8)
    picture[120 - white // 2 : 120 + white // 2, 60:260] = 255
    return picture


def test_a_white_band_is_too_bright_though_the_median_is_not():
    banded, plain = light_of(disc(150, 20)), light_of(disc(150))
    assert banded.median_gray == plain.median_gray == 150 and plain.white_share == 0
    assert banded.white_share == pytest.approx(20 * 200 / (np.pi * 114**2), rel=0.01)
    assert banded.too_bright and not plain.too_bright and not banded.too_dark
    assert light_of(disc(40)).too_dark and light_of(disc(250)).too_bright
    assert [light_of(disc(gray)).white_share for gray in (249, 250)] == [0.0, 1.0]


def test_of_colours_blue_and_green_count():
    gray, none = disc(150), disc(0)
    assert light_of(np.dstack([gray, gray, none])).median_gray == 150
    assert light_of(np.dstack([none, none, gray])).median_gray == 0
