"""What a part on the ring's board shades, and how much copper a hole has round it: against plain geometry."""

from __future__ import annotations

import numpy as np
import pytest
from shapely import Point

from cad.led_ring.board import BOARD_THICKNESS_MM
from cad.led_ring.placement import placements
from cad.ring_spacer import SEAT_Z_MM
from fab.led_ring.light import blocked
from fab.led_ring.rules import hole_checks


def test_a_part_shades_what_lies_behind_it_and_not_what_lies_before():
    """Against points along the way, in the part's own drawing as it is placed on the board."""
    rng, foot = np.random.default_rng(2), SEAT_Z_MM + BOARD_THICKNESS_MM
    for body in (p for p in placements() if p.kind in ("driver", "inductor", "diode")):
        size = np.array([body.part.length_mm, body.part.width_mm, body.part.height_mm])
        zero, x, y = (np.array(body.on_board(*place)) for place in ((0, 0), (1, 0), (0, 1)))
        source = np.array([*body.on_board(7.0, 4.0), foot + 0.6])
        aimed = rng.uniform(-0.8, 0.8, (300, 3)) * size
        through = np.column_stack(
            [zero + aimed[:, :1] * (x - zero) + aimed[:, 1:2] * (y - zero), foot + abs(aimed[:, 2])]
        )
        wall = source + rng.uniform(0.2, 3.0, (300, 1)) * (through - source)
        on_way = source + np.linspace(0, 1, 2001)[:, None, None] * (wall - source)
        local = (on_way[..., :2] - zero) @ np.linalg.inv(np.array([x - zero, y - zero]))
        high = on_way[..., 2] - foot
        inside = (abs(local) < size[:2] / 2).all(axis=-1) & (high > 0) & (high < size[2])
        expected = inside.any(axis=0)
        assert 50 < expected.sum() < 250
        assert (blocked(source, wall, body) == expected).mean() > 0.99  # but for those that graze an edge


def test_a_hole_beside_its_copper_has_none_round_it():
    face = Point(0, 0).buffer(38.6) - Point(0, 0).buffer(31.55)
    copper = Point(34, 0).buffer(0.5, 64)
    layers = {"F_Cu": copper, "B_Cu": copper}
    for place, rim in ((34.0, 0.35), (34.2, 0.15), (35.0, -0.15)):
        checks = {c.name: c for c in hole_checks(layers, [(place, 0.0, 0.3)], face)}
        assert checks["ring.copper_round_hole_mm"].value == pytest.approx(rim, abs=1e-3)
