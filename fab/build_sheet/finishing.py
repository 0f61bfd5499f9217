"""Chapters of painting, assembly and first light in the build sheet."""

from __future__ import annotations

import math
from collections.abc import Sequence

from cad.dots import dot_pattern, ring_count
from cad.lens import RELEASED_MODULE, camera_module
from cad.params import EndcapParams
from cad.pattern import step_deg
from cad.robot_sides import robot_side
from fab.bom import screw_name
from fab.build_sheet.blocks import Block, Heading, Paragraph, Table
from fab.build_sheet.commands import INTERPRETER, RELEASED
from fab.build_sheet.data import SheetData
from fab.build_sheet.dots import SCALE_LINE_MM, first_light, gores, repeat_deg, ruler
from fab.build_sheet.first_run import first_run
from fab.build_sheet.steps import stage_blocks, steps
from fab.camera_view import FRAME_PX, SQUARE_PX, camera_pixels, dots_in, edge_cuts_px, edge_px, seen_dots

CENTRED_PX = 10.0  # E: largest offset of the camera's centre from that of the frame


def painting(data: SheetData) -> list[Block]:
    """Chapter of painting: the dots, and gores to cut out.

    Args:
        data: of the sheet.
    """
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
             ("Wipe the inside with alcohol, and let it dry. Wear the lamp: a dent shows when light comes from the "
              "side.",
              f"{_full_lines(params)} Write 0 at its end on the interface's rim: azimuths count from it, clockwise as "
              "you look into the dome.",
              "Touch each dent with the marker, from the tip outward, ring by ring. Where dents are hard to see, lay a "
              "gore in (below).",
              f"This size has {len(dots)} dots of {params.dot_mm:g} mm, {spacing:.1f} mm from ring to ring along "
              f"the wall. Paint all: {sum(inside.values())} of them lie in the camera's centre square.",
              "Ink only inside the dents; wipe what runs over at once. Let it dry 10 min, dome up, before "
              "assembly."), "dots"),
        ]),
        Table(("ring", "dots", "angle from the tip", "in the centre square"), rows, (1, 1, 2, 2)),
        *_gore_blocks(params),
    ]  # fmt: skip


def _full_lines(params: EndcapParams) -> str:
    """Text on the meridians with a dot of every ring: as many as rotations map the pattern onto itself.

    Azimuth 0 lies midway between two screw holes of the interface; only with a line that does so, too, the base's holes
    meet its nuts with the cables' slot under the mark.
    """
    count = round(360.0 / repeat_deg(params))
    if count == 1:
        return "One line from tip to rim has a dot of every ring: it is azimuth 0, begin there."
    return (
        f"{count} lines from tip to rim have a dot of every ring, {repeat_deg(params):.3g}° apart, and the pattern is "
        "the same from each. Choose as azimuth 0 one that ends midway between two screw holes of the interface, and "
        "begin there."
    )


def _gore_blocks(params: EndcapParams) -> list[Block]:
    """Gores at true size, how to check their scale, and how to use them."""
    return [
        Heading("Gores, 1:1"),
        Paragraph(
            f"Print this page and the gores after it at 100 %, and measure the ruler and the line of {SCALE_LINE_MM:g} "
            "mm beside each gore:"
        ),
        ruler(),
        Paragraph(
            "The gores show where dents are that are hard to see. Cut a gore out. Where its outline crosses a dot, as "
            f"at the tip, cut 2 mm round the dot. Punch the dots out, {params.dot_mm:g} mm wide. Lay the gore into the "
            "dome from the tip, print toward you, its middle at the azimuth below it: a dent lies under every hole. "
            "Azimuth counts clockwise as you look into the dome, print toward you: gore 1 lies on the line marked 0, "
            "the others follow clockwise. When the ink is dry, lay the gore in again: a hole without ink is a dot that "
            "was missed. The numbers beside the dots are their rings."
        ),
        *gores(params),
    ]


