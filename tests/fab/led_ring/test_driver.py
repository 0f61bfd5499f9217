"""The LED ring's circuit: data sheet equations against a simulated converter, and planted faults."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cad.errors import ParameterError
from cad.led_ring.parts import led_part
from cad.led_ring.placement import led_azimuths_deg, placements
from fab.led_ring.bom import bom_csv, ring_bom
from fab.led_ring.budget import (
    CAMERA_A,
    conduction_report,
    corners,
    driver_checks,
)
from fab.led_ring.circuit import PINS, circuit_checks, netlist
from fab.led_ring.driver import (
    F_SWITCH,
    I_LIMIT,
    INDUCTOR_OHM,
    QUIESCENT_A,
    Driver,
    choose_driver,
    fitted_driver,
    losses_w,
    sense_resistor_ohm,
)


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


def light_corner(count: int) -> Driver:
    """A ring at the corner where its inductor carries least against its ripple."""
    return min(corners(fitted_driver(count)), key=lambda at: at.conduction)


@pytest.mark.parametrize("count", [6, 9])
def test_a_current_that_stops_agrees_with_a_stepped_converter(count):
    driver = light_corner(count)
    assert driver.conduction < 1
    dt, current, trace = 1e-4 / driver.f_switch_hz, 0.0, []
    for step in range(10_000):  # one period, from zero to zero
        slope_v = driver.v_in if step < 1e4 * driver.duty else driver.v_in - driver.swing_v
        current = max(0.0, current + slope_v / driver.inductance_h * dt)
        trace.append(current)
    assert trace[-1] == 0.0
    assert sum(value > 0 for value in trace) / 1e4 == pytest.approx(driver.conduction, abs=2e-3)
    assert max(trace) == pytest.approx(driver.peak_a, rel=2e-3)
    assert sum(trace) / 1e4 == pytest.approx(driver.mean_a, rel=2e-3)
    assert sum(value**2 for value in trace) / 1e4 * INDUCTOR_OHM == pytest.approx(
        losses_w(driver)["inductor"], rel=5e-3
    )
    discharged = (
        sum(value for value in trace[round(1e4 * driver.duty) :]) * dt * driver.f_switch_hz
    )  # through the diode
    assert driver.led_a < discharged < 1.15 * driver.led_a  # switch, coil and controller lose the rest


def test_both_modes_meet_where_the_current_just_touches_zero():
    driver = choose_driver(6)
    low, high = 5e-6, 22e-6
    for _ in range(60):  # the inductance at which it does
        middle = (low + high) / 2
        low, high = (middle, high) if replace(driver, inductance_h=middle).conduction < 1 else (low, middle)
    below, above = (replace(driver, inductance_h=high * (1 + sign * 1e-7)) for sign in (-1, 1))
    assert below.conduction < 1 == above.conduction
    for name in ("peak_a", "mean_a", "duty", "output_ripple_v", "efficiency"):
        assert getattr(below, name) == pytest.approx(getattr(above, name), rel=1e-5), name
    assert above.peak_a == pytest.approx(above.ripple_a, rel=1e-5)


def test_the_inductor_does_not_carry_what_the_controller_draws():
    driver = choose_driver()
    assert driver.mean_a == pytest.approx(driver.input_a - QUIESCENT_A)
    assert driver.peak_a == pytest.approx(driver.mean_a + driver.ripple_a / 2)


@pytest.mark.parametrize("count", [6, 7, 8, 9])
def test_every_rating_is_checked_at_its_worst_corner(count):
    driver = fitted_driver(count)
    checks = {check.name.removeprefix("ring."): check.value for check in driver_checks(driver)}
    rng = np.random.default_rng(count)
    for _ in range(200):  # anywhere within the spreads, not at their ends alone
        u = rng.random(6)
        at = replace(
            driver,
            v_in=4.75 + 0.5 * u[0],
            r_set_ohm=driver.r_set_ohm * (0.97 + 0.06 * u[1]),
            inductance_h=driver.inductance_h * (0.8 + 0.4 * u[2]),
            f_switch_hz=1.0e6 + 0.5e6 * u[3],
            led_v=2.5 + 0.7 * u[4],
            c_out_f=driver.c_out_f * (0.9 + 0.2 * u[5]),
        )
        assert at.peak_a <= checks["peak_current_a"] and at.duty <= checks["duty"]
        assert at.most_output_a / at.led_a >= checks["current_margin"]
        assert at.output_ripple_v <= checks["output_ripple_v"]
        assert 1e3 * (at.input_a + CAMERA_A) <= checks["usb_with_camera_ma"]
        margin_v = min(checks["string_v"] - 6.25, 37.0 - checks["string_v"])
        assert min(at.v_out - 6.25, 37.0 - at.v_out) >= margin_v


def test_the_page_has_the_numbers_of_the_circuit():
    page = (Path(__file__).resolve().parents[3] / "docs" / "led_ring.md").read_text(encoding="utf-8")
    driver = fitted_driver()
    every, six = corners(driver), conduction_report(fitted_driver(6))
    nine = conduction_report(driver)
    for line in (
        f"| string | {driver.v_out:.1f} V | {max(at.v_out for at in every):.1f} V |",
        f"| duty | {driver.duty:.2f} | {max(at.duty for at in every):.2f} |",
        f"| peak current | {driver.peak_a:.2f} A | {max(at.peak_a for at in every):.2f} A |",
        f"| {driver.output_ripple_v:.3f} V | {max(at.output_ripple_v for at in every):.3f} V |",
        f"| {100 * driver.efficiency:.1f} % | {100 * min(at.efficiency for at in every):.1f} % |",
        f"| {1e3 * driver.input_a:.0f} mA | {1e3 * max(at.input_a for at in every):.0f} mA |",
        f"worst of {len(every)} corners",
        f"with nine LEDs in {100 * nine['corners_where_the_current_stops_share']:.0f} % of the corners, with six in "
        f"{100 * six['corners_where_the_current_stops_share']:.0f} %. There it flows for "
        f"{nine['least_conducting_share_of_a_period']:.2f} and {six['least_conducting_share_of_a_period']:.2f} of",
    ):
        assert line in page, line


def test_where_the_current_stops_is_said():
    six, nine = (conduction_report(fitted_driver(count)) for count in (6, 9))
    assert six["continuous_at_nominal_values"] and nine["continuous_at_nominal_values"]
    for report in (six, nine):
        there = [report[f"there_{name}"] for name in ("supply_v", "frequency_hz", "led_v")]
        assert there == pytest.approx([5.25, 1.0e6, 2.5])
    assert 0.3 < six["corners_where_the_current_stops_share"] < 0.4
    assert 0 < nine["corners_where_the_current_stops_share"] < 0.1
    assert six["least_conducting_share_of_a_period"] < nine["least_conducting_share_of_a_period"] < 1
    steady = conduction_report(replace(fitted_driver(9), inductance_h=100e-6))
    assert steady["corners_where_the_current_stops_share"] == 0 and steady["least_conducting_share_of_a_period"] == 1.0


def test_a_string_whose_inductor_current_stops_at_nominal_values_is_refused(monkeypatch):
    with pytest.raises(ParameterError, match=r"with 6 LEDs: the current in the largest inductor .* 22 uH, stops"):
        choose_driver(6, 0.015)
    monkeypatch.setattr("cad.led_ring.placement.LED_RANGE", (3, 9))
    with pytest.raises(ParameterError, match=r"led_a=0\.02 with 4 LEDs"):
        choose_driver(4)
    edge = choose_driver(5)
    assert 0 < edge.mean_a - edge.ripple_a / 2 < 0.5e-3  # why five are not offered
    assert choose_driver(6).mean_a - choose_driver(6).ripple_a / 2 > 5e-3


def test_power_that_the_supply_cannot_give_is_no_number_of_a_check():
    driver = replace(choose_driver(), r_set_ohm=1.0)  # 200 mA
    assert math.isinf(min(corners(driver), key=lambda at: at.v_in - at.led_v).input_a)
    assert {"ring.peak_current_a", "ring.current_margin", "ring.usb_with_camera_ma"} <= failed(driver_checks(driver))


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
        ({"inductance_h": 4.7e-6}, {"ring.inductance_uh"}),
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


def test_at_its_largest_output_the_switch_is_at_its_limit():
    driver = choose_driver()
    mean_a = driver.v_out * driver.most_output_a / driver.efficiency / driver.v_in
    assert mean_a + driver.ripple_a / 2 == pytest.approx(I_LIMIT)


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
    past = {**nets, "FB": nets["FB"][:2], "GND": (*nets["GND"], ("LED9", "K"))}  # past the sense resistor
    assert failed(circuit_checks(past)) == {"ring.leds_in_string"}
    twice = {**nets, "SW": (*nets["SW"], ("R1", "1"))}
    assert "ring.pins_in_two_nets" in failed(circuit_checks(twice))
    bridged = {**nets, "VIN": nets["VIN"][:2], "SW": (*nets["SW"], ("L1", "1"), ("U1", "1"), ("U1", "2"))}
    assert failed(circuit_checks(bridged)) == {"ring.shorted_parts"}


def test_every_placed_part_is_in_table_bom_and_circuit():
    lines = ring_bom()
    named = [name for line in lines for name in line.references.split()]
    assert sorted(named) == sorted(place.reference for place in placements())
    assert sum(line.quantity for line in lines) == len(named) + 1  # and the board
    table = csv.DictReader(io.StringIO(bom_csv(lines)))  # as assembly houses read it: commas between references
    assert [name for row in table for name in row["references"].split(",") if name] == named
    assert {place.kind for place in placements()} == set(PINS)
    assert led_part("r_set").value == pytest.approx(0.2 / 0.020)


@pytest.mark.parametrize("count", [5, 10, 8.5, math.nan])
def test_led_counts_that_do_not_fit_are_refused(count):
    with pytest.raises(ParameterError, match=r"outside 6\.\.9"):
        led_azimuths_deg(count)
