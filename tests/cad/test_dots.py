"""The pattern of dots: the released counts, equal polar steps, one meridian, inside the camera's view."""

from __future__ import annotations

import math
from collections import Counter

import pytest

from cad.dots import DOT_RADIUS_MM, POLAR_STEP_DEG, dot_pattern, dot_position_mm, ring_count
from cad.params import EndcapParams

RELEASED_COUNTS = (1, 6, 10, 12, 16, 18)  # M, CAM06
SIZES = [(98.86, 6.5), (99.0, 8.1), (130.0, 8.0), (180.0, 10.0), (250.0, 6.5), (250.0, 25.0)]


@pytest.fixture(params=SIZES, ids=lambda s: f"D{s[0]:g}_T{s[1]:g}")
def params(request):
    return EndcapParams(*request.param)


def test_released_rings():
    counts = Counter(dot.ring for dot in dot_pattern(EndcapParams(130.0, 8.0)))
    assert tuple(counts[k] for k in range(6)) == RELEASED_COUNTS


def test_counts_mirror_about_the_equator():
    assert [ring_count(k) for k in range(14)] == [ring_count(13 - k) for k in range(14)]


def test_rings_stand_at_equal_polar_steps_with_a_dot_on_one_meridian(params):
    dots = dot_pattern(params)
    for dot in dots:
        assert dot.polar_deg == pytest.approx(dot.ring * POLAR_STEP_DEG)
        assert dot.azimuth_deg == pytest.approx(360.0 * dot.index / ring_count(dot.ring))
    assert {dot.ring for dot in dots if dot.azimuth_deg == 0.0} == {dot.ring for dot in dots}
    assert sorted({dot.ring for dot in dots}) == list(range(max(dot.ring for dot in dots) + 1))


def test_every_dot_is_whole_in_view_and_one_more_ring_would_not_be(params):
    dots = dot_pattern(params)
    half_angle = math.degrees(math.asin(DOT_RADIUS_MM / params.inner_radius_mm))
    last = max(dot.polar_deg for dot in dots)
    assert last + half_angle <= params.view_rim_polar_deg < last + POLAR_STEP_DEG + half_angle


def test_positions_lie_on_the_inner_sphere_above_the_camera(params):
    for dot in dot_pattern(params):
        assert math.hypot(*dot.direction) == pytest.approx(1.0)
        x, y, z = dot_position_mm(params, dot)
        assert math.hypot(x, y, z - params.centre_height_mm) == pytest.approx(params.inner_radius_mm)
        assert z > params.camera_height_mm
    assert dot_position_mm(params, dot_pattern(params)[0])[:2] == (0.0, 0.0)  # ring 0 is the tip


def test_no_two_dots_touch(params):
    places = [dot_position_mm(params, dot) for dot in dot_pattern(params)]
    least = min(math.dist(a, b) for i, a in enumerate(places) for b in places[:i])
    assert least > 2 * DOT_RADIUS_MM + 1.0  # a millimetre of silicone between two dents
