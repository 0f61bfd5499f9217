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
from cad.mold_layout import MoldLayout
from fab.checks.check import Check
from fab.checks.screw_fit import ScrewFit, fitted
from fab.recipe import RELEASE_AGENT, Recipe

BOUGHT = {  # manifest's bought parts: what to ask for, price
    "camera": ("USB camera ELP-USBFHD01M, OV2710, 180 degree fisheye (P)", 45.0),
    "led_ring": ("LED ring board, nine JB3030AWT and TPS61165 (P; made from its own files)", 12.0),
}
SCREW_USD = {"screw_m2": 0.05, "screw_m3": 0.06, "screw_m4": 0.10}
SILICONE_USD_KG = 40.0  # E: Smooth-Sil 950, small kit


def all_joints(layout: MoldLayout) -> tuple[ScrewJoint, ...]:
    """Every screw joint of endcap and mold, as the parts return them."""
    from cad import arm_adapter, base, hanger, mold_cup

    params = layout.params
    return (
        *base.screw_joints(params),
        *arm_adapter.screw_joints(params),
        *hanger.screw_joints(layout),
        *mold_cup.screw_joints(layout),
    )


def fit_joints(layout: MoldLayout, meshes: Mapping[str, trimesh.Trimesh]) -> list[ScrewFit]:
    """Choose and measure the screws of every joint."""
    return [fitted(joint, meshes) for joint in all_joints(layout)]


def bom_lines(
    manifest: Mapping[str, Any], fits: Sequence[ScrewFit], recipe: Recipe, sliced: Mapping[str, Any] | None
) -> list[BomLine]:
    """All lines: made parts, bought parts, screws and nuts, silicone, small things.

    Args:
        manifest: of the export.
        fits: every joint with its chosen screw.
        recipe: of the cast.
        sliced: ``slice.json``, for grams and cost of the printed parts; ``None`` if it was not made.
    """
    prints = {project["name"]: project for project in sliced["projects"]} if sliced else {}
    lines = []
    for part in manifest["parts"]:
        name, quantity = part["name"], part["quantity"]
        if part["role"] == "printed":
            project = prints.get("interface_infill" if name == "interface" else name)
            use = f"print, {project['grams']:.0f} g" if project else "print"
            cost = quantity * project["cost_usd"] if project else None
            lines.append(BomLine(f"{name} ({part['material']})", quantity, "pc", name, use, cost))
        elif part["role"] == "bought":
            item, price = BOUGHT.get(name, (name, None))
            lines.append(BomLine(item, quantity, "pc", name, "buy", price, "P"))
        else:
            grams = recipe.part_a_g + recipe.part_b_g
            price = grams / 1000 * SILICONE_USD_KG
            item = f"{recipe.silicone.name} ({recipe.part_a_g:.1f} g A, {recipe.part_b_g:.1f} g B)"
            lines.append(BomLine(item, round(grams, 1), "g", name, "cast", price))
    return [*lines, *_fastener_lines(fits), *_small_lines()]


def bom_checks(
    manifest: Mapping[str, Any], joints: Sequence[ScrewJoint], fits: Sequence[ScrewFit], lines: Sequence[BomLine]
) -> list[Check]:
    """Gates: every screw clamps; every part and every screw of the assembly has its line."""
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
    table.writerow(["item", "quantity", "unit", "owner", "use", "price_usd", "provenance"])
    for line in lines:
        price = "" if line.price_usd is None else f"{line.price_usd:.2f}"
        table.writerow([line.item, f"{line.quantity:g}", line.unit, line.owner, line.use, price, line.provenance])
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
        uses = ", ".join(sorted({_use(fit.joint) for fit in members}))
        price = count * SCREW_USD[members[0].joint.thread]
        lines.append(BomLine(f"{name} {standard}", count, "pc", "screws", uses, price, "S"))
    captured = max((len(f.joint.places) for f in fits if f.joint.holder == "captured nut"), default=0)
    loose = [f for f in fits if f.joint.holder == "loose nut"]
    count = sum(len(f.joint.places) for f in loose)
    lines.append(
        BomLine("M3 square nut DIN 562", captured, "pc", "nuts", "captured in the interface", 0.05 * captured, "S")
    )
    lines.append(BomLine("M4 hexagon nut ISO 4032", count, "pc", "nuts", "closes the mold", 0.05 * count, "S"))
    small = sum(f.joint.washers * len(f.joint.places) for f in fits if f.joint.holder == "captured nut")
    if small:
        lines.append(
            BomLine("M3 washer ISO 7092 (small)", small, "pc", "washers", "base to interface", 0.02 * small, "S")
        )
    washers = sum(2 * f.joint.washers * len(f.joint.places) for f in loose)
    lines.append(BomLine("M4 washer ISO 7089", washers, "pc", "washers", "closes the mold", 0.02 * washers, "S"))
    return lines


def _use(joint: ScrewJoint) -> str:
    return joint.name.replace("_", " ").rstrip("0123456789 ") if joint.owner == "hanger" else f"{joint.owner}"


def _small_lines() -> list[BomLine]:
    return [
        BomLine("M4 threaded insert, 5.6 mm hole, at most 8.1 mm long", 5, "pc", "base", "robot arm", 1.5, "M"),
        BomLine(RELEASE_AGENT, 1, "set", "casting", "all PLA that touches silicone, never the TPU", 20.0, "P"),
        BomLine("permanent marker, black", 1, "pc", "painting", "dots", 2.0, "P"),
        BomLine("cyanoacrylate glue, two drops", 1, "set", "ring_spacer", "spacer to base, ring to spacer", 2.0),
        BomLine("mixing cup of five times the volume, stick, gloves", 1, "set", "casting", "mixing and degassing", 2.0),
    ]