def assembling(data: SheetData) -> list[Block]:
    """Chapter of the assembly of camera, ring and base, with each screw as measured.

    Args:
        data: of the sheet.
    """
    return [
        Heading("Assemble", 1),
        Paragraph(
            "The chapter First light comes after A4, and the robot after it: the calibration by weight needs the "
            "endcap upright on a level table, and there the base is quickly off if a picture is wrong. The endcap "
            "stands on its adapter: screw that under it alone, by the five screws of A5, both cables out along the "
            "hub's groove. For A5 take the screws out again."
        ),
        Paragraph(
            "Focus the camera before A4, when the glue smells no more, for the lens is out of reach afterwards: hold a "
            f"printed page {_focus_mm(data.layout.params):.0f} mm above the lens, as far as the dome's tip will be, "
            "save a frame (chapter First light), and turn the lens until the letters are sharp."
        ),
        *stage_blocks(data, "A", ("assemble",)),
        Heading("Screws, as measured on the parts"),
        Table(
            ("joint", "screw", "grip", "held by the shortest", "wanted", "room before the tip"),
            (
                *(
                    (fit.joint.name, f"{len(fit.joint.places)} x {screw_name(fit)}", f"{fit.grip_mm:.2f}",
                     f"{fit.engagement_mm:.2f}", f"{fit.needed_mm:.2f}",
                     "through" if fit.tip_room_mm > 100 else f"{fit.tip_room_mm:.2f}")
                    for fit in data.fits
                ),
                *_robot_rows(data.robot),
            ),
            (2.4, 1.3, 0.8, 1.4, 0.8, 1.4), is_small=True,
        ),
    ]  # fmt: skip


def _focus_mm(params: EndcapParams) -> float:
    """Distance of the dome's inner tip from the camera's entrance pupil, mm."""
    return params.tip_height_mm - params.wall_mm - params.camera_height_mm


def _robot_rows(robot: str) -> list[tuple[str, ...]]:
    """Rows of the screws into the robot's flange, with the depth to which they enter it."""
    return [
        (
            "adapter_to_robot",
            f"{holes.count} x {holes.order_as.removeprefix('ISO 4762 ')}",
            f"{holes.grip_mm:.2f}",
            f"{holes.enters_mm:.2f} in the flange",
            f"{holes.body_mm:.2f}",
            f"{holes.flange_depth_mm - holes.enters_mm:.2f}, if the flange takes {holes.flange_depth_mm:g}",
        )
        for holes in robot_side(robot)
        if holes.element == "screw"
    ]


def light_check(data: SheetData) -> list[Block]:
    """Chapter of first light: what the first frame should show.

    Args:
        data: of the sheet.
    """
    return [
        Heading("First light", 1),
        Paragraph(
            "The endcap stands on its adapter, and is not on the robot yet (chapter Assemble). Run make setup once; it "
            "installs the programs. Plug in the LED ring and the camera, let nothing touch the "
            "dome, and save a frame of 640 x 480. 0 is the camera's number; "
            f"{INTERPRETER} -m sensing.sources lists them."
        ),
        Paragraph(f"{INTERPRETER} -m sensing.sources save 0 a.jpg"),
        Paragraph(
            "Compare a.jpg with the drawing: dots black, the edge of the bright disc green, the centre square dashed. "
            "The drawing looks into the dome, as the camera does: azimuth 0 is at the right, and azimuth counts "
            "clockwise, as on the gores."
        ),
        first_light(data.layout.params),
        Table(("look at", "good", "if not"), _looks(data.layout.params), (1.4, 2.2, 2)),
        *first_run(data),
    ]


