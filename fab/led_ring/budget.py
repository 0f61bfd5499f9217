"""Checks of the LED ring's driver: does it start, stay inside every rating, and fit the USB plug? SI units.

Limits are those of the TPS61165 data sheet (SLVS790E), USB 2.0 (7.2.1, 7.2.4.1) and the paper (under 130 mA).
"""

from __future__ import annotations

import math
from dataclasses import replace

from cad import led_ring
from cad.params import EndcapParams
from fab.checks.check import Check
from fab.led_ring.driver import (
    C_IN_LEAST_F,
    C_OUT_RANGE_F,
    DIODE_RATING_V,
    DUTY_MAX,
    I_START_LIMIT,
    INDUCTANCE_SPREAD,
    INDUCTOR_SATURATION_A,
    LED_V_MAX,
    OUTPUT_SHARE_AT_BIAS,
    RESISTOR_SPREAD,
    RIPPLE_V,
    USB_INRUSH_F,
    V_PROTECTION,
    V_REFERENCE,
    V_REFERENCE_SPREAD,
    V_SWITCH_RATING,
    Driver,
    choose_driver,
    losses_w,
)

LED_A = 0.020  # P, LED03
RING_A = 0.130  # P, LED08: the ring draws less
USB_A = 0.500  # S: 2.5 W at 5 V
USB_LOW_V = 4.75  # S: at a powered port
CAMERA_A = 0.220  # E: ELP-USBFHD01M streaming
LED_RATING_A = 0.240  # S: J Series 3030, 3 V
LIGHT_SHARE = 0.45  # E: light of a white LED over its electrical power
FILM_W_M2K = 8.0  # E: free convection and radiation at a wall
BOARD_FILM_W_M2K = 12.0  # E: the same at a ring 7 mm wide
RUBBER_W_MK = 0.2  # E: silicone
PLASTIC_W_MK = 0.15  # E: PLA and PETG
PLASTIC_MM = 12.0  # E: way from the board's back through spacer and base
WARM_ROOM_C = 40.0  # E: for the junctions
SPACER_C = 70.0  # E: PETG creeps above it (PLA from 55)
DRIVER_K_W = 210.0  # S: SOT-23-6, junction to ambient, on the test board of the data sheet
LED_K_W = 40.0  # E: junction to board
DRIVER_MAX_C = 125.0  # S
LED_MAX_C = 85.0  # E: where the silicone of the package ages slowly


def driver_checks(driver: Driver) -> list[Check]:
    """All electrical checks of a circuit."""
    wanted = choose_driver(driver.led_count, LED_A)
    weak = replace(driver, v_in=USB_LOW_V, r_set_ohm=driver.r_set_ohm * (1 - RESISTOR_SPREAD - V_REFERENCE_SPREAD))
    small = replace(weak, inductance_h=driver.inductance_h * (1 - INDUCTANCE_SPREAD))
    open_v = driver.led_count * LED_V_MAX + V_REFERENCE
    kept = OUTPUT_SHARE_AT_BIAS * driver.c_out_f
    return [
        Check("ring.r_set_ohm", driver.r_set_ohm, wanted.r_set_ohm, wanted.r_set_ohm),
        Check("ring.led_current_ma", 1e3 * driver.led_a, 0.97 * 1e3 * LED_A, 1.03 * 1e3 * LED_A),
        Check("ring.led_current_share_of_rating", driver.led_a / LED_RATING_A, high=0.5),
        Check("ring.string_v", driver.v_out, low=weak.v_in + 1.0, high=V_PROTECTION[0]),
        Check("ring.string_highest_v", open_v, high=V_PROTECTION[0]),
        Check("ring.protection_highest_v", V_PROTECTION[1], high=min(V_SWITCH_RATING, DIODE_RATING_V)),
        Check("ring.duty", weak.duty, high=DUTY_MAX),
        Check("ring.inductance_uh", 1e6 * driver.inductance_h, 10.0, 22.0),
        Check("ring.least_inductor_current_ma", 1e3 * (small.input_a - small.ripple_a / 2), low=0.0),
        Check("ring.peak_current_a", small.peak_a, high=min(I_START_LIMIT, INDUCTOR_SATURATION_A)),
        Check("ring.current_margin", small.most_output_a / small.led_a, low=2.0),
        Check("ring.output_capacitance_uf", 1e6 * kept, *(1e6 * c for c in C_OUT_RANGE_F)),
        Check("ring.output_ripple_v", driver.output_ripple_v, high=RIPPLE_V),
        Check("ring.input_capacitance_uf", 1e6 * driver.c_in_f, 1e6 * C_IN_LEAST_F, 1e6 * USB_INRUSH_F),
        Check("ring.efficiency", driver.efficiency, 0.80, 0.90),
        Check("ring.input_ma", 1e3 * driver.input_a, high=1e3 * RING_A),
        Check("ring.input_worst_ma", 1e3 * small.input_a, high=1e3 * RING_A),
        Check("ring.usb_with_camera_ma", 1e3 * (small.input_a + CAMERA_A), high=1e3 * USB_A),
    ]


def temperatures_c(driver: Driver, params: EndcapParams, room_c: float) -> dict[str, float]:
    """Steady temperatures in the closed endcap, an estimate.

    Board -> air inside -> silicone -> room: the whole power of ring and camera (light ends as heat, too) leaves through
    the half sphere that sees the room; the board's heat also flows through spacer and base. Lumped: good to perhaps a
    third of the rise.

    Args:
        driver: the circuit. params: the design. room_c: temperature of the room.
    """
    heat = driver.input_w + CAMERA_A * driver.v_in
    dome = 2 * math.pi * (1e-3 * params.outer_radius_mm) ** 2
    inside = room_c + heat * (2 / FILM_W_M2K + 1e-3 * params.wall_mm / RUBBER_W_MK) / dome
    outer, inner = (1e-3 * r for r in (led_ring.BOARD_OUTER_RADIUS_MM, led_ring.BOARD_INNER_RADIUS_MM))
    face = math.pi * (outer**2 - inner**2)
    warm = driver.input_w - LIGHT_SHARE * driver.led_w
    board = inside + warm / (face * (BOARD_FILM_W_M2K + PLASTIC_W_MK / (1e-3 * PLASTIC_MM)))
    lost = losses_w(driver)
    chip = sum(lost[name] for name in ("switch conducting", "switch turning", "switch node", "controller"))
    led = driver.led_v * driver.led_a * (1 - LIGHT_SHARE)
    return {
        "air inside": inside,
        "board": board,
        "led junction": board + LED_K_W * led,
        "driver junction": board + DRIVER_K_W * chip,
    }


def warmest_room_c(driver: Driver, params: EndcapParams) -> float:
    """Room in which the board reaches what its PETG spacer bears; the estimate of :func:`temperatures_c`, no gate."""
    return SPACER_C - temperatures_c(driver, params, 0.0)["board"]


def thermal_checks(driver: Driver, params: EndcapParams) -> list[Check]:
    """Junctions in a warm room."""
    hot = temperatures_c(driver, params, WARM_ROOM_C)
    return [
        Check("ring.led_junction_c", hot["led junction"], high=LED_MAX_C),
        Check("ring.driver_junction_c", hot["driver junction"], high=DRIVER_MAX_C),
    ]
