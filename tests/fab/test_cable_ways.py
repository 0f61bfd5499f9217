"""The cables' way out of the endcap: which plugs pass which opening, and that the steps ask for nothing else."""

from __future__ import annotations

import math

import pytest

from cad.arm_adapter import GROOVE_DEPTH_MM, adapter_part
from cad.base import CABLE_HOLE_RADIUS_MM, SLOT_OFFSET_MM, SLOT_RADIUS_MM, base_part
from cad.camera import PLUG_MM
from cad.mold.core import REMOVAL_ORDER
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from cad.ring_spacer import NOTCH_AZIMUTH_DEG
from cad.robot_sides import GROOVE_AZIMUTH_DEG, robot_sides
from fab.build_sheet.lighting import steps_of_wiring
from fab.steps.endcap import all_steps

PARAMS = EndcapParams(98.9, 6.5)
USB_A_MM = (12.0, 4.5)  # S: USB 2.0, shell of an A plug
SH_MM = (4.0, 2.9)  # S: JST SHR-02V-S-B, across its way
CABLE_MM = 4.5  # E: the camera's, already in the slot
STEPS = {step.key: step for step in all_steps(MoldLayout(PARAMS), dict.fromkeys(REMOVAL_ORDER, ()))}


def words(key: str) -> str:
    return " ".join(STEPS[key].lines)


def test_small_plugs_pass_the_slot_and_no_usb_a_plug_passes_the_base():
    slot, hole = 2 * SLOT_RADIUS_MM, 2 * CABLE_HOLE_RADIUS_MM
    assert math.hypot(*USB_A_MM) > max(slot, hole)
    assert hole < math.hypot(*PLUG_MM[:2]) <= slot  # the camera's small plug, not through a hole
    assert math.hypot(*SH_MM) + CABLE_MM <= slot  # the ring's, beside the camera's cable
    assert f"slot at azimuth 0, {slot:g} mm wide" in words("camera")


def test_the_slot_of_the_cables_is_named_by_the_lugs_beside_it():
    apart = [abs((azimuth + 180.0) % 360.0 - 180.0) for azimuth in PARAMS.arm_azimuths_deg]
    assert min(apart) == pytest.approx(36.0) and max(apart) == pytest.approx(180.0)  # between two lugs; at a lug
    assert GROOVE_AZIMUTH_DEG == 0.0 and NOTCH_AZIMUTH_DEG == 90.0
    assert "the one that points between two lugs. The adapter covers the other." in words("camera")
    assert "a quarter turn counterclockwise from the slot of the cables, as seen from above" in words("ring")
    assert "the slot of the cables over the hub's groove" in words("adapter")


@pytest.mark.parametrize("robot", sorted(robot_sides()))
def test_the_adapter_leaves_the_slot_at_azimuth_0_alone_open(robot):
    solid, deep = adapter_part(PARAMS, robot).solid, -PARAMS.base_thickness_mm - GROOVE_DEPTH_MM / 2

    def covered(side: int) -> int:
        turns = [(side * SLOT_OFFSET_MM, 0.0)]
        for turn in range(0, 360, 30):
            across = (SLOT_RADIUS_MM * f(math.radians(turn)) for f in (math.cos, math.sin))
            turns.append(tuple(a + b for a, b in zip(turns[0], across, strict=True)))
        return sum(solid.is_inside((x, y, deep)) for x, y in turns)

    assert covered(1) == 0 and covered(-1) > 6


@pytest.mark.long
def test_the_slot_goes_through_the_base():
    solid = base_part(PARAMS).solid
    for z in (-15.9, -12.0, -8.0, -4.0, -1.1, -0.5):
        for across in (-4.5, 0.0, 4.5):
            assert not solid.is_inside((SLOT_OFFSET_MM, across, z))


def test_a_cable_is_unplugged_before_its_small_plug_goes_up_and_plugged_in_after():
    camera, ring = words("camera"), words("ring")
    order = [camera.index(each) for each in ("Unplug", "up through that slot", "SH plug", "in again", "Board onto")]
    assert order == sorted(order)
    keys = list(STEPS)
    assert keys.index("camera") < keys.index("ring") and "SH plug into J1" in ring
    tried = steps_of_wiring()[-1]
    assert "Unplug it from J1 again" in tried.lines[-1] and "goes up through it first" in tried.lines[-1]
