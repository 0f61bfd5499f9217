"""Steps of the cast: pouring and closing the mold, and demolding the endcap."""

from __future__ import annotations

from cad.mold.cup import BOWL, COLLAR
from cad.mold.layout import MoldLayout
from fab.checks.extraction import Leg
from fab.steps.mold import CENTRE, CORE, KEYS, TO_DOME, TO_RIM, UPPER, WEDGES, Ways, core_passes_gyroid
from fab.steps.record import Move, Step, one_by_one


def cast_steps(layout: MoldLayout, ways: Ways) -> tuple[Step, ...]:
    """Steps from the two halves of the mold to the demolded endcap, in order.

    Args:
        layout: mold sizes.
        ways: removal path of every core piece (:func:`fab.checks.extraction.core_path`).
    """
    return (*_poured(), _lowered(layout), _closed(), *_opened(layout), *_core_out(layout, ways))


def _poured() -> tuple[Step, ...]:
    return (
        Step(
            "mix",
            "cast",
            "Weigh, mix",
            (
                "{part_a_g} g A and {part_b_g} g B into one cup. The clock runs.",
                "Mix until no streak is left; {degas}.",
            ),
        ),
        Step(
            "pour",
            "cast",
            "Pour",
            (
                "Weigh cup, stick and mix before you pour, and write it down.",
                "A thin stream onto one spot of the bowl; the silicone finds its level. Stop when cup, stick and mix "
                "have lost {poured_g} g: it stands {fill_depth_mm} mm below the seam, not over it.",
                "Scrape the cup: only {left_g} g stay in it and on the stick, and the wells may want some of them. "
                "The rest cures in the cup and shows when the cast is ready.",
            ),
            look="dome down",
            shown=BOWL,
            extras=("silicone",),
        ),
    )


def _lowered(layout: MoldLayout) -> Step:
    """Step that lowers the upper half into the bowl."""
    stroke = layout.seam_height_mm - layout.dam_top_mm
    # Where the core was inserted into the interface first, the hanger was lowered onto both: the core is in place.
    first = (
        "Turn the upper half over, core down." if core_passes_gyroid(layout) else "Lift the upper half off its ring."
    )
    return Step(
        "close",
        "cast",
        "Lower the upper half",
        (
            f"{first} Lower it upright, slowly: the silicone climbs into the gyroid. The collar's seams come "
            "midway between the bowl's, so that the bolts tie all segments.",
            f"Last {stroke:.0f} mm: the collar slides into the bowl's dam. Silicone lifts the upper half, in the end "
            "with {lift_n} N less its weight: lay {lift_kg} kg on the middle of the hanger, off the wells, or have "
            "somebody press.",
        ),
        (Move(UPPER, (Leg(TO_RIM, layout.stand_height_mm),), BOWL),),
        look="dome down, from the side",
        drawn_mm=0.8 * layout.params.tip_height_mm,
    )


def _closed() -> Step:
    """Step of the bolts, with the inspection of the wells until the cure."""
    return Step(
        "closed",
        "cast",
        "Close, and look at the wells",
        (
            "{screws:cup_collar} with a washer at either end, crosswise, until the piston seats. A bolt reaches its "
            "nut only when {reach_mm} mm are left. One hand turns the key, the other holds the socket, which holds "
            "the nut in its recess from below. Take the weight off once all six bolts have hold.",
            "Lift one side by a finger's breadth and walk it round once, so that every vent is the highest for a "
            "while: air under the flat flange runs along it to that vent.",
            "All wells on the hanger show silicone: the mold is full. A dry well: press, wait, tap; if it "
            "stays dry, fill it with the stick from what is left in the cup.",
            "{beyond_ml} ml are poured beyond the cast. The dam's gap, the flange's edge, vents and wells have "
            "room for {room_ml} ml, up to {leak_ml} ml creep out at the bowl's joints; the rest rises onto the "
            "hanger.",
            "Look again before the {pot_life_min} min of the pot life are over: silicone creeps into the core's "
            "joints, too. Push what lies on the hanger into a well that has sunk, or fill it from the cup, and "
            "wipe the rest off the screws' heads.",
            "Leave it for {cure_h} h at room temperature.",
        ),
        screws=("cup_collar",),
        look="dome down, from the side",
        shown=(*BOWL, *UPPER, "shell"),
        cut=(*BOWL, *UPPER, "shell"),
    )


def _opened(layout: MoldLayout) -> tuple[Step, ...]:
    """Steps that remove bowl, hanger and collar."""
    far = layout.params.tip_height_mm
    to_dome, to_rim = (Leg(TO_DOME, far),), (Leg(TO_RIM, far),)
    cast = ("shell", "interface")
    return (
        Step(
            "bowl_off",
            "demold",
            "Bolts out, bowl off",
            (
                "Take the six bolts out. Hold bowl and hanger together, and turn the mold over onto the hanger.",
                "Cut the tape on the bowl and take the rubber band off. Draw the segments off upward, one by one, "
                "straight away from the collar.",
            ),
            one_by_one(BOWL, to_dome, (*UPPER, "shell"), False),
            False,
            ("cup_collar",),
            look="from the side",
        ),
        _hanger_off(layout),
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


def _hanger_off(layout: MoldLayout) -> Step:
    """Step that removes the hanger from the dome in its soft ring."""
    diameter_mm, to_rim = layout.params.diameter_mm, (Leg(TO_RIM, layout.params.tip_height_mm),)
    return Step(
        "hanger_off",
        "demold",
        "Hanger off",
        (
            "The bowl was the foot. Turn the mold back and lay the dome, tip down, into the soft ring, about "
            f"{0.7 * diameter_mm:.0f} mm wide inside and {0.2 * diameter_mm:.0f} mm high: {{count:hanger_to}} "
            "screws want a dome that lies still.",
            "All screws out; lift the hanger. Plugs of silicone in the vents tear: that is right.",
        ),
        (Move(("hanger",), to_rim, (*COLLAR, *CORE, "shell", "interface")),),
        False,
        ("hanger_to",),
        look="dome down, from the side",
    )


def _core_out(layout: MoldLayout, ways: Ways) -> tuple[Step, ...]:
    """Steps that remove the core's pieces from the cast."""
    cast, drawn_mm = ("shell", "interface"), 1.2 * layout.params.tip_height_mm

    def core(key: str, title: str, lines: tuple[str, ...], names: tuple[str, ...], later: tuple[str, ...]) -> Step:
        moves = one_by_one(names, dict(ways), (*cast, *later), False)
        return Step(key, "demold", title, lines, moves, False, look="dome down", cut=cast, drawn_mm=drawn_mm)

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
            (
                "The same way, with the same grip. Trim the flash at seam and vents. Inside, cut off the fins that the "
                "core's joints have left: the camera sees them. Weigh the endcap.",
            ),
            WEDGES,
            (),
        ),
    )
