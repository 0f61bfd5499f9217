"""Numbered steps with their screws: the records of :mod:`fab.steps` as blocks of the sheet."""

from __future__ import annotations

import re
from collections.abc import Sequence

from cad.bought import bought_mm
from cad.robot_sides import LEAST_FLOOR_MM, entry_words, fixing_words, ream_words, robot_side, robot_words
from fab.bom import screw_name
from fab.build_sheet.blocks import Block
from fab.build_sheet.blocks import Step as StepBlock
from fab.build_sheet.commands import GRAVITY_M_S2
from fab.build_sheet.data import SheetData
from fab.lift import lift_g, lift_kg
from fab.recipe import Recipe, millilitres

BLANK = re.compile(r"\{(\w+)(?::(\w+))?\}")


def stage_blocks(data: SheetData, letter: str, stages: Sequence[str]) -> list[Block]:
    """Steps <letter>1, 2, ... of some stages of the work, in order.

    Args:
        data: of the sheet.
        letter: before the numbers.
        stages: names of the stages.
    """
    chosen = [step for step in data.steps if step.stage in stages]
    return [
        StepBlock(f"{letter}{number}", step.title, filled(data, step.lines), data.pictures.get(step.key))
        for number, step in enumerate(chosen, 1)
    ]


def screws(data: SheetData, prefix: str) -> str:
    """Number and name of the screws of some joints, as text.

    Args:
        data: of the sheet.
        prefix: beginning of the joints' names.
    """
    fits = [fit for fit in data.fits if fit.joint.name.startswith(prefix)]
    washers = (
        ", each with a washer under its head"
        if fits[0].joint.washers and fits[0].joint.holder == "captured nut"
        else ""
    )
    return f"{_screw_count(data, prefix)} x {screw_name(fits[0])}{washers}"


def _screw_count(data: SheetData, prefix: str) -> int:
    """Number of screws of the joints whose names begin so."""
    return sum(len(fit.joint.places) for fit in data.fits if fit.joint.name.startswith(prefix))


def filled(data: SheetData, lines: Sequence[str]) -> tuple[str, ...]:
    """Lines with their blanks filled in: ``{screws:joint}``, ``{count:joint}`` and the recipe's numbers.

    Raises:
        KeyError: a blank of an unknown name.
    """
    recipe = data.recipe
    values = {
        "part_a_g": f"{recipe.part_a_g:.1f}",
        "part_b_g": f"{recipe.part_b_g:.1f}",
        "degas": _degassing(recipe),
        "poured_g": f"{recipe.poured_g:.0f}",
        "left_g": f"{recipe.left_g:.0f}",
        "lift_n": f"{GRAVITY_M_S2 * lift_g(data.layout, recipe) / 1000:.0f}",
        "lift_kg": f"{lift_kg(data.layout, recipe):g}",
        "reach_mm": f"{bolt_reach_mm(data):.0f}",
        "fill_depth_mm": f"{data.fill_depth_mm:.0f}",
        "cure_h": f"{recipe.silicone.cure_h:g}",
        "beyond_ml": f"{recipe.beyond_mm3 / 1000:.1f}",
        "room_ml": f"{recipe.overflow.room / 1000:.1f}",
        "leak_ml": millilitres(recipe.overflow.leak),
        "pot_life_min": f"{recipe.silicone.pot_life_min:g}",
        "robot": robot_words(data.robot).removeprefix("flange ") if robot_side(data.robot) else "your own robot",
        "robot_fixing": _fixing(data.robot),
    }

    def fill(match: re.Match[str]) -> str:
        if match[1] == "count":
            return str(_screw_count(data, match[2]))
        return screws(data, match[2]) if match[1] == "screws" else values[match[1]]

    return tuple(BLANK.sub(fill, line) for line in lines)


def bolt_reach_mm(data: SheetData) -> float:
    """Gap between bowl and collar at which the first thread of a bolt enters its nut, mm.

    Args:
        data: of the sheet.
    """
    beyond = [fit.length_mm - fit.grip_mm for fit in data.fits if fit.joint.holder == "loose nut"]
    return min(beyond, default=0.0) - bought_mm("screw_m4", "pitch")


def _degassing(recipe: Recipe) -> str:
    """Text on degassing, or on why the pot life leaves no time for it."""
    if recipe.is_degassed:
        return "degas until the foam has risen and fallen"
    return f"do not degas: {recipe.silicone.pot_life_min:g} min of pot life leave no time for it"


def _fixing(robot: str) -> str:
    """Text on how the adapter is fastened to the robot."""
    if not robot_side(robot):
        return (
            "its upper side is blank: drill it for your robot, 5 mm from the hub's edge at least, clear of bore and "
            f"groove, and sink the screws' heads, for the base lies on that side; {LEAST_FLOOR_MM:g} mm stay under a "
            "head at least"
        )
    ream = f"ream the pin's hole to {size} by hand; " if (size := ream_words(robot)) else ""
    depth = (
        f". A screw enters the flange {entry}: compare with your robot's flange, never longer than its thread"
        if (entry := entry_words(robot))
        else ""
    )
    return f"{ream}pin first, then the screws from above, heads in the hub's pockets ({fixing_words(robot)}){depth}"


def steps(data: SheetData, letter: str, records: Sequence[tuple[str, tuple[str, ...], str | None]]) -> list[Block]:
    """Steps <letter>1, 2, ... of work without parts.

    Args:
        data: of the sheet.
        letter: before the numbers.
        records: (title, lines, name of the picture or None) of each step.
    """
    return [
        StepBlock(f"{letter}{number}", title, lines, data.pictures[picture] if picture else None)
        for number, (title, lines, picture) in enumerate(records, 1)
    ]
