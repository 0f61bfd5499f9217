"""The command ``python -m endcap.robot_model``: MJCF, URDF, meshes, USD, checked; one folder, whole or not at all."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path

from cad.errors import ParameterError
from cad.messages import show
from cad.plain_numbers import is_plain, plain
from fab.command import VARIANT_DEFAULTS, Command, Interrupts, parse_variant
from fab.exports.whole_folder import whole_folder
from fab.progress import Progress

FOLDER = "robot_model"
HELP = """\
options, as NAME=VALUE:
  D=130 T=8             the design: writes exports/D130_T8/robot_model/
  material='Smooth-Sil 950'   row of cad/materials.csv
  friction=0.8          Coulomb's mu of silicone and ground
  gyroid=, dots=, dot_mm=, robot=, joint_clearance=   as in make molds: mass, and the name of the folder
  exports=DIR           another folder

Writes endcap.xml (MJCF), endcap.urdf, base.stl and shell.stl (m), check.csv, robot_model.json, and endcap.usda where
usd-core is installed. With mujoco installed the file is loaded and pressed before it is kept (docs/robot_model.md).
exit status: 0 written; 1 a check failed; 2 bad input; 130 interrupted
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    command = Command(
        "make robot-model", "[D=130 T=8 material=... friction=0.8 exports=DIR]",
        "One endcap for robot simulators: MJCF, URDF, USD.", HELP, {**VARIANT_DEFAULTS, "friction": "0.8"},
    )  # fmt: skip
    return command.run(arguments, _act)


def _friction(text: str) -> float:
    value = float(text) if is_plain(text) else math.nan
    if not 0 < value <= 3:
        what = f"{plain(value)} is not above 0 and at most 3" if is_plain(text) else f"{text} is not a number"
        raise ParameterError(
            f"friction={what}: give Coulomb's mu of silicone and ground as a plain number, for example 0.8",
            name="friction", value=text,
        )  # fmt: skip
    return value


def _act(options: dict[str, str], interrupts: Interrupts) -> int:
    variant = parse_variant(options)
    friction = _friction(options["friction"])
    from endcap.robot_model.folder import RECORD, write_robot_model

    final = Path(options["exports"]) / variant.label / FOLDER
    check_interrupt = interrupts.raise_swallowed
    with Progress(check_interrupt) as progress, whole_folder(final, RECORD, check_interrupt) as folder:
        said = write_robot_model(variant, friction, folder, progress)
    for line in said:
        show(line)
    show(f"{final / 'endcap.xml'}: {variant.label} for MuJoCo, {progress.seconds:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
