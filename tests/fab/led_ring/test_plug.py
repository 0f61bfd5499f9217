"""The ring's plug: contacts of the real header on the board's back, their nets, legend and the words of the sheet."""

from __future__ import annotations

import pytest
from gerbonara.cad.kicad.pcb import Board
from shapely import Polygon, box

from cad.led_ring.parts import led_part
from fab.build_sheet.lighting import steps_of_wiring
from fab.led_ring.copper import build_copper
from fab.led_ring.kicad import ORIGIN_MM, write_project
from fab.led_ring.silk import WORDS, word

# JST SM02B-SRSS-TB (catalogue eSH) as in KiCad's footprint JST_SH_SM02B-SRSS-TB_1x02-1MP_P1.00mm_Horizontal, seen from
# the component side, millimetres, y downward there and upward here: name, x, y, width, height.
HEADER = (("1", -0.5, 2.0, 0.6, 1.55), ("2", 0.5, 2.0, 0.6, 1.55),
          ("M1", -1.8, -1.875, 1.2, 1.8), ("M2", 1.8, -1.875, 1.2, 1.8))  # fmt: skip
NETS = {"1": "VIN", "2": "GND", "M1": "GND", "M2": "GND"}
PLUG_RADIUS_MM = 34.375  # on the board's y axis


def lands_from_behind(folder, leds: int) -> dict[str, tuple[str, Polygon]]:
    """Net and area of each land of J1 in the KiCad file, seen from the back (x mirrored), about the header's centre."""
    write_project(build_copper(leds), leds, folder)
    board = Board.open(folder / "led_ring.kicad_pcb")
    (plug,) = (part for part in board.footprints if any(text.text == "J1" for text in part.texts))
    lands = {}
    for pad in plug.pads:
        assert pad.layers[0] == "B.Cu" and not (pad.at.rotation or 0.0) % 180
        x = -(plug.at.x + pad.at.x - ORIGIN_MM)
        y = ORIGIN_MM - plug.at.y - pad.at.y - PLUG_RADIUS_MM
        half_x, half_y = pad.size.x / 2, pad.size.y / 2
        lands[pad.number] = pad.net.name, box(x - half_x, y - half_y, x + half_x, y + half_y)
    return lands


@pytest.mark.parametrize("leds", [6, 7, 8, 9])
def test_contacts_of_the_header_lie_where_the_maker_has_them_seen_from_the_back(tmp_path, leds):
    assert led_part("plug").part_number == "SM02B-SRSS-TB"
    lands = lands_from_behind(tmp_path, leds)
    assert {name: net for name, (net, _) in lands.items()} == NETS
    for name, x, y, width, height in HEADER:
        whole = box(x - width / 2, y - height / 2, x + width / 2, y + height / 2)
        land = lands[name][1]
        assert whole.buffer(1e-3).contains(land), name
        assert land.area > 0.78 * whole.area  # shortened by 0.325 mm to stay on the ring


def test_the_legend_names_the_nearer_contact_and_the_sheet_wires_contact_1_to_5_v():
    contacts = {pad.net: pad.shape for pad in build_copper().pads if pad.reference == "J1" and pad.pin in ("1", "2")}
    for text, net in (("5V", "VIN"), ("GND", "GND")):
        (shape,) = (word(text, s, t, side) for name, s, t, side in WORDS if name == text)
        distance_mm = {name: contact.distance(shape.centroid) for name, contact in contacts.items()}
        assert min(contacts, key=distance_mm.__getitem__) == net
    cable = " ".join(steps_of_wiring()[0].lines)
    assert "contact 1 to red (5 V), contact 2 to black (GND)" in cable
