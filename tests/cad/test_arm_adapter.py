"""The arm adapter at several sizes: axes meet the base's, heads lie inside the hub, dome screws stay free."""

from __future__ import annotations

import math

import pytest
from build123d import Solid
from long_cases import others_long

from cad.arm_adapter import THICKNESS_MM, adapter_part, arm_places_mm
from cad.base import base_part
from cad.errors import ParameterError
from cad.params import EndcapParams
from cad.robot_sides import HUB_RADIUS_MM, robot_side, robot_sides

SIZES = others_long([(98.86, 6.5), (130.0, 8.0), (250.0, 25.0)])


@pytest.mark.parametrize("size", SIZES)
def test_it_lies_under_the_base_and_its_screws_meet_the_inserts(size):
    params = EndcapParams(*size)
    solid = adapter_part(params).solid
    assert (
        pytest.approx(-16.0) == solid.bounding_box().max.Z
        and pytest.approx(THICKNESS_MM) == solid.bounding_box().size.Z
    )
    base = base_part(params).solid
    for x, y in arm_places_mm(params):
        assert not solid.is_inside((x, y, -26.0)) and not base.is_inside((x, y, -10.0))
        assert solid.is_inside((x + 3.0, y, -20.0)) and base.is_inside((x + 4.0, y, -12.0))


@pytest.mark.parametrize("size", SIZES)
def test_heads_of_the_dome_screws_stay_free(size):
    params = EndcapParams(*size)
    solid = adapter_part(params).solid
    for azimuth in params.screw_azimuths_deg:
        x, y = (params.screw_circle_radius_mm * f(math.radians(azimuth)) for f in (math.cos, math.sin))
        key = Solid.make_cylinder(3.25, 60.0).translate((x, y, -60.0))
        shared = solid.intersect(key)
        assert not shared or sum(s.volume for s in shared.solids()) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("pattern", sorted(robot_sides()))
def test_every_pattern_keeps_its_walls(pattern):
    solid = adapter_part(EndcapParams(98.86, 6.5), pattern).solid
    for holes in robot_side(pattern):
        assert holes.circle_radius_mm + holes.head_diameter_mm / 2 < HUB_RADIUS_MM - 3.0
        for x, y in holes.places_mm:
            assert not solid.is_inside((x, y, -33.0))
    places = [(p, max(h.head_diameter_mm, h.hole_diameter_mm) / 2) for h in robot_side(pattern) for p in h.places_mm]
    gaps = [math.dist(p, q) - a - b for k, (p, a) in enumerate(places) for q, b in places[:k]]
    assert min(gaps, default=2.0) >= 1.5


@pytest.mark.parametrize("pattern", [name for name in robot_sides() if robot_side(name)])
def test_a_screw_enters_the_flange_by_what_the_adapter_leaves_of_its_length(pattern):
    solid = adapter_part(EndcapParams(98.86, 6.5), pattern).solid
    holes = next(holes for holes in robot_side(pattern) if holes.element == "screw")
    under_head = (holes.hole_diameter_mm + holes.head_mm) / 4  # from the axis: half of it bears
    x, y = holes.places_mm[0]
    heights = [-36.0 + 0.05 + 0.1 * k for k in range(200)]
    grip_mm = 0.1 * sum(solid.is_inside((x + under_head, y, z)) for z in heights)
    length_mm = float(holes.order_as.split()[-1])
    assert holes.enters_mm == pytest.approx(length_mm - grip_mm, abs=0.06)
    assert holes.body_mm <= holes.enters_mm <= 8.0  # more breaks into some robots' flanges


def test_an_unknown_robot_is_refused_with_the_list():
    with pytest.raises(ParameterError, match=r"robot=puma .*blank"):
        robot_side("puma")
