"""Electrical design of the LED ring: values from the data sheet's equations, and its budget at the USB plug.

SI units throughout (volt, ampere, ohm, henry, farad, watt, kelvin). Equations and limits are those of the TPS61165
data sheet (Texas Instruments SLVS790E, sections 7.2, 7.6, 8.3.2, 9.1.1 to 9.1.5, 9.2.1.2.5); the string is the paper's.

    current        I_LED = V_FB / R_set
    string         V_out = n V_LED + V_FB
    ripple         I_P = 1 / (L f_s (1 / (V_out + V_F - V_in) + 1 / V_in))    peak to peak, in the inductor
    duty           D = 1 - V_in / (V_out + V_F)          while the inductor's current never stops
    inductor       I_in = V_out I_LED / (V_in eta),  I_L = I_in +- I_P / 2
    most current   I_max = V_in (I_lim - I_P / 2) eta / V_out
    output ripple  C_out >= (V_out - V_in) I_LED / (V_out f_s V_ripple)

The efficiency is a sum of losses (:func:`losses_w`), of which the transition time of the switch and its capacitance
are our estimates (E); everything else is from data sheets. It is compared with the paper's 86 %, not fitted to it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from cad.led_parts import led_part
from cad.led_placement import LED_COUNT, led_azimuths_deg

V_REFERENCE = 0.200  # S, LED01: V_FB, 0.196 to 0.204
V_REFERENCE_SPREAD = 0.02  # S
RESISTOR_SPREAD = 0.01  # 1 % part
V_PROTECTION = (37.0, 39.0)  # S: open-LED protection at the SW pin, least and most
V_SWITCH_RATING = 40.0  # S: absolute maximum at SW
I_LIMIT = 0.96  # S: least current limit of the switch
I_START_LIMIT = 0.7  # S: while it starts
F_SWITCH = 1.2e6  # S: 1.0 to 1.5 MHz
DUTY_MAX = 0.90  # S: least of the maximum duty
SWITCH_OHM = 0.6  # S: most at V_in 3.6 V
QUIESCENT_A = 2.3e-3  # S: while switching
TRANSITION_S = 2 * 8e-9  # E: rise and fall of the SW pin
SWITCH_FARAD = 60e-12  # E: capacitance at the SW pin: switch, diode, pads
INDUCTOR_OHM = 0.45  # E: 22 uH in 4 x 4 x 1.8 mm
INDUCTOR_SATURATION_A = 0.6  # E: at the least; the data sheet of the part rules
INDUCTANCE_SPREAD = 0.20  # S
INDUCTORS_H = (10e-6, 15e-6, 22e-6)  # standard values in the recommended 10 to 22 uH
OUTPUT_SHARE_AT_BIAS = 0.55  # E: what a 50 V X7R capacitor keeps at 25 V
C_OUT_RANGE_F = (1e-6, 10e-6)  # S: recommended
C_IN_LEAST_F = 1e-6  # S
USB_INRUSH_F = 10e-6  # S: USB 2.0, 7.2.4.1: most capacitance at the plug
DIODE_RATING_V = 40.0  # S: MBR0540
LED_V_MAX = 3.2  # E: brightest bin, cold
RIPPLE_V = 0.1  # E: 0.4 % of the string: no visible change of brightness
_E24 = (10, 11, 12, 13, 15, 16, 18, 20, 22, 24, 27, 30, 33, 36, 39, 43, 47, 51, 56, 62, 68, 75, 82, 91)


@dataclass(frozen=True)
class Driver:
    """The circuit's values.

    Attributes:
        led_count: LEDs in the one string.
        led_v: forward voltage of one LED.
        r_set_ohm: current sense resistor.
        inductance_h, c_in_f, c_out_f, c_comp_f: nominal values.
        v_in: supply at the plug.
        v_diode: forward voltage of the Schottky diode.
    """

    led_count: int
    led_v: float
    r_set_ohm: float
    inductance_h: float
    c_in_f: float
    c_out_f: float
    c_comp_f: float
    v_in: float = 5.0
    v_diode: float = 0.4

    @property
    def led_a(self) -> float:
        """Current of the string."""
        return V_REFERENCE / self.r_set_ohm

    @property
    def v_out(self) -> float:
        """Voltage of string and sense resistor."""
        return self.led_count * self.led_v + V_REFERENCE

    @property
    def duty(self) -> float:
        """Share of the period in which the switch conducts."""
        return 1 - self.v_in / (self.v_out + self.v_diode)

    @property
    def ripple_a(self) -> float:
        """Peak-to-peak current in the inductor."""
        return 1 / (self.inductance_h * F_SWITCH * (1 / (self.v_out + self.v_diode - self.v_in) + 1 / self.v_in))

    @property
    def led_w(self) -> float:
        """Electrical power of the LEDs alone, what the efficiency counts."""
        return self.led_count * self.led_v * self.led_a

    @property
    def input_w(self) -> float:
        """Power at the plug."""
        return self.led_w + sum(losses_w(self).values())

    @property
    def input_a(self) -> float:
        """Current at the plug."""
        return self.input_w / self.v_in

    @property
    def efficiency(self) -> float:
        """Power of the LEDs over power at the plug."""
        return self.led_w / self.input_w

    @property
    def peak_a(self) -> float:
        """Largest current in inductor and switch."""
        return self.v_out * self.led_a / (self.v_in * self.efficiency) + self.ripple_a / 2

    @property
    def most_output_a(self) -> float:
        """Output current at which the switch reaches its limit."""
        return self.v_in * (I_LIMIT - self.ripple_a / 2) * self.efficiency / self.v_out

    @property
    def output_ripple_v(self) -> float:
        """Ripple of the output with what the capacitor keeps under voltage."""
        kept = OUTPUT_SHARE_AT_BIAS * self.c_out_f
        return (self.v_out - self.v_in) * self.led_a / (self.v_out * F_SWITCH * kept)


def losses_w(driver: Driver) -> dict[str, float]:
    """Power lost in each part; the inductor's current is a triangle on its mean (continuous conduction).

    The mean is found from the power it must carry, itself included, by fixed point: it converges to 1e-9 in ten steps.
    """
    mean_a = driver.v_out * driver.led_a / driver.v_in
    lost: dict[str, float] = {}
    for _ in range(30):
        square = mean_a**2 + driver.ripple_a**2 / 12
        swing = driver.v_out + driver.v_diode
        lost = {
            "switch conducting": driver.duty * square * SWITCH_OHM,
            "switch turning": 0.5 * swing * mean_a * TRANSITION_S * F_SWITCH,
            "switch node": 0.5 * SWITCH_FARAD * swing**2 * F_SWITCH,
            "inductor": square * INDUCTOR_OHM,
            "diode": driver.v_diode * driver.led_a,
            "sense resistor": V_REFERENCE * driver.led_a,
            "controller": QUIESCENT_A * driver.v_in,
        }
        before, mean_a = mean_a, (driver.led_w + sum(lost.values())) / driver.v_in - QUIESCENT_A
        if abs(mean_a - before) < 1e-12:
            break
    return lost


def sense_resistor_ohm(led_a: float) -> float:
    """Standard value (E24) nearest to V_FB / I by ratio."""
    wanted = V_REFERENCE / led_a
    decade = 10.0 ** math.floor(math.log10(wanted))
    values = [decade * step * value / 10 for step in (0.1, 1.0, 10.0) for value in _E24]
    return min(values, key=lambda value: abs(math.log(value / wanted)))


def choose_driver(led_count: int = LED_COUNT, led_a: float = 0.020) -> Driver:
    """Choose the values for a string.

    The inductor is the smallest standard value that keeps its current from stopping when it is 20 % low: below that
    the converter's ripple, and with it its losses, more than double (data sheet, 9.1.2).

    Args:
        led_count: LEDs in the string.
        led_a: wanted current.

    Raises:
        ParameterError: LED count outside what the board takes.
    """
    led_azimuths_deg(led_count)
    first = Driver(
        led_count,
        led_part("led").value,
        sense_resistor_ohm(led_a),
        INDUCTORS_H[-1],
        led_part("c_in").value,
        led_part("c_out").value,
        led_part("c_comp").value,
        v_diode=led_part("diode").value,
    )
    for inductance in INDUCTORS_H:
        low = replace(first, inductance_h=inductance * (1 - INDUCTANCE_SPREAD))
        if low.ripple_a / 2 < low.input_a:
            return replace(first, inductance_h=inductance)
    return first


def fitted_driver(led_count: int = LED_COUNT) -> Driver:
    """The driver as the parts' table has it: what is really soldered."""
    return replace(choose_driver(led_count), r_set_ohm=led_part("r_set").value, inductance_h=led_part("inductor").value)
