"""The bill of materials, from the parts themselves: each part returns its joints, the manifest its printed and bought
parts, the recipe its silicone. Prices in US dollars are estimates (E) for small quantities.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

import trimesh

from cad.fasteners import BomLine, ScrewJoint
from cad.mold.layout import MoldLayout
from cad.robot_sides import DEFAULT_ROBOT, ream_words, robot_side, robot_words
from fab.checks.check import Check
from fab.checks.screw_fit import ScrewFit, fitted
from fab.part_words import joint_words, part_words
from fab.recipe import Recipe
from fab.supplies import bag_size, camera_supply, silicone_line, supply_lines

SCREW_USD = {"screw_m2": 0.05, "screw_m3": 0.06, "screw_m4": 0.10}
ROBOT_SCREW_USD = 0.4  # E: a screw or a pin, bought singly
RING_USD, RING_BATCH = 12.0, 5  # E: a fitted board; so many at the least are made by a board house
NUT_USD, WASHER_USD = 0.05, 0.02  # E
STEEL = "A2 or 8.8"  # what to ask for besides standard and size
BAG_OWNERS = ("screws", "nuts", "washers", "robot")  # of the lines that are ordered by the bag
MOLD_USE = "closes the mold"  # of nuts and washers that stay with the mold


def all_joints(layout: MoldLayout) -> tuple[ScrewJoint, ...]:
    """Every screw joint of endcap and mold, as the parts return them."""
    from cad import arm_adapter, base, hanger
    from cad.mold import cup

    params = layout.params
    return (
        *base.screw_joints(params),
        *arm_adapter.screw_joints(params),
        *hanger.screw_joints(layout),
        *cup.screw_joints(layout),
    )


def fit_joints(layout: MoldLayout, meshes: Mapping[str, trimesh.Trimesh]) -> list[ScrewFit]:
    """Choose and measure the screws of every joint."""
    return [fitted(joint, meshes) for joint in all_joints(layout)]


def bom_lines(
    layout: MoldLayout,
    manifest: Mapping[str, Any],
    fits: Sequence[ScrewFit],
    recipe: Recipe,
    sliced: Mapping[str, Any] | None,
) -> list[BomLine]:
    """All lines: made parts, bought parts, screws and nuts, silicone, small things.

    Args:
        layout: mold sizes.
        manifest: of the export.
        fits: every joint with its chosen screw.
        recipe: of the cast.
        sliced: ``slice.json``, for grams and cost of the printed parts; ``None`` if it was not made.
    """
    prints = printed_figures(sliced)
    lines = []
    for part in manifest["parts"]:
        name, quantity = part["name"], part["quantity"]
        if part["role"] == "printed":
            found = prints.get(name)
            use = part_words(name) + (f"; {found[0]:.0f} g" if found else "")
            cost = quantity * found[1] if found else None
            order = f"spool of {part['material']}, 1.75 mm"
            item = f"{name} ({part['material']})"
            lines.append(BomLine(item, quantity, "pc", name, use, cost, "E", order, "made", 0.0))  # the spool is paid
        elif part["role"] == "bought":
            lines.append(_bought_line(name, quantity))
        else:
            lines.append(silicone_line(recipe))
    robot = str(manifest.get("robot", DEFAULT_ROBOT))
    return [*lines, *_fastener_lines(fits), *_robot_lines(robot), *supply_lines(recipe, layout, robot)]


def printed_figures(sliced: Mapping[str, Any] | None) -> dict[str, tuple[float, float]]:
    """Grams and US dollars of every printed part, by its name; the interface as the slicer's infill makes it."""
    figures = {}
    for project in sliced["projects"] if sliced else ():
        for piece in project["pieces"]:
            if project["name"] != "interface_gyroid":
                name = "interface" if project["name"] == "interface_infill" else piece["name"]
                figures[name] = (piece["grams"], piece["cost_usd"])
    return figures


def _bought_line(name: str, quantity: int) -> BomLine:
    """Camera or ring."""
    if name == "camera":
        camera = camera_supply()
        return BomLine(
            "USB camera", quantity, "pc", name, part_words(name), camera.price_usd, camera.letter, camera.order_as
        )
    if name == "led_ring":
        order = (
            f"files of make ring to a board house (batch of {RING_BATCH}), or the table in chapter LED ring to solder "
            "it yourself"
        )
        pack = max(RING_BATCH, quantity) * RING_USD
        return BomLine(
            "LED ring board", quantity, "pc", name, part_words(name), quantity * RING_USD, "P", order, pack_usd=pack
        )
    return BomLine(name, quantity, "pc", name, part_words(name))


