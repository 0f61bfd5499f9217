"""Drawings of the dots: gores at true size for painting, and what the camera should see. SVG in millimetres or pixels.

A gore is the strip of the inner surface between two meridians: along its middle, lengths from the tip are true; across,
lengths on each parallel are true. Cut out, its dots punched out, and laid into the dome from the tip, it has a dent
under every hole: so dents are found that are hard to see, and those without ink.

Notes:
    The camera's picture is that of the lens of the module at hand (:mod:`cad.lens`), as drawn frames have it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from cad.dots import Dot, dot_pattern, dot_position_mm
from cad.lens import camera_module
from cad.params import EndcapParams
from fab.build_sheet.blocks import Drawing

Point = tuple[float, float]
Box = tuple[float, float, float, float]  # centre, half the width, half the height
MARGIN_MM = 4.0
DISC_DEG = 86.4  # off the axis: the released lens has the 331 px there at which photos show the shell end (M, CAM04)
CIRCLE_DEG = 92.0  # off the axis: the released lens's circle ends there on the photo of 720 rows (M)
OUTLINE_POINTS = 32  # of a dot in the picture
FRAME_PX = (640.0, 480.0)
SQUARE_PX = 480.0  # P, NET01: centre square of the released pipeline
SPLIT = 6  # gores at the least
PAGE_WIDTH_MM = 180.0  # of the text on A4: two gores side by side, with a space between
SPACE_MM = 2.0
SCALE_LINE_MM = 50.0  # beside every gore: a printer may scale one page and not another
LABEL_MM = 2.6  # size of the letters
LETTER_MM = 0.65 * LABEL_MM  # width of a figure
CAPITAL_MM = 0.73 * LABEL_MM  # height of a figure
LABEL_GAP_MM, LABEL_ROOM_MM = 0.6, 0.4  # to its dot, to the outline
LABEL_TURNS = [math.radians(turn) for turn in (0, 180, 45, 135, -45, -135, 125, -125, 90, -90)]  # down is 90
LARGEST_WIDTH_MM = (PAGE_WIDTH_MM - SPACE_MM) / 2 - 2 * MARGIN_MM


def gores(params: EndcapParams) -> list[Drawing]:
    """Gores that together have every dot once, in order of azimuth."""
    radius = params.inner_radius_mm
    count = max(SPLIT, math.ceil(2 * math.pi * radius / LARGEST_WIDTH_MM))
    dots = dot_pattern(params)
    end = math.radians(max(dot.polar_deg for dot in dots)) + (params.dot_radius_mm + 2.0) / radius
    width = 2 * math.pi * radius / count + 2 * MARGIN_MM
    height = radius * end + 2 * MARGIN_MM
    sheets = []
    for number in range(count):
        middle = 360.0 / count * number
        own = [dot for dot in dots if gore_of(dot, count) == number]
        svg = _gore(params, own, middle, count, end, width, height)
        caption = f"gore {number + 1} of {count}: {len(own)} dots about {middle:.1f}°"
        sheets.append(Drawing(svg, width, height, caption))
    return sheets


def gore_of(dot: Dot, count: int) -> int:
    """The gore that has a dot: the nearest middle meridian; the dot at the tip is in the first."""
    return round(dot.azimuth_deg * count / 360.0 + 1e-9) % count if dot.ring else 0


def camera_pixels(params: EndcapParams) -> dict[Dot, tuple[float, float]]:
    """Where the dots should appear (x right, y down, frame of 640 x 480): of those alone that the lens sees."""
    places = {dot: dot_position_mm(params, dot) for dot in dot_pattern(params)}
    return {dot: pixel for dot, place in places.items() if (pixel := _pixel(params, place)) is not None}


def dot_outline_px(params: EndcapParams, dot: Dot) -> list[Point]:
    """Points round the edge of a dot as the camera sees it: of those that the lens sees.

    Args:
        params: design. dot: of its pattern.
    """
    polar, azimuth = math.radians(dot.polar_deg), math.radians(dot.azimuth_deg)
    radius = params.inner_radius_mm
    wide = math.asin(params.dot_radius_mm / radius)
    points = []
    for turn in (2 * math.pi * k / OUTLINE_POINTS for k in range(OUTLINE_POINTS)):
        along, across = math.sin(wide) * math.cos(turn), math.sin(wide) * math.sin(turn)
        outward = math.cos(wide) * math.sin(polar) + along * math.cos(polar)
        x = outward * math.cos(azimuth) - across * math.sin(azimuth)
        y = outward * math.sin(azimuth) + across * math.cos(azimuth)
        z = math.cos(wide) * math.cos(polar) - along * math.sin(polar)
        points.append(_pixel(params, (radius * x, radius * y, params.centre_height_mm + radius * z)))
    return [point for point in points if point is not None]


def _pixel(params: EndcapParams, place_mm: tuple[float, float, float]) -> Point | None:
    """Where a place in the endcap frame appears; None where the lens does not see it."""
    x, y, z = place_mm
    off_axis = math.atan2(math.hypot(x, y), z - params.camera_height_mm)
    if math.degrees(off_axis) > camera_module().max_half_angle_deg:
        return None
    reach, azimuth = lens_px(off_axis), math.atan2(y, x)
    return FRAME_PX[0] / 2 + reach * math.cos(azimuth), FRAME_PX[1] / 2 + reach * math.sin(azimuth)


def lens_px(off_axis: float) -> float:
    """Distance from the frame's centre, px: Kannala and Brandt 2006, doi:10.1109/TPAMI.2006.153, radial terms.

    Args:
        off_axis: angle from the optical axis, rad.
    """
    module = camera_module()
    radial = 1.0 + sum(k * off_axis ** (2 * power) for power, k in enumerate(module.k, start=1))
    return module.focal_per_row * FRAME_PX[1] * off_axis * radial


def repeat_deg(params: EndcapParams) -> float:
    """Turn after which the pattern looks alike: 360 over the greatest common divisor of its rings' counts."""
    return 360.0 / math.gcd(*params.dot_rings[1:])


