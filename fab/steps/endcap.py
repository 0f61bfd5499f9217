"""Steps of the endcap: camera and ring into the base, the adapter onto the robot, the base under the dome."""

from __future__ import annotations

from cad.mold_layout import MoldLayout
from fab.steps.cast import cast_steps
from fab.steps.mold import TO_DOME, TO_RIM, Ways, mold_steps
from fab.steps.record import Leg, Move, Step

HARDWARE = ("camera", "ring_spacer", "led_ring")


def endcap_steps(layout: MoldLayout) -> tuple[Step, ...]:
    """From the base to the endcap on the robot."""
    return (_inserts(), *_into_the_base(), *_under_the_dome(layout))


def _inserts() -> Step:
    """Threads for the screws of the adapter."""
    return Step(
        "inserts",
        "assemble",
        "Heat-set inserts into the lugs of the base",
        (
            "Five M4 inserts, one in the hole under each lug. Base upside down on the table.",
            "Iron at 230 °C, insert on its tip. Let weight and heat sink it straight in 10 to 15 s; no force.",
            "Stop when it is flush or 0.2 mm below; press a flat piece of metal on it for 10 s while it cools.",
            "Turn a screw in by hand: it must run freely and stand upright.",
        ),
        look="dome down",
        shown=("base",),
        extras=("inserts",),
    )


def _into_the_base() -> tuple[Step, ...]:
    """Camera, spacer and LED ring."""
    up = (Leg(TO_DOME, 40.0),)
    return (
        Step(
            "camera",
            "assemble",
            "Camera into the base",
            (
                "Cable through the hole first. Board onto its four corner posts, lens up; lens cover off last.",
                "{screws:camera_to_base} cut their own thread in the plastic: slowly, half a turn back for each turn "
                "in; stop when they bear.",
            ),
            (Move(("camera",), up, ("base",)),),
            screws=("camera_to_base",),
            look="from above",
            drawn_mm=25.0,
        ),
        Step(
            "ring",
            "assemble",
            "Spacer and LED ring",
            (
                "A drop of glue at two places of the recess, spacer in, notch over the cable's side.",
                "SH cable into the plug J1 on the ring's back. Ring on the spacer, plug in the notch, glue at two "
                "places; its wires leave beside the camera's.",
                "5 V and GND: see Wiring in the chapter LED ring. Light it once before you go on.",
            ),
            (
                Move(("ring_spacer",), up, ("base", "camera")),
                Move(("led_ring",), up, ("base", "camera", "ring_spacer")),
            ),
            look="from above",
            drawn_mm=40.0,
        ),
    )


def _under_the_dome(layout: MoldLayout) -> tuple[Step, ...]:
    """Base to the cast, and both to the robot."""
    down = (Leg(TO_RIM, layout.params.tip_height_mm),)
    return (
        Step(
            "base",
            "assemble",
            "Base to endcap",
            (
                "Base under the interface; the ring goes through the bore. Turn until the holes meet the nuts.",
                "{screws:base_to_interface} from below, crosswise, until the heads bear.",
                "Other silicones and walls of the same D fit the same base.",
            ),
            (Move(("base", *HARDWARE), down, ("interface", "shell")),),
            screws=("base_to_interface",),
            drawn_mm=45.0,
        ),
        Step(
            "adapter",
            "assemble",
            "Adapter to the robot, endcap to the adapter",
            (
                "Adapter onto the robot's flange ({robot}): {robot_fixing}.",
                "Cables through the hub's bore and out along its groove.",
                "Endcap onto the arms; {screws:adapter_to_base} from below into the inserts of the lugs.",
                "The heads of the endcap's own screws stay free between the arms: a dome is changed on the robot.",
            ),
            (Move(("arm_adapter",), down, ("base", "interface", "shell")),),
            screws=("adapter_to_base",),
            drawn_mm=35.0,
        ),
    )


def all_steps(layout: MoldLayout, ways: Ways) -> tuple[Step, ...]:
    """Every step of the build, in order."""
    return (*mold_steps(layout, ways), *cast_steps(layout, ways), *endcap_steps(layout))
