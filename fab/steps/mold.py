"""Steps that assemble the two halves of the mold.

The collar is placed first at every size, because its bore passes neither the interface nor the core. Where the core
passes the gyroid ring from the dome's side, its pieces are lowered one by one; where the ring is narrower than the
core's equator (small D), they are inserted into the interface through the bore, along their removal paths. Sweeps
prove the order of every export.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from cad.interface import POCKET_FLOOR_MM, zone_radii_mm
from cad.mold.core import REMOVAL_ORDER
from cad.mold.cup import BOWL, COLLAR
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.checks.extraction import Leg
from fab.steps.record import Move, Step, one_by_one

Ways = Mapping[str, tuple[Leg, ...]]  # name of a core piece -> its removal path
CORE = REMOVAL_ORDER
CENTRE, KEYS, WEDGES = CORE[:1], CORE[1:4], CORE[4:]
UPPER = ("hanger", *COLLAR, "interface", *CORE)  # parts of the upper half
HAND_MM = 0.2  # E: room between a bump and the gyroid for lowering by hand
TO_DOME, TO_RIM = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)  # unit vectors
AGENT = "Release agent on every PLA face that will touch silicone, seams too; let it dry as its label says."
CORE_AGENT = f"{AGENT} Do so before a piece meets the interface: none may reach the gyroid."
NUMBERS = (
    "Keys look alike, and so do wedges, but their bumps differ. Hole up and round side away from you, number 1 has its "
    "hole on the left, 2 in the middle, 3 on the right."
)  # holes: cad.mold.layout.MoldLayout.core_screws_mm


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
    """Steps from the printed parts to the two halves of the mold, in order.

    Args:
        layout: mold sizes.
        ways: removal path of every core piece (:func:`fab.checks.extraction.core_path`).
    """
    return (*_upper_half(layout, ways), *_lower_half(layout))


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
    return (nuts, collar, *_core_in_interface(layout, ways))


def _core_lowered(out: tuple[Leg, ...]) -> tuple[Step, ...]:
    held = ("hanger", *COLLAR)
    return (
        Step(
            "interface_on_hanger",
            "upper half",
            "Lower the interface into the collar",
            (
                "Gyroid up, nuts over the circle of ten holes next to the collar.",
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
                f"{CORE_AGENT} Neck first, straight down through the gyroid ring onto the hanger.",
                "First the centre, its tabs toward the middles of the collar's segments; then the three wedges against "
                "its short sides; then the three keys, between the wedges and over the tabs.",
                f"{NUMBERS} Each belongs where its hole meets that of the hanger.",
                "{screws:hanger_to_core} from below, each piece before the next; they cut their own thread, too.",
            ),
            one_by_one((*CENTRE, *WEDGES, *KEYS), out, (*held, "interface"), True),
            screws=("hanger_to_core",),
            drawn_mm=110.0,
        ),
    )


def _core_in_interface(layout: MoldLayout, ways: Ways) -> tuple[Step, ...]:
    up = (Leg(TO_RIM, layout.params.tip_height_mm + 10.0),)
    return (
        Step(
            "core_inside",
            "upper half",
            "Put the core together inside the interface",
            (
                f"{CORE_AGENT} At this size the gyroid closes in over the core's equator: the pieces go in through the "
                "bore, as they will come out, last piece first.",
                f"Interface, bore up, on a soft ring {_soft_ring(layout.params)}: the gyroid lies on it, the core "
                "hangs through. Wedges in and outward, keys in between, the centre straight down.",
                f"{NUMBERS} Clockwise lie key 1, wedge 1, key 2, wedge 2, key 3, wedge 3; the centre's two holes are "
                "in line with the middle of key 1.",
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
                "Leave the interface on its ring. Turn the hanger with its collar over and lower it straight onto "
                "interface and core, the middles of the collar's segments over the keys. Turned so that one screw of a "
                "piece finds its hole, all must: else a piece has another one's place.",
                "{screws:hanger_to_core} into the core and {screws:hanger_to_interface} into the interface's nuts, "
                "hand-tight: TPU gives way.",
            ),
            (Move(("hanger", *COLLAR), up, ("interface", *CORE)),),
            screws=("hanger_to_core", "hanger_to_interface"),
            look="dome down, from the side",
        ),
    )


def _soft_ring(params: EndcapParams) -> str:
    """Inner width and height of the soft ring, as text: the gyroid lies on it and the core hangs inside it."""
    above = params.interlock_top_mm - params.centre_height_mm
    width = 2 * math.sqrt(zone_radii_mm(params)[0] ** 2 - above**2)
    depth = params.centre_height_mm + params.inner_radius_mm + params.dent_depth_mm - params.interlock_top_mm
    return f"{width:.0f} mm wide inside and {math.ceil(depth / 5 + 1) * 5} mm high"


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
