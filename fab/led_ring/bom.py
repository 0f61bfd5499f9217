"""BOM lines and pick-and-place table of one LED ring."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass

from cad.led_ring.placement import LED_COUNT, placements


@dataclass(frozen=True)
class RingLine:
    """One line of the BOM.

    Attributes:
        item: name of the part in this project.
        quantity: pieces.
        references: places on the board, for example ``LED1 LED2``.
        description: of the part to order.
        maker: of that part.
        part_number: of its maker.
        package: of the part, a key of the land patterns.
    """

    item: str
    quantity: int
    references: str
    description: str
    maker: str
    part_number: str
    package: str


def ring_bom(led_count: int = LED_COUNT) -> tuple[RingLine, ...]:
    """Lines of one ring, the board itself first.

    Args:
        led_count: LEDs in the string.

    Raises:
        ParameterError: LED count outside the range of the board.
    """
    lines = [
        RingLine(
            "board",
            1,
            "",
            "circuit board, 2 layers, 1.6 mm FR4, white mask",
            "any board house",
            "led_ring-gerber.zip",
            "",
        )
    ]
    places = placements(led_count)
    for kind in dict.fromkeys(place.kind for place in places):
        same = [place for place in places if place.kind == kind]
        part = same[0].part
        names = " ".join(place.reference for place in same)
        lines.append(RingLine(kind, len(same), names, part.description, part.maker, part.part_number, part.package))
    return tuple(lines)


def bom_csv(lines: tuple[RingLine, ...]) -> str:
    """The lines as CSV, references with commas between them, as assembly houses read them."""
    rows = [vars(line) | {"references": line.references.replace(" ", ",")} for line in lines]
    return _table(list(RingLine.__dataclass_fields__), [list(row.values()) for row in rows])


def placement_csv(led_count: int = LED_COUNT) -> str:
    """Pick-and-place table: mm from the ring's axis, degrees counter-clockwise, both seen from the LED side."""
    rows = [
        [
            p.reference,
            f"{p.centre_mm[0]:.4f}",
            f"{p.centre_mm[1]:.4f}",
            p.side,
            f"{p.rotation_deg:.2f}",
            p.part.part_number,
        ]
        for p in placements(led_count)
    ]
    return _table(["designator", "mid_x_mm", "mid_y_mm", "layer", "rotation_deg", "part_number"], rows)


def _table(header: list[str], rows: Sequence[Sequence[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()
