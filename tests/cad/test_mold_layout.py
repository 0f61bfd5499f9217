"""Closed forms of the mold over the whole region: necks of core tabs, joints that hold the silicone, vents."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from cad import leak
from cad.errors import ParameterError
from cad.feasible import diameter_range_mm, wall_range_mm
from cad.interface import vent_reach_mm, zone_radii_mm
from cad.materials import silicone, silicones
from cad.mold.layout import CORE_NECK_HALF_MM, NECK_FILLET_MM, MoldLayout, joint_clearance_range_mm, rotated
from cad.params import EndcapParams

DIAMETERS = np.linspace(diameter_range_mm()[0] + 1e-6, 250.0, 40)
REGION = [EndcapParams(float(d), float(t)) for d in DIAMETERS for t in np.linspace(*wall_range_mm(float(d)), 5)]


def neck_half_mm(layout: MoldLayout, height_mm: float, radius_mm: float) -> float:
    """Half the neck of a core tab at a height: the tab's fillets, whose centres stay, widen with the draft."""
    across = (radius_mm + NECK_FILLET_MM) ** 2 - (0.62 * radius_mm - NECK_FILLET_MM) ** 2
    return math.sqrt(across) - NECK_FILLET_MM - height_mm * math.tan(math.radians(layout.core_draft_deg))


def test_no_neck_of_a_core_tab_is_thinner_than_wanted_up_to_the_tip():
    for params in REGION:
        layout = MoldLayout(params)
        neck = neck_half_mm(layout, params.tip_height_mm, layout.core_tab_radius_mm)
        assert neck >= CORE_NECK_HALF_MM - 1e-9
        assert layout.core_tab_radius_mm == 4.0 or neck == pytest.approx(CORE_NECK_HALF_MM)
        room = layout.neck_radius_mm - layout.centre_inradius_mm - 2 * layout.core_tab_radius_mm
        assert room > 7.5  # for the key's own screw and 2.4 mm of PLA on either side of it
    largest = MoldLayout(EndcapParams(250.0, 12.0))
    assert neck_half_mm(largest, largest.params.tip_height_mm, 4.0) < 0.2  # released tabs would come off


def test_every_size_has_joints_from_0_05_to_0_2_mm_and_its_widest_just_holds():
    for params in REGION:
        low, high = joint_clearance_range_mm(params)
        assert low == 0.05 and 0.2 <= high <= 0.3
        layout = MoldLayout(params, high)
        assert leak.LEAST_BOWL_WALL_MM <= layout.bowl_wall_mm <= leak.MOST_BOWL_WALL_MM
        volume = leak.sizing_volume_mm3(params)
        assert leak.leak_ratio(params, silicone(), high, layout.bowl_wall_mm, volume) <= leak.DESIGN_RATIO * (1 + 1e-9)
        if high < 0.3:
            wider = leak.leak_ratio(params, silicone(), high + 1e-3, leak.MOST_BOWL_WALL_MM, volume)
            assert wider > leak.DESIGN_RATIO
            with pytest.raises(ParameterError, match="leak more than 1 %"):
                MoldLayout(params, high + 1e-3)


@pytest.mark.parametrize("row", silicones().values(), ids=lambda row: row.name)
def test_a_thinner_silicone_gets_closer_joints_by_the_cube_root_of_its_viscosity(row):
    usual, size = silicone(), EndcapParams(150.0, 9.0)
    ratio = row.viscosity_pa_s / row.pot_life_min / row.density_g_cm3
    ratio /= usual.viscosity_pa_s / usual.pot_life_min / usual.density_g_cm3
    assert leak.widest_joint_mm(size, row) == pytest.approx(leak.widest_joint_mm(size, usual) * ratio ** (1 / 3))
    for params in REGION:
        low, high = joint_clearance_range_mm(params, row.name)
        assert low <= high  # every silicone of the table can be cast at every size
        layout = MoldLayout(params, high, row.name)
        leaked = leak.leak_ratio(params, row, high, layout.bowl_wall_mm, leak.sizing_volume_mm3(params))
        assert leaked <= leak.DESIGN_RATIO * (1 + 1e-9)


def test_a_thin_silicone_is_refused_with_the_joint_that_holds_it():
    params = EndcapParams(130.0, 8.0)
    _, high = joint_clearance_range_mm(params, "Ecoflex 00-30")
    assert 0.05 < high < 0.15
    with pytest.raises(
        ParameterError, match=rf"Ecoflex 00-30 \(3 Pa s\).*nearest valid choice joint_clearance={high:g};"
    ):
        MoldLayout(params, silicone="Ecoflex 00-30")
    assert MoldLayout(params, high, "Ecoflex 00-30").bowl_wall_mm == pytest.approx(leak.MOST_BOWL_WALL_MM, abs=0.3)


def test_a_refused_clearance_has_every_digit_that_was_given():
    with pytest.raises(
        ParameterError, match=r"joint_clearance=0\.2170001 outside 0\.05\.\.0\.217 mm .* D=130\.00001 T=8 "
    ):
        MoldLayout(EndcapParams(130.00001, 8.0), 0.2170001)


def test_a_clearance_that_is_no_number_is_refused_with_one_that_is():
    with pytest.raises(
        ParameterError, match=r"joint_clearance=nan outside .* nearest valid choice joint_clearance=0\.05;"
    ):
        MoldLayout(EndcapParams(130.0, 8.0), math.nan)


def test_a_silicone_that_no_joint_holds_is_refused_with_those_that_hold(monkeypatch):
    water = replace(silicone("Ecoflex 00-30"), name="water", viscosity_pa_s=1e-3)
    monkeypatch.setitem(silicones(), "water", water)
    with pytest.raises(
        ParameterError, match=r"water: joints would have to be 0\.0\d+ mm, below the 0\.05 .*'Smooth-Sil 950'"
    ):
        MoldLayout(EndcapParams(130.0, 8.0), 0.05, "water")


