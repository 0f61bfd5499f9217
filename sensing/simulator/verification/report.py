"""The verification report: python -m sensing.simulator.verification writes docs/verification.md and its plots.

Every number in the report is computed by the run that writes its section; --only renews chosen sections. A section is
written as soon as it is computed, so that a later failure does not lose it.
"""

from __future__ import annotations

import argparse
import io
import math
import re
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from cad.errors import EndcapError, FileError
from cad.extras import program
from cad.materials import HyperelasticLaw, hyperelastic_law, silicone
from cad.messages import LOG, show, transient
from cad.whole_file import make_folder, replace_file, require_place
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.press.press import Press, Target
from sensing.simulator.press.state import State
from sensing.simulator.solid import closed_forms
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.shell import ShellModel, shell_model
from sensing.simulator.solid.surface import dot_directions, surface_sampler
from sensing.simulator.verification import contact as verify_contact
from sensing.simulator.verification import hard_cases
from sensing.simulator.verification import levels as verify_levels
from sensing.simulator.verification import reduced as verify_reduced
from sensing.simulator.verification import solid as verify_solid
from sensing.simulator.verification.levels import rms, table

HEAD = """# Verification of the simulator

Written by `python -m sensing.simulator.verification`; do not edit.

Is the [simulator](simulator.md) right? Each section compares one of its levels with something known independently:

| section | compared with |
|---|---|
| The solid | closed forms and textbook cases of elasticity, at several Poisson's ratios nu and finer meshes |
| Contact | the closed forms of Hertz, of Cattaneo and Mindlin, and of Reissner |
| The shell | other material laws: how much the choice of the law and of nu changes |
| CalculiX | another finite-element code, on the same mesh |
| Level 2, 3 and 4 | the next more exact level, at the same loads |
| Hard cases | nothing: each must converge with a certificate, or be refused with a reason |

Words of the tables:

- *Markers* are the displacements of the painted dots. A *marker error*, *change* or *gap* is the rms difference of all
  markers over their rms; a *force gap* is the norm of the difference over the norm.
- *Estimate* is the error that the level itself states; *fall-backs* are the states that it handed to the more exact
  level.
- *States/s* are solved states a second of processor time.
- Of a hard case: *residual* is the norm of the forces out of balance over that of the contact forces, *wrench* the
  largest difference of contact and clamp wrench over the load, *penetration* the depth by which the surface enters the
  body at the points where contact is computed (in brackets, between them). N is the normal force, T the tangential one.
- "wall 3 mm, depth to 20 mm, there and back" stands on the edge between convergence and refusal: a wall thicker by 1e-9
  mm, or the rounding of another computer, decides.
"""
# Order of the sections' groups in the report.
ORDER = ("The solid", "Contact", "The shell", "CalculiX", "Level 2", "Level 3", "Level 4", "Hard cases")
PLOT = "verification_force_depth.png"  # file name of the shell's plot
HARD_PARTS = 4  # sections of hard cases, so that none takes many minutes
# Loads of the press of level 1, N.
FORCES_N = (1.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0)


