"""SVG drawings of the dots: gores at true size for painting (mm), and the expected picture of the camera (px).

A gore is the strip of the inner surface between two meridians: along its middle, lengths from the tip are true; across,
lengths on each parallel are true. Cut out, its dots punched out, and laid into the dome from the tip, print toward the
viewer, it has a dent under every hole: so dents are found that are hard to see, and those without ink.

The viewer looks into the dome along +z, as the camera does: azimuth increases clockwise there. With the tip up,
decreasing azimuth is to the right.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from cad.dots import Dot, dot_pattern
from cad.params import EndcapParams
from fab.build_sheet.blocks import Drawing
from fab.camera_view import FRAME_PX, SQUARE_PX, camera_pixels, disc_px, dot_outline_px

Point = tuple[float, float]
Box = tuple[float, float, float, float]  # centre, half the width, half the height
MARGIN_MM = 4.0
SPLIT = 6  # least number of gores
PAGE_WIDTH_MM = 180.0  # of the text on A4: two gores side by side, with a space between
SPACE_MM = 2.0
SCALE_LINE_MM = 50.0  # beside every gore: a printer may scale one page and not another
LABEL_MM = 2.6  # size of the letters
LETTER_MM = 0.65 * LABEL_MM  # width of a figure
CAPITAL_MM = 0.73 * LABEL_MM  # height of a figure
LABEL_GAP_MM, LABEL_ROOM_MM = 0.6, 0.4  # to its dot, to the outline
LABEL_TURNS = [
    math.radians(turn) for turn in (0, 180, 45, 135, -45, -135, 125, -125, 90, -90)
]  # SVG angles: 90 is down
LARGEST_WIDTH_MM = (PAGE_WIDTH_MM - SPACE_MM) / 2 - 2 * MARGIN_MM


def gores(params: EndcapParams) -> list[Drawing]:
    """Gores that together contain each dot once, in order of azimuth, seen with the print toward the viewer.

    Args:
        params: the design.
    """
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
        caption = f"gore {number + 1} of {count}: {len(own)} dots about azimuth {middle:.1f}°"
        sheets.append(Drawing(svg, width, height, caption))
    return sheets


def gore_of(dot: Dot, count: int) -> int:
    """Index of the gore with a dot: that with the nearest middle meridian; the dot at the tip is in the first.

    Args:
        dot: of the pattern.
        count: number of gores.
    """
    return round(dot.azimuth_deg * count / 360.0 + 1e-9) % count if dot.ring else 0


def repeat_deg(params: EndcapParams) -> float:
    """Smallest rotation that maps the pattern onto itself: 360 degrees over the gcd of the dot counts of its rings."""
    return 360.0 / math.gcd(*params.dot_rings[1:])


def first_light(params: EndcapParams) -> Drawing:
    """Expected picture of the camera: the disc of the shell, the dots and the centre square.

    Args:
        params: the design.
    """
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
    """A scale of 100 mm, by which a printer that scales the page is found."""
    ticks = "".join(f'<path d="M{2 + x} 8v-{4 if x % 50 == 0 else 2.5 if x % 10 == 0 else 1.2}"/>' for x in range(101))
    svg = (
        '<svg xmlns="http://www.w3.org/2000/svg" width="104mm" height="10mm" viewBox="0 0 104 10">'
        f'<g stroke="#20242a" stroke-width="0.2" fill="none"><path d="M2 8h100"/>{ticks}</g></svg>'
    )
    return Drawing(svg, 104.0, 10.0, "100 mm: if this measures otherwise, print again at 100 %")


def _gore(
    params: EndcapParams, dots: Sequence[Dot], middle: float, count: int, end: float, width: float, height: float
) -> str:
    """One gore, tip at the top, as seen from inside the dome: azimuth increases to the left."""
    radius = params.inner_radius_mm

    def place(polar: float, azimuth_deg: float) -> tuple[float, float]:
        across = (azimuth_deg - middle + 180.0) % 360.0 - 180.0
        x = radius * math.sin(polar) * math.radians(across) if polar else 0.0
        return width / 2 - x, MARGIN_MM + radius * polar

    half = 180.0 / count
    steps = [end * k / 40 for k in range(41)]
    edge = [place(polar, middle - half) for polar in steps] + [place(polar, middle + half) for polar in reversed(steps)]
    outline = "M" + "L".join(f"{x:.2f} {y:.2f}" for x, y in edge) + "Z"
    shapes = [f'<path d="{outline}" fill="none" stroke="#20242a" stroke-width="0.25"/>', _scale_line()]
    places = [place(math.radians(dot.polar_deg), dot.azimuth_deg) for dot in dots]
    dense = [place(end * k / 400, middle + side * half) for side in (-1, 1) for k in range(401)]
    dense += [(x, height * k / 400) for x in (0.0, width) for k in range(401)]  # clipped to the drawing
    boxes: list[Box] = [(*point, params.dot_radius_mm, params.dot_radius_mm) for point in places]
    ring_by_ring = sorted(zip(dots, places, strict=True), key=lambda each: (each[0].ring, each[1]))  # left to right
    for dot, (x, y) in ring_by_ring:
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
    """Half the width and half the height (mm) of a label.

    Args:
        letters: number of its characters.
    """
    return letters * LETTER_MM / 2, CAPITAL_MM / 2


def label_place(dot: Point, boxes: Sequence[Box], radius_mm: float, letters: int, outline: Sequence[Point]) -> Point:
    """Start of a label on its base line: beside its dot, clear of lines, of other dots and of labels placed before.

    Args:
        dot: its centre, mm.
        boxes: of all dots of the gore and of the labels placed before.
        radius_mm: of a dot.
        letters: number of characters of the label.
        outline: points of the gore's outline and of the drawing's sides, mm.
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