def test_pins_keep_off_cavity_vents_and_bolts_at_every_size():
    for params in REGION:
        layout = MoldLayout(params)
        inside = layout.pin_circle_radius_mm - 3.0
        assert inside - params.outer_radius_at(4.5) >= 1.2 - 1e-9  # the socket broke into the cavity below D=100
        assert inside > layout.vent_circle_radius_mm + 1.75  # a vent cut the pins on its meridian
        assert layout.hanger_radius_mm < layout.bolt_circle_radius_mm - 5.5  # spot faces of the bolts
        assert layout.pin_circle_radius_mm + 3.0 + 1.2 < layout.flange_radius_mm - layout.collar_flange_top_mm or (
            layout.pin_circle_radius_mm == layout.collar_screw_circle_radius_mm
        )


def test_pilots_of_the_collar_end_under_a_roof_or_go_through_it():
    """From D=100.4 to 100.8 they ended 0 to 0.75 mm short of the seam."""
    low = diameter_range_mm()[0]
    for diameter in (*np.linspace(low + 1e-6, 102.0, 200), *DIAMETERS):
        layout = MoldLayout(EndcapParams(float(diameter), 6.5))
        roof = layout.seam_height_mm - layout.collar_screw_depth_mm
        assert roof >= 1.2 - 1e-9 or (roof < 0 and layout.seam_height_mm < 10.2)
        assert layout.collar_screw_depth_mm >= 9.0  # the longest M3 x 16 reaches 8.75


def test_the_collars_flange_leaves_no_film_of_pla_under_its_bolts_at_any_size():
    """Its top is the mating plane, or a step of 2 mm and more below it that spot faces are cut into."""
    low, lowest = diameter_range_mm()[0], set()
    for diameter in (*np.linspace(low + 1e-6, 112.0, 200), *DIAMETERS):
        layout = MoldLayout(EndcapParams(float(diameter), 6.5))
        top = layout.collar_flange_top_mm
        assert top == 0.0 or top > 2.0
        assert layout.dam_top_mm - top >= 6.0 - 1e-9  # PLA under a bolt's head
        lowest.add(top > 0)
    assert lowest == {True, False}


def test_screws_of_the_core_keep_off_the_cavity_at_every_size():
    """They came into it where a thick wall stands over the neck, at D=179 and more."""
    for params in REGION:
        layout = MoldLayout(params)
        cavity = min(layout.neck_radius_mm, params.inner_radius_at(params.flange_thickness_mm))
        inner = {
            "key": layout.centre_inradius_mm + 2 * layout.core_tab_radius_mm,
            "wedge": layout.centre_short_inradius_mm,
        }
        for kind, start in inner.items():
            for along, across in screws_in_their_pieces_mm(layout, kind):
                axis = math.hypot(along, across)
                assert start + 1.3 + 2 <= along and axis <= cavity - 1.3 - 2 + 1e-9
                half = layout.key_half_width_mm
                side = half - abs(across) if kind == "key" else (math.sqrt(3) * along - abs(across)) / 2 - half
                assert side >= 1.3 + 2


def screws_in_their_pieces_mm(layout: MoldLayout, kind: str) -> list[tuple[float, float]]:
    """Screw of each key or wedge: (from the axis along the piece's middle, beside the middle)."""
    middles = [azimuth + 60.0 * (kind == "wedge") for azimuth in layout.key_azimuths_deg]
    holes = [layout.core_screws_mm[f"core_{kind}_{k}"][0] for k in (1, 2, 3)]
    return [rotated(hole, -middle) for hole, middle in zip(holes, middles, strict=True)]


def test_no_key_or_wedge_can_be_screwed_into_another_ones_place():
    """Their bumps differ, at D=130 T=8 by up to 6 mm, and they looked alike down to their holes."""
    for params in REGION:
        for kind in ("key", "wedge"):
            screws = screws_in_their_pieces_mm(MoldLayout(params), kind)
            assert all(math.dist(a, b) > 4.5 for a, b in itertools.combinations(screws, 2))  # a screw's 3 mm and half


@pytest.mark.parametrize("size", [(99.0, 7.0), (180.0, 18.0)])
def test_the_volume_that_joints_are_sized_by_is_that_of_slices_without_the_zones_clip(size):
    params = EndcapParams(*size)
    z = np.linspace(params.flange_thickness_mm, params.tip_height_mm, 400_001)

    def area(radius: float) -> np.ndarray:
        return math.pi * np.maximum(0.0, radius**2 - (z - params.centre_height_mm) ** 2)

    inner, outer = zone_radii_mm(params)
    zone = (area(outer) - area(inner)) * (z <= params.interlock_top_mm)
    slices = area(params.outer_radius_mm) - area(params.inner_radius_mm) - 0.1 * zone
    assert leak.sizing_volume_mm3(params) == pytest.approx(np.trapezoid(slices, z), rel=1e-6)


def test_a_vents_reach_is_the_diameter_of_its_cylinder_inside_the_flange():
    params = EndcapParams(200.0, 10.0)
    sphere = params.outer_radius_mm - 0.2
    low, high = (math.sqrt(sphere**2 - (z - params.centre_height_mm) ** 2) for z in (0.0, 6.0))
    axis = np.array([high - low, 6.0]) / math.hypot(high - low, 6.0)
    for height in (5.7, 6.0):
        offset = np.array([vent_reach_mm(params, height) - low, height])
        assert abs(offset @ [-axis[1], axis[0]]) == pytest.approx(1.5)
        assert offset[0] < axis[0] / axis[1] * height
