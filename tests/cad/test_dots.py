"""The pattern of dots: the released counts, equal polar steps, one meridian, inside the camera's view."""

from __future__ import annotations

import math
import random
import re
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cad.dots import dot_pattern, dot_position_mm, ring_count
from cad.errors import ParameterError
from cad.params import EndcapParams
from cad.pattern import (
    LEAST_BRIDGE_MM,
    RELEASED_RINGS,
    most_dots,
    parse_rings,
    pitch_mm,
    require_pattern,
    step_deg,
)

RELEASED_COUNTS = (1, 6, 10, 12, 16, 18)  # M, CAM06
SIZES = [(98.86, 6.5), (99.0, 8.1), (130.0, 8.0), (180.0, 10.0), (250.0, 6.5), (250.0, 25.0)]


@pytest.fixture(params=SIZES, ids=lambda s: f"D{s[0]:g}_T{s[1]:g}")
def params(request):
    return EndcapParams(*request.param)


def test_released_rings():
    counts = Counter(dot.ring for dot in dot_pattern(EndcapParams(130.0, 8.0)))
    assert tuple(counts[k] for k in range(6)) == RELEASED_COUNTS


def test_counts_mirror_about_the_equator():
    params = EndcapParams(130.0, 8.0)
    assert [ring_count(params, k) for k in range(14)] == [ring_count(params, 13 - k) for k in range(14)]


def test_rings_stand_at_equal_polar_steps_with_a_dot_on_one_meridian(params):
    dots = dot_pattern(params)
    for dot in dots:
        assert dot.polar_deg == pytest.approx(dot.ring * 180.0 / 13)
        assert dot.azimuth_deg == pytest.approx(360.0 * dot.index / ring_count(params, dot.ring))
    assert {dot.ring for dot in dots if dot.azimuth_deg == 0.0} == {dot.ring for dot in dots}
    assert sorted({dot.ring for dot in dots}) == list(range(max(dot.ring for dot in dots) + 1))


def test_every_dot_is_whole_in_view_and_one_more_ring_would_not_be(params):
    dots = dot_pattern(params)
    half_angle = math.degrees(math.asin(2.0 / params.inner_radius_mm))
    last = max(dot.polar_deg for dot in dots)
    assert last + half_angle <= params.view_rim_polar_deg < last + 180.0 / 13 + half_angle


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
    assert least > 4.0 + 1.0  # a millimetre of silicone between two dents


CHOICES = [(1, 6, 12, 18), (1, 5, 9, 12, 14), RELEASED_RINGS, (1, 4, 8, 10, 12, 14, 16, 18)]


@pytest.mark.parametrize("rings", CHOICES)
def test_other_counts_follow_the_same_law_and_their_least_pitch_is_the_closed_form(rings):
    params = EndcapParams(150.0, 9.0, rings, 3.5)
    dots = dot_pattern(params)
    assert [ring_count(params, k) for k in range(len(rings))] == list(rings)
    assert ring_count(params, len(rings)) == rings[-1]  # the equator lies midway
    assert {dot.polar_deg for dot in dots} == {dot.ring * step_deg(rings) for dot in dots}
    places = [dot_position_mm(params, dot) for dot in dots]
    least = min(math.dist(a, b) for i, a in enumerate(places) for b in places[:i])
    assert least == pytest.approx(pitch_mm(params.inner_radius_mm, rings))


def test_dots_that_do_not_fit_are_refused_with_the_number_that_does():
    inner, rings = EndcapParams(130.0, 8.0).inner_radius_mm, (1, 6, 10, 12, 16, 60, 20)
    most = most_dots(inner, rings, 5, 4.0 + LEAST_BRIDGE_MM)
    with pytest.raises(ParameterError, match=f"ring 5 at most {most}"):
        EndcapParams(130.0, 8.0, rings)
    EndcapParams(130.0, 8.0, (*rings[:5], most, 20))
    with pytest.raises(ParameterError, match=f"ring 5 at most {most}"):
        EndcapParams(130.0, 8.0, (*rings[:5], most + 1, 20))
    with pytest.raises(ParameterError, match="at most 7 rings"):
        EndcapParams(98.9, 6.5, (1, *(4,) * 11), 8.0)
    with pytest.raises(ParameterError, match=r"or dot_mm=7\.\d"):
        EndcapParams(98.9, 6.5, (1, 6, 12, 16, 20, 28), 8.0)


@given(st.integers(0, 10**6))
def test_the_dots_that_a_refusal_proposes_are_accepted(seed):
    draw = random.Random(seed)
    inner, dot_mm = draw.uniform(40.0, 118.0), draw.uniform(2.9, 8.0)
    rings = (1, *(draw.randint(3, 4 + 12 * ring) for ring in range(1, draw.randint(3, 12))))
    if seed % 4 == 0 and 2.9 <= (just := pitch_mm(inner, rings) - LEAST_BRIDGE_MM) <= 8.0:
        dot_mm = min(8.0, math.nextafter(just, math.inf))  # one bit too large: the remedy was empty
    try:
        require_pattern(inner, rings, dot_mm)
    except ParameterError as error:
        choice = re.search(r"(?:rings|ring \d+ at most \d+): dots=([\d-]+)(?:, or dot_mm=([\d.]+))?$", str(error))
        require_pattern(inner, parse_rings(choice[1]), dot_mm)
        if choice[2]:
            require_pattern(inner, rings, float(choice[2]))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"dot_mm": 2.0}, r"dot_mm=2 outside 2.9..8: .*nearest valid choice dot_mm=2.9"),
        ({"dot_mm": 9.0}, "nearest valid choice dot_mm=8"),
        ({"dot_rings": (2, 6, 10)}, "the first of 1 dot"),
        ({"dot_rings": (1, 6)}, "give 3 to 12 rings"),
        ({"gyroid": 0.5}, "gyroid=0.5 outside .*nearest valid choice gyroid="),
    ],
)
def test_options_out_of_range_are_refused_with_the_nearest(options, said):
    with pytest.raises(ParameterError, match=said):
        EndcapParams(130.0, 8.0, **options)


@pytest.mark.parametrize("text", ["1,6,10", "1-6-x", "", "1--6", "1-６-10", "1-" + 5000 * "1"])
def test_counts_of_another_form_are_refused(text):
    with pytest.raises(ParameterError, match="not of the form") as caught:
        parse_rings(text)
    assert len(str(caught.value)) < 250


def test_options_are_part_of_label_digest_and_record_only_where_they_differ():
    plain = EndcapParams(130.0, 8.0)
    assert plain == EndcapParams(130.0, 8.0, RELEASED_RINGS, 4.0, 0.1)
    assert plain.label == "D130_T8" and plain.record == {"diameter_mm": 130.0, "wall_mm": 8.0}
    other = EndcapParams(130.0, 8.0, (1, 6, 12, 18), 3.5, 0.12)
    assert other.label == "D130_T8_dots1-6-12-18_dot_mm3.5_gyroid0.12" and other.digest != plain.digest
    assert EndcapParams(**other.record) == other