def bom_checks(
    manifest: Mapping[str, Any], joints: Sequence[ScrewJoint], fits: Sequence[ScrewFit], lines: Sequence[BomLine]
) -> list[Check]:
    """Gates: every screw clamps; every part and every screw of the assembly has its line.

    Args:
        manifest: manifest of the export; its ``parts`` are read.
        joints: screw joints of the assembly.
        fits: how the screw of each joint fits.
        lines: the bill of materials.
    """
    owners = {line.owner for line in lines}
    missing = [part["name"] for part in manifest["parts"] if part["name"] not in owners]
    screws = sum(line.quantity for line in lines if line.owner == "screws")
    nuts = sum(line.quantity for line in lines if line.owner == "nuts")
    wanted = sum(len(joint.places) for joint in joints)
    with_nut = ("captured nut", "loose nut")
    held = sum(len(joint.places) for joint in joints if joint.holder in with_nut and joint.owner != "hanger")
    return [
        *(check for fit in fits for check in fit.checks),
        Check("bom.parts_without_line", len(missing), high=0),
        Check("bom.screws_short", wanted - screws, high=0),
        Check("bom.nuts_short", held - nuts, high=0),
    ]


def bom_csv(lines: Sequence[BomLine]) -> str:
    """The bill as CSV."""
    stream = io.StringIO()
    table = csv.writer(stream, lineterminator="\n")
    first = ["item", "order_as", "quantity", "unit", "kind", "owner", "use"]
    table.writerow([*first, "price_usd", "paid_usd", "provenance"])
    for line in lines:
        words = [line.item, line.order_as, f"{line.quantity:g}", line.unit, line.kind, line.owner, line.use]
        prices = ["" if usd is None else f"{usd:.2f}" for usd in (line.price_usd, line.paid_usd)]
        table.writerow([*words, *prices, line.provenance])
    return stream.getvalue()


def screw_name(fit: ScrewFit) -> str:
    """For example ``M3 x 12``."""
    return f"{fit.joint.thread.removeprefix('screw_').upper()} x {fit.length_mm:g}"


def _fastener_lines(fits: Sequence[ScrewFit]) -> list[BomLine]:
    """Equal screws are one line. Hanger and base use the same nuts one after the other, so these count once."""
    groups: dict[tuple[str, str], list[ScrewFit]] = {}
    for fit in fits:
        groups.setdefault((screw_name(fit), fit.joint.standard), []).append(fit)
    lines = []
    for (name, standard), members in sorted(groups.items()):
        count = sum(len(fit.joint.places) for fit in members)
        uses = ", ".join(sorted({joint_words(fit.joint.name) for fit in members}))
        each = SCREW_USD[members[0].joint.thread]
        lines.append(_fastener(f"{name} {standard}", count, "screws", uses, each, _order(name, standard)))
    captured = max((len(f.joint.places) for f in fits if f.joint.holder == "captured nut"), default=0)
    loose = [f for f in fits if f.joint.holder == "loose nut"]
    count = sum(len(f.joint.places) for f in loose)
    square = "DIN 562 M3, zinc-plated or A2"
    lines.append(_fastener("M3 square nut DIN 562", captured, "nuts", "captured in the interface", NUT_USD, square))
    order = f"ISO 4032 M4, {STEEL}"
    lines.append(_fastener("M4 hexagon nut ISO 4032", count, "nuts", MOLD_USE, NUT_USD, order))
    small = sum(f.joint.washers * len(f.joint.places) for f in fits if f.joint.holder == "captured nut")
    if small:
        order = "ISO 7092 M3 (6 mm outside, 0.5 mm)"
        lines.append(_fastener("M3 washer ISO 7092 (small)", small, "washers", "base to interface", WASHER_USD, order))
    count = sum(2 * f.joint.washers * len(f.joint.places) for f in loose)
    order = "ISO 7089 M4 (9 mm outside)"
    lines.append(_fastener("M4 washer ISO 7089", count, "washers", MOLD_USE, WASHER_USD, order))
    return lines


def _robot_lines(robot: str) -> list[BomLine]:
    """What holds the adapter on the robot, and the reamer that a tight pin asks for; nothing for a blank side."""
    lines = [
        _fastener(
            f"{holes.element} {holes.order_as}", holes.count, "robot", f"arm adapter to {robot_words(robot)}",
            ROBOT_SCREW_USD, holes.order_as, "E",
        )
        for holes in robot_side(robot)
    ]  # fmt: skip
    if size := ream_words(robot):
        use, order = "hole of the arm adapter's pin", f"{size}, turned by hand"
        lines.append(BomLine("reamer", 1, "pc", "reamer", use, None, "S", order, "tool"))
    return lines


def _fastener(
    item: str, count: int, owner: str, use: str, each_usd: float, order: str, provenance: str = "S"
) -> BomLine:
    """So many out of the smallest bag that holds them, which is bought whole."""
    size = bag_size(count)
    return BomLine(
        item, count, "pc", owner, use, count * each_usd, provenance, f"{order}, bag of {size}", pack_usd=size * each_usd
    )


def _order(name: str, standard: str) -> str:
    """What to ask for: ``ISO 4762 M3 x 16, A2 or 8.8``; for plastic, thread and length of a thread-forming screw."""
    if standard.startswith("ISO"):
        return f"{' '.join(standard.split()[:2])} {name}, {STEEL}"
    thread, length = name.split(" x ")
    return f"thread-forming pan-head screw for plastic {thread.replace('M', '')} x {length} (EJOT PT or equivalent)"
