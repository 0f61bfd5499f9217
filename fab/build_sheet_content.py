"""The words and tables of the build sheet. Every number comes from parameters, manifest, slices, recipe or screws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cad.dots import DENT_DEPTH_MM, DOT_RADIUS_MM, dot_pattern, ring_count
from cad.fasteners import BomLine
from cad.interface import POCKET_FLOOR_MM
from cad.mold_layout import MoldLayout
from fab.bom import screw_name
from fab.build_sheet_blocks import Block, Document, Heading, Paragraph, Picture, Step, Table
from fab.build_sheet_dots import DISC_PX, FRAME_PX, SQUARE_PX, camera_pixels, dots_in, first_light, gores, ruler
from fab.recipe import RELEASE_AGENT, Recipe
from fab.screw_fit import ScrewFit
from fab.slice_result import hours, is_mold

PAPER_MOLD_USD = 8.50  # P


@dataclass(frozen=True)
class SheetData:
    """Everything that a sheet prints.

    Attributes:
        layout: sizes.
        manifest: of the export.
        sliced: ``slice.json``, or ``None``.
        recipe: of the cast.
        fits: screws.
        lines: bill of materials.
        checks: gates of manifest, slices and sheet, as records ``name, value, limit, ok``.
        fill_depth_mm: how far below the bowl's seam the poured silicone stands.
        pictures: step pictures by name, ``thumb_<part>`` of parts, ``cover`` and ``section``.
    """

    layout: MoldLayout
    manifest: Mapping[str, Any]
    sliced: Mapping[str, Any] | None
    recipe: Recipe
    fits: Sequence[ScrewFit]
    lines: Sequence[BomLine]
    checks: Sequence[Mapping[str, Any]]
    fill_depth_mm: float
    pictures: Mapping[str, Path]


def build_document(data: SheetData) -> Document:
    """The whole sheet."""
    params = data.layout.params
    blocks = [
        *_cover(data),
        *_bill(data),
        *_prints(data),
        *_recipe(data),
        *_casting(data),
        *_demolding(data),
        *_painting(data),
        *_assembling(data),
        *_first_light(data),
        *_gates(data),
    ]
    subtitle = f"digest of the parameters {params.digest[:12]}; lengths in mm unless marked"
    return Document(f"Endcap D = {params.diameter_mm:g}, T = {params.wall_mm:g} mm", subtitle, tuple(blocks))


def _cover(data: SheetData) -> list[Block]:
    params, recipe = data.layout.params, data.recipe
    facts = [
        ("silicone dome", f"{params.diameter_mm:g} outside, wall {params.wall_mm:g}, {params.tip_height_mm:.1f} high"),
        ("dots", f"{len(dot_pattern(params))} dents of {2 * DOT_RADIUS_MM:g} diameter, {DENT_DEPTH_MM:g} deep"),
        ("silicone", f"{recipe.silicone.name}: {recipe.part_a_g:.1f} g A + {recipe.part_b_g:.1f} g B"),
        ("cast weighs", f"{recipe.expected_g:.0f} g of silicone"),
        ("gates", f"{len(data.checks)}, all held" if all(c["ok"] for c in data.checks) else "NOT ALL HELD"),
    ]
    if mold := _mold_sums(data):
        facts.append(
            ("mold", f"{mold[0]}, {mold[1]:.0f} g of PLA, {mold[2]:.2f} USD (the paper: about {PAPER_MOLD_USD:.2f})")
        )
    total = sum(line.price_usd or 0.0 for line in data.lines)
    facts.append(("everything", f"about {total:.0f} USD, small things bought whole"))
    return [
        Picture(data.pictures["cover"], "what you will build"),
        Table(("", ""), tuple(facts), (1, 4)),
        Paragraph(
            "Read once to the end before you mix: from the first drop of B the clock runs. The order is print, "
            "buy, cast, "
            "demold, paint, assemble, test."
        ),
    ]


def _bill(data: SheetData) -> list[Block]:
    rows = []
    for line in data.lines:
        picture: str | Path = data.pictures.get(f"thumb_{line.owner}", "")
        quantity = f"{line.quantity:g} {line.unit}"
        price = "" if line.price_usd is None else f"{line.price_usd:.2f}"
        shown = picture if line.unit != "set" and "insert" not in line.item else ""
        rows.append((shown, line.item, quantity, line.use, price))
    return [
        Heading("What you need", 1),
        Paragraph("The same lines are in bom.csv. Prices are estimates in US dollars, spools and kits by their share."),
        Table(("", "item", "quantity", "for", "USD"), tuple(rows), (1.1, 3.4, 1, 2.8, 0.8)),
    ]


def _prints(data: SheetData) -> list[Block]:
    blocks: list[Block] = [Heading("Print", 1)]
    if data.sliced is None:
        return [*blocks, Paragraph("Not sliced yet: run make slice with the same numbers, then make sheet again.")]
    rows = []
    for project in data.sliced["projects"]:
        s = project["settings"]
        fill = f"{s['walls']} walls, {s['density_percent']:g} % {s['pattern']}"
        for volume, own in project["own_settings"].items():
            fill += f"; {volume}: {own['density_percent']:g} % {own['pattern']}, no walls, no top, no bottom, anchors 0"
        extra = ", ".join(
            word
            for word in (
                f"brim {s['brim_mm']:g}" if s["brim_mm"] else "",
                "support from the bed" if s["support"] else "",
                f"outlines +{s['grow_mm']:.3f}" if s["grow_mm"] else "",
            )
            if word
        )
        rows.append(
            (project["name"], project["material"], fill, extra, hours(project["time_s"]), f"{project['grams']:.1f}")
        )
    zones = [p for p in data.sliced["projects"] if p["zone"]]
    return [
        *blocks,
        Paragraph(
            f"Open <part>.prusa.3mf in PrusaSlicer or <part>.orca.3mf in OrcaSlicer or Bambu Studio: pose and "
            f"settings are "
            f"inside. Layers {data.sliced['projects'][0]['settings']['layer_mm']:g}, nozzle 0.4. Times and grams were "
            f"measured on the G-code of {data.sliced['slicer']}."
        ),
        Paragraph(
            "Print ONE interface: interface_infill (the slicer makes the gyroid; quick, small) unless you want "
            "the very "
            "gyroid of the CAD files: interface_gyroid."
        ),
        Table(("project", "material", "filling", "also", "time", "g"), tuple(rows), (2, 1.1, 2.4, 2.2, 1, 0.7)),
        *(
            Paragraph(
                f"{zone['name']}: {100 * zone['zone']['fraction']:.2f} % of the zone is printed (wanted 10), "
                f"{100 * zone['zone']['open_share']:.1f} % of its boundary is open for the silicone."
            )
            for zone in zones
        ),
        Paragraph(
            "Before you go on: rub the cup's inside and the core's outside with a fingernail; a blob there "
            "becomes a pit in "
            "the dome. The interface's infill must be open at its sides: hold it against a lamp."
        ),
    ]


def _recipe(data: SheetData) -> list[Block]:
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
    clock = tuple((f"{step.start_min:g} to {step.end_min:g} min", step.what) for step in recipe.timeline)
    left = silicone.pot_life_min - recipe.timeline[-1].end_min
    return [
        Heading("Silicone", 1),
        Table(("", ""), rows, (1, 3)),
        Heading("Clock, from the moment A and B meet"),
        Table(
            ("when", "what"),
            (*clock, (f"{recipe.timeline[-1].end_min:g} min", f"closed; {left:g} min to spare")),
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


def _screw(data: SheetData, prefix: str) -> str:
    fits = [fit for fit in data.fits if fit.joint.name.startswith(prefix)]
    return f"{sum(len(fit.joint.places) for fit in fits)} x {screw_name(fits[0])}"


def _steps(data: SheetData, letter: str, steps: Sequence[tuple[str, tuple[str, ...], str | None]]) -> list[Block]:
    return [
        Step(f"{letter}{number}", title, lines, data.pictures[picture] if picture else None)
        for number, (title, lines, picture) in enumerate(steps, 1)
    ]


def _casting(data: SheetData) -> list[Block]:
    layout, recipe = data.layout, data.recipe
    return [
        Heading("Cast", 1),
        *_steps(
            data,
            "C",
            [
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
                        "Hanger on the table, pins up. Interface on it, gyroid up, nuts over the inner circle "
                        "of holes.",
                        f"{_screw(data, 'hanger_to_interface')} from below, hand-tight: TPU gives way.",
                    ),
                    "interface_on_hanger",
                ),
                *_core_to_hanger(data),
                (
                    "Set the collar round it",
                    (
                        "Release agent first. Slide the three segments into one another along their jigsaw tabs.",
                        "Lower them onto the hanger: its three pins fix where they go.",
                        f"{_screw(data, 'hanger_to_cup')} from below.",
                    ),
                    "collar",
                ),
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
                (
                    "Lower the upper half",
                    (
                        "Turn the upper half over, core down. Lower it upright and slowly: the silicone climbs "
                        "into the gyroid.",
                        f"Last {layout.seam_height_mm - layout.dam_top_mm:.0f} mm: the collar slides into the "
                        f"bowl's dam.",
                    ),
                    "close",
                ),
                (
                    "Close, and look at the wells",
                    (
                        f"{_screw(data, 'cup_collar')} with a washer at either end, crosswise, until the piston seats.",
                        "All ten wells on the hanger show silicone: the mold is full. A dry well: press, wait, tap.",
                        f"Leave it for {recipe.silicone.cure_h:g} h at room temperature.",
                    ),
                    "closed",
                ),
            ],
        ),
    ]


def _core_first(data: SheetData) -> list[tuple[str, tuple[str, ...], str]]:
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


def _core_to_hanger(data: SheetData) -> list[tuple[str, tuple[str, ...], str]]:
    """The step that brings the core to the hanger; where it is inside the interface already, its screws alone."""
    screws = f"{_screw(data, 'hanger_to_core')} from below into the core."
    if not lowers(data.layout):
        return [
            ("Screw the core to the hanger", (f"Keys at the azimuths of the hanger's pins. {screws}",), "core_held")
        ]
    lines = (
        "Neck first, through the gyroid ring onto the hanger; keys at the azimuths of the hanger's pins.",
        f"{screws} Take the rubber band off.",
    )
    return [("Lower the core into the interface", lines, "core_on_hanger")]


def lowers(layout: MoldLayout) -> bool:
    """Whether the whole core passes the gyroid ring from the dome's side: below its equator it narrows all the way."""
    return layout.params.interlock_top_mm <= layout.params.centre_height_mm


