"""Steps of the mold: its two halves put together, the cast, and the way back to the endcap.

The collar comes first at every size: its bore passes neither the interface nor the core. Where the gyroid ring lets the
core through from the dome's side, its pieces are lowered one by one; where it closes in over the core's equator (small
D), they go into the interface through the bore, as they will come out. Sweeps prove either order on every export.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from cad.interface import POCKET_FLOOR_MM, zone_radii_mm
from cad.mold_core import REMOVAL_ORDER
from cad.mold_layout import MoldLayout
from fab.checks.extraction import Leg
from fab.steps.record import Move, Step, one_by_one

Ways = Mapping[str, tuple[Leg, ...]]  # way out of every core piece
CORE = REMOVAL_ORDER
CENTRE, KEYS, WEDGES = CORE[:1], CORE[1:4], CORE[4:]
BOWL = tuple(f"cup_bowl_{k}" for k in (1, 2, 3))
COLLAR = tuple(f"cup_collar_{k}" for k in (1, 2, 3))
UPPER = ("hanger", *COLLAR, "interface", *CORE)
HAND_MM = 0.2  # E: room between a bump and the gyroid for lowering by hand
TO_DOME, TO_RIM = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
AGENT = "Release agent on every PLA face that will touch silicone, seams too; let it dry as its label says."


def core_passes_gyroid(layout: MoldLayout) -> bool:
    """Whether the core, bumps included, passes the gyroid ring from the dome's side.

    Below the equator the ring is wider than the core at every height. Above it the ring narrows to its top, where its
    inner radius must still exceed the core's equator and a bump.
    """
    params = layout.params
    above = params.interlock_top_mm - params.centre_height_mm
    if above <= 0:
        return True
    inner = zone_radii_mm(params)[0]
    return math.sqrt(max(0.0, inner**2 - above**2)) >= params.inner_radius_mm + params.dent_depth_mm + HAND_MM


def mold_steps(layout: MoldLayout, ways: Ways) -> tuple[Step, ...]:
    """All steps from the printed parts to the demolded endcap, in order.

    Args:
        layout: mold sizes.
        ways: way out of every core piece (:func:`fab.checks.extraction.core_path`).
    """
    return (*_upper_half(layout, ways), *_lower_half(layout), *_cast(layout), *_demold(layout, ways))


def _upper_half(layout: MoldLayout, ways: Ways) -> tuple[Step, ...]:
    out = (Leg(TO_DOME, layout.params.tip_height_mm + 10.0),)
    nuts = Step(
        "nuts",
        "upper half",
        "Push the ten square nuts into the interface",
        (
            "From the bore outward, flat side down, until each snaps over its rib.",
            f"They lie on {POCKET_FLOOR_MM:g} mm of TPU. Weigh the interface now.",
        ),
        look="from above",
        shown=("interface",),
        extras=("nuts",),
    )
    collar = Step(
        "collar",
        "upper half",
        "Set the collar on the hanger",
        (
            f"{AGENT} Hanger on the table, pins up.",
            "Lower the three segments onto it one after the other, each along the jigsaw tabs of the one before; the "
            "hanger's three pins fix where they go.",
            "{screws:hanger_to_cup} from below. They cut their own thread in the PLA: slowly, half a turn back for "
            "each turn in; stop when the heads bear. Interface and core come after: they do not pass the bore.",
        ),
        one_by_one(COLLAR, out, ("hanger",), True),
        screws=("hanger_to_cup",),
    )
    if core_passes_gyroid(layout):
        return (nuts, collar, *_core_lowered(out))
    return (nuts, collar, *_core_in_interface(out, ways))


def _core_lowered(out: tuple[Leg, ...]) -> tuple[Step, ...]:
    held = ("hanger", *COLLAR)
    return (
        Step(
            "interface_on_hanger",
            "upper half",
            "Lower the interface into the collar",
            (
                "Gyroid up, nuts over the inner circle of holes.",
                "{screws:hanger_to_interface} from below, hand-tight: TPU gives way.",
            ),
            (Move(("interface",), out, held),),
            screws=("hanger_to_interface",),
        ),
        Step(
            "core_on_hanger",
            "upper half",
            "Lower the core into the interface, piece by piece",
            (
                f"{AGENT} Neck first, straight down through the gyroid ring onto the hanger.",
                "First the centre, its tabs toward the hanger's pins; then the three wedges against its short sides; "
                "then the three keys, between the wedges and over the tabs.",
                "{screws:hanger_to_core} from below, each piece before the next; they cut their own thread, too.",
            ),
            one_by_one((*CENTRE, *WEDGES, *KEYS), out, (*held, "interface"), True),
            screws=("hanger_to_core",),
            drawn_mm=110.0,
        ),
    )


def _core_in_interface(out: tuple[Leg, ...], ways: Ways) -> tuple[Step, ...]:
    held = ("hanger", *COLLAR)
    return (
        Step(
            "core_inside",
            "upper half",
            "Put the core together inside the interface",
            (
                f"{AGENT} At this size the gyroid closes in over the core's equator: the pieces go in through the "
                "bore, as they will come out, last piece first.",
                "Interface on a soft ring, bore up. Wedges in and outward, keys in between, the centre straight down.",
            ),
            one_by_one(tuple(reversed(CORE)), dict(ways), ("interface",), True),
            look="dome down",
            cut=("interface",),
            drawn_mm=110.0,
        ),
        Step(
            "upper_unit",
            "upper half",
            "Bring hanger and collar onto it",
            (
                "Turn the hanger with its collar over and lower it straight onto interface and core, keys at the "
                "azimuths of the hanger's pins.",
                "{screws:hanger_to_core} into the core and {screws:hanger_to_interface} into the interface's nuts, "
                "hand-tight: TPU gives way.",
            ),
            (Move(("interface", *CORE), out, held),),
            screws=("hanger_to_core", "hanger_to_interface"),
        ),
    )


def _lower_half(layout: MoldLayout) -> tuple[Step, ...]:
    out = (Leg(TO_RIM, layout.stand_height_mm),)
    return (
        Step(
            "bowl",
            "bowl",
            "Put the bowl together",
            (
                f"{AGENT} Stand the first segment on its foot, on a level table; slide the others down its tabs, one "
                "after the other.",
                "A rubber band round the outside holds it; then tape along each seam and twice round keeps it tight.",
                "Lay a spirit level across the dam both ways: the silicone's surface is level, the mold must be, too.",
            ),
            one_by_one(BOWL, out, (), True),
            look="dome down",
        ),
    )


def _cast(layout: MoldLayout) -> tuple[Step, ...]:
    return (*_poured(), *_closed(layout))


def _poured() -> tuple[Step, ...]:
    return (
        Step(
            "mix",
            "cast",
            "Weigh, mix, degas",
            (
                "{part_a_g} g A and {part_b_g} g B into one cup. The clock runs.",
                "Mix until no streak is left; degas until the foam has risen and fallen.",
            ),
        ),
        Step(
            "pour",
            "cast",
            "Pour",
            (
                "A thin stream onto one spot of the bowl; the silicone finds its level.",
                "Pour {poured_g} g, the cup's loss on the scale: it stands {fill_depth_mm} mm below the seam, not over "
                "it. The rest stays in the cup.",
            ),
            look="dome down",
            shown=BOWL,
            extras=("silicone",),
        ),
    )


def _closed(layout: MoldLayout) -> tuple[Step, ...]:
    stroke = layout.seam_height_mm - layout.dam_top_mm
    return (
        Step(
            "close",
            "cast",
            "Lower the upper half",
            (
                "Turn the upper half over, core down. Lower it upright, slowly: the silicone climbs into the gyroid.",
                f"Last {stroke:.0f} mm: the collar slides into the bowl's dam.",
            ),
            (Move(UPPER, (Leg(TO_RIM, layout.stand_height_mm),), BOWL),),
            look="dome down, from the side",
            drawn_mm=0.8 * layout.params.tip_height_mm,
        ),
        Step(
            "closed",
            "cast",
            "Close, and look at the wells",
            (
                "{screws:cup_collar} with a washer at either end, crosswise, until the piston seats.",
                "Lift one side by a finger's breadth and walk it round once, so that every vent is the highest for a "
                "while: air under the flat flange runs along it to that vent.",
                "All wells on the hanger show silicone: the mold is full; they hold the {overflow_ml} ml beyond it. A "
                "dry well: press, wait, tap.",
                "Leave it for {cure_h} h at room temperature.",
            ),
            screws=("cup_collar",),
            look="dome down, from the side",
            shown=(*BOWL, *UPPER, "shell"),
            cut=(*BOWL, *UPPER, "shell"),
        ),
    )


def _demold(layout: MoldLayout, ways: Ways) -> tuple[Step, ...]:
    return (*_opened(layout), *_core_out(layout, ways))


def _opened(layout: MoldLayout) -> tuple[Step, ...]:
    """Bowl, hanger and collar off."""
    far = layout.params.tip_height_mm
    to_dome, to_rim = (Leg(TO_DOME, far),), (Leg(TO_RIM, far),)
    cast = ("shell", "interface")
    return (
        Step(
            "bowl_off",
            "demold",
            "Bolts out, bowl off",
            (
                "Take the six bolts out.",
                "Draw the bowl's segments off one by one, straight away from the collar.",
            ),
            one_by_one(BOWL, to_dome, (*UPPER, "shell"), False),
            False,
            ("cup_collar",),
            look="dome down, from the side",
        ),
        Step(
            "hanger_off",
            "demold",
            "Hanger off",
            ("All screws out; lift the hanger.", "Plugs of silicone in the vents tear: that is right."),
            (Move(("hanger",), to_rim, (*COLLAR, *CORE, *cast)),),
            False,
            ("hanger_to",),
            look="dome down, from the side",
        ),
        Step(
            "collar_off",
            "demold",
            "Collar off",
            ("Lift its segments straight up one by one, past the rim of the interface.",),
            one_by_one(COLLAR, to_rim, (*CORE, *cast), False),
            False,
            look="dome down, from the side",
        ),
    )


def _core_out(layout: MoldLayout, ways: Ways) -> tuple[Step, ...]:
    """The core's pieces out of the cast."""
    far = layout.params.tip_height_mm
    cast = ("shell", "interface")

    def core(key: str, title: str, lines: tuple[str, ...], names: tuple[str, ...], later: tuple[str, ...]) -> Step:
        moves = one_by_one(names, dict(ways), (*cast, *later), False)
        return Step(key, "demold", title, lines, moves, False, look="dome down", cut=cast, drawn_mm=1.2 * far)

    return (
        core(
            "centre_out",
            "Centre of the core out",
            (
                "Two of the core's screws in its holes are your handle.",
                "Straight out: it is tapered by one degree and free after the first millimetre.",
            ),
            CENTRE,
            (*KEYS, *WEDGES),
        ),
        core(
            "keys_out",
            "Keys out",
            (
                "Grip: turn one of its own screws 6 mm into its hole, hold the head with flat pliers.",
                "One after the other: inward, toward the axis, until clear of the silicone; then out.",
                "Stuck: a few drops of alcohol along the seam, wait a minute, press the dome from outside. No knife.",
            ),
            KEYS,
            WEDGES,
        ),
        core(
            "wedges_out",
            "Wedges out",
            ("The same way, with the same grip.", "Trim the flash at seam and vents. Weigh the endcap."),
            WEDGES,
            (),
        ),
    )
