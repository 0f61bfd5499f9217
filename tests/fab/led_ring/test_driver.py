"""The LED ring's circuit: data sheet equations against a simulated converter, and planted faults."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from cad.errors import ParameterError
from cad.led_parts import led_part
from cad.led_placement import led_azimuths_deg, placements
from cad.params import EndcapParams
from fab.led_ring.bom import ring_bom
from fab.led_ring.budget import driver_checks, temperatures_c, thermal_checks
from fab.led_ring.circuit import PINS, circuit_checks, netlist
from fab.led_ring.driver import F_SWITCH, Driver, choose_driver, fitted_driver, losses_w, sense_resistor_ohm


def failed(checks) -> set[str]:
    return {check.name for check in checks if not check.ok}


def simulated(driver: Driver, periods: int = 400, steps: int = 400) -> tuple[float, float]:
    """Mean and swing of the inductor's current, by stepping an ideal boost converter through its periods.

    The output is held at its voltage, the duty is found so that charge balances: the simplest other way to the numbers.
    """
    swing = driver.v_out + driver.v_diode
    duty, current = 1 - driver.v_in / swing, driver.v_out * driver.led_a / driver.v_in
    dt = 1 / F_SWITCH / steps
    trace = []
    for period in range(periods):
        for k in range(steps):
            slope = driver.v_in if k < duty * steps else driver.v_in - swing
            current += slope / driver.inductance_h * dt
            if period == periods - 1:
                trace.append(current)
    return sum(trace) / len(trace), max(trace) - min(trace)


def test_the_paper_ring_is_what_is_chosen_and_fitted():
    driver = choose_driver()
    assert driver == fitted_driver()  # table and equations agree
    assert (driver.r_set_ohm, driver.led_a, driver.inductance_h) == (10.0, pytest.approx(0.020), 22e-6)
    assert driver.v_out == pytest.approx(25.4)
    assert driver.input_a < 0.130
    assert driver.efficiency == pytest.approx(0.86, abs=0.02)  # P: 86 %
    assert failed(driver_checks(driver)) == set()


def test_ripple_and_duty_agree_with_a_stepped_converter():
    driver = choose_driver()
    _, swing = simulated(driver)
    assert driver.ripple_a == pytest.approx(swing, rel=0.01)
    assert driver.ripple_a == pytest.approx(driver.v_in * driver.duty / (driver.inductance_h * F_SWITCH), rel=1e-9)


def test_power_is_conserved():
    driver = choose_driver()
    assert driver.input_w == pytest.approx(driver.led_w + sum(losses_w(driver).values()), rel=1e-9)
    lossless = driver.v_out * driver.led_a / driver.v_in
    assert driver.peak_a - driver.ripple_a / 2 > lossless


@pytest.mark.parametrize(("current", "ohm"), [(0.020, 10.0), (0.0185, 11.0), (0.1, 2.0), (0.00202, 100.0)])
def test_sense_resistor_is_the_nearest_standard_value(current, ohm):
    assert sense_resistor_ohm(current) == pytest.approx(ohm)


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"r_set_ohm": 1.0}, {"ring.r_set_ohm", "ring.led_current_ma", "ring.input_ma", "ring.usb_with_camera_ma"}),
        ({"r_set_ohm": 9.1}, {"ring.r_set_ohm", "ring.led_current_ma", "ring.input_ma"}),
        ({"inductance_h": 4.7e-6}, {"ring.inductance_uh", "ring.least_inductor_current_ma"}),
        ({"c_out_f": 1e-6}, {"ring.output_capacitance_uf"}),
        ({"c_in_f": 22e-6}, {"ring.input_capacitance_uf"}),
        ({"v_in": 2.5}, {"ring.input_ma"}),
        ({"led_v": 4.2}, {"ring.string_v"}),
    ],
)
def test_planted_faults_are_named(change, names):
    driver = replace(choose_driver(), **change)
    assert names <= failed(driver_checks(driver))


def test_a_duty_beyond_the_limit_is_seen():
    assert "ring.duty" in failed(driver_checks(replace(choose_driver(), v_diode=40.0)))


def test_temperatures_rise_with_power_and_fall_with_size():
    driver, small, large = choose_driver(), EndcapParams(110, 7), EndcapParams(180, 10)
    assert temperatures_c(driver, small, 25)["board"] > temperatures_c(driver, large, 25)["board"]
    rise = [temperatures_c(driver, large, room)["board"] - room for room in (0, 30)]
    assert rise[0] == pytest.approx(rise[1])
    assert failed(thermal_checks(driver, large)) == set()
    assert "ring.led_junction_c" in failed(thermal_checks(replace(driver, r_set_ohm=2.0), small))


@pytest.mark.parametrize("count", [6, 7, 8, 9])
def test_circuit_holds_for_every_led_count(count):
    assert failed(circuit_checks(netlist(count), count)) == set()
    assert failed(driver_checks(choose_driver(count))) == set()


def test_a_wrong_circuit_is_seen():
    nets = netlist()
    turned = {**nets, "N3": (("LED3", "K"), ("LED4", "K")), "N4": (("LED4", "A"), ("LED5", "A"))}
    assert failed(circuit_checks(turned)) == {"ring.leds_in_string"}
    without = {name: tuple(pin for pin in pins if pin != ("R1", "2")) for name, pins in nets.items()}
    assert "ring.unconnected_pins" in failed(circuit_checks(without))
    twice = {**nets, "SW": (*nets["SW"], ("R1", "1"))}
    assert "ring.pins_in_two_nets" in failed(circuit_checks(twice))
    bridged = {**nets, "VIN": nets["VIN"][:2], "SW": (*nets["SW"], ("L1", "1"), ("U1", "1"), ("U1", "2"))}
    assert failed(circuit_checks(bridged)) == {"ring.shorted_parts"}


def test_every_placed_part_is_in_table_bom_and_circuit():
    lines = ring_bom()
    named = [name for line in lines for name in line.references.split()]
    assert sorted(named) == sorted(place.reference for place in placements())
    assert sum(line.quantity for line in lines) == len(named) + 1  # and the board
    assert {place.kind for place in placements()} == set(PINS)
    assert led_part("r_set").value == pytest.approx(0.2 / 0.020)


@pytest.mark.parametrize("count", [5, 10, 8.5, math.nan])
def test_led_counts_that_do_not_fit_are_refused(count):
    with pytest.raises(ParameterError, match=r"outside 6\.\.9"):
        led_azimuths_deg(count)