def _demolding(data: SheetData) -> list[Block]:
    return [
        Heading("Demold", 1),
        *_steps(
            data,
            "D",
            [
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
            ],
        ),
    ]


def _painting(data: SheetData) -> list[Block]:
    params = data.layout.params
    dots = dot_pattern(params)
    pixels = camera_pixels(params)
    rings = sorted({dot.ring for dot in dots})
    inside = {
        ring: dots_in([p for p, dot in zip(pixels, dots, strict=True) if dot.ring == ring], SQUARE_PX, SQUARE_PX)
        for ring in rings
    }
    rows = tuple(
        (
            str(ring),
            str(ring_count(ring)),
            f"{next(d.polar_deg for d in dots if d.ring == ring):.1f}°",
            str(inside[ring]),
        )
        for ring in rings
    )
    return [
        Heading("Paint the dots", 1),
        *_steps(data, "P", [
            ("Fill every dent with ink",
             ("Wipe the inside with alcohol. Touch each dent with the marker, from the tip outward, ring by ring.",
              f"Paint all {len(dots)}: {sum(inside.values())} of them lie in the camera's centre square.",
              "The dots at azimuth 0 of all rings form one line: begin there."), "dots"),
        ]),
        Table(("ring", "dots", "angle from the tip", "in the centre square"), rows, (1, 1, 2, 2)),
        Heading("Gores, 1:1"),
        Paragraph("Print this page at 100 % and measure:"),
        ruler(),
        Paragraph("Cut out, lay into the dome from the tip: every dot meets its dent. Numbers are rings."),
        *gores(params),
    ]  # fmt: skip


