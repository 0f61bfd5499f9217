"""What goes into the folder: files, what the model is and how wrong it is, and what stops it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from cad.identity import identity
from cad.messages import LOG
from endcap.robot_model import checked, usd
from endcap.robot_model.parts import EndcapParts, endcap_parts
from endcap.robot_model.urdf import endcap_urdf
from fab.checks.check import require_passed
from fab.exports.whole_folder import write_record
from fab.meshing.mesh import write_stl
from fab.variant import Variant
from sensing.simulator.robot_model.errors import TORQUE_LIMIT, FitErrors, fit_errors
from sensing.simulator.robot_model.mjcf import Inertial, endcap_file, endcap_pieces
from sensing.simulator.robot_model.model import CARRIED_KG, RobotModel, robot_model
from sensing.simulator.robot_model.stiffness import DEPTHS_MM

RECORD = "robot_model.json"
MJCF, URDF, USD, TABLE = "endcap.xml", "endcap.urdf", "endcap.usda", "check.csv"
MESHES = {"base": "base.stl", "shell": "shell.stl"}
FIGURES = 6
SENSORS = (
    "the force and torque sensors say what the endcap does to the world: their negative is what the world does to the "
    "endcap, in the endcap frame, about the centre of the mating plane, with weight and inertia of the moving shell"
)


@dataclass(frozen=True)
class RobotModelFiles:
    """What the files are made of.

    Attributes:
        variant: the design.
        model: springs.
        parts: masses and meshes.
        errors: errors of the springs.
    """

    variant: Variant
    model: RobotModel
    parts: EndcapParts
    errors: FitErrors

    @property
    def facts(self) -> list[str]:
        """What the model is and how wrong it is, a line each."""
        spring, found, depths = self.model.stiffness, self.errors, f"{DEPTHS_MM[0]:g} to {DEPTHS_MM[1]:g} mm"
        damping = (
            f"damping {1000 * self.model.damping_s:.3g} ms of the stiffness: the silicone's Prony series (order of "
            f"magnitude, E) in the bounce of {CARRIED_KG:g} kg"
            if self.model.damping_s
            else "no damping: the silicone has no Prony series in cad/materials.csv"
        )
        return [
            f"springs of the sphere's centre: radial {spring.radial_n_mm:.4g} N/mm + {spring.radial_cubic_n_mm3:.4g} "
            f"N/mm3, axial {spring.axial_n_mm:.4g} N/mm + {spring.axial_cubic_n_mm3:.4g} N/mm3",
            f"normal force against the pressed shell, {depths} at 0, 25 and 50 degrees, less deep at seven tilts more: "
            f"within {100 * found.fitted:.1f} % at tilts of the fit, {100 * found.held_out:.1f} % at tilts held out",
            f"shear force after the same travel sideways: {found.shear:.2f} of the shell's (median)",
            f"torque at the mount within {100 * TORQUE_LIMIT:.0f} %: {100 * found.torque_same_force:.0f} % of the "
            f"states under the shell's force, {100 * found.torque_same_motion:.0f} % after its motion: not published",
            damping,
        ]

    @property
    def comment(self) -> str:
        """First lines of the MJCF file."""
        lines = [
            f"Endcap {self.variant.label} of {self.model.silicone}, made by make robot-model. m, kg, s, N.",
            "Frame of body endcap: origin at the centre of the mating plane, z to the tip.",
            *(fact[0].upper() + fact[1:] + "." for fact in self.facts),
            SENSORS[0].upper() + SENSORS[1:] + ".",
            "Needs the options below, and MuJoCo 4 (springs with a cubic term). See docs/robot_model.md.",
        ]
        return "\n".join(lines)

    def record(self, found: checked.Checked | None) -> dict[str, Any]:
        """The record's content.

        Args:
            found: in MuJoCo; None where it was not checked.
        """
        bodies = self.parts.bodies
        masses = {**self.parts.by_part, "silicone": self.parts.silicone}
        return {
            "label": self.variant.label,
            "identity": identity(self.variant.params, self.model.silicone).record(),
            "units": "m, kg, s, N, N m but where a name says mm or g",
            "sensors": SENSORS,
            "mass_g": {name: _figures(1000 * one.mass_kg) for name, one in masses.items()},
            "whole": _inertial(bodies.whole),
            "base": _inertial(bodies.base),
            "moving_shell": _inertial(bodies.shell),
            "stiffness": {name: _figures(value) for name, value in asdict(self.model.stiffness).items()},
            "damping_s": _figures(self.model.damping_s),
            "friction": self.model.friction,
            "torsion_m": _figures(self.model.torsion_m),
            "errors": asdict(self.errors),
            "facts": self.facts,
            "mujoco": checked.NOT_CHECKED if found is None else _checks(found),
        }


def write_robot_model(variant: Variant, friction: float, folder: Path, progress: Callable[[str], None]) -> list[str]:
    """Write every file, load the MJCF and press it.

    Args:
        variant: the design.
        friction: Coulomb's mu.
        folder: empty folder for the files.
        progress: called with the name of each step as it begins.

    Returns:
        What the command prints, a line each.

    Raises:
        ChecksFailedError: the file does not do what it says in MuJoCo. ParameterError: a shell that cannot be fitted.
    """
    progress("springs")
    model = robot_model(variant.params, variant.silicone, friction)
    files = RobotModelFiles(variant, model, endcap_parts(variant, progress), fit_errors(model))
    progress("files")
    bodies, title = files.parts.bodies, f"endcap_{variant.label}"
    for name, mesh in files.parts.drawn.items():
        write_stl(folder / MESHES[name], mesh)
    pieces = endcap_pieces(model, bodies, meshes=MESHES)
    (folder / MJCF).write_text(endcap_file(pieces, title, files.comment), encoding="utf-8")
    (folder / URDF).write_text(endcap_urdf(model, bodies.whole, MESHES, title), encoding="utf-8")
    lines = [f"{1000 * bodies.whole.mass_kg:.0f} g", *files.facts]
    if usd.is_installed():
        usd.write_usd(folder / USD, model, bodies.whole, files.parts.drawn)
    else:
        lines.append(usd.MISSING)
    found = _checked(folder, model, progress)
    lines += [checked.NOT_CHECKED] if found is None else [_said(found)]
    write_record(folder, RECORD, files.record(found))
    return lines


def _checked(folder: Path, model: RobotModel, progress: Callable[[str], None]) -> checked.Checked | None:
    if not checked.is_installed():
        return None
    progress("pressed in MuJoCo")
    found = checked.check_in_mujoco(folder / MJCF, model)
    require_passed(found.gates, "in MuJoCo")
    if found.force_error > checked.FORCE_LIMIT:
        LOG.warning(f"goal missed: {_said(found)}; the limit is {100 * checked.FORCE_LIMIT:.0f} %")
    (folder / TABLE).write_text(found.table, encoding="utf-8")
    return found


def _said(found: checked.Checked) -> str:
    return (
        f"in MuJoCo, {len(found.rows)} states, two carried masses: normal force within {100 * found.force_error:.1f} % "
        f"of the shell's, creep {found.creep_mm_s:.2g} mm/s"
    )


def _checks(found: checked.Checked) -> dict[str, Any]:
    return {
        "force_error": _figures(found.force_error),
        "force_within_limit": found.force_error <= checked.FORCE_LIMIT,
        "checks": [check.record(FIGURES) for check in found.gates],
        "table": TABLE,
    }


def _inertial(one: Inertial) -> dict[str, Any]:
    return {
        "mass_kg": _figures(one.mass_kg),
        "centre_m": [_figures(value) for value in one.centre_m],
        "inertia_kg_m2": [[_figures(value) for value in row] for row in one.inertia_kg_m2],
    }


def _figures(value: float) -> float:
    return float(f"{value:.{FIGURES}g}")
