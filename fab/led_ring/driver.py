"""Electrical design of the LED ring: values from the data sheet's equations, and its budget at the USB plug.

SI units throughout (volt, ampere, ohm, henry, farad, watt, kelvin). Equations and limits are those of the TPS61165
data sheet (Texas Instruments SLVS790E, sections 7.2, 7.6, 8.3.2, 9.1.1 to 9.1.5, 9.2.1.2.5); the string is the paper's.

    current        I_LED = V_FB / R_set
    string         V_out = n V_LED + V_FB
    ripple         I_P = 1 / (L f_s (1 / (V_out + V_F - V_in) + 1 / V_in))  peak to peak, if the current never stops
    inductor       I_L = P_in / V_in - I_q, the mean: the controller's own current does not flow through it
    conduction     c = min(1, sqrt(2 I_L / I_P)), the share of the period in which the current flows
    peak           I_L + I_P / 2 where c = 1, else c I_P
    duty           D = c (1 - V_in / (V_out + V_F))
    limit          I_max = V_in (I_lim - I_P / 2) eta / V_out
    output ripple  V_ripple = (1 - c V_in / (V_out + V_F)) I_LED / (C_out f_s)

The current stops (discontinuous conduction, c < 1) where its mean is less than half its ripple. A triangle from zero
to I_pk that rises for D / f_s and falls to zero has the mean I_pk^2 / (2 I_P), whence c. The regulator holds the
current of the LEDs either way, so their light is the same; losses and ripple are counted for both.

The efficiency is a sum of losses (:func:`losses_w`), of which the transition time of the switch and its capacitance
are our estimates (E); everything else is from data sheets. It is compared with the paper's 86 %, not fitted to it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from cad.errors import ParameterError
from cad.led_ring.parts import led_part
from cad.led_ring.placement import LED_COUNT, led_azimuths_deg

V_REFERENCE = 0.200  # S, LED01: V_FB, 0.196 to 0.204
V_REFERENCE_SPREAD = 0.02  # S
RESISTOR_SPREAD = 0.01  # 1 % part
V_PROTECTION = (37.0, 39.0)  # S: open-LED protection at the SW pin, least and most
V_SWITCH_RATING = 40.0  # S: absolute maximum at SW
I_LIMIT = 0.96  # S: least current limit of the switch
I_START_LIMIT = 0.7  # S: while it starts
F_SWITCH = 1.2e6  # S
F_SWITCH_RANGE = (1.0e6, 1.5e6)  # S
DUTY_MAX = 0.90  # S: least of the maximum duty
SWITCH_OHM = 0.6  # S: most at V_in 3.6 V
QUIESCENT_A = 2.3e-3  # S: while switching
TRANSITION_S = 2 * 8e-9  # E: rise and fall of the SW pin
SWITCH_FARAD = 60e-12  # E: capacitance at the SW pin: switch, diode, pads
INDUCTOR_OHM = 0.45  # E: 22 uH in 4 x 4 x 1.8 mm
INDUCTOR_SATURATION_A = 0.6  # E: lower bound; see the data sheet of the part
INDUCTANCE_SPREAD = 0.20  # S
INDUCTANCE_RANGE_H = (10e-6, 22e-6)  # S: recommended range of the nominal value
CAPACITOR_SPREAD = 0.10  # S: X5R and X7R of 10 %
OUTPUT_SHARE_AT_BIAS = 0.55  # E: share of its capacitance that a 50 V X7R capacitor has at 25 V
C_OUT_RANGE_F = (1e-6, 10e-6)  # S: recommended
C_IN_LEAST_F = 1e-6  # S
USB_INRUSH_F = 10e-6  # S: USB 2.0, 7.2.4.1: most capacitance at the plug
DIODE_RATING_V = 40.0  # S: MBR0540
LED_V_SPREAD = (-0.3, 0.4)  # E: lowest bin, hot; highest bin, cold
RIPPLE_V = 0.1  # E: 0.4 % of the string: no visible change of brightness
_E24 = (10, 11, 12, 13, 15, 16, 18, 20, 22, 24, 27, 30, 33, 36, 39, 43, 47, 51, 56, 62, 68, 75, 82, 91)


@dataclass(frozen=True)
class Driver:
    """Values of the circuit.

    Attributes:
        led_count: LEDs in the one string.
        led_v: forward voltage of one LED.
        r_set_ohm: current sense resistor.
        inductance_h, c_in_f, c_out_f, c_comp_f: nominal values.
        v_in: supply at the plug.
        v_diode: forward voltage of the Schottky diode.
        f_switch_hz: switching frequency.
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
    f_switch_hz: float = F_SWITCH

    @property
    def led_a(self) -> float:
        """Current of the string."""
        return V_REFERENCE / self.r_set_ohm

    @property
    def v_out(self) -> float:
        """Voltage of string and sense resistor."""
        return self.led_count * self.led_v + V_REFERENCE

    @property
    def swing_v(self) -> float:
        """Voltage at the SW pin while the diode conducts."""
        return self.v_out + self.v_diode

    @property
    def ripple_a(self) -> float:
        """Peak-to-peak current in the inductor in continuous conduction."""
        return 1 / (self.inductance_h * self.f_switch_hz * (1 / (self.swing_v - self.v_in) + 1 / self.v_in))

    @property
    def mean_a(self) -> float:
        """Mean current in the inductor."""
        return self.input_a - QUIESCENT_A

    @property
    def conduction(self) -> float:
        """Share of the period in which the inductor's current flows; 1 where it never stops."""
        return conducting_share(self.mean_a, self.ripple_a)

    @property
    def duty(self) -> float:
        """Share of the period in which the switch conducts."""
        return self.conduction * (1 - self.v_in / self.swing_v)

    @property
    def led_w(self) -> float:
        """Electrical power of the LEDs alone, the useful power of the efficiency."""
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
        share = self.conduction
        return self.mean_a / share + share * self.ripple_a / 2

    @property
    def most_output_a(self) -> float:
        """Output current at which the switch reaches its limit, in continuous conduction."""
        return self.v_in * (I_LIMIT - self.ripple_a / 2) * self.efficiency / self.v_out

    @property
    def output_ripple_v(self) -> float:
        """Ripple of the output with the capacitance under bias, which alone supplies the LEDs for that time."""
        alone = 1 - self.conduction * self.v_in / self.swing_v
        return alone * self.led_a / (self.f_switch_hz * OUTPUT_SHARE_AT_BIAS * self.c_out_f)


