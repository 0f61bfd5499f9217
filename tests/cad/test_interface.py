"""The TPU flange and the gyroid zone's envelope: closed forms, positions, and the sizes at the region's corners."""

from __future__ import annotations

import math

import numpy as np
import pytest
from long_cases import others_long
from scipy.integrate import quad

from bench.sizes import random_sizes
from cad import interface
from cad.bought import bought_mm
from cad.errors import ParameterError
from cad.params import EndcapParams

SIZES = others_long(
    [(98.86, 6.5), (130, 8), (250, 25), (99, 8.1), (180, 10), (130, 6.5), (130, 13), (250, 6.5)], 3, unpack=True
)


def slab_mm3(radius: float, low: float, high: float) -> float:
    return quad(lambda z: math.pi * (radius**2 - z**2), low, high)[0]


def vent_mm3(params: EndcapParams) -> float:
    """Volume that one vent takes from the flange, by counting cells of a fine grid (good to 1e-3)."""
    sphere, height = params.outer_radius_mm - interface.COLLAR_CLEARANCE_MM, params.flange_thickness_mm
    foot, head = (math.sqrt(sphere**2 - (z - params.centre_height_mm) ** 2) for z in (0.0, height))
    step = 0.02
    x = np.arange(min(foot, head) - 2, max(foot, head) + 2, step) + step / 2
    y = np.arange(-1.6, 1.6, step) + step / 2
    count = 0
    for z in np.arange(0, height, 0.1) + 0.05:
        along = np.array([head - foot, height]) / math.hypot(head - foot, height)
        off_axis = (x - foot) * along[1] - z * along[0]
        in_vent = off_axis[:, None] ** 2 + y**2 < (interface.VENT_DIAMETER_MM / 2) ** 2
        in_sphere = x[:, None] ** 2 + y**2 + (z - params.centre_height_mm) ** 2 < sphere**2
        count += int((in_vent & in_sphere).sum())
    return count * step**2 * 0.1


def flange_mm3(params: EndcapParams) -> float:
    """The flange's volume without the CAD kernel."""
    sphere, bore, height = params.outer_radius_mm - 0.2, params.bore_radius_mm, params.flange_thickness_mm
    ring = slab_mm3(sphere, -params.centre_height_mm, height - params.centre_height_mm) - math.pi * bore**2 * height
    rib = params.screw_circle_radius_mm - 2.75 - 0.15
    mouth = quad(lambda y: rib - math.sqrt(bore**2 - y**2), -2.825, 2.825)[0] * (2.0 - 0.4)
    seat = (2.75 + 0.15 + 2.75 + 0.1) * 5.65 * 2.0
    hole = math.pi * 1.7**2 * (5.35 - 2.0)
    return ring - 10 * (mouth + seat + hole + vent_mm3(params))


@pytest.mark.parametrize(("diameter", "wall"), SIZES)
def test_the_room_at_the_flanges_edge_is_what_clearance_and_vents_leave(diameter: float, wall: float) -> None:
    params = EndcapParams(diameter, wall)
    ends = (-params.centre_height_mm, params.flange_thickness_mm - params.centre_height_mm)
    clearance = slab_mm3(params.outer_radius_mm, *ends) - slab_mm3(params.outer_radius_mm - 0.2, *ends)
    room = clearance + 10 * vent_mm3(params)
    assert 0.95 * room < interface.edge_room_mm3(params) <= room


@pytest.mark.parametrize(("diameter", "wall"), SIZES)
def test_flange_has_the_closed_form_volume(diameter: float, wall: float) -> None:
    params = EndcapParams(diameter, wall)
    flange = interface.build_flange(params)
    assert flange.is_valid
    assert flange.volume == pytest.approx(flange_mm3(params), rel=5e-5)  # the ten vents are counted to 2 in 100,000


def test_vents_and_nuts_do_not_meet() -> None:
    params = EndcapParams(98.9, 7)
    gap = params.screw_circle_radius_mm * math.radians(18) - 1.5 - interface.POCKET_WIDTH_MM / 2
    assert gap > 5.0


def test_flange_touches_the_mating_plane_and_leaves_the_collar_its_clearance() -> None:
    params = EndcapParams(130, 8)
    flange = interface.build_flange(params)
    box = flange.bounding_box()
    assert pytest.approx(0.0, abs=1e-6) == box.min.Z
    assert pytest.approx(6.0, abs=1e-6) == box.max.Z
    reach = max((vertex.center() - (0, 0, params.centre_height_mm)).length for vertex in flange.vertices())
    assert reach == pytest.approx(params.outer_radius_mm - 0.2, abs=1e-6)


def test_screw_holes_are_on_the_released_circle() -> None:
    from build123d import GeomType

    params = EndcapParams(130, 8)
    faces = interface.build_flange(params).faces().filter_by(GeomType.CYLINDER)
    axes = [face.axis_of_rotation for face in faces if face.radius == pytest.approx(1.7)]
    places = {(round(a.position.X, 3), round(a.position.Y, 3)) for a in axes if a is not None}
    wanted = {
        (round(47.53 * math.cos(math.radians(a)), 3), round(47.53 * math.sin(math.radians(a)), 3))
        for a in range(18, 360, 36)
    }
    assert len(wanted) == 10
    for x, y in places:
        assert min(math.hypot(x - u, y - v) for u, v in wanted) < 0.01
    assert len({min(wanted, key=lambda w: math.hypot(w[0] - x, w[1] - y)) for x, y in places}) == 10


@pytest.mark.parametrize(("diameter", "wall"), SIZES)
def test_zone_volume_is_its_integral_and_its_solid(diameter: float, wall: float) -> None:
    params = EndcapParams(diameter, wall)
    inner, outer = interface.zone_radii_mm(params)
    clip = interface.zone_clip_radius_mm(params)

    def section(z: float) -> float:
        offset = (z - params.centre_height_mm) ** 2
        return math.pi * (outer**2 - offset - max(inner**2 - offset, clip**2))

    integral = quad(section, params.flange_thickness_mm, params.interlock_top_mm, limit=200)[0]
    assert interface.zone_volume_mm3(params) == pytest.approx(integral, rel=1e-6)
    assert interface.build_zone(params).volume == pytest.approx(integral, rel=1e-6)


def test_a_thick_wall_leaves_the_gyroid_standing_on_the_flange() -> None:
    thick, thin = EndcapParams(130, 13), EndcapParams(130, 8)
    assert interface.zone_clip_radius_mm(thick) == pytest.approx(thick.bore_radius_mm + 0.5)
    assert interface.zone_clip_radius_mm(thin) == 0.0
    for params in (random_size.params for random_size in random_sizes(3, 300)):
        foot = params.inner_radius_mm + params.skin_mm  # sphere of the zone, where it meets the flange
        section = math.sqrt(foot**2 - (params.flange_thickness_mm - params.centre_height_mm) ** 2)
        assert max(section, interface.zone_clip_radius_mm(params)) >= params.bore_radius_mm + 0.5


def test_bought_parts_are_read_from_the_table() -> None:
    assert bought_mm("nut_m3", "across_flats") == 5.5  # DIN 562
    with pytest.raises(
        ParameterError, match=r"nut_m3\.colour is not in cad/bought\.csv: known are .*nut_m3\.thickness"
    ):
        bought_mm("nut_m3", "colour")
