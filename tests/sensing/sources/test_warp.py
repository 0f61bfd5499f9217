"""Warped pictures: displacement and its cells."""

import cv2
import numpy as np
import pytest

from cad.errors import ParameterError
from sensing.sources.degrade import random_degradation
from sensing.sources.warp import Bump, Displacement, cell_truth, warp_image


def test_warp_moves_a_dot_where_the_displacement_says():
    image = np.full((240, 320), 200, np.uint8)
    cv2.circle(image, (150, 110), 6, 20, -1)
    motion = Displacement((3.0, 2.0), 0.02, (160.0, 120.0), (Bump((150.0, 110.0), (8.0, -5.0), 90.0),))
    dark = 200.0 - warp_image(image, motion)
    y, x = np.mgrid[0:240, 0:320]
    centre = np.array([(dark * x).sum(), (dark * y).sum()]) / dark.sum()
    u, v = motion.at(np.array(150.0), np.array(110.0))
    assert np.abs(centre - [150 + u, 110 + v]).max() < 0.03


@pytest.mark.parametrize("shift", [0.1, 0.25, 0.5, 0.8])
def test_warp_shifts_a_ramp_without_bias(shift):
    ramp = np.tile(np.arange(0, 256, 2, dtype=np.uint8), (32, 1))
    moved = warp_image(ramp, Displacement((shift, 0.0))).astype(float)[4:-4, 8:-8]
    expected = np.floor(ramp[4:-4, 8:-8] - 2 * shift + 0.5)
    assert (moved == expected).mean() > 0.95  # one gray level is half a pixel of this ramp


def test_cell_truth_converges_to_the_centre_value_for_small_cells():
    motion = Displacement(bumps=(Bump((320.0, 240.0), (10.0, 0.0), 80.0),))
    fine = cell_truth(motion, (640, 480), (240, 240), unit_px=480)
    assert abs(fine[0].max() - 10) < 0.01
    coarse = cell_truth(motion, (640, 480), (30, 30), unit_px=480)
    assert np.allclose(fine.reshape(2, 30, 8, 30, 8).mean(axis=(2, 4)), coarse, atol=1e-3)


def test_unknown_level_is_refused():
    with pytest.raises(ParameterError, match="clean, mild, hard"):
        random_degradation("awful", np.random.default_rng(0))
