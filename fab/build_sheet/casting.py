"""Silicone, casting and demolding: words and steps of the build sheet."""

from __future__ import annotations

from cad.interface import POCKET_FLOOR_MM
from cad.mold_layout import MoldLayout
from fab.build_sheet.blocks import Block, Heading, Paragraph, Table
from fab.build_sheet.data import SheetData
from fab.build_sheet.steps import screws, steps
from fab.recipe import RELEASE_AGENT

Told = list[tuple[str, tuple[str, ...], str | None]]  # title, lines, picture
DEMOLDING: Told = [
    (
        "Bolts out, bowl off",
        (
            "Take the six bolts out.",
            "Draw the bowl's segments off one by one, straight away from the collar.",
        ),
        "bowl_off",
    ),
    (
        "Hanger off",
        ("All screws out; lift the hanger.", "Plugs of silicone in the vents tear: that is right."),
        "hanger_off",
    ),
    (
        "Collar off",
        ("Lift its segments straight up, past the rim of the interface.",),
        "collar_off",
    ),
    (
        "Centre of the core out",
        (
            "Two of the M3 x 16 in its holes are your handle.",
            "Straight out: it is tapered by one degree and free after the first millimetre.",
        ),
        "centre_out",
    ),
    (
        "Keys out",
        ("One after the other: inward, toward the axis, until clear of the silicone; then out.",),
        "keys_out",
    ),
    (
        "Wides out",
        ("The same way.", "Trim the flash at seam and vents. Weigh the endcap."),
        "wides_out",
    ),
]


def silicone(data: SheetData) -> list[Block]:
    """Recipe, clock and the check by weight."""
    recipe, silicone = data.recipe, data.recipe.silicone
    rows = (
        ("part A", f"{recipe.part_a_g:.1f} g"),
        ("part B", f"{recipe.part_b_g:.1f} g"),
        ("mixing ratio", silicone.mix_ratio),
        ("volume of the cast", f"{recipe.cast_volume_mm3 / 1000:.1f} ml, and {100 * recipe.surplus:.0f} % surplus"),
        ("density", f"{silicone.density_g_cm3:g} g/ml"),
        ("pot life", f"{silicone.pot_life_min:g} min at 23 °C; warmer is shorter"),
        ("cure", f"{silicone.cure_h:g} h at room temperature before demolding"),
        ("release agent", f"{RELEASE_AGENT}: all PLA that touches silicone, never the TPU"),
        ("hardness", f"Shore {silicone.shore}"),
    )
    closed = f"{recipe.timeline[-1].end_min:g} min", f"closed; {recipe.pot_life_to_spare_min:g} min to spare"
    clock = tuple((f"{step.start_min:g} to {step.end_min:g} min", step.what) for step in recipe.timeline)
    return [
        Heading("Silicone", 1),
        Table(("", ""), rows, (1, 3)),
        Heading("Clock, from the moment A and B meet"),
        Table(
            ("when", "what"),
            (*clock, closed),
            (1, 3),
        ),
        Heading("Check the pour by weight"),
        Paragraph(
            f"Weigh the interface before casting (with its nuts) and the demolded endcap after. The difference is the "
            f"silicone: {recipe.expected_g:.0f} g, accepted {recipe.lightest_g:.0f} to {recipe.heaviest_g:.0f} "
            f"g once the "
            f"flash is trimmed. Each gram missing is {recipe.air_mm3_per_g / 1000:.2f} ml of air or of unfilled "
            f"gyroid; more "
            f"than {recipe.heaviest_g:.0f} g means that the mold did not close. Write it down: ______ g before, "
            f"______ g "
            f"after, ______ g silicone."
        ),
    ]


def casting(data: SheetData) -> list[Block]:
    """Steps from the nuts to the closed mold."""
    return [Heading("Cast", 1), *steps(data, "C", [*_upper_half(data), *_pour(data)])]


