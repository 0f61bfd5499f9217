"""How dots of a design look: against circles projected point by point, and sizes that scale as they should."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from cad.dots import dot_pattern, dot_position_mm
from cad.params import EndcapParams
from sensing.camera.dot_look import disc_radius_px, dot_look
from sensing.camera.nominal import nominal_mount

RELEASED = EndcapParams(130.0, 8.0)


def test_the_released_design_is_the_measure():
    assert dot_look() == dot_look(RELEASED)
    assert dot_look(RELEASED).scale == 1.0
    assert dot_look(replace(RELEASED, dot_mm=6.0)).scale == pytest.approx(1.5, abs=0.02)  # another dot may be in view


@pytest.mark.parametrize("size", [(100.0, 8.0), (130.0, 8.0), (250.0, 10.0)])
def test_a_disc_has_the_area_of_its_projected_circle(size):
    params = EndcapParams(*size)
    mounted = nominal_mount(params)
    for dot in dot_pattern(params)[:40:6]:
        normal = np.array(dot.direction)
        aside = np.cross(normal, [0.6, -0.8, 0.0])
        aside /= np.linalg.norm(aside)
        other = np.cross(normal, aside)
        angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)[:, None]
        centre = np.array(dot_position_mm(params, dot))
        circle = centre + 0.1 * (np.cos(angle) * aside + np.sin(angle) * other)  # small: the disc is linear in it
        area = cv2.contourArea(mounted.project(circle).astype(np.float32) * 100) / 1e4
        radius = float(disc_radius_px(mounted, centre[None], params)[0])
        assert radius * 0.1 / params.dot_radius_mm == pytest.approx(math.sqrt(area / math.pi), rel=2e-3)


def test_the_least_pitch_is_that_of_the_dots_in_the_frame():
    params = EndcapParams(130.0, 8.0, (1, 3, 3))
    pixels = nominal_mount(params).project(np.array([dot_position_mm(params, dot) for dot in dot_pattern(params)[:7]]))
    away = np.linalg.norm(pixels[:, None] - pixels[None], axis=-1)
    assert dot_look(params).least_pitch == pytest.approx(away[away > 0].min() / 480, rel=1e-9)
