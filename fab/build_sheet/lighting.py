"""Chapter of the LED ring in the build sheet: parts to order, current, and evenness of the light on this dome."""

from __future__ import annotations

from pathlib import Path

from cad.led_ring.placement import LED_COUNT, LED_RANGE
from cad.params import EndcapParams
from fab.build_sheet.blocks import Block, Heading, Paragraph, Picture, Step, Table
from fab.build_sheet.commands import ring_command
from fab.build_sheet.data import SheetData
from fab.checks.check import Check
from fab.led_ring.bom import ring_bom
from fab.led_ring.budget import CAMERA_A, RING_A, USB_A, driver_checks, warmest_room_c
from fab.led_ring.driver import fitted_driver
from fab.led_ring.light import dome_light, light_checks, require_even
from fab.variant import size_words


def ring_checks(params: EndcapParams) -> list[Check]:
    """Checks of the driver and of the light of the usual ring on this dome.

    Raises:
        ParameterError: the camera module sees places where the light of the ring is too uneven.
    """
    light = dome_light(params)
    require_even(light, params, LED_COUNT)
    return [*driver_checks(fitted_driver()), *light_checks(light)]


def draw_ring_light(params: EndcapParams, folder: Path) -> Path:
    """Draw the picture of the light on this dome.

    Args:
        params: the design.
        folder: receives the picture.
    """
    from fab.led_ring.picture import draw_light

    path = folder / "ring_light.png"
    draw_light(dome_light(params), f"{size_words(params)}, {LED_COUNT} LEDs", path)
    return path


def _parts() -> tuple[tuple[str, ...], ...]:
    """Electronic parts of the usual ring without the bare board."""
    return tuple(
        (f"{line.quantity} x {line.references}", line.description, f"{line.maker} {line.part_number}", line.package)
        for line in ring_bom()
        if line.item != "board"
    )


def steps_of_wiring() -> list[Block]:
    """Steps of the wiring of 5 V and GND."""
    driver = fitted_driver()
    draws = 1e3 * (driver.input_a + CAMERA_A)
    return [
        Step(
            "W1",
            "Make the cable",
            (
                "Cut a USB cable 300 mm behind its A plug. Red is 5 V, black is GND; cut green, white and the shield "
                "short and insulate each by itself.",
                "Slide a piece of heat-shrink tube over each wire, then solder the crimped SH cable on: contact 1 to "
                "red (5 V), contact 2 to black (GND). Shrink the tubes over the joints with the iron. The ring's plug "
                "J1 is on its back; 5V and GND are printed beside it.",
                "The colours of bought SH cables follow no rule. Before the ring is plugged in, measure on the free "
                "plug: + on the contact that meets 5V. Reversed, the driver dies.",
            ),
        ),
        Step(
            "W2",
            "Try it before it is glued in",
            (
                f"Plug it into J1 and into a USB port: {LED_COUNT} LEDs light at once, there is no switch. The cable "
                f"draws {1e3 * driver.input_a:.0f} mA.",
                f"It may share a USB port with the camera through a hub with its own supply, or take a second port; "
                f"both together draw {draws:.0f} mA of the {1e3 * USB_A:.0f} mA that one USB 2.0 port gives.",
                "No light: 5 V and GND exchanged, or one LED turned; the string is in series, one fault darkens all.",
                "Unplug it from J1 again: the USB-A plug does not pass the base, so the SH plug goes up through it "
                "first (chapter Assemble).",
            ),
        ),
    ]


def led_ring(data: SheetData) -> list[Block]:
    """Chapter of the LED ring: what to order and what to check before.

    Args:
        data: of the sheet.
    """
    params = data.layout.params
    driver = fitted_driver()
    rows = []
    for count in range(LED_RANGE[0], LED_RANGE[1] + 1):
        light = dome_light(params, count)
        rows.append((str(count), f"{100 * light.ripple:.0f} %", f"{light.darkest:.2f}", f"{light.brightest:.2f}"))
    return [
        Heading("LED ring", 1),
        Paragraph(
            f"{ring_command(data)} writes the board's files and its own checks; its last line names the folder. A "
            "board house gets led_ring-gerber.zip from there, and led_ring-bom.csv and led_ring-placement.csv to fit "
            f"the parts. With {LED_COUNT} LEDs and R1 = {driver.r_set_ohm:g} ohm it draws "
            f"{1e3 * driver.input_a:.0f} mA at {driver.v_in:g} V (the paper: under {1e3 * RING_A:.0f}), efficiency "
            f"{100 * driver.efficiency:.0f} %. The spacer is PETG, which keeps its shape in rooms up to "
            f"{warmest_room_c(driver, params):.0f} °C by estimate; PLA would creep 15 K earlier."
        ),
        Heading("Parts of the board"),
        Paragraph(
            "For whoever solders it; a board house takes led_ring-bom.csv. Part numbers name parts that fit: any of "
            "the same value, size and rating does as well. Marks on the board: a bar at each cathode, a dot at pin 1."
        ),
        Table(("place", "what", "order as", "size"), _parts(), (1.6, 2.4, 2.8, 0.8), is_small=True),
        Heading("Wiring"),
        *steps_of_wiring(),
        Heading("Light on this dome"),
        Paragraph(
            "Half swing: by how much the light varies to either side of its mean on the worst circle about the axis. "
            "Darkest and brightest: the light there over the mean of the part that the camera sees. Computed from the "
            "places of the LEDs, with one reflectance for the silicone."
        ),
        Table(("LEDs", "half swing", "darkest", "brightest"), tuple(rows), (1, 1, 1, 1)),
        Picture(data.pictures["ring_light"], f"relative irradiance with {LED_COUNT} LEDs"),
    ]
