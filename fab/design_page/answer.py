"""Content of the page for one setting of its sliders: numbers and section, or refusal; and the feasible region."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from cad.dots import dot_pattern
from cad.errors import ParameterError
from cad.feasible import diameter_range_mm, wall_range_mm
from cad.materials import silicone, silicones
from cad.mold.layout import JOINT_CLEARANCE_MM, JOINT_CLEARANCE_RANGE_MM, MoldLayout, joint_clearance_range_mm
from cad.options import PATTERN_DEFAULTS
from cad.params import EndcapParams
from cad.robot_sides import DEFAULT_ROBOT, robot_sides, robot_words
from fab.camera_view import few_dots_words, seen_dots
from fab.command import VARIANT_DEFAULTS, parse_variant
from fab.design_page.estimate import estimate
from fab.design_page.outline import parts, preview_parts
from fab.exports.preview import glb
from fab.pot_life import short_pot_life_words
from fab.recipe import closed_cast_mm3
from fab.slice.printers import DEFAULT_PRINTER, printer, printer_words, printers
from fab.variant import Variant

MAY_BE_EMPTY = ("material", "printer", *PATTERN_DEFAULTS, "robot")  # then the defaults of make molds apply
KNOBS = ("D", "T", "joint_clearance", *MAY_BE_EMPTY)
REGION_STEPS = 160


@dataclass(frozen=True)
class Choice:
    """A feasible setting of the sliders and lists.

    Attributes:
        variant: design, joint clearance, silicone and robot.
        printer: name of a row of the printers' table.
    """

    variant: Variant
    printer: str

    @property
    def words(self) -> tuple[str, ...]:
        """Options of `make molds`, one word each, not quoted for a shell."""
        return tuple(shlex.split(self.variant.words))


def parse_choice(knobs: Mapping[str, str]) -> Choice:
    """Read the settings as the command line reads its options.

    Args:
        knobs: settings by name, as typed.

    Raises:
        ParameterError: a value that cannot be read or made; the message has the nearest valid choice.
    """
    if strangers := sorted(set(knobs) - set(KNOBS)):
        raise ParameterError(f"{strangers[0]!r} is no knob: they are {', '.join(KNOBS)}", name=strangers[0])
    given = {name: value for name, value in knobs.items() if value or name not in MAY_BE_EMPTY}
    where = printer(given.pop("printer", DEFAULT_PRINTER))
    return Choice(parse_variant({**VARIANT_DEFAULTS, "D": "130", "T": "8", **given}), where.name)


def answer(knobs: Mapping[str, str], exports_option: str = "") -> dict[str, Any]:
    """Content for a setting: either ``refusal``, or facts, section and commands.

    Args:
        knobs: settings by name, as typed.
        exports_option: option of the folder of exports in the commands (:func:`fab.command.exports_words`).
    """
    try:
        choice = parse_choice(knobs)
    except ParameterError as error:
        return {"refusal": str(error)}
    variant = choice.variant
    params, row = variant.params, silicone(variant.silicone)
    volume = closed_cast_mm3(params)
    costs = estimate(variant.layout, row, choice.printer)
    low, high = joint_clearance_range_mm(params, row.name)
    facts = [
        ("height", f"{params.tip_height_mm:.1f} mm above the base's face"),
        ("silicone", f"{volume / 1000:.0f} ml, {volume * row.density_g_cm3 / 1000:.0f} g of {row.name}"),
        *_late(variant),
        ("dots", _dots_words(params)),
        ("endcap weighs", f"about {costs.endcap_g:.0f} g with camera and ring"),
        ("mold", f"about {costs.mold_g:.0f} g of PLA"),
        ("printing", f"about {costs.hours:.0f} h, mold and all printed parts of the endcap"),
        ("cost", f"about {costs.usd:.0f} USD: plastic, silicone in the cast, camera, ring, screws"),
        ("joint clearance", f"{low:g} to {high:g} mm a side in this silicone"),
        ("bed", costs.bed),
    ]
    return {
        "facts": facts,
        "section": _section(variant.layout),
        "label": variant.label,
        "commands": [
            f"{variant.command(target)}{printer_words(choice.printer)}{exports_option}"
            for target in ("molds", "slice", "sheet")
        ],
    }


def preview(knobs: Mapping[str, str]) -> bytes:
    """GLB of the closed-form parts.

    Args:
        knobs: settings by name, as typed.

    Raises:
        ParameterError: the setting is not feasible.
    """
    layout = parse_choice(knobs).variant.layout
    return _preview(layout)


@lru_cache(maxsize=8)
def _preview(layout: MoldLayout) -> bytes:
    return glb(preview_parts(layout))


@lru_cache(maxsize=1)
def region() -> dict[str, Any]:
    """The feasible region, and the choices of the lists."""
    smallest, largest = diameter_range_mm()
    low_d = math.ceil(smallest * 100) / 100
    diameters = np.linspace(low_d, largest, REGION_STEPS)
    ranges = [wall_range_mm(float(d)) for d in diameters]
    rows = [[float(d), *walls] for d, walls in zip(diameters, ranges, strict=True) if math.isfinite(walls[0])]
    return {
        "region": [[round(v, 4) for v in row] for row in rows],
        "diameter": [low_d, largest],
        "wall": [min(row[1] for row in rows), max(row[2] for row in rows)],
        "clearance": list(JOINT_CLEARANCE_RANGE_MM),
        "silicones": list(silicones()),
        "robots": [[name, robot_words(name)] for name in robot_sides()],
        "options": PATTERN_DEFAULTS,
        "printers": [[each.name, f"{each.title}, {each.size}"] for each in printers().values()],
        "start": {
            "D": "130",
            "T": "8",
            "joint_clearance": f"{JOINT_CLEARANCE_MM:g}",
            "printer": DEFAULT_PRINTER,
            "robot": DEFAULT_ROBOT,
        },
    }


def _late(variant: Variant) -> list[tuple[str, str]]:
    words = short_pot_life_words(variant.layout)
    return [] if words is None else [("no time to cast", words)]


def _dots_words(params: EndcapParams) -> str:
    few = "" if few_dots_words(params) is None else ": too few to calibrate it"
    return f"{len(dot_pattern(params))}, the camera's picture shows {seen_dots(params)} of them{few}"


def _section(layout: MoldLayout) -> list[dict[str, Any]]:
    """Profiles of the endcap, for the section."""
    return [
        {
            "name": part.name,
            "color": [round(c, 3) for c in part.color],
            "profiles": [[[round(x, 2), round(z, 2)] for x, z in profile] for profile in part.profiles],
        }
        for part in parts(layout)
        if part.group == "endcap"
    ]