def _looks(params: EndcapParams) -> tuple[tuple[str, str, str], ...]:
    """Rows of what to look at in the first frames: what, how it is when good, and the cause or fix."""
    frame, square = seen_dots(params), dots_in(camera_pixels(params).values(), SQUARE_PX, SQUARE_PX)
    # Photos of the released sensor are valid for its own size and camera only.
    is_released = params == RELEASED and camera_module().name == RELEASED_MODULE
    of_frame, of_square = ("; the released sensor: 92", "; the released sensor: 75 to 80") if is_released else ("", "")
    return (
        ("edge of the bright disc", edge_words(), "camera not flat on its four pads, or another lens"),
        ("dots in the whole frame", f"about {frame} by the lens of this module{of_frame}",
         "ink missing, or LEDs too dark"),
        ("dots in the centre square", f"about {square} by the same{of_square}",
         "camera not centred"),
        ("brightness", "no white patches; every dot darker than the silicone round it",
         "set the exposure by hand: --exposure V, in the driver's unit"),
        ("focus", "sharp rims of the dots, near the edge, too",
         "base off, turn the lens a little, base on again"),
        ("dots of the common meridian", _line_words(params), _turn_words(params)),
        ("a second frame, a finger on the dome", *_finger_words(params)),
    )  # fmt: skip


def edge_words() -> str:
    """Text on the edge of the picture in the frame; with most lenses its circle is wider than the frame."""
    radii, half_height = edge_px(), FRAME_PX[1] / 2
    uppers, sides = zip(*(edge_cuts_px(radius) for radius in radii), strict=True)
    if radii[-1] <= half_height:
        return f"a whole circle: centre within {CENTRED_PX:.0f} px of the frame's, radius {_span(radii)} px"
    if not any(uppers):
        return "not in the frame: it lies outside the corners"
    alike = 2 * CENTRED_PX * radii[-1] / math.sqrt(radii[-1] ** 2 - half_height**2)
    cuts = (
        f"arcs that cut the upper and lower edge {_span(uppers)} px from each corner, the four alike to {alike:.0f} px"
    )
    return f"{cuts}; the left and right edge {_span(sides)} px from it" if any(sides) else cuts


def _span(lengths: Sequence[float | None]) -> str:
    """Range of the lengths that are not None, as text: ``72 to 92``, or ``about 73`` where they are equal."""
    known = sorted(length for length in lengths if length is not None)
    ends = dict.fromkeys(f"{length:.0f}" for length in (known[0], known[-1]))
    return " to ".join(ends) if len(ends) > 1 else f"about {known[0]:.0f}"


def _line_words(params: EndcapParams) -> str:
    """Text on the dots at azimuth 0 and on those opposite to them, which rings of an even count have."""
    even = [count % 2 == 0 for count in params.dot_rings[1:]]
    line = "one straight line from the middle to the right edge"
    if all(even):
        return f"{line}, and as straight to the left"
    return f"{line}; to the left rings of an even count alone" if any(even) else f"{line}, none to the left"


def _turn_words(params: EndcapParams) -> str:
    """Text on how the rotation of a camera that is not mounted upright is found."""
    repeat = repeat_deg(params)
    limit = "" if repeat >= 360.0 else f", if it is less than {repeat / 2:.3g}°"
    return f"leave the camera: sensing.calibrate and sensing.setup find its turn from the dots{limit}"


def _finger_words(params: EndcapParams) -> tuple[str, str]:
    """Text on the test by touch: a picture turned by half a turn, or mirrored, shows the dots in the same places.

    The board fits its four posts in four orientations. No program can detect those that map the dots onto themselves,
    nor a mirrored picture; the forces are then rotated, or have reversed signs.
    """
    repeat = repeat_deg(params)
    near = f" or less than {repeat / 2:.3g}° from it" if repeat < 180.0 else ""
    good = (
        f"at the mark 0 it moves the dots at the right{near}; a quarter turn clockwise from it, as you look into the "
        "dome, those at the bottom"
    )
    mirrored = "one of the two opposite: the picture is mirrored; switch that off"
    if repeat >= 360.0:
        return good, f"both turned alike: leave the camera; {mirrored}. No program sees that from the dots"
    turned = f"both turned by {repeat:.3g}°{' or a multiple' if repeat < 180.0 else ''}: turn the board round"
    return good, f"{turned}; {mirrored}. No program sees either from the dots, and forces would point elsewhere"