def disc_px() -> float:
    """Radius at which the picture of the shell ends."""
    return lens_px(math.radians(DISC_DEG))


def edge_px() -> tuple[float, float]:
    """Least and largest radius at which the bright disc ends: with the shell, or with the circle of the lens."""
    return disc_px(), lens_px(math.radians(CIRCLE_DEG))


def edge_cuts_px(radius: float) -> tuple[float | None, float | None]:
    """How far from the corner a circle cuts the frame's upper and lower, and its left and right edge.

    Args:
        radius: of the circle about the frame's centre, px.

    Returns:
        Two distances, px; None where it does not cut that edge.
    """
    half_width, half_height = FRAME_PX[0] / 2, FRAME_PX[1] / 2

    def from_corner(along: float, across: float) -> float | None:
        return along - math.sqrt(radius**2 - across**2) if across < radius < math.hypot(along, across) else None

    return from_corner(half_width, half_height), from_corner(half_height, half_width)


def dots_in(pixels: Iterable[tuple[float, float]], width: float, height: float) -> int:
    """How many points lie in a centred rectangle of the frame.

    Args:
        pixels: (x, y) in the frame, px. width, height: of the rectangle, px.
    """
    return sum(abs(x - FRAME_PX[0] / 2) <= width / 2 and abs(y - FRAME_PX[1] / 2) <= height / 2 for x, y in pixels)


def first_light(params: EndcapParams) -> Drawing:
    """What the camera should show: the shell's disc, the dots, the centre square."""
    width, height = FRAME_PX
    scale = 110.0 / width
    shapes = [
        f'<rect x="0" y="0" width="{width:g}" height="{height:g}" fill="#eef1f3" stroke="#20242a"/>',
        f'<circle cx="{width / 2:g}" cy="{height / 2:g}" r="{disc_px():.0f}" '
        'fill="none" stroke="#2f6f6a" stroke-width="2"/>',
        f'<rect x="{(width - SQUARE_PX) / 2:g}" y="{(height - SQUARE_PX) / 2:g}" width="{SQUARE_PX:g}" '
        f'height="{SQUARE_PX:g}" fill="none" stroke="#c05a1c" stroke-width="1.5" stroke-dasharray="6 4"/>',
        f'<path d="M{width / 2 - 8} {height / 2}h16M{width / 2} {height / 2 - 8}v16" stroke="#2f6f6a"/>',
    ]
    for dot in camera_pixels(params):
        outline = " ".join(f"{x:.1f},{y:.1f}" for x, y in dot_outline_px(params, dot))
        shapes.append(f'<polygon points="{outline}" fill="#20242a"/>')
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width * scale:g}mm" height="{height * scale:g}mm" '
        f'viewBox="0 0 {width:g} {height:g}">{"".join(shapes)}</svg>'
    )
    return Drawing(svg, width * scale, height * scale)


