"""Painting, assembly and first light: words and steps of the build sheet."""

from __future__ import annotations

import math
import shlex

from cad.dots import dot_pattern, ring_count
from cad.lens import RELEASED_MODULE, camera_module
from cad.params import EndcapParams
from cad.pattern import step_deg
from fab.bom import screw_name
from fab.build_sheet.blocks import Block, Heading, Paragraph, Table
from fab.build_sheet.commands import INTERPRETER, camera_setting, program_command
from fab.build_sheet.data import SheetData
from fab.build_sheet.dots import (
    FRAME_PX,
    SQUARE_PX,
    camera_pixels,
    disc_px,
    dots_in,
    first_light,
    gores,
    repeat_deg,
    ruler,
)
from fab.build_sheet.steps import stage_blocks, steps

RELEASED = EndcapParams(130.0, 8.0)


def painting(data: SheetData) -> list[Block]:
    """Which dots to paint, and gores to cut out."""
    params = data.layout.params
    dots = dot_pattern(params)
    pixels = camera_pixels(params)
    rings = sorted({dot.ring for dot in dots})
    inside = {
        ring: dots_in([place for dot, place in pixels.items() if dot.ring == ring], SQUARE_PX, SQUARE_PX)
        for ring in rings
    }
    spacing = math.radians(step_deg(params.dot_rings)) * params.inner_radius_mm
    rows = tuple(
        (
            str(ring),
            str(ring_count(params, ring)),
            f"{next(d.polar_deg for d in dots if d.ring == ring):.1f}°",
            str(inside[ring]),
        )
        for ring in rings
    )
    return [
        Heading("Paint the dots", 1),
        *steps(data, "P", [
            ("Fill every dent with ink",
             ("Wipe the inside with alcohol. Touch each dent with the marker, from the tip outward, ring by ring.",
              f"This size has {len(dots)} dots of {params.dot_mm:g} mm, {spacing:.1f} mm from ring to ring along "
              f"the wall. Paint all: {sum(inside.values())} of them lie in the camera's centre square.",
              "Ink only inside the dents; wipe what runs over at once. Let it dry 10 min, dome up, before assembly.",
              "The dots at azimuth 0 of all rings form one line: begin there."), "dots"),
        ]),
        Table(("ring", "dots", "angle from the tip", "in the centre square"), rows, (1, 1, 2, 2)),
        Heading("Gores, 1:1"),
        Paragraph("Print this page at 100 % and measure:"),
        ruler(),
        Paragraph("Cut out, lay into the dome from the tip: every dot meets its dent. Numbers are rings."),
        *gores(params),
    ]  # fmt: skip


def assembling(data: SheetData) -> list[Block]:
    """Camera, ring, base; every screw as measured."""
    return [
        Heading("Assemble", 1),
        *stage_blocks(data, "A", ("assemble",)),
        Heading("Screws, as measured on the parts"),
        Table(
            ("joint", "screw", "grip", "held by the shortest", "wanted", "room before the tip"),
            tuple(
                (fit.joint.name, f"{len(fit.joint.places)} x {screw_name(fit)}", f"{fit.grip_mm:.2f}",
                 f"{fit.engagement_mm:.2f}", f"{fit.needed_mm:.2f}",
                 "through" if fit.tip_room_mm > 100 else f"{fit.tip_room_mm:.2f}")
                for fit in data.fits
            ),
            (2.4, 1.3, 0.8, 1.4, 0.8, 1.4), is_small=True,
        ),
    ]  # fmt: skip


def light_check(data: SheetData) -> list[Block]:
    """What the first frame should show."""
    params = data.layout.params
    pixels = camera_pixels(params).values()
    frame, square = dots_in(pixels, *FRAME_PX), dots_in(pixels, SQUARE_PX, SQUARE_PX)
    # Photos of the released sensor count for its own size and camera only.
    is_released = params == RELEASED and camera_module().name == RELEASED_MODULE
    of_frame, of_square = ("; the released sensor: 92", "; the released sensor: 75 to 80") if is_released else ("", "")
    return [
        Heading("First light", 1),
        Paragraph(
            "Plug the camera in and look at a frame of 640 x 480 with nothing touching the dome. Compare with "
            "the drawing: "
            "dots black, the shell's disc green, the centre square dashed."
        ),
        first_light(data.layout.params),
        Table(
            ("look at", "good", "if not"),
            (
                ("disc of the shell", f"centre within 10 px of the frame's, radius about {disc_px():.0f} px",
                 "camera not flat on its four pads, or another lens"),
                ("dots in the whole frame", f"about {frame} by the lens of this module{of_frame}",
                 "ink missing, or lamps too dark"),
                ("dots in the centre square", f"about {square} by the same{of_square}",
                 "camera not centred"),
                ("brightness", "no white patches; the darkest dot still darker than its ground", "exposure "
                "fixed by hand"),
                ("dots of the common meridian", "one straight line to the right", "turn the picture, not the camera"),
                *_repeats(params),
            ),
            (1.4, 2.2, 2),
        ),
        *_first_run(data),
    ]  # fmt: skip


def _repeats(params: EndcapParams) -> list[tuple[str, str, str]]:
    """A row where the dots look alike after less than half a turn: no picture shows then how the camera is turned."""
    repeat = repeat_deg(params)
    if repeat >= 180.0:
        return []
    good = f"within {repeat / 2:.3g}° of upright: these dots look alike every {repeat:.3g}°, so no program sees more"
    return [("turn of the camera", good, "loosen its screws and turn it")]


def _first_run(data: SheetData) -> list[Block]:
    """Calibration and live."""
    params = data.layout.params
    return [
        Paragraph(
            "Then save the frame as a.jpg in the toolkit's folder, open a terminal there, and run: "
            + program_command(
                "sensing.calibrate", params, "--photo", "a.jpg", "--out", "camera.json", "--picture", "fit.png"
            )
            + " (after `make setup`). fit.png shows the same dots with circles on them."
        ),
        Paragraph(
            "To run it: "
            + program_command("sensing.setup", params, "--silicone", shlex.quote(data.recipe.silicone.name))
            + " takes the untouched reference and writes endcaps.toml; then "
            + f"{camera_setting()}{INTERPRETER} -m sensing.live --config endcaps.toml shows force and contact."
        ),
    ]  # fmt: skip
