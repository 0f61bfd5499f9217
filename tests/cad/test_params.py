"""The two numbers: docs/provenance.md at D=130, the region that can be made, and what is refused with which words."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from cad import feasible, pattern, scaling
from cad.errors import EndcapError, ParameterError
from cad.params import EndcapParams

FACT_MM = 0.05  # the released sensor is known to this
LIMIT = r"-?\d+(?:\.\d+)?"
NEAREST = re.compile(rf"nearest valid choice D=({LIMIT}) T=({LIMIT})")
LEAST_WALL_MM = 6.5
CORNERS = [(98.86, 6.5), (99.0, 6.5), (130.0, 6.5), (130.0, 13.0), (250.0, 6.5), (250.0, 25.0)]


def refusal(diameter_mm, wall_mm) -> str:
    with pytest.raises(ParameterError) as caught:
        EndcapParams(diameter_mm, wall_mm)
    return str(caught.value)


@pytest.fixture(scope="module")
def released():
    return EndcapParams(130.0, 8.0)


@pytest.mark.parametrize(
    ("name", "fact"),
    [
        ("outer_radius_mm", 65.0),
        ("base_sphere_radius_mm", 67.5),
        ("centre_height_mm", 38.37),
        ("base_thickness_mm", 16.0),
        ("screw_circle_radius_mm", 47.53),
        ("arm_circle_radius_mm", 60.0),
        ("interlock_depth_mm", 25.0),
    ],
)
def test_released_sizes(released, name, fact):
    assert getattr(released, name) == pytest.approx(fact, abs=FACT_MM)


def test_released_screw_and_arm_azimuths(released):
    assert released.screw_azimuths_deg == tuple(18.0 + 36 * k for k in range(10))
    assert sorted(released.arm_azimuths_deg) == sorted((180.0 + 72 * k) % 360 for k in range(5))


def test_screws_run_in_the_middle_of_the_released_wall(released):
    # E, GEO24: 47.31 at the mating plane; the circle was measured 0.22 mm outside it
    middle = (released.outer_radius_at(0.0) + released.inner_radius_at(0.0)) / 2
    assert middle == pytest.approx(47.31, abs=FACT_MM)
    assert abs(released.screw_circle_radius_mm - middle) < 0.25


@pytest.mark.parametrize(("diameter_mm", "wall_mm"), CORNERS)
def test_surfaces_are_spheres_about_one_centre(diameter_mm, wall_mm):
    params = EndcapParams(diameter_mm, wall_mm)
    for height in (0.0, 6.0, 20.0):
        offset = height - params.centre_height_mm
        assert math.hypot(params.outer_radius_at(height), offset) == pytest.approx(diameter_mm / 2)
        assert math.hypot(params.inner_radius_at(height), offset) == pytest.approx(diameter_mm / 2 - wall_mm)
    assert params.outer_radius_at(0.0) == pytest.approx(params.rim_radius_mm)
    assert params.outer_radius_at(params.tip_height_mm) == pytest.approx(0.0, abs=1e-4)
    assert params.outer_radius_at(params.tip_height_mm + 1) == 0.0  # beyond the tip there is no section


@pytest.mark.parametrize("wall_mm", [6.5, 8.0, 13.0])
def test_base_and_screws_do_not_depend_on_the_wall(released, wall_mm):
    other = EndcapParams(130.0, wall_mm)
    for name in ("screw_circle_radius_mm", "bore_radius_mm", "arm_circle_radius_mm", "rim_radius_mm"):
        assert getattr(other, name) == getattr(released, name)


def test_the_camera_sees_the_rim_of_its_view_in_its_own_plane():
    for diameter, wall in CORNERS:
        params = EndcapParams(diameter, wall)
        polar = math.radians(params.view_rim_polar_deg)
        height = params.centre_height_mm + params.inner_radius_mm * math.cos(polar)
        assert height == pytest.approx(params.camera_height_mm)


def test_params_are_frozen_floats_with_a_digest_of_their_own(released):
    with pytest.raises(dataclasses.FrozenInstanceError):
        released.wall_mm = 7.0
    assert EndcapParams(130, 8) == released
    assert EndcapParams(130, 8).digest == released.digest
    assert len({EndcapParams(d, t).digest for d, t in CORNERS}) == len(CORNERS)
    assert (released.label, EndcapParams(130, 8.5).label) == ("D130_T8", "D130_T8.5")


# --- the region ---------------------------------------------------------------------------------------------------


def test_the_least_rim_holds_ring_nut_and_screw():
    # 39.0 ring + 0.3 clearance + 2.8 half a nut + 1.7 ledge = screw circle; the rim is the released inset beyond it
    released_rim = math.sqrt(65.0**2 - 38.37**2)
    assert pytest.approx(39.0 + 0.3 + 2.8 + 1.7 + released_rim - 47.53) == scaling.MIN_RIM_RADIUS_MM
    assert EndcapParams(100.0, 7.0).rim_radius_mm == scaling.MIN_RIM_RADIUS_MM
    assert EndcapParams(180.0, 10.0).rim_radius_mm == pytest.approx(released_rim * 180 / 130)


def test_smallest_diameter_is_where_the_collar_ends_for_the_thinnest_wall():
    def room_mm(outer: float) -> float:
        """What dam, its margin (1.5) and bolt flange (6) leave of the height between equator and mating plane."""
        centre = math.sqrt(outer**2 - scaling.MIN_RIM_RADIUS_MM**2)
        return centre - 6.0 - 1.5 - (outer**2 / (outer - LEAST_WALL_MM) ** 2 - 1) * (centre - 6.0)

    expected = 2 * brentq(room_mm, scaling.MIN_RIM_RADIUS_MM + 0.1, 65.0, xtol=1e-10)
    assert feasible.diameter_range_mm()[0] == pytest.approx(expected, abs=1e-6)


def test_the_contact_zone_would_allow_smaller_diameters_still():
    # gyroid's end at 60 degrees: 31 = c + R/2, c^2 = R^2 - rim^2  =>  3/4 R^2 + 31 R - 31^2 - rim^2 = 0
    constant = 31.0**2 + scaling.MIN_RIM_RADIUS_MM**2
    outer = (-31.0 + math.sqrt(31.0**2 + 3 * constant)) / 1.5
    assert 2 * outer < feasible.diameter_range_mm()[0]


@pytest.mark.parametrize("diameter_mm", [130.0, 180.0, 250.0])
def test_thickest_wall_is_a_fifth_of_the_radius_or_less(diameter_mm):
    low, high = feasible.wall_range_mm(diameter_mm)
    assert low == LEAST_WALL_MM
    assert high == pytest.approx(diameter_mm / 10)


def test_a_wall_of_just_a_fifth_of_the_radius_is_accepted_as_typed():
    tenths = [(f"{step / 10:g}", f"{step / 100:g}") for step in range(1290, 2501)]  # D=179.2 T=17.92 was refused
    assert [words for words in tenths if EndcapParams(*map(float, words)).wall_mm != float(words[1])] == []
    proposed = [(d, t, feasible.nearest_wall_mm(float(d), 99.0)) for d, t in tenths]  # 16.06 * 100 ends under 1606
    assert [words for words in proposed if words[2] != float(words[1])] == []
    with pytest.raises(ParameterError, match=r"nearest valid choice D=179\.2 T=17\.92$"):
        EndcapParams(179.2, 17.9200001)


def test_thickest_wall_between_115_and_125_lets_the_ring_in():
    for diameter in (115.0, 120.0, 124.0):
        high = feasible.wall_range_mm(diameter)[1]
        assert high < diameter / 10
        assert EndcapParams(diameter, high).inner_radius_at(6.0) == pytest.approx(39.3)


def test_closing_stroke_conserves_the_silicone_above_the_equator():
    # what stands above the equator between flange and seam, as an integral over slices of the spherical shell
    params = EndcapParams(180.0, 10.0)
    stroke = feasible.closing_stroke_mm(180.0, 10.0)
    steps = 20000
    length = params.centre_height_mm - params.flange_thickness_mm
    annuli = (
        params.outer_radius_at(z) ** 2 - params.inner_radius_at(z) ** 2
        for z in (params.flange_thickness_mm + (k + 0.5) * length / steps for k in range(steps))
    )
    assert stroke * params.inner_radius_mm**2 == pytest.approx(sum(annuli) * length / steps, rel=1e-9)


@given(st.floats(feasible.diameter_range_mm()[0], 250.0), st.floats(0.0, 1.0))
def test_inside_the_region_everything_fits(diameter_mm, share):
    low, high = feasible.wall_range_mm(diameter_mm)
    params = EndcapParams(diameter_mm, min(max(low + share * (high - low), low), high))
    assert params.opening_radius_mm >= 39.3 - 1e-9  # ring with clearance passes
    assert params.bore_radius_mm < params.screw_circle_radius_mm - 2.75  # half a nut
    assert params.interlock_top_mm <= params.centre_height_mm + params.outer_radius_mm / 2 + 1e-9  # 60 degrees free
    assert feasible.dam_height_mm(diameter_mm, params.wall_mm) + 6.0 <= params.centre_height_mm + 1e-6
    assert params.outer_radius_mm / 5 + 1e-9 >= params.wall_mm >= LEAST_WALL_MM


@given(st.floats(1e-6, 1e4), st.floats(1e-6, 1e4))
def test_outside_the_region_the_refusal_is_complete_and_its_choice_is_accepted(diameter_mm, wall_mm):
    try:
        params = EndcapParams(diameter_mm, wall_mm)
    except ParameterError as error:
        message = str(error)
    else:
        low, high = feasible.wall_range_mm(diameter_mm)
        assert low <= params.wall_mm <= high
        return
    assert "\n" not in message
    assert re.match(rf"(diameter|wall)_mm=\S+ outside {LIMIT}\.\.{LIMIT}", message)
    nearest = NEAREST.search(message)
    assert nearest, message
    EndcapParams(float(nearest[1]), float(nearest[2]))


@pytest.mark.parametrize(
    ("diameter_mm", "wall_mm", "words"),
    [
        (130, 6.49, ["wall_mm=6.49", "6.5..13", "silicone can fill", "D=130 T=6.5"]),
        (130, 13.01, ["wall_mm=13.01", "6.5..13", "R/5", "D=130 T=13"]),
        (120, 11.5, ["wall_mm=11.5", "6.5..11.16", "LED ring", "39.3", "D=120 T=11.16"]),
        (99, 9.5, ["wall_mm=9.5", "6.5..8.19", "dam and bolt flange", "D=99 T=8.19"]),
        (250, 30, ["wall_mm=30", "6.5..25", "R/5", "D=250 T=25"]),
        (98, 5, ["diameter_mm=98 ", "98.86..250", "keep their size", "bolt flange", "D=98.86 T=6.5"]),
        (251, 5, ["diameter_mm=251", "98.86..250", "256 mm print bed", "D=250 T=6.5"]),
        (5.118, 8, ["diameter_mm=5.118", "looks like inches", "129.997 mm", "nearest valid choice"]),
        (8, 130, ["diameter_mm=8", "(swapped? D=130 T=8 can be made)", "nearest valid choice"]),
    ],
)
def test_refusals_name_value_limit_reason_and_nearest_choice(diameter_mm, wall_mm, words):
    message = refusal(diameter_mm, wall_mm)
    assert [word for word in words if word not in message] == []
    nearest = NEAREST.search(message)
    EndcapParams(float(nearest[1]), float(nearest[2]))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"diameter_mm": 250.0001}, "diameter_mm=250.0001 outside 98.86..250:"),
        ({"wall_mm": 6.4999999}, "wall_mm=6.4999999 outside 6.5..13 at D=130:"),
        ({"gyroid": 0.12000001}, "gyroid=0.12000001 outside 0.08..0.12:"),
        ({"dot_mm": 8.0000001}, "dot_mm=8.0000001 outside 2.9..8:"),
        ({"dot_mm": 4.0, "dot_rings": (1, 6, 88)}, "neighbours lie 3.87 mm apart, dots need 6 "),
        ({"dot_mm": 5.5449999, "dot_rings": (1, 3, 88)}, "with dot_mm=5.5449999 on an inner radius of 57 mm: "),
    ],
)
def test_a_refused_value_has_every_digit_that_was_given(given, words):
    with pytest.raises(ParameterError, match=re.escape(words)):
        EndcapParams(**({"diameter_mm": 130.0, "wall_mm": 8.0} | given))


@pytest.mark.parametrize("rings", [(1, 6.7, 10), "1-6-10", (1, math.nan, 10), 5, None])
def test_dots_of_a_ring_are_whole_numbers(rings):
    with pytest.raises(ParameterError, match="is no list of whole numbers: give the dots of each ring, for example"):
        EndcapParams(130.0, 8.0, rings)
    assert EndcapParams(130.0, 8.0, np.array([1, 6, 10])).dot_rings == (1, 6, 10)


def test_dots_that_lie_a_hair_too_near_are_not_said_to_lie_far_enough_apart():
    rings = (1, 6, 40)
    fitting = pattern.pitch_mm(57.0, rings) - pattern.LEAST_BRIDGE_MM
    message = refusal_of_dots(57.0, rings, fitting + 1e-7)
    apart, needed = map(float, re.search(r"lie ([\d.]+) mm apart, dots need ([\d.]+) ", message).groups())
    assert apart < needed


def refusal_of_dots(inner_radius_mm, rings, dot_mm) -> str:
    with pytest.raises(ParameterError) as caught:
        pattern.require_pattern(inner_radius_mm, rings, dot_mm)
    return str(caught.value)


@pytest.mark.parametrize("corner", CORNERS)
def test_corners_are_inside_and_just_beyond_them_is_not(corner):
    diameter, wall = corner
    EndcapParams(diameter, wall)
    beyond = [(diameter, wall - 0.011)] if wall == LEAST_WALL_MM else [(diameter, wall + 0.011)]
    beyond += [(250.01, wall)] if diameter == 250 else []
    beyond += [(98.85, wall)] if diameter == 98.86 else []
    for pair in beyond:
        refusal(*pair)


@pytest.mark.parametrize("value", ["130", "abc", None, True, False, [130], 1 + 0j])
def test_what_is_not_a_number_is_refused(value):
    for pair in ((value, 8.0), (130.0, value)):
        message = refusal(*pair)
        assert "is not a number" in message and repr(value) in message and "D=130 T=8" in message


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, -130.0, 0.0, -0.0])
def test_nan_infinity_zero_and_negative_are_refused(value):
    for pair in ((value, 8.0), (130.0, value)):
        message = refusal(*pair)
        assert "positive finite" in message and f"{value:g}" in message


def test_refusals_carry_name_and_value_and_are_value_errors():
    with pytest.raises(EndcapError) as caught:
        EndcapParams(130.0, 99.0)
    assert isinstance(caught.value, ValueError)
    assert (caught.value.name, caught.value.value) == ("wall_mm", 99.0)
