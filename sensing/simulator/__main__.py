"""Command line of the simulator: one press with its certificate, or a labelled data set."""

from __future__ import annotations

import argparse
import sys

import numpy as np

from cad.errors import EndcapError
from cad.materials import DEFAULT_SILICONE, silicone
from cad.plain_numbers import plain_number
from sensing.simulator.contact.indenter import KINDS, Indenter
from sensing.simulator.dataset import cli as data_cli
from sensing.simulator.press.press import Press, Target
from sensing.simulator.press.state import contact_patch
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.mesh import DENSITIES
from sensing.simulator.solid.shell import shell_model


def main(arguments: list[str] | None = None) -> int:
    """Run a command; returns the exit status (0, or 2 for what the user can fix)."""
    options = _parser().parse_args(arguments)
    try:
        return int(options.run(options))
    except EndcapError as error:
        print(error, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("stopped; run the same command again to go on", file=sys.stderr)
        return 130


def _press(options: argparse.Namespace) -> int:
    model = shell_model(
        shell_geometry(options.diameter, options.wall),
        silicone(options.silicone).neo_hooke(),
        options.density,
        half=options.lateral == 0,
    )
    press = Press(model, Indenter(options.tilt, options.body, options.radius), options.friction)
    state = press.start()
    for share in np.linspace(0, 1, max(1, round(options.normal / 5)) + 1)[1:]:
        state = press.advance(state, Target(normal_n=float(share * options.normal)))
    if options.meridian or options.lateral:
        state = press.advance(state, Target(normal_n=options.normal, shift_mm=(options.meridian, options.lateral)))
    patch, certificate = contact_patch(model, state), state.certificate
    assert certificate is not None
    force, torque = state.wrench[:3], state.wrench[3:] / 1000
    area = patch.area_mm2 / model.force_share
    print(f"depth       {state.depth_mm:.3f} mm at a normal force of {state.normal_n:.3f} N")
    print("force       " + " ".join(f"{v:9.4f}" for v in force) + " N   (on the endcap, endcap frame)")
    print("torque      " + " ".join(f"{v:9.4f}" for v in torque) + " N m (about the centre of the mating plane)")
    print(f"patch       {area:.0f} mm2, {100 * patch.slip_share:.0f} % of the load slipping")
    print(
        f"certificate residual {certificate.residual:.1e}, clamp against tractions {certificate.wrench_gap:.1e}, "
        f"penetration {certificate.penetration_mm:.4f} mm, negative pivots {certificate.negative_pivots}, "
        f"dN/dd {certificate.force_stiffness_n_mm:.2f} N/mm"
    )
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m sensing.simulator", description=__doc__)
    commands = parser.add_subparsers(required=True)
    press = commands.add_parser(
        "press", help="press the shell once and print wrench and certificate", description=_press_text()
    )
    _shell_options(press)
    press.add_argument("--tilt", type=float, default=30, help="polar angle of first contact, degrees (default 30)")
    press.add_argument("--normal", type=float, default=20, help="normal force, N (default 20)")
    press.add_argument("--meridian", type=float, default=0, help="tangential travel away from the tip, mm")
    press.add_argument("--lateral", type=float, default=0, help="tangential travel across, mm (needs the whole mesh)")
    press.add_argument("--friction", type=float, default=0.5, help="Coulomb coefficient (default 0.5)")
    press.add_argument("--body", choices=list(KINDS), default="plane", help="what presses (default plane)")
    press.add_argument("--radius", type=float, default=20, help="radius of sphere or edge, mm")
    press.set_defaults(run=_press)
    data = commands.add_parser(
        "data",
        help="write labelled, rendered frames",
        description=data_cli.DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    data_cli.add_options(data)
    data.set_defaults(run=data_cli.run)
    return parser


def _press_text() -> str:
    return "Example: python -m sensing.simulator press --tilt 30 --normal 20 --friction 0.5"


def _shell_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--diameter", type=plain_number, default=130, help="diameter D, mm (default 130)")
    parser.add_argument("--wall", type=plain_number, default=8, help="wall T, mm (default 8)")
    parser.add_argument("--silicone", default=DEFAULT_SILICONE, help=f"row of the table (default {DEFAULT_SILICONE})")
    parser.add_argument("--density", default="data", help=f"mesh: {', '.join(DENSITIES)} (default data)")


if __name__ == "__main__":
    sys.exit(main())
