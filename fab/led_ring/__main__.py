"""Command `python -m fab.led_ring`: circuit, board files, pictures and checks of the LED ring, from the LED count."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from cad.led_ring.placement import LED_COUNT, LED_RANGE, placements
from cad.messages import show
from cad.options import parse_design, parse_length
from cad.params import EndcapParams
from cad.typed_folder import EXPORTS
from fab.checks.check import Check, require_passed
from fab.command import Command
from fab.exports.whole_folder import whole_folder, write_record
from fab.led_ring.bom import bom_csv, placement_csv, ring_bom
from fab.led_ring.budget import (
    conduction_report,
    corners,
    driver_checks,
    temperatures_c,
    thermal_checks,
    warmest_room_c,
)
from fab.led_ring.circuit import circuit_checks, netlist
from fab.led_ring.driver import Driver, fitted_driver, losses_w
from fab.variant import camera_words, size_words

RECORD = "led_ring.json"
HELP = f"""\
options, as NAME=VALUE:
  D=130 T=8        the endcap whose dome the ring lights (light and temperatures alone depend on it)
  leds={LED_COUNT}           LEDs in the string, {LED_RANGE[0]} to {LED_RANGE[1]}
  exports=DIR      folder that receives led_ring/, led_ring_D150_T9/ and so on (default: exports/)

writes led_ring-gerber.zip (layers and drill file), led_ring-bom.csv, led_ring-placement.csv, led_ring.kicad_pro with
led_ring.kicad_sch (schematic) and led_ring.kicad_pcb (the same copper), led_ring.png, led_ring-light.png and
led_ring.json (values, budget, checks); the folder appears whole or not at all
exit status: 0 written; 1 a check failed; 2 bad input or no place to write; 130 interrupted
"""


COMMAND = Command(
    "make ring",
    "[D=MM] [T=MM] [leds=N] [exports=DIR]",
    "Make the files from which a board house makes and fits the LED ring.",
    HELP,
    {"D": "130", "T": "8", "leds": str(LED_COUNT), "exports": EXPORTS},
)


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    return COMMAND.run(
        argv,
        lambda options, interrupts: make_ring(
            parse_design(options),
            parse_length("leds", options["leds"]),
            Path(options["exports"]),
            interrupts.raise_swallowed,
        ),
    )


def make_ring(
    params: EndcapParams, led_count: float, exports: Path, check_interrupt: Callable[[], None] = lambda: None
) -> int:
    """Make, check and write the ring.

    Args:
        params: the endcap that the ring lights.
        led_count: LEDs in the string.
        exports: folder that receives ``led_ring``.
        check_interrupt: raises KeyboardInterrupt where a library swallowed one.

    Returns:
        0.

    Raises:
        ParameterError: LED count outside the range of the board, or too small for this dome.
        ChecksFailedError: a check failed; nothing is left.
        FileError: the folder cannot be written.
    """
    from fab.led_ring.copper import build_copper
    from fab.led_ring.gerber import board_files, read_archive, write_archive
    from fab.led_ring.kicad import kicad_checks, write_project
    from fab.led_ring.light import dome_light, light_checks, require_even
    from fab.led_ring.picture import draw_board, draw_light
    from fab.led_ring.rules import rule_checks
    from fab.led_ring.schematic_check import schematic_checks

    places, count = placements(led_count), int(led_count)
    driver = fitted_driver(count)
    light = dome_light(params, count)
    require_even(light, params, count)
    copper = build_copper(count)
    final = exports / folder_name(params, count)
    with whole_folder(final, RECORD, check_interrupt) as folder:
        write_archive(board_files(copper), folder / "led_ring-gerber.zip")
        layers, holes = read_archive(folder / "led_ring-gerber.zip")
        write_project(copper, count, folder)
        checks = [
            *driver_checks(driver),
            *thermal_checks(driver, params),
            *circuit_checks(netlist(count), count),
            *rule_checks(layers, holes, copper.pads, places),
            *light_checks(light),
            *kicad_checks(folder / "led_ring.kicad_pcb", layers, count),
            *schematic_checks(folder / "led_ring.kicad_sch", folder / "led_ring.kicad_pcb", count),
        ]
        require_passed(checks, "of the ring")
        (folder / "led_ring-bom.csv").write_text(bom_csv(ring_bom(count)), encoding="utf-8")
        (folder / "led_ring-placement.csv").write_text(placement_csv(count), encoding="utf-8")
        draw_board(layers, holes, places, folder / "led_ring.png")
        draw_light(light, f"{size_words(params)}, {count} LEDs", folder / "led_ring-light.png")
        write_record(folder, RECORD, ring_report(driver, params, checks))
    show(f"{final}: {count} LEDs, {_supply_words(driver)}, all {len(checks)} checks passed")
    return 0


def _supply_words(driver: Driver) -> str:
    return f"{1e3 * driver.input_a:.0f} mA at {driver.v_in:g} V, efficiency {driver.efficiency:.0%}"


def folder_name(params: EndcapParams, led_count: int) -> str:
    """Name of the ring's folder: ``led_ring`` and each parameter that is not the default; no ring replaces another.

    Args:
        params: the design.
        led_count: LEDs in the string.
    """
    parts = ["led_ring"]
    if params != EndcapParams(float(COMMAND.defaults["D"]), float(COMMAND.defaults["T"])):
        parts.append(params.label)
    if led_count != LED_COUNT:
        parts.append(f"{led_count}leds")
    return "_".join((*parts, *camera_words()))


def ring_report(driver: Driver, params: EndcapParams, checks: Sequence[Check]) -> dict[str, object]:
    """Values, budget and checks of the ring for manifest and sheet.

    Args:
        driver: the circuit.
        params: the design.
        checks: results of the gates.
    """
    return {
        "parameters": {"diameter_mm": params.diameter_mm, "wall_mm": params.wall_mm, "leds": driver.led_count},
        "circuit": {
            "r_set_ohm": driver.r_set_ohm,
            "inductance_h": driver.inductance_h,
            "c_in_f": driver.c_in_f,
            "c_out_f": driver.c_out_f,
            "c_comp_f": driver.c_comp_f,
            "led_a": driver.led_a,
            "string_v": driver.v_out,
            "duty": _figures(driver.duty),
            "peak_a": _figures(driver.peak_a),
            "input_a": _figures(driver.input_a),
            "efficiency": _figures(driver.efficiency),
            "input_a_at_the_worst_corner": _figures(max(at.input_a for at in corners(driver))),
        },
        "inductor_current": {
            name: value if isinstance(value, bool) else _figures(value)
            for name, value in conduction_report(driver).items()
        },
        "losses_w": {name: _figures(loss) for name, loss in losses_w(driver).items()},
        "temperatures_c_in_a_room_of_25": {
            name: _figures(value) for name, value in temperatures_c(driver, params, 25.0).items()
        },
        "warmest_room_for_a_petg_spacer_c": _figures(warmest_room_c(driver, params)),
        "bom": [vars(line) for line in ring_bom(driver.led_count)],
        "nets": {name: [f"{ref}.{pin}" for ref, pin in pins] for name, pins in netlist(driver.led_count).items()},
        "checks": [check.record(6) for check in checks],
    }


def _figures(value: float) -> float:
    return float(f"{value:.6g}")


if __name__ == "__main__":
    sys.exit(main())
