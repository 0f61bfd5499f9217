"""Command line of the simulator: one press with its certificate, or a labelled data set."""

from __future__ import annotations

import argparse
import sys

from cad.errors import EndcapError
from cad.extras import program
from cad.materials import DEFAULT_SILICONE, silicone
from cad.messages import LOG, announced, show
from sensing.arguments import number, silicone_name
from sensing.simulator.contact.indenter import Indenter, known_kinds, require_used
from sensing.simulator.dataset import cli as data_cli
from sensing.simulator.levels import Simulator
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.mesh import DENSITIES
from sensing.simulator.solid.shell import PLAIN

PATIENCE_S = 3.0  # s; a press takes 2 s, and one that takes longer is announced


def main(arguments: list[str] | None = None) -> int:
    """Run a command; returns the exit status (0, or 2 for what the user can fix)."""
    options = _parser().parse_args(arguments)
    try:
        return int(options.run(options))
    except EndcapError as error:
        LOG.error(f"sensing.simulator: {error}")
        return 2
    except KeyboardInterrupt:
        LOG.error(f"sensing.simulator: {options.stopped}")
        return 130


def _press(options: argparse.Namespace) -> int:
    require_used(options.body, radius=options.radius, axis=options.axis)
    given = {"radius_mm": options.radius, "axis_deg": options.axis}
    geometry, law = shell_geometry(options.diameter, options.wall), silicone(options.silicone).neo_hooke()
    text = "pressing: half a minute more where the simulator must be compiled, once on this computer"
    with announced(text, PATIENCE_S):
        state = Simulator(geometry, law, options.density, level=1, interlock=options.interlock).press(
            options.normal if options.depth is None else None, options.tilt, (options.meridian, options.lateral),
            options.depth, friction=options.friction, kind=options.body,
            **{name: value for name, value in given.items() if value is not None},
        )  # fmt: skip
    certificate = state.certificate
    assert certificate is not None
    show(f"depth       {state.depth_mm:.3f} mm at a normal force of {state.normal_n:.3f} N")
    force, torque = (" ".join(f"{value:9.4f}" for value in values) for values in (state.force_n, state.torque_nm))
    show(f"force       {force} N   (on the endcap, endcap frame)")
    show(f"torque      {torque} N m (about the centre of the mating plane)")
    points = 0 if state.patch is None else len(state.patch.area)
    slip = f"{100 * state.slip_share:.0f} % of the load slipped in the last step" if options.friction else "no friction"
    show(f"patch       {state.patch_mm2:.0f} mm2, counted in {points} points of the mesh; {slip}")
    show(
        f"certificate residual {certificate.residual:.1e}, clamp against tractions {certificate.wrench_gap:.1e}, "
        f"penetration {certificate.penetration_mm:.4f} mm, negative pivots {certificate.negative_pivots}, "
        f"dN/dd {certificate.force_stiffness_n_mm:.2f} N/mm"
    )
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=program("python -m sensing.simulator"), description=__doc__)
    started = program("")  # "endcap press": its last word is the name of a parser below
    commands = parser.add_subparsers(required=True, prog=started.rsplit(" ", 1)[0] if started else None)
    press = commands.add_parser(
        "press", help="press the shell once and print wrench and certificate", description=_press_text()
    )
    _shell_options(press)
    press.add_argument("--tilt", type=number, default=30, help="polar angle of first contact, degrees (default 30)")
    how_far = press.add_mutually_exclusive_group()
    how_far.add_argument("--normal", type=number, default=20, help="normal force, N (default 20)")
    how_far.add_argument(
        "--depth", type=number, metavar="MM",
        help="press to that depth instead, mm: also past a snap, where the force falls",
    )  # fmt: skip
    press.add_argument("--meridian", type=number, default=0, help="tangential travel away from the tip, mm")
    press.add_argument("--lateral", type=number, default=0, help="tangential travel across, mm (needs the whole mesh)")
    press.add_argument("--friction", type=number, default=0.5, help="Coulomb coefficient (default 0.5)")
    press.add_argument(
        "--indenter", "--body", dest="body", choices=known_kinds(), default="plane", help="what presses (default plane)"
    )
    press.add_argument(
        "--radius", type=number, help=f"radius of sphere, edge or crest, mm (default {Indenter.radius_mm:g})"
    )
    press.add_argument(
        "--axis",
        type=number,
        help=f"direction of an edge or of rows of crests from the meridian, degrees (default {Indenter.axis_deg:g})",
    )
    press.set_defaults(run=_press, stopped="stopped")
    data = commands.add_parser(
        "data",
        help="write labelled, rendered frames",
        description=data_cli.DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    data_cli.add_options(data)
    data.set_defaults(run=data_cli.run, stopped="stopped; run the same command again to go on")
    return parser


def _press_text() -> str:
    return "Press the shell once. Example: python -m sensing.simulator press --tilt 30 --normal 20 --friction 0.5"


def _shell_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--diameter", type=number, default=130, help="diameter D, mm (default 130)")
    parser.add_argument("--wall", type=number, default=8, help="wall T, mm (default 8)")
    parser.add_argument(
        "--silicone",
        type=silicone_name,
        default=DEFAULT_SILICONE,
        help=f"row of the table (default {DEFAULT_SILICONE})",
    )
    parser.add_argument(
        "--interlock", type=number, default=PLAIN, metavar="RATIO",
        help="stiffness of the zone with TPU gyroid over the silicone's (default 1; Smooth-Sil 950: 1.49)",
    )  # fmt: skip
    parser.add_argument("--density", default="data", help=f"mesh: {', '.join(DENSITIES)} (default data)")


if __name__ == "__main__":
    sys.exit(main())