def _assembling(data: SheetData) -> list[Block]:
    return [
        Heading("Assemble", 1),
        *_steps(data, "A", [
            ("Camera into the base",
             ("Cable through the slot first. Board into its pocket, lens up.",
              f"{_screw(data, 'camera_to_base')} into the plastic; stop when they bear."), "camera"),
            ("Spacer and LED ring",
             ("A drop of glue at two places of the recess, spacer in, notch over the cable's side.",
              "Ring on the spacer, plug in the notch; its wires leave beside the camera's."), "ring"),
            ("Base to endcap",
             ("Base under the interface; the ring goes through the bore. Turn until the holes meet the nuts.",
              f"{_screw(data, 'base_to_interface')} from below, crosswise, until the heads bear.",
              "Other silicones and walls of the same D fit the same base."), "base"),
        ]),
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


def _first_light(data: SheetData) -> list[Block]:
    pixels = camera_pixels(data.layout.params)
    frame, square = dots_in(pixels, *FRAME_PX), dots_in(pixels, SQUARE_PX, SQUARE_PX)
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
                ("disc of the shell", f"centre within 10 px of the frame's, radius about {DISC_PX:g} px",
                 "camera not flat on its four pads, or another lens"),
                ("dots in the whole frame", f"about {frame} by an equidistant lens; the released sensor: 92",
                 "ink missing, or lamps too dark"),
                ("dots in the centre square", f"about {square} by the same; the released sensor: 75 to 80",
                 "camera not centred"),
                ("brightness", "no white patches; the darkest dot still darker than its ground", "exposure "
                "fixed by hand"),
                ("dots of the common meridian", "one straight line to the right", "turn the picture, not the camera"),
            ),
            (1.4, 2.2, 2),
        ),
        Paragraph(
            "Then save the frame as a.jpg and run: python -m sensing.calibrate --photo a.jpg --out camera.json "
            "--picture "
            "fit.png. Its fit shows the same dots with circles on them."
        ),
    ]  # fmt: skip


def _gates(data: SheetData) -> list[Block]:
    rows = tuple((c["name"], f"{c['value']:.6g}", c["limit"], "held" if c["ok"] else "FAILED") for c in data.checks)
    return [
        Heading("Every gate", 1),
        Paragraph("From manifest.json, slice.json and this sheet's own checks. Nothing is written when one fails."),
        Table(("gate", "value", "limit", ""), rows, (4, 1.4, 1.6, 0.6), is_small=True),
    ]


def _mold_sums(data: SheetData) -> tuple[str, float, float] | None:
    if data.sliced is None:
        return None
    mold = [p for p in data.sliced["projects"] if is_mold(p["name"])]
    return (
        hours(sum(p["time_s"] for p in mold)) + " of printing",
        sum(p["grams"] for p in mold),
        sum(p["cost_usd"] for p in mold),
    )