def conducting_share(mean_a: float, ripple_a: float) -> float:
    """Share of the period in which an inductor's current flows.

    Args:
        mean_a: over the whole period.
        ripple_a: peak to peak, in continuous conduction.
    """
    return min(1.0, math.sqrt(2 * mean_a / ripple_a))


def losses_w(driver: Driver) -> dict[str, float]:
    """Power lost in each part; the inductor's current is a triangle about its mean or, where it stops, from zero.

    The mean follows from the power at the plug, losses included, by fixed point: it converges to 1e-9 in ten steps.
    Where the supply cannot give that power at all the inductor's loss is infinite, and so is the current at the plug.
    """
    mean_a, swing, f_hz = driver.v_out * driver.led_a / driver.v_in, driver.swing_v, driver.f_switch_hz
    lost: dict[str, float] = {}
    for _ in range(30):
        share = conducting_share(mean_a, driver.ripple_a)
        flowing_a = mean_a / share  # mean while it flows; also the mean of what the switch turns on and off
        square = share * (flowing_a**2 + (share * driver.ripple_a) ** 2 / 12)
        lost = {
            "switch conducting": (1 - driver.v_in / swing) * square * SWITCH_OHM,
            "switch turning": 0.5 * swing * flowing_a * TRANSITION_S * f_hz,
            "switch node": 0.5 * SWITCH_FARAD * swing**2 * f_hz,
            "inductor": square * INDUCTOR_OHM,
            "diode": driver.v_diode * driver.led_a,
            "sense resistor": V_REFERENCE * driver.led_a,
            "controller": QUIESCENT_A * driver.v_in,
        }
        before, mean_a = mean_a, (driver.led_w + sum(lost.values())) / driver.v_in - QUIESCENT_A
        if mean_a > driver.v_in / INDUCTOR_OHM:  # more than the inductor alone would pass
            return {**lost, "inductor": math.inf}
        if abs(mean_a - before) < 1e-12:
            break
    return lost


def sense_resistor_ohm(led_a: float) -> float:
    """Standard value (E24) nearest to V_FB / I by ratio.

    Args:
        led_a: current of the string.
    """
    wanted = V_REFERENCE / led_a
    decade = 10.0 ** math.floor(math.log10(wanted))
    values = [decade * step * value / 10 for step in (0.1, 1.0, 10.0) for value in _E24]
    return min(values, key=lambda value: abs(math.log(value / wanted)))


def choose_driver(led_count: int = LED_COUNT, led_a: float = 0.020) -> Driver:
    """Choose the values for a string.

    The inductor is the largest of the recommended range: a smaller one has more ripple, and once its current stops the
    converter gives less current, draws a rougher one from the plug and loses more (data sheet, 9.1.2). With the nominal
    values, to which the data sheet's equations belong, the current must not stop; where supply, frequency, inductance
    or LEDs spread it may (where: :func:`fab.led_ring.budget.conduction_report`), and every limit is checked there.

    Args:
        led_count: LEDs in the string.
        led_a: wanted current.

    Raises:
        ParameterError: LED count outside the range of the board, or so little current that the inductor's stops.
    """
    led_azimuths_deg(led_count)
    chosen = Driver(
        led_count,
        led_part("led").value,
        sense_resistor_ohm(led_a),
        INDUCTANCE_RANGE_H[1],
        led_part("c_in").value,
        led_part("c_out").value,
        led_part("c_comp").value,
        v_diode=led_part("diode").value,
    )
    if chosen.conduction < 1:
        raise ParameterError(
            f"led_a={led_a:g} with {led_count} LEDs: the current in the largest inductor that the driver's data sheet "
            f"recommends, {1e6 * chosen.inductance_h:g} uH, stops in every period: take more current or more LEDs",
            name="led_a",
            value=led_a,
        )
    return chosen


def fitted_driver(led_count: int = LED_COUNT) -> Driver:
    """The driver with the values in the table of the parts that are soldered.

    Args:
        led_count: LEDs in the string.
    """
    return replace(choose_driver(led_count), r_set_ohm=led_part("r_set").value, inductance_h=led_part("inductor").value)