def main(arguments: list[str] | None = None) -> int:
    """Write the report; returns the exit status."""
    parser = argparse.ArgumentParser(prog=program("python -m sensing.simulator.verification"), description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs"), help="folder for verification.md (default docs)")
    parser.add_argument(
        "--only", nargs="+", choices=list(SECTIONS), default=list(SECTIONS), help="renew these, keep the others"
    )
    options = parser.parse_args(arguments)
    path = options.out / "verification.md"
    try:
        make_folder(options.out)
        require_place(path)
        parts = _read(path)
        for name in options.only:
            begin = time.process_time()
            title, *rest = SECTIONS[name](options.out).split("\n", 1)
            if title in parts and verify_levels.NOT_INSTALLED in rest[0]:
                LOG.warning(f"{path}: CalculiX is not installed (apt-get install calculix-ccx): its section stays")
                continue
            parts[title] = f"{rest[0]}\n({time.process_time() - begin:.0f} s of processor time on one core.)\n"
            text = [HEAD, *(f"{each}\n{parts[each]}" for each in sorted(parts, key=_place))]
            replace_file(path, "\n".join(text).encode())
    except EndcapError as error:
        LOG.error(f"sensing.simulator.verification: {error}")
        return 2
    show(str(path))
    return 0


def _read(path: Path) -> dict[str, str]:
    """Sections of an earlier report: title -> body.

    Raises:
        FileError: a file of that name that is no such report; it is not overwritten.
    """
    if not path.exists():
        return {}
    try:
        before, *parts = path.read_text(encoding="utf-8").split("\n## ")
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: cannot read ({error}): choose another folder with --out") from error
    strange = [part.split("\n", 1)[0] for part in parts if not part.startswith(ORDER)]
    if strange or not before.startswith(HEAD.split("\n", 1)[0]):
        said = f"its section {strange[0]!r}" if strange else "its first line"
        raise FileError(f"{path}: not a report of this command ({said}): choose another folder with --out")
    return {"## " + title: body.rstrip("\n") + "\n" for title, _, body in (part.partition("\n") for part in parts)}


def _place(title: str) -> tuple[int, int, str]:
    """Sort key of a section, independent of when it was written."""
    number = re.search(r", part (\d+) of ", title)
    return [title.startswith(f"## {name}") for name in ORDER].index(True), int(number[1]) if number else 0, title


def _solid(_: Path) -> str:
    transient("solid")
    rows = [("patch test, distorted 2x2x2 mesh", f"relative error {verify_solid.patch_error():.0e}")]
    for poisson in (0.3, 0.4999):
        sizes = (2, 4, 6)
        errors = [verify_solid.lame_error(n, n, poisson) for n in sizes]
        order = math.log(errors[1] / errors[2]) / math.log(sizes[2] / sizes[1])
        listed = ", ".join(f"{100 * e:.3f} %" for e in errors)
        rows.append((f"Lame thick sphere, nu {poisson:g}, 2, 4, 6 elements", f"L2 error {listed}; order {order:.2f}"))
    for across in (2, 4):
        found, exact = verify_solid.inflated_sphere(1.3, across, across)
        rows.append(
            (f"inflated sphere, inner stretch 1.3, {across} elements", f"{found:.5f} against {exact:.5f} MPa "
             f"({100 * (found / exact - 1):+.3f} %)")
        )  # fmt: skip
    for poisson in (0.0, 0.49, 0.4999):
        rows.append(
            (f"slender bar, nu {poisson:g}, 5 elements", f"{verify_solid.cantilever_ratio(poisson):.4f} of Timoshenko")
        )
    for poisson in (0.3, 0.4999):
        law = hyperelastic_law(0.34, poisson)
        tips = [verify_solid.cook_tip_mm(n, law) for n in (2, 4, 8)]
        rows.append((f"Cook's membrane, nu {poisson:g}, 2, 4, 8 elements", ", ".join(f"{t:.4f}" for t in tips) + " mm"))
    return "## The solid\n\nNo locking: errors hardly depend on Poisson's ratio.\n\n" + table(("case", "result"), rows)


def _contact(_: Path) -> str:
    transient("contact")
    ball = verify_contact.ball_on_block()
    rows = [
        ("contact radius under a ball", f"{ball.radius_mm:.4f}", f"{ball.hertz_radius_mm:.4f} mm (Hertz)"),
        (
            f"stick radius at {100 * ball.tangential_share:.0f} % of the friction limit",
            f"{ball.stick_radius_mm:.4f}",
            f"{ball.mindlin_radius_mm:.4f} mm (Cattaneo, Mindlin)",
        ),
    ]
    text = "## Contact\n\n" + table(("case", "found", "closed form"), rows)
    text += (
        f"\nRadii are from the area of the Gauss points that touch or stick, a resolution of about 3 %. Single Gauss "
        f"point pressures scatter round Hertz's by {100 * ball.pressure_scatter:.0f} % rms, because there are more "
        "contact points than nodes on a face; sums over a face are right.\n"
    )
    return text + _domes()


def _domes() -> str:
    """Reissner's point load on ever thinner domes, and the change by one more layer of elements."""
    rows = []
    for wall, density in verify_contact.DOMES:
        finer = replace(density, layers=density.layers + 1)
        ratio, more = (verify_contact.reissner_ratio(wall, each) for each in (density, finer))
        thinness, defect = wall / (65 - wall / 2), 1 - ratio
        rows.append(
            (f"{wall:g}", f"{thinness:.4f}", f"{ratio:.3f}", f"{100 * (more / ratio - 1):+.1f} %",
             f"{defect / thinness:.1f}", f"{defect / (-thinness * math.log(thinness)):.2f}")
        )  # fmt: skip
    text = (
        "\nReissner's point load on the open dome, on meshes of two layers. The form leaves out shear through the "
        "wall, so it holds as T/R goes to 0; the defect falls somewhat slower than T/R, about as T/R ln(R/T):\n\n"
    )
    titles = ("wall mm", "T/R", "stiffness over Reissner's", "a third layer changes it by", "defect over T/R")
    return text + table((*titles, "defect over T/R ln(R/T)"), rows)


def _march(model: ShellModel, friction: float, tilt: float, forces: tuple[float, ...]) -> list[State]:
    press = Press(model, Indenter(tilt), friction)
    states = [press.start()]
    for force in forces:
        states.append(press.advance(states[-1], Target(normal_n=force)))
    return states[1:]


def _shell(out: Path) -> str:
    transient("shell")
    geometry, entry = shell_geometry(130, 8), silicone()
    laws: dict[str, HyperelasticLaw] = {
        "neo-Hooke, nu 0.49": entry.neo_hooke(),
        "Yeoh, nu 0.49": entry.yeoh(),
        "neo-Hooke, nu 0.499": entry.neo_hooke(0.499),
        "neo-Hooke, nu 0.4999": entry.neo_hooke(0.4999),
    }
    dots = dot_directions(geometry)
    curves: dict[str, tuple[Array, Array]] = {}
    rows, markers = [], {}
    worst = 0.0
    for name, law in laws.items():
        model = shell_model(geometry, law, "data", half=True)
        states = _march(model, 0.5, 30.0, FORCES_N)
        sampler = surface_sampler(model, dots)
        markers[name] = [sampler.sample(state.displacement) for state in states]
        depths = np.array([state.depth_mm for state in states])
        curves[name] = (depths, np.array(FORCES_N))
        worst = max(worst, *(state.certificate.wrench_gap for state in states if state.certificate))
        base = markers["neo-Hooke, nu 0.49"]
        change = [rms(a - b) / rms(b) for a, b in zip(markers[name], base, strict=True)]
        largest = float(np.linalg.norm(markers[name][-1], axis=1).max())
        rows.append((name, f"{depths[4]:.3f}", f"{depths[-1]:.3f}", f"{largest:.2f}", f"{100 * change[-1]:.2f} %"))
    plot = _plot(out, curves, geometry_line=closed_forms.point_stiffness_n_mm(geometry, entry.neo_hooke()))
    return (
        "## The shell\n\nD = 130, T = 8, Smooth-Sil 950, plane at tilt 30 degrees, friction 0.5, `data` mesh. Contact "
        f"and clamp wrenches differ by at most {worst:.0e} of the load.\n\n"
        + table(("law", "depth at 20 N, mm", "at 35 N", "largest marker at 35 N, mm", "marker change at 35 N"), rows)
        + f"\n![Force by depth]({plot})\n"
    )


def _hard(part: int, _: Path) -> str:
    rows, size = [], math.ceil(len(hard_cases.CASES) / HARD_PARTS)
    for case in hard_cases.CASES[part * size : (part + 1) * size]:
        transient(f"hard case: {case.name}")
        outcome = hard_cases.run_case(case)
        rows.append((outcome.name, outcome.verdict, outcome.detail))
    wrong = sum(row[1].startswith("WRONG") for row in rows)
    return (
        f"## Hard cases, part {part + 1} of {HARD_PARTS}\n\n{len(rows)} of {len(hard_cases.CASES)}; half model, `data` "
        f"mesh, tilt 30 and friction 0.5 where not named: {wrong} passed silently wrong.\n\n"
        + table(("case", "verdict", "detail"), rows)
    )


def _plot(out: Path, curves: dict[str, tuple[Array, Array]], geometry_line: float) -> str:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(5, 3.2), layout="constrained")
    for name, (depth, force) in curves.items():
        axes.plot(depth, force, marker=".", label=name)
    depth = np.array([0, 4.0])
    axes.plot(depth, geometry_line * depth, "k:", label="Reissner (level 0)")
    axes.set(xlabel="depth, mm", ylabel="normal force, N", title="Plane on the dome, tilt 30, friction 0.5")
    axes.legend(fontsize=7)
    figure.savefig(buffer := io.BytesIO(), format="png", dpi=110)
    pyplot.close(figure)
    replace_file(out / PLOT, buffer.getvalue())
    return PLOT


# Title -> function that computes the section and writes its plots into a folder.
SECTIONS: dict[str, Callable[[Path], str]] = {
    "solid": _solid,
    "contact": _contact,
    "shell": _shell,
    "levels": lambda _: verify_levels.level_2_section(),
    "reduced-half": lambda _: verify_reduced.level_3_section(half=True, tilts_deg=(30.0,)),
    "reduced-whole": lambda _: verify_reduced.level_3_section(half=False, tilts_deg=(40.0,)),
    "library": lambda _: verify_levels.level_4_section(),
    "calculix": lambda _: verify_levels.calculix_section(),
    **{f"hard-{part + 1}": partial(_hard, part) for part in range(HARD_PARTS)},
}

if __name__ == "__main__":
    sys.exit(main())
