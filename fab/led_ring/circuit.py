"""Netlist of the LED ring, and its electrical rule check.

The circuit is the typical application of the TPS61165 (SLVS790E, figure on page 1): supply, inductor, switch node,
Schottky diode, output capacitor, the string, sense resistor; CTRL is tied to the supply, so the light is on while the
plug has power.
Pins of the SOT-23-6 package: 1 VIN, 2 CTRL, 3 SW, 4 GND, 5 COMP, 6 FB (DBV; compare with your data sheet).
"""

from __future__ import annotations

from collections import Counter

from cad.led_ring.placement import LED_COUNT, placements
from fab.checks.check import Check

Pin = tuple[str, str]  # reference, pin
Netlist = dict[str, tuple[Pin, ...]]
PINS = {
    "driver": ("1", "2", "3", "4", "5", "6"),
    "inductor": ("1", "2"),
    "diode": ("K", "A"),
    "c_in": ("1", "2"),
    "c_out": ("1", "2"),
    "c_comp": ("1", "2"),
    "r_set": ("1", "2"),
    "plug": ("1", "2", "M1", "M2"),
    "led": ("A", "K"),
}


def netlist(led_count: int = LED_COUNT) -> Netlist:
    """Nets by name, each with its pins.

    Args:
        led_count: LEDs in the string.
    """
    nets: dict[str, tuple[Pin, ...]] = {
        "VIN": (("J1", "1"), ("C1", "1"), ("L1", "1"), ("U1", "1"), ("U1", "2")),
        "GND": (
            *(("J1", pin) for pin in ("2", "M1", "M2")),
            *((part, "2") for part in ("C1", "C2", "C3", "R1")),
            ("U1", "4"),
        ),
        "SW": (("L1", "2"), ("U1", "3"), ("D1", "A")),
        "VOUT": (("D1", "K"), ("C2", "1"), ("LED1", "A")),
        "COMP": (("U1", "5"), ("C3", "1")),
        "FB": (("U1", "6"), ("R1", "1"), (f"LED{led_count}", "K")),
    }
    for k in range(1, led_count):
        nets[f"N{k}"] = ((f"LED{k}", "K"), (f"LED{k + 1}", "A"))
    return nets


def circuit_checks(nets: Netlist, led_count: int = LED_COUNT) -> list[Check]:
    """Electrical rules, each with the number of its violations.

    Every pin in exactly one net; no net with a single pin; every part between two different nets; the string one
    chain of LEDs, all in the same sense, from the output to the sense resistor.
    """
    uses = Counter(pin for pins in nets.values() for pin in pins)
    wanted = [(p.reference, pin) for p in placements(led_count) for pin in PINS[p.kind]]
    net_of = {pin: name for name, pins in nets.items() for pin in pins}
    shorted = [
        p.reference
        for p in placements(led_count)
        if len({net_of.get((p.reference, pin)) for pin in PINS[p.kind][:2]}) < 2 and p.kind != "driver"
    ]
    return [
        Check("ring.unconnected_pins", float(sum(pin not in uses for pin in wanted)), high=0),
        Check("ring.unknown_pins", float(sum(pin not in wanted for pin in uses)), high=0),
        Check("ring.pins_in_two_nets", float(sum(count > 1 for count in uses.values())), high=0),
        Check("ring.single_pin_nets", float(sum(len(pins) < 2 for pins in nets.values())), high=0),
        Check("ring.shorted_parts", float(len(shorted)), high=0),
        Check("ring.leds_in_string", float(string_length(net_of)), led_count, led_count),
    ]


def string_length(net_of: dict[Pin, str]) -> int:
    """Number of LEDs in series from the output to the sense resistor, anode to cathode; 0 if the chain ends elsewhere.

    Args:
        net_of: net of each pin.
    """
    net, count = "VOUT", 0
    anodes = {name: pin[0] for pin, name in net_of.items() if pin[1] == "A" and pin[0].startswith("LED")}
    while net in anodes and count <= len(anodes):
        net = net_of.get((anodes[net], "K"), "")
        count += 1
    return count if net == "FB" else 0
