"""Drawings of the build sheet: gores, ruler, and what the first picture shows."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from shapely import LinearRing, Point, box, unary_union

from cad.dots import dot_pattern, dot_position_mm
from cad.params import EndcapParams
from fab.build_sheet import finishing
from fab.build_sheet.blocks import Paragraph
from fab.build_sheet.dots import first_light, gore_of, gores, ruler
from fab.camera_view import camera_pixels, disc_px, dot_outline_px, dots_in
from sensing.camera.nominal import nominal_mount

PARAMS = EndcapParams(130.0, 8.0)
SIZES = [(100.0, 8.0), (130.0, 8.0), (187.3, 12.6), (250.0, 6.5), (250.0, 25.0)]


@pytest.mark.parametrize("params", [EndcapParams(*size, dot_mm=dot_mm) for size in SIZES for dot_mm in (4.5, 8.0)])
def test_gores_have_every_dot_once_and_fit_a_page_in_pairs(params):
    sheets = gores(params)
    assert sum(sheet.svg.count("<circle") for sheet in sheets) == len(dot_pattern(params))
    for sheet in sheets:
        assert 2 * sheet.width_mm < 179 and sheet.height_mm <= 258
        assert f'width="{sheet.width_mm:.2f}mm"' in sheet.svg and f"0 0 {sheet.width_mm:.2f}" in sheet.svg  # 1:1
        dots, labels = (
            [float(x) for x in re.findall(f'<{shape} [a-z]*="([0-9.]+)"', sheet.svg)] for shape in ("circle", "text")
        )
        assert len(dots) == len(labels)


MANY = (1, 7, 13, 19, 25, 31, 37, 43, 47, 53, 59, 61)


@pytest.mark.parametrize(
    "params",
    [
        *(EndcapParams(*size, dot_mm=dot_mm) for size in SIZES for dot_mm in (4.0, 8.0)),
        EndcapParams(209.9, 20.77, MANY, 2.9),
        EndcapParams(99.37, 6.63, (1, 6, 12), 7.9),
    ],
)
def test_labels_of_a_gore_lie_off_its_outline_every_dot_and_each_other(params):
    number = r'<circle cx="([\d.]+)" cy="([\d.]+)"[^>]*/><text x="([\d.]+)" y="([\d.]+)" [^>]*>(\d+)<'
    for sheet in gores(params):
        corners = re.search(r'<path d="M([^Z]+)Z"', sheet.svg)[1].split("L")
        outline = LinearRing([tuple(map(float, corner.split())) for corner in corners])
        found = [tuple(map(float, each)) for each in re.findall(number, sheet.svg)]
        assert len(found) == sheet.svg.count("<circle")
        dots = unary_union([Point(x, y).buffer(params.dot_radius_mm) for x, y, *_ in found])
        labels = [box(left, base - 1.9, left + 1.6 * len(f"{ring:.0f}"), base) for _, _, left, base, ring in found]
        for label in labels:
            assert not label.intersects(outline) and not label.intersects(dots)
            assert box(0.0, 0.0, sheet.width_mm, sheet.height_mm).contains(label)
        apart = [label.buffer(0.1) for label in labels]
        assert unary_union(apart).area == pytest.approx(sum(label.area for label in apart))


def test_every_gore_has_a_line_of_its_own_to_see_whether_the_printer_scales():
    for sheet in gores(EndcapParams(142.0, 7.5)):
        assert "M2 4V54" in sheet.svg and ">50 mm</text>" in sheet.svg


@pytest.mark.parametrize("params", [EndcapParams(113.7, 7.9), EndcapParams(187.0, 14.5, (1, 6, 12, 16, 20))])
def test_a_dot_that_the_outline_of_its_gore_crosses_is_not_cut_in_half(params):
    crossed = 0
    for sheet in gores(params):
        corners = re.search(r'<path d="M([^Z]*)Z"', sheet.svg)[1].split("L")
        outline = LinearRing([tuple(map(float, corner.split())) for corner in corners])
        places = re.findall(r'<circle cx="([0-9.]+)" cy="([0-9.]+)"', sheet.svg)
        crossed += sum(outline.distance(Point(float(x), float(y))) < params.dot_radius_mm for x, y in places)
    assert crossed >= 4  # the one at the tip, in every size; others lie on the meridian between two gores
    text = " ".join(block.text for block in finishing._gore_blocks(params) if isinstance(block, Paragraph))
    assert "Where its outline crosses a dot, as at the tip, cut 2 mm round the dot." in text


def test_dots_on_a_gore_keep_their_arc_length_from_the_tip():
    first = gores(PARAMS)[0]
    count = len(gores(PARAMS))
    own = [dot for dot in dot_pattern(PARAMS) if gore_of(dot, count) == 0]
    heights = sorted(float(y) for y in re.findall(r'<circle cx="[\d.]+" cy="([\d.]+)"', first.svg))
    wanted = sorted(4.0 + PARAMS.inner_radius_mm * math.radians(dot.polar_deg) for dot in own)
    assert np.allclose(heights, wanted, atol=0.01)


@pytest.mark.parametrize(
    "params", [PARAMS, EndcapParams(171.3, 10.1), EndcapParams(101.2, 7.9, (1, 5, 9, 11, 14), 3.3)]
)
def test_a_gore_laid_into_the_dome_print_toward_the_viewer_has_a_dent_under_every_hole(params):
    sheets, radius = gores(params), params.inner_radius_mm
    dents = radius * np.array([dot.direction for dot in dot_pattern(params)])
    for number, sheet in enumerate(sheets):
        middle = 2 * math.pi * number / len(sheets)
        outward = np.array([math.cos(middle), math.sin(middle), 0.0])  # the viewer stands on the axis, tip up
        to_the_right = np.cross(outward, [0.0, 0.0, 1.0])
        growing = np.array([-math.sin(middle), math.cos(middle), 0.0])  # the way in which azimuth grows
        for x, y in re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', sheet.svg):
            polar = (float(y) - 4.0) / radius
            turn = (float(x) - sheet.width_mm / 2) / max(radius * math.sin(polar), 1e-9) * (to_the_right @ growing)
            flat = math.sin(polar) * np.array([math.cos(middle + turn), math.sin(middle + turn)])
            hole = radius * np.array([*flat, math.cos(polar)])
            assert np.linalg.norm(dents - hole, axis=1).min() < 0.05
        assert f"about azimuth {math.degrees(middle):.1f}°" in sheet.caption


def test_azimuth_counts_clockwise_in_the_picture_as_for_a_viewer_who_looks_into_the_dome():
    right, down, forward = np.eye(3)  # of a camera that looks along +z, upright: a picture that is not mirrored
    assert np.allclose(np.cross(right, down), forward)
    for dot, (x, y) in camera_pixels(PARAMS).items():
        if dot.ring:
            turn = math.degrees(math.atan2(y - 240.0, x - 320.0))  # y down: clockwise
            assert (turn - dot.azimuth_deg + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1e-6)


def test_ruler_is_a_hundred_millimetres_long():
    drawing = ruler()
    assert 'width="104mm"' in drawing.svg and 'viewBox="0 0 104 10"' in drawing.svg and "M2 8h100" in drawing.svg


@pytest.mark.parametrize("module", ["ELP-USBFHD01M-L180", "ELP-USBFHD01M-L170"])
@pytest.mark.parametrize("params", [PARAMS, EndcapParams(162.5, 10.75)])
def test_first_light_shows_the_dots_where_the_nominal_camera_sees_them(params, module, monkeypatch):
    monkeypatch.setenv("ENDCAP_CAMERA", module)
    nominal = nominal_mount(params)
    seen = nominal.project(np.array([dot_position_mm(params, dot) for dot in dot_pattern(params)]))
    wanted = seen[np.isfinite(seen).all(axis=1)] + 0.5  # a drawing begins at the pixel's corner
    pixels = list(camera_pixels(params).values())
    assert np.allclose(pixels, wanted, atol=1e-6)
    assert 0 < dots_in(pixels, 480, 480) < dots_in(pixels, 640, 480) <= len(pixels)
    assert first_light(params).svg.count("<polygon") == len(pixels)


@pytest.mark.parametrize("params", [PARAMS, EndcapParams(99.37, 6.63, (1, 6, 12), 7.9)])
def test_first_light_shows_dots_as_large_as_the_nominal_camera_sees_them(params):
    centre = np.array([0.0, 0.0, params.centre_height_mm])
    for dot in (dot for dot in camera_pixels(params) if dot.polar_deg < 70):
        out = np.array(dot_position_mm(params, dot)) - centre
        out /= np.linalg.norm(out)
        side = np.cross(out, [0.3, -0.2, 0.9])
        side /= np.linalg.norm(side)
        rim = math.sqrt(params.inner_radius_mm**2 - params.dot_radius_mm**2) * out
        turns = np.linspace(0, 2 * math.pi, 4000)[:, None]
        ring = centre + rim + params.dot_radius_mm * (np.cos(turns) * side + np.sin(turns) * np.cross(out, side))
        seen = nominal_mount(params).project(ring) + 0.5
        away = np.linalg.norm(np.array(dot_outline_px(params, dot))[:, None] - seen, axis=2).min(axis=1)
        assert away.max() < 0.03  # half a step between the points


def test_the_shell_ends_where_the_photos_show_it():
    """CAM04: 331 px at 640 x 480."""
    assert disc_px() == pytest.approx(331.0, abs=0.5)