def ruler() -> Drawing:
    """A hundred millimetres, to see whether the printer scales."""
    ticks = "".join(f'<path d="M{2 + x} 8v-{4 if x % 50 == 0 else 2.5 if x % 10 == 0 else 1.2}"/>' for x in range(101))
    svg = (
        '<svg xmlns="http://www.w3.org/2000/svg" width="104mm" height="10mm" viewBox="0 0 104 10">'
        f'<g stroke="#20242a" stroke-width="0.2" fill="none"><path d="M2 8h100"/>{ticks}</g></svg>'
    )
    return Drawing(svg, 104.0, 10.0, "100 mm: if this measures otherwise, print again at 100 %")


def _gore(
    params: EndcapParams, dots: Sequence[Dot], middle: float, count: int, end: float, width: float, height: float
) -> str:
    """One gore, tip at the top."""
    radius = params.inner_radius_mm

    def place(polar: float, azimuth_deg: float) -> tuple[float, float]:
        across = (azimuth_deg - middle + 180.0) % 360.0 - 180.0
        x = radius * math.sin(polar) * math.radians(across) if polar else 0.0
        return width / 2 + x, MARGIN_MM + radius * polar

    half = 180.0 / count
    steps = [end * k / 40 for k in range(41)]
    edge = [place(polar, middle - half) for polar in steps] + [place(polar, middle + half) for polar in reversed(steps)]
    outline = "M" + "L".join(f"{x:.2f} {y:.2f}" for x, y in edge) + "Z"
    shapes = [f'<path d="{outline}" fill="none" stroke="#20242a" stroke-width="0.25"/>', _scale_line()]
    places = [place(math.radians(dot.polar_deg), dot.azimuth_deg) for dot in dots]
    dense = [place(end * k / 400, middle + side * half) for side in (-1, 1) for k in range(401)]
    dense += [(x, height * k / 400) for x in (0.0, width) for k in range(401)]  # what goes over it is cut off
    boxes: list[Box] = [(*point, params.dot_radius_mm, params.dot_radius_mm) for point in places]
    for dot, (x, y) in zip(dots, places, strict=True):
        shapes.append(f'<circle cx="{x:.2f}" cy="{y:.2f}" r="{params.dot_radius_mm:g}" fill="#20242a"/>')
        letters = len(str(dot.ring))
        label = label_place((x, y), boxes, params.dot_radius_mm, letters, dense)
        wide, high = label_half(letters)
        boxes.append((label[0] + wide, label[1] - high, wide + LABEL_ROOM_MM, high + LABEL_ROOM_MM))
        shapes.append(
            f'<text x="{label[0]:.2f}" y="{label[1]:.2f}" font-size="{LABEL_MM}" fill="#5a626c">{dot.ring}</text>'
        )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.2f}mm" height="{height:.2f}mm" '
        f'viewBox="0 0 {width:.2f} {height:.2f}" font-family="DejaVu Sans">{"".join(shapes)}</svg>'
    )


def label_half(letters: int) -> tuple[float, float]:
    """Half the width and height of a label of so many figures."""
    return letters * LETTER_MM / 2, CAPITAL_MM / 2


def label_place(dot: Point, boxes: Sequence[Box], radius_mm: float, letters: int, outline: Sequence[Point]) -> Point:
    """Where a dot's label begins, on its base line: beside the dot, off lines, the other dots and the labels so far.

    Args:
        dot: its centre. boxes: of all dots of the gore, and of the labels that have been placed. radius_mm: of a dot.
        letters: of the label. outline: points of the gore's outline and of the drawing's sides.
    """
    half = label_half(letters)
    kept_off = [(*point, LABEL_ROOM_MM, LABEL_ROOM_MM) for point in outline]
    kept_off += [each for each in boxes if each[:2] != dot]
    places = []
    for turn in LABEL_TURNS:
        away = radius_mm + LABEL_GAP_MM
        x, y = dot[0] + (away + half[0]) * math.cos(turn), dot[1] + (away + half[1]) * math.sin(turn)
        places.append((x - half[0], y + half[1]))
        if all(abs(a - x) > half[0] + wide or abs(b - y) > half[1] + high for a, b, wide, high in kept_off):
            return places[-1]
    return places[0]


def _scale_line() -> str:
    """A line of known length in the empty corner beside the tip."""
    low = MARGIN_MM + SCALE_LINE_MM
    line = f'<path d="M1 {MARGIN_MM:g}h2.5M1 {low:g}h2.5M2 {MARGIN_MM:g}V{low:g}" fill="none" stroke="#20242a" '
    words = f'<text fill="#5a626c" font-size="{LABEL_MM}" x="4.2" y="{MARGIN_MM + 2:g}">{SCALE_LINE_MM:g} mm</text>'
    return line + 'stroke-width="0.2"/>' + words
