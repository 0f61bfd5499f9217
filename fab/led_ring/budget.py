"""Checks that the LED ring's driver starts, stays inside every rating, and keeps the limits of the USB plug. SI units.

Limits are those of the TPS61165 data sheet (SLVS790E), USB 2.0 (7.2.1, 7.2.4.1) and the paper (under 130 mA). Every
rating is held at the worst of :func:`corners`; what is compared with the paper or with an estimate of ageing, with the
nominal values.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import product

from cad.led_ring.board import BOARD_INNER_RADIUS_MM, BOARD_OUTER_RADIUS_MM
from cad.params import EndcapParams
from fab.checks.check import Check
from fab.led_ring.driver import (
    C_IN_LEAST_F,
    C_OUT_RANGE_F,
    CAPACITOR_SPREAD,
    DIODE_RATING_V,
    DUTY_MAX,
    F_SWITCH_RANGE,
    I_START_LIMIT,
    INDUCTANCE_RANGE_H,
    INDUCTANCE_SPREAD,
    INDUCTOR_SATURATION_A,
    LED_V_SPREAD,
    OUTPUT_SHARE_AT_BIAS,
    RESISTOR_SPREAD,
    RIPPLE_V,
    USB_INRUSH_F,
    V_PROTECTION,
    V_REFERENCE_SPREAD,
    V_SWITCH_RATING,
    Driver,
    choose_driver,
    losses_w,
)

LED_A = 0.020  # P, LED03
RING_A = 0.130  # P, LED08: upper limit of the ring at the nominal values
USB_A = 0.500  # S: 2.5 W at 5 V
USB_RANGE_V = (4.75, 5.25)  # S: at a powered port
STEP_UP_V = 1.0  # E: least of the string over the supply; a boost converter cannot go below it
CAMERA_A = 0.220  # E: ELP-USBFHD01M streaming
LED_RATING_A = 0.240  # S: J Series 3030, 3 V
LIGHT_SHARE = 0.45  # E: light of a white LED over its electrical power
FILM_W_M2K = 8.0  # E: free convection and radiation at a wall
BOARD_FILM_W_M2K = 12.0  # E: the same at a ring 7 mm wide
RUBBER_W_MK = 0.2  # E: silicone
PLASTIC_W_MK = 0.15  # E: PLA and PETG
PLASTIC_MM = 12.0  # E: heat path from the board's back through spacer and base
WARM_ROOM_C = 40.0  # E: for the junctions
SPACER_C = 70.0  # E: PETG creeps above this temperature (PLA above 55)
DRIVER_K_W = 210.0  # S: SOT-23-6, junction to ambient, on the test board of the data sheet
LED_K_W = 40.0  # E: junction to board
DRIVER_MAX_C = 125.0  # S
LED_MAX_C = 85.0  # E: limit for slow ageing of the silicone in the package


def corners(driver: Driver) -> tuple[Driver, ...]:
    """A circuit at each corner of its tolerances: supply, sense current, inductor, frequency, LEDs and capacitors.

    Args:
        driver: the circuit with its nominal values.
    """
    sense = RESISTOR_SPREAD + V_REFERENCE_SPREAD
    spreads = (
        USB_RANGE_V,
        (1 - sense, 1 + sense),
        (1 - INDUCTANCE_SPREAD, 1 + INDUCTANCE_SPREAD),
        F_SWITCH_RANGE,
        LED_V_SPREAD,
        (1 - CAPACITOR_SPREAD, 1 + CAPACITOR_SPREAD),
    )
    return tuple(
        replace(
            driver,
            v_in=supply,
            r_set_ohm=driver.r_set_ohm * current,
            inductance_h=driver.inductance_h * inductor,
            f_switch_hz=frequency,
            led_v=driver.led_v + led,
            c_in_f=driver.c_in_f * capacitor,
            c_out_f=driver.c_out_f * capacitor,
        )
        for supply, current, inductor, frequency, led, capacitor in product(*spreads)
    )


def driver_checks(driver: Driver) -> list[Check]:
    """All electrical checks of a circuit: its nominal values, and each rating at the worst corner of its tolerances.

    Args:
        driver: the circuit with its nominal values.
    """
    wanted = choose_driver(driver.led_count, LED_A)
    every = corners(driver)
    sold_uh = 1e6 * driver.inductance_h  # the recommended range is one of nominal values
    return [
        Check("ring.r_set_ohm", driver.r_set_ohm, wanted.r_set_ohm, wanted.r_set_ohm),
        Check("ring.led_current_ma", 1e3 * driver.led_a, 0.97 * 1e3 * LED_A, 1.03 * 1e3 * LED_A),
        _worst("ring.led_current_share_of_rating", (at.led_a / LED_RATING_A for at in every), high=0.5),
        _worst("ring.string_v", (at.v_out for at in every), USB_RANGE_V[1] + STEP_UP_V, V_PROTECTION[0]),
        Check("ring.protection_highest_v", V_PROTECTION[1], high=min(V_SWITCH_RATING, DIODE_RATING_V)),
        _worst("ring.duty", (at.duty for at in every), high=DUTY_MAX),
        Check("ring.inductance_uh", sold_uh, *(1e6 * henry for henry in INDUCTANCE_RANGE_H)),
        _worst("ring.peak_current_a", (at.peak_a for at in every), high=min(I_START_LIMIT, INDUCTOR_SATURATION_A)),
        _worst("ring.current_margin", (at.most_output_a / at.led_a for at in every), low=2.0),
        _worst(
            "ring.output_capacitance_uf",
            (1e6 * OUTPUT_SHARE_AT_BIAS * at.c_out_f for at in every),
            *(1e6 * farad for farad in C_OUT_RANGE_F),
        ),
        _worst("ring.output_ripple_v", (at.output_ripple_v for at in every), high=RIPPLE_V),
        _worst("ring.input_capacitance_uf", (1e6 * at.c_in_f for at in every), 1e6 * C_IN_LEAST_F, 1e6 * USB_INRUSH_F),
        Check("ring.efficiency", driver.efficiency, 0.80, 0.90),
        Check("ring.input_ma", 1e3 * driver.input_a, high=1e3 * RING_A),
        _worst("ring.usb_with_camera_ma", (1e3 * (at.input_a + CAMERA_A) for at in every), high=1e3 * USB_A),
    ]


def _worst(name: str, values: Iterable[float], low: float = -math.inf, high: float = math.inf) -> Check:
    """The check of the value that is farthest beyond a limit or, where all are inside, nearest to one."""
    return Check(name, min(values, key=lambda value: min(value - low, high - value)), low, high)


def conduction_report(driver: Driver) -> dict[str, float]:
    """Conditions under which the inductor's current stops in each period; no gate, as every rating is checked there.

    Args:
        driver: the circuit with its nominal values.
    """
    every = corners(driver)
    lightest = min(every, key=lambda at: at.conduction)
    return {
        "continuous_at_nominal_values": driver.conduction == 1.0,
        "corners_where_the_current_stops_share": sum(at.conduction < 1.0 for at in every) / len(every),
        "least_conducting_share_of_a_period": lightest.conduction,
        "there_supply_v": lightest.v_in,
        "there_frequency_hz": lightest.f_switch_hz,
        "there_led_v": lightest.led_v,
    }


def temperatures_c(driver: Driver, params: EndcapParams, room_c: float) -> dict[str, float]:
    """Steady temperatures in the closed endcap, an estimate.

    Board -> air inside -> silicone -> room: the whole power of ring and camera (light ends as heat, too) leaves through
    the half sphere that sees the room; the board's heat also flows through spacer and base. Lumped: good to perhaps a
    third of the rise.

    Args:
        driver: the circuit.
        params: the design.
        room_c: temperature of the room, degrees Celsius.
    """
    heat = driver.input_w + CAMERA_A * driver.v_in
    dome = 2 * math.pi * (1e-3 * params.outer_radius_mm) ** 2
    inside = room_c + heat * (2 / FILM_W_M2K + 1e-3 * params.wall_mm / RUBBER_W_MK) / dome
    outer, inner = (1e-3 * r for r in (BOARD_OUTER_RADIUS_MM, BOARD_INNER_RADIUS_MM))
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
    """Room temperature at which the board reaches the limit of its PETG spacer, by :func:`temperatures_c`; no gate.

    Args:
        driver: the circuit.
        params: the design.
    """
    return SPACER_C - temperatures_c(driver, params, 0.0)["board"]


def thermal_checks(driver: Driver, params: EndcapParams) -> list[Check]:
    """Junctions in a warm room: the LEDs' at the nominal values, the driver's at the worst corner.

    The limit of the LEDs is set by ageing over years, so nominal values apply; LEDs have their highest voltage cold.

    Args:
        driver: the circuit with its nominal values.
        params: the design.
    """
    usual = temperatures_c(driver, params, WARM_ROOM_C)
    hottest = (temperatures_c(at, params, WARM_ROOM_C)["driver junction"] for at in corners(driver))
    return [
        Check("ring.led_junction_c", usual["led junction"], high=LED_MAX_C),
        _worst("ring.driver_junction_c", hottest, high=DRIVER_MAX_C),
    ]
