"""Chapters after the cast in the build sheet: whether the dome is good, what to do otherwise, reuse of the mold.

Nothing was cast yet: limits and remedies are our estimates (E), from the parts' own tolerances and from how
addition-cure silicone behaves by its makers' data sheets.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from cad.dots import dot_pattern
from fab.build_sheet.blocks import Block, Heading, Paragraph, Table
from fab.build_sheet.commands import make_command
from fab.build_sheet.data import SheetData
from fab.checks.screw_fit import LENGTHS_MM, ScrewFit, length_tolerance_mm, tip_room_wanted_mm
from fab.recipe import LEAST_LEFT_MM3
from fab.slice.result import is_mold
from fab.variant import Variant

ROUND_MM = 0.6  # E: of the diameter: prints to 0.2 mm, three seams, the tape
DEPTH_MM = 0.5  # E: of the depth and the height: seats and first layers of three prints, a hand-held ruler
PIT_MM = 1.0  # E: deeper pits outside are filled
WARM_C = 40  # E: printed PLA of the mold keeps its shape up to here
COLD_C = 18  # S: makers of addition-cure silicone name this as the least


def judging(data: SheetData) -> list[Block]:
    """Chapter of the demolded dome: what to measure, and what to do about faults of cast and mold.

    Args:
        data: of the sheet.
    """
    return [
        Heading("Judge the dome", 1),
        Paragraph(
            "Before you paint: ten minutes that save a wrong endcap. Trim the flash first. Limits are estimates (E) "
            "for a printed mold; a dome within them can be used. Write the values into the record at the end of this "
            "sheet."
        ),
        Table(("what", "how", "good", "if not"), _acceptance(data), (1.2, 2.4, 1.7, 2.4)),
        Heading("When something goes wrong"),
        Table(("you see", "do"), (*_casting_faults(data), *_mold_faults(data)), (1.3, 3)),
        Heading("The mold again"),
        *(Paragraph(words) for words in _reuse(data)),
    ]


def _acceptance(data: SheetData) -> tuple[tuple[str, str, str, str], ...]:
    """Rows of the inspection: what, with which tool, limit, and what to do beyond it."""
    params, recipe = data.layout.params, data.recipe
    low, high = (math.pi * (params.diameter_mm + side * ROUND_MM) for side in (-1, 1))
    depth, height = params.tip_height_mm - params.wall_mm, params.tip_height_mm
    return (
        ("cure", "press what is left in the cup with a thumbnail, before D1; then the dome", "dry and firm, no mark",
         "leave the mold closed for some hours more; see below"),
        ("mass of silicone", "scale: endcap less interface with its nuts (chapter Silicone)",
         f"{recipe.lightest_g:.0f} to {recipe.heaviest_g:.0f} g",
         "too light: look for air with the lamp; too heavy: flash, or a seam that stood open"),
        ("round the dome", "tape measure or paper strip, level, round the widest section beside the seam",
         f"{low:.0f} to {high:.0f} mm",
         "wider: a seam stood open, the wall is thicker; calibration by weight corrects a little of it"),
        ("depth", "ruler across the interface's flange; caliper's rod from its lower edge to the tip inside, between "
         "dents, without pressing", f"{depth - DEPTH_MM:.1f} to {depth + DEPTH_MM:.1f} mm",
         "more: the centre of the core did not lie against the hanger, the wall at the tip is thinner by as much; "
         "less: the core was printed too low"),
        ("height", "endcap on its flange on the table, ruler level on the tip, caliper from the table to its lower "
         "edge",
         f"{height - 2 * DEPTH_MM:.1f} to {height + 2 * DEPTH_MM:.1f} mm",
         "more: bowl and collar stood apart, the wall is thicker below the tip; clean seam and dam before the next "
         "cast"),
        ("dents", "lamp inside, count; lay a gore in (chapter Paint the dots)",
         f"{len(dot_pattern(params))}, all round, each under its hole",
         "filled or flat: paint it through the gore's hole; rows beside their holes: two pieces of the core had "
         "changed places, cast again"),
        ("bond", "hold the flange, pull the wall away from it with your thumbs, once round",
         "no gap opens between silicone and TPU", "cast again, with a new interface: a gap grows"),
        ("surface inside", "lamp", "no fins, nothing loose, no pit within 2 mm of a dent",
         "cut fins off; fill pits as below"),
    )  # fmt: skip


def _casting_faults(data: SheetData) -> tuple[tuple[str, str], ...]:
    """Rows of faults that show until the mold is closed."""
    recipe = data.recipe
    more_g = math.ceil(LEAST_LEFT_MM3 / 1000 * recipe.silicone.density_g_cm3 / 5) * 5
    return (
        ("a piece of the gyroid is torn before the cast",
         "A loose bit: take it out, the camera would see it. More than a thumb's width, or a ring that moves on its "
         "flange: print the interface again."),
        ("silicone comes out at a seam of the bowl while you pour",
         "Press the tape on, add a turn above it, go on: it thickens. Catch it in the tray, and top up by its weight. "
         "A stream that does not stop: pour back into the cup, scrape the bowl, wipe the seam, tape again. The clock "
         "runs."),
        ("the cup gives less than is to be poured",
         f"Scrape it. Still short: mix {more_g:g} g more in the same ratio, at once, and pour it on: wet on wet "
         "joins."),
        ("the collar stops before it is down",
         "Do not pull it down with the bolts. Lift it a little, look for a thread of silicone, a washer or a seam of "
         "the collar on the dam; lower it again."),
    )  # fmt: skip


def _mold_faults(data: SheetData) -> tuple[tuple[str, str], ...]:
    """Rows of faults that show once the mold is opened, and of worn parts."""
    return (
        ("sticky everywhere, in the cup, too",
         f"Below {COLD_C} °C: wait; {WARM_C} °C for some hours helps, warmer bends PLA: no oven above it. Else the "
         "ratio was wrong, or a lid or spoon was exchanged: scrape all off, wipe with alcohol, cast again."),
        ("streaks or spots that stay soft, the cup is firm",
         "Badly mixed: sides and bottom were not scraped. They never cure: cut them out, fill as a pit."),
        ("sticky where it touched one plastic or glove",
         "Its cure was stopped. Wash with alcohol, find the cause by a spoonful on each suspect, then cast again."),
        ("a pit or bubble outside",
         f"Less than {PIT_MM:g} mm deep: leave it. Else wash with alcohol, fill with a little fresh mix of the same "
         "silicone, press smooth with tape, cure. It joins well."),
        ("a dry hollow at the flange or in the gyroid",
         "Only if no gap opens at the bond: fill it with fresh mix from a syringe, opening up. Else cast again."),
        ("a piece of the core is stuck",
         "Alcohol along its seams, a minute, press the dome in from outside beside it, turn its screw 10 mm in and "
         "pull along the way of the picture. Never pry against the silicone."),
        ("a piece of the core or of the cup breaks",
         f"Pull the rest by a screw turned into it. {make_command('slice', data)} plates=single makes a project of "
         "each part: print the one of the same number, the others stay."),
        ("a hole in the PLA no longer holds its screw", _stripped(data.fits)),
        ("a nut turns or has lost its thread",
         "The pockets open into the bore: push it out with a screw after the demolding, put a new one in. Silicone in "
         "a thread: turn a screw through it, pick it out."),
        ("ink beside a dent, or dots that fade",
         "A cotton bud with alcohol takes it off; let it dry, paint that dot again. Never wash a painted dome inside "
         "with alcohol."),
    )  # fmt: skip


def _stripped(fits: Sequence[ScrewFit]) -> str:
    """Text on holes in plastic that are worn, with the next longer screw where it has room before its tip."""
    longer: dict[str, set[str]] = {}
    for fit in fits:
        if fit.joint.holder == "plastic" and is_mold(fit.joint.seat):
            place = "core" if fit.joint.anchor.startswith("core_") else "collar"
            longer.setdefault(place, set()).add(_next_length(fit))
    found = {place: next(iter(sizes)) for place, sizes in longer.items() if len(sizes) == 1}
    known = [f"of the {place} {size}" for place, size in found.items() if size]
    words = f"A longer screw has room: in the holes {' and '.join(known)}. " if known else ""
    return (
        f"{words}Elsewhere push a strip of PLA filament, cut lengthwise, into the hole and drive the screw again; "
        "after that, print the piece again."
    )


def _next_length(fit: ScrewFit) -> str:
    """The next longer screw of a joint, such as ``M3 x 20``; empty where its tip has no room."""
    longer = next((length for length in LENGTHS_MM if length > fit.length_mm), None)
    if longer is None:
        return ""
    more = longer + length_tolerance_mm(longer) - fit.length_mm - length_tolerance_mm(fit.length_mm)
    has_room = fit.tip_room_mm - more >= tip_room_wanted_mm(fit.joint)
    return f"{fit.joint.thread.removeprefix('screw_').upper()} x {longer:g}" if has_room else ""


def _reuse(data: SheetData) -> tuple[str, ...]:
    """Paragraphs on cleaning, reuse, storage and disposal."""
    return (
        "After each cast: peel flash off, with a toothpick out of joints, screw holes and recesses; look at every seam "
        "with the lamp, for a skin of 0.1 mm keeps a joint open. Wipe with alcohol; no acetone, it eats PLA. Release "
        "agent on every PLA face before every cast: what the last cast took off is where the next one sticks. Turn "
        "screws backward until they drop into their old thread, then forward: a second thread across the first strips "
        "it.",
        "How many casts a mold gives is not known: none was made yet, and the paper says reusable without a number. "
        "Stop using a piece when a seam's edge is chipped, a joint rattles wider than the coupon's step, or silicone "
        f"holds on it in spite of release agent. Keep the mold screwed together, dry, dark and below {WARM_C} °C.",
        f"The kit of {data.recipe.silicone.name}: close both lids at once and never exchange them, nor spoons: a trace "
        "of A in B sets it. Stir each part in its can before you weigh. An opened kit is for weeks, not years: write "
        "the date on it, and try a spoonful first.",
        "Waste: leave the rest in the cup, cured silicone peels out and goes with household waste, and the cup can be "
        "used again. Nothing uncured down a drain. Let wipes with alcohol dry in the open; spray release agent away "
        "from flames, hot irons and motors: its solvent burns.",
    )


def record(data: SheetData) -> list[Block]:
    """Chapter with the form that is filled in for each endcap."""
    recipe, params = data.recipe, data.layout.params
    blank = "________"
    rows = (
        ("number on the rim; date; made by", f"{blank}  {blank}  {blank}"),
        ("design", f"{Variant(data.layout, data.robot).words}; digest {params.digest[:12]}"),
        (f"{recipe.silicone.name}: lot of A, of B; kit opened on", f"{blank}  {blank}  {blank}"),
        ("room; cast number of this mold", f"{blank} °C  {blank}"),
        (f"A ({recipe.part_a_g:.1f} g), B ({recipe.part_b_g:.1f} g)", f"{blank} g  {blank} g"),
        (f"cup, stick and mix before pouring; after ({recipe.poured_g:.0f} g less)", f"{blank} g  {blank} g"),
        ("A and B met at; closed at; demolded at", f"{blank}  {blank}  {blank}"),
        ("interface with nuts; endcap; silicone", f"{blank} g  {blank} g  {blank} g"),
        ("round the dome; depth; height", f"{blank} mm  {blank} mm  {blank} mm"),
        (f"dents of {len(dot_pattern(params))}; bond all round; faults and where", f"{blank}  {blank}  {blank}{blank}"),
        ("ring: current at 5 V; camera's number or name", f"{blank} mA  {blank}"),
        ("dots in the frame; gain by weight; file of weights", f"{blank}  {blank}  {blank}"),
    )
    return [
        Heading("Record of one endcap", 1),
        Paragraph("Print this page once for each endcap, and keep it with its endcaps.toml."),
        Table(("what", "value"), rows, (2, 2.4)),
    ]
