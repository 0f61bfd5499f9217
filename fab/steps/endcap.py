"""Steps of the endcap: camera and ring into the base, base to the dome, and both to the robot's adapter."""

from __future__ import annotations

from cad.base import SLOT_RADIUS_MM
from cad.mold.layout import MoldLayout
from fab.steps.cast import cast_steps
from fab.steps.mold import TO_DOME, TO_RIM, Ways, mold_steps
from fab.steps.record import Leg, Move, Step

HARDWARE = ("camera", "ring_spacer", "led_ring")  # parts that go into the base
INTO_BASE = (Leg(TO_DOME, 40.0),)  # their removal path, mm


def endcap_steps(layout: MoldLayout) -> tuple[Step, ...]:
    """Steps from the base to the endcap on the robot, in order."""
    return (_inserts(), _camera(), _ring(), *_under_the_dome(layout))


def _inserts() -> Step:
    """Step of the threaded inserts for the adapter's screws."""
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


def _camera() -> Step:
    """Step of the cables and the camera on the base's posts."""
    return Step(
        "camera",
        "assemble",
        "Camera into the base",
        (
            f"Both cables go through the slot at azimuth 0, {2 * SLOT_RADIUS_MM:g} mm wide: of the two slots beside "
            "the camera the one that points between two lugs. The adapter covers the other. No USB-A plug passes the "
            "base, so the small plugs go up from below.",
            "Unplug the camera's cable from its board. Push its small plug up through that slot, then the free SH plug "
            "of the ring's cable, and let the SH plug lie beside the pocket. Plug the camera's cable in again.",
            "Board onto its four corner posts, lens up and covered, its cable in the channel under it.",
            "{screws:camera_to_base} cut their own thread in the plastic: slowly, half a turn back for each turn "
            "in; stop when they bear.",
        ),
        (Move(("camera",), INTO_BASE, ("base",)),),
        screws=("camera_to_base",),
        look="from above",
        drawn_mm=25.0,
    )


def _ring() -> Step:
    """Step of spacer and LED ring."""
    return Step(
        "ring",
        "assemble",
        "Spacer and LED ring",
        (
            "A drop of glue at two places of the recess, spacer in, its notch a quarter turn counterclockwise from "
            "the slot of the cables, as seen from above.",
            "SH plug into J1 on the ring's back, its wires inside the spacer from the slot to the notch. Ring on "
            "the spacer, J1 in the notch, glue at two places.",
            "5 V and GND: see Wiring in the chapter LED ring. Light it once before you go on.",
        ),
        (
            Move(("ring_spacer",), INTO_BASE, ("base", "camera")),
            Move(("led_ring",), INTO_BASE, ("base", "camera", "ring_spacer")),
        ),
        look="from above",
        drawn_mm=40.0,
    )


def _under_the_dome(layout: MoldLayout) -> tuple[Step, ...]:
    """Steps that fix the base to the cast, and both to the robot."""
    down = (Leg(TO_RIM, layout.params.tip_height_mm),)
    return (
        Step(
            "base",
            "assemble",
            "Base to endcap",
            (
                "Lens cover off once the glue has set and smells no more: its vapour leaves a white bloom on a lens.",
                "Base under the interface; the ring goes through the bore. Turn until the holes meet the nuts and "
                "the slot of the cables is under the dome's mark 0.",
                "{screws:base_to_interface}, from below, crosswise, until the heads bear.",
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
                "Endcap over it, the slot of the cables over the hub's groove; lay both cables out along the groove.",
                "Endcap onto the arms; {screws:adapter_to_base} from below into the inserts of the lugs.",
                "The heads of the endcap's own screws stay free between the arms: a dome is changed on the robot.",
            ),
            (Move(("arm_adapter",), down, ("base", "interface", "shell")),),
            screws=("adapter_to_base",),
            drawn_mm=35.0,
        ),
    )


def all_steps(layout: MoldLayout, ways: Ways) -> tuple[Step, ...]:
    """All steps of the build, in order."""
    return (*mold_steps(layout, ways), *cast_steps(layout, ways), *endcap_steps(layout))
