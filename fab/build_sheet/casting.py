"""Chapters of silicone, casting and demolding in the build sheet."""

from __future__ import annotations

from fab.build_sheet.blocks import Block, Heading, Paragraph, Table
from fab.build_sheet.data import SheetData
from fab.build_sheet.judging import COLD_C, WARM_C
from fab.build_sheet.shopping import safety
from fab.build_sheet.steps import stage_blocks
from fab.recipe import RELEASE_AGENT, Recipe, millilitres


def silicone(data: SheetData) -> list[Block]:
    """Recipe, clock and the check by weight."""
    recipe = data.recipe
    closed = f"{recipe.timeline[-1].end_min:g} min", f"closed; {recipe.pot_life_to_spare_min:g} min to spare"
    clock = tuple((f"{step.start_min:g} to {step.end_min:g} min", step.what) for step in recipe.timeline)
    return [
        Heading("Silicone", 1),
        *safety(data),
        Heading("What to weigh"),
        Table((), _recipe_rows(recipe), (1, 3)),
        Heading("Clock, from the moment A and B meet"),
        Table(("when", "what"), (*clock, closed), (1, 3)),
        Heading("Check the pour by weight"),
        Paragraph(
            "Weigh the interface before casting (with its nuts) and the demolded endcap after. The difference is the "
            f"silicone: {recipe.expected_g:.0f} g, accepted {recipe.lightest_g:.0f} to {recipe.heaviest_g:.0f} g once "
            f"the flash is trimmed. Each gram missing is {recipe.air_mm3_per_g / 1000:.2f} ml of air or of unfilled "
            f"gyroid. Each gram over {recipe.expected_g:.0f} g is flash that is still on it, or a mold that did not "
            f"close all the way. More than {recipe.heaviest_g:.0f} g was never poured: see whether a piece of the core "
            "is still inside or the nuts were not weighed before, and weigh again. Write it down: ______ g before, "
            "______ g after, ______ g silicone."
        ),
    ]


def _recipe_rows(recipe: Recipe) -> tuple[tuple[str, str], ...]:
    silicone = recipe.silicone
    return (
        ("part A", f"{recipe.part_a_g:.1f} g"),
        ("part B", f"{recipe.part_b_g:.1f} g"),
        ("mixing ratio", silicone.mix_ratio),
        ("volume of the cast", f"{recipe.cast_volume_mm3 / 1000:.1f} ml"),
        ("mix", f"{100 * recipe.surplus:.0f} % more than the cast: what is not poured stays in cup and on stick"),
        (
            "pour",
            f"{recipe.poured_g:.0f} g: {recipe.beyond_mm3 / 1000:.1f} ml more than the cast, of which as much as "
            f"{millilitres(recipe.overflow.leak)} ml creeps out at the bowl's joints; the dam's gap, the flange's "
            f"edge, vents and wells have room for {recipe.overflow.room / 1000:.1f} ml, the rest rises onto the hanger",
        ),
        ("stays", f"{recipe.left_g:.0f} g in the cup and on the stick, once the cup is scraped"),
        ("density", f"{silicone.density_g_cm3:g} g/ml"),
        ("pot life", f"{silicone.pot_life_min:g} min at 23 °C; warmer is shorter, about half at 33 °C"),
        (
            "cure",
            f"{silicone.cure_h:g} h at room temperature before demolding; longer when colder, not below {COLD_C} °C, "
            f"and no oven above {WARM_C} °C: the mold is PLA",
        ),
        ("release agent", f"{RELEASE_AGENT}: all PLA that touches silicone, never the TPU"),
        ("hardness", f"Shore {silicone.shore}"),
    )


def casting(data: SheetData) -> list[Block]:
    """Steps from the nuts to the closed mold."""
    vacuum = "vacuum chamber and pump, " if data.recipe.is_degassed else ""
    return [
        Heading("Cast", 1),
        Paragraph(
            "First smooth the core: the dome copies its layer lines, and the camera sees them as rings. Rub it with "
            "grit 240, then 400, and keep off its bumps. Wash it, let it dry, wipe it with alcohol. Do not lacquer "
            "it: most lacquers hinder the cure."
        ),
        Paragraph(
            "Spray release agent away from the interface, never onto it: silicone must hold in its gyroid. Before A "
            "and B meet, lay ready what the clock does not wait for: gloves, safety glasses, scale, cup, stick, "
            f"{vacuum}the tray under the bowl, tape, paper towels, the six bolts with their washers and nuts, the hex "
            "key and the socket for them. Stir each part in its can, with a stick of its own: what has settled is "
            "missing in the mix."
        ),
        *stage_blocks(data, "C", ("upper half", "bowl", "cast")),
    ]


def demolding(data: SheetData) -> list[Block]:
    """Steps from the closed mold to the endcap."""
    return [
        Heading("Demold", 1),
        Paragraph(
            "First press what is left in the cup with a thumbnail. Soft or sticky: the cast is, too; leave it closed."
        ),
        Paragraph(
            "Put safety glasses on. Lay the soft ring ready. Keep the core's screws at hand: they are the handles of "
            "its pieces."
        ),
        *stage_blocks(data, "D", ("demold",)),
    ]
