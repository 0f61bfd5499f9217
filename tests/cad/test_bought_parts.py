"""Bought parts and the ring's spacer on the base: out of the camera's view, volumes in closed form."""

from __future__ import annotations

import math

import pytest
from build123d import Pos, Solid

from cad.camera import camera_part
from cad.led_ring.board import led_ring_part
from cad.params import EndcapParams
from cad.ring_spacer import ring_spacer_part


def test_camera_keeps_out_of_its_own_view():
    """Only glass, within the lens head's rim, rises over the 180 degree plane."""
    params = EndcapParams(130.0, 8.0)
    view = Solid.make_box(100, 100, 100).moved(Pos(-50, -50, params.camera_height_mm))
    above = camera_part(params).solid & view
    assert 0.0 < above.bounding_box().size.Z <= 2.0
    assert above.bounding_box().size.X / 2 <= 7.5


def test_spacer_and_ring_have_their_closed_form_volume():
    """Turned profiles; the notch by the annulus between two chords; the parts are boxes."""
    params = EndcapParams(130.0, 8.0)

    def disc(radius: float, height: float) -> float:
        return math.pi * radius**2 * height

    def between(radius: float, half_width: float) -> float:
        """Area of a disc's half strip |t| < half_width, s > 0."""
        return radius**2 * math.asin(half_width / radius) + half_width * math.sqrt(radius**2 - half_width**2)

    cone = math.pi * 0.72 / 3 * (38.85**2 + 38.85 * 34.85 + 34.85**2)
    turned = disc(38.85, 0.28 + 5.4) + cone + disc(31.4, 1.4) - disc(30.0, 1.0 + 6.8)
    notch = (37.0 * 9.0 - between(30.0, 4.5)) * (5.4 - 0.8) + (between(31.4, 4.5) - between(30.0, 4.5)) * 1.4
    assert ring_spacer_part(params).solid.volume == pytest.approx(turned - notch, rel=1e-6)
    ring = disc(38.6, 1.6) - disc(31.55, 1.6) + 9 * 3.0 * 3.0 * 0.55 + 5.0 * 4.25 * 2.95
    ring += 2.8 * 2.9 * 1.45 + 4.0 * 4.0 * 1.8 + 3.7 * 1.6 * 1.35 + 2.0 * 1.25 * 1.35 + 3.2 * 1.6 * 1.7
    ring += 1.6 * 0.8 * (0.9 + 0.5)
    assert led_ring_part(params).solid.volume == pytest.approx(ring, rel=1e-6)
