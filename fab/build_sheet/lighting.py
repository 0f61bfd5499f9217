"""The LED ring in the build sheet: what to order, what it draws, how evenly it lights this dome."""

from __future__ import annotations

from pathlib import Path

from cad.led_placement import LED_COUNT, LED_RANGE
from cad.params import EndcapParams
from fab.build_sheet.blocks import Block, Heading, Paragraph, Picture, Table
from fab.build_sheet.commands import ring_command
from fab.checks.check import Check
from fab.led_ring.budget import RING_A, driver_checks, warmest_room_c
from fab.led_ring.driver import fitted_driver
from fab.led_ring.light import dome_light, light_checks


def ring_checks(params: EndcapParams) -> list[Check]:
    """Driver and light of the usual ring on this dome."""
    return [*driver_checks(fitted_driver()), *light_checks(dome_light(params))]


def draw_ring_light(params: EndcapParams, folder: Path) -> Path:
    """The picture of the light on this dome."""
    from fab.led_ring.picture import draw_light

    path = folder / "ring_light.png"
    draw_light(dome_light(params), f"D={params.diameter_mm:g} T={params.wall_mm:g}, {LED_COUNT} LEDs", path)
    return path


def led_ring(params: EndcapParams, picture: Path) -> list[Block]:
    """What a person needs to know of the ring before ordering it."""
    driver = fitted_driver()
    rows = []
    for count in range(LED_RANGE[0], LED_RANGE[1] + 1):
        light = dome_light(params, count)
        rows.append((str(count), f"{100 * light.ripple:.0f} %", f"{light.darkest:.2f}", f"{light.brightest:.2f}"))
    return [
        Heading("LED ring", 1),
        Paragraph(
            f"{ring_command(params)} writes the board's files (Gerber, drills, bill, "
            f"placement) and its own checks. With {LED_COUNT} LEDs and R_set = {driver.r_set_ohm:g} ohm it draws "
            f"{1e3 * driver.input_a:.0f} mA at {driver.v_in:g} V (at most {1e3 * RING_A:.0f}), efficiency "
            f"{100 * driver.efficiency:.0f} %. A spacer of PLA keeps its shape in rooms up to "
            f"{warmest_room_c(driver, params):.0f} °C by estimate; print it in PETG for warmer ones."
        ),
        Heading("Light on this dome"),
        Paragraph(
            "Half swing is the largest round any circle about the axis; darkest and brightest are over the mean of the "
            "part that the camera sees. Computed from the places of the LEDs, one reflectance for the silicone."
        ),
        Table(("LEDs", "half swing", "darkest", "brightest"), tuple(rows), (1, 1, 1, 1)),
        Picture(picture, f"relative irradiance with {LED_COUNT} LEDs"),
    ]