def _upper_half(data: SheetData) -> Told:
    return [
        (
            "Push the ten square nuts into the interface",
            (
                "From the bore outward, flat side down, until each snaps over its rib.",
                f"They sit on {POCKET_FLOOR_MM:g} mm of TPU. Weigh the interface now.",
            ),
            "nuts",
        ),
        *_core_first(data),
        (
            "Screw the interface to the hanger",
            (
                "Hanger on the table, pins up. Interface on it, gyroid up, nuts over the inner circle of holes.",
                f"{screws(data, 'hanger_to_interface')} from below, hand-tight: TPU gives way.",
            ),
            "interface_on_hanger",
        ),
        *_core_to_hanger(data),
        (
            "Set the collar round it",
            (
                "Release agent first. Slide the three segments into one another along their jigsaw tabs.",
                "Lower them onto the hanger: its three pins fix where they go.",
                f"{screws(data, 'hanger_to_cup')} from below.",
            ),
            "collar",
        ),
    ]


def _pour(data: SheetData) -> Told:
    layout, recipe = data.layout, data.recipe
    return [
        (
            "Put the bowl together",
            (
                "Slide the three segments into one another; stand them on their foot, on a level table.",
                "Release agent inside and on the seams. Tape round the outside keeps it tight while you pour.",
            ),
            "bowl",
        ),
        (
            "Weigh, mix, degas",
            (
                f"{recipe.part_a_g:.1f} g A and {recipe.part_b_g:.1f} g B into one cup. The clock runs.",
                "Mix until no streak is left; degas until the foam has risen and fallen.",
            ),
            None,
        ),
        (
            "Pour",
            (
                "A thin stream onto one spot of the bowl; the silicone finds its level.",
                f"All of it stands about {data.fill_depth_mm:.0f} mm below the seam, not over it.",
            ),
            "pour",
        ),
        *_closing(layout, screws(data, "cup_collar"), recipe.silicone.cure_h),
    ]


def _closing(layout: MoldLayout, bolts: str, cure_h: float) -> Told:
    return [
        (
            "Lower the upper half",
            (
                "Turn the upper half over, core down. Lower it upright, slowly: the silicone climbs into the gyroid.",
                f"Last {layout.seam_height_mm - layout.dam_top_mm:.0f} mm: the collar slides into the bowl's dam.",
            ),
            "close",
        ),
        (
            "Close, and look at the wells",
            (
                f"{bolts} with a washer at either end, crosswise, until the piston seats.",
                "All ten wells on the hanger show silicone: the mold is full. A dry well: press, wait, tap.",
                f"Leave it for {cure_h:g} h at room temperature.",
            ),
            "closed",
        ),
    ]


def _core_first(data: SheetData) -> Told:
    """How the core comes together: outside the interface where it can be lowered in whole, else inside it."""
    agent = "Release agent on every face, seams too; let it dry as its label says."
    if lowers(data.layout):
        lines: tuple[str, ...] = (
            agent,
            "Stand the centre on its neck. Push the three wides against its short sides.",
            "Lower the three keys over its tabs. Hold all with a rubber band round the equator.",
        )
        return [("Put the core together", lines, "core")]
    lines = (
        agent,
        "At this size the gyroid closes in over the core's equator: the pieces go in through the bore, as they will "
        "come out, last piece first.",
        "Interface on a soft ring, bore up. Wides in and outward, keys in between, the centre straight down.",
    )
    return [("Put the core together inside the interface", lines, "core_inside")]


def _core_to_hanger(data: SheetData) -> Told:
    """The step that brings the core to the hanger; where it is inside the interface already, its screws alone."""
    fastened = f"{screws(data, 'hanger_to_core')} from below into the core."
    if not lowers(data.layout):
        return [
            ("Screw the core to the hanger", (f"Keys at the azimuths of the hanger's pins. {fastened}",), "core_held")
        ]
    lines = (
        "Neck first, through the gyroid ring onto the hanger; keys at the azimuths of the hanger's pins.",
        f"{fastened} Take the rubber band off.",
    )
    return [("Lower the core into the interface", lines, "core_on_hanger")]


def lowers(layout: MoldLayout) -> bool:
    """Whether the whole core passes the gyroid ring from the dome's side: below its equator it narrows all the way."""
    return layout.params.interlock_top_mm <= layout.params.centre_height_mm


def demolding(data: SheetData) -> list[Block]:
    """Steps from the closed mold to the endcap."""
    return [Heading("Demold", 1), *steps(data, "D", DEMOLDING)]
