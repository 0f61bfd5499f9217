"""Hard cases: each converges with a valid certificate, or is refused by name; none may be wrong silently (mm, N).

A case is a list of targets on one shell. :func:`run_case` checks the certificate of every state on its way and returns
one row of the report's table.
"""

from __future__ import annotations

from dataclasses import dataclass

from cad.materials import silicone
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.press.press import Press, Target
from sensing.simulator.press.state import Refusal, State
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.mesh import MeshDensity
from sensing.simulator.solid.shell import shell_model

RESIDUAL_LIMIT = 1e-9  # largest residual of a certificate that holds
WRENCH_LIMIT = 1e-6  # largest wrench gap of a certificate that holds
TILTED = Indenter(tilt_deg=30)


@dataclass(frozen=True)
class HardCase:
    """A shell, a body and a path that is hard to solve."""

    name: str
    targets: tuple[Target, ...]
    diameter_mm: float = 130.0
    wall_mm: float = 8.0
    poisson: float = 0.49
    friction: float = 0.5
    indenter: Indenter = TILTED


@dataclass(frozen=True)
class Outcome:
    """Outcome of a case.

    Attributes:
        name: name of the case.
        verdict: ``converged``, or ``refused: <reason>``, or ``WRONG: ...`` where a certificate does not hold.
        detail: last state, and text of the refusal.
    """

    name: str
    verdict: str
    detail: str

    @property
    def sound(self) -> bool:
        """Whether the case converged with a valid certificate or was refused."""
        return not self.verdict.startswith("WRONG")


def _press(*forces: float) -> tuple[Target, ...]:
    return tuple(Target(normal_n=force) for force in forces)


def _depths(*depths: float) -> tuple[Target, ...]:
    return tuple(Target(depth_mm=depth) for depth in depths)


CASES: tuple[HardCase, ...] = (
    HardCase("wall 3 mm, 5 N", _press(2, 5), wall_mm=3),
    HardCase(
        "wall 3 mm axial, force to 15 N (snaps)", _press(3, 6, 9, 12, 15), wall_mm=3, friction=0, indenter=Indenter()
    ),
    HardCase("wall 3 mm axial, depth to 12 mm", _depths(*range(1, 13)), wall_mm=3, friction=0, indenter=Indenter()),
    HardCase("wall 4 mm axial, force to 30 N", _press(*range(3, 31, 3)), wall_mm=4, friction=0, indenter=Indenter()),
    HardCase("wall 4 mm axial, depth to 16 mm", _depths(*range(2, 17, 2)), wall_mm=4, friction=0, indenter=Indenter()),
    HardCase("wall 3 mm, depth to 20 mm, there and back", _depths(4, 8, 12, 16, 20, 16, 12, 8, 4), wall_mm=3),
    HardCase("wall 5 mm, 35 N", _press(10, 20, 35), wall_mm=5),
    HardCase("wall 12 mm, 100 N", _press(35, 70, 100), wall_mm=12),
    HardCase("depth 30 mm in steps of 3", _depths(*range(3, 31, 3))),
    HardCase("depth 30 mm in one step", _depths(30)),
    HardCase("friction 0", _press(10, 35), friction=0),
    HardCase("friction 2", _press(10, 35), friction=2),
    HardCase("friction 2, 8 mm in one step", _depths(8), friction=2),
    HardCase("wall 10 mm, 60 N in one step", _press(60), wall_mm=10),
    HardCase("nu 0.45", _press(10, 35), poisson=0.45),
    HardCase("nu 0.499", _press(10, 35), poisson=0.499),
    HardCase("nu 0.4999 in 15 N steps", _press(15, 30), poisson=0.4999),
    HardCase(
        "slip reversal",
        tuple(Target(normal_n=15, shift_mm=(s, 0.0)) for s in (0, 1, 2, 1, 0, -1, -2, -1, 0)),
        friction=0.3,
    ),
    HardCase(
        "gross sliding, 10 mm in one step", (*_press(10), Target(normal_n=10, shift_mm=(10.0, 0.0))), friction=0.3
    ),
    HardCase("contact at the rim (tilt 90)", _press(5, 15), indenter=Indenter(tilt_deg=90)),
    HardCase("contact below the equator (tilt 100)", _press(5, 15), indenter=Indenter(tilt_deg=100)),
    HardCase("grazing contact, 1e-3 mm", _depths(1e-3)),
    HardCase("tiny load, 1e-3 N", _press(1e-3)),
    HardCase("zero load", _press(0)),
    HardCase("load, lift, load again", _press(10, 0, 10)),
    HardCase("35 N in one step", _press(35)),
    HardCase("plane starts 10 mm inside", _depths(10)),
    HardCase("sharp edge, radius 1 mm", _depths(0.5, 1, 2), indenter=Indenter(30, "edge", 1.0)),
    HardCase("edge, radius 8 mm", _depths(0.5, 1, 2, 4), indenter=Indenter(30, "edge", 8.0)),
    HardCase("small bump, radius 3 mm, light", _depths(0.5), indenter=Indenter(30, "sphere", 3.0)),
    HardCase("small bump, radius 3 mm", _depths(2, 4), indenter=Indenter(30, "sphere", 3.0)),
    HardCase("too deep for the model", _depths(45)),
    HardCase("pulling", _press(-1)),
    HardCase("sphere of 5 mm, 12 mm deep in one step", _depths(12), indenter=Indenter(30, "sphere", 5.0)),
    HardCase("on the clamped rim (D 99, tilt 95)", _press(5), 99.0, 6.5, indenter=Indenter(tilt_deg=95)),
)


def run_case(case: HardCase, density: MeshDensity | str = "data") -> Outcome:
    """Solve a case on a half model and check every state."""
    law = silicone().neo_hooke(case.poisson)
    model = shell_model(shell_geometry(case.diameter_mm, case.wall_mm), law, density, half=True)
    press = Press(model, case.indenter, case.friction)
    state, reached, buckled = press.start(), "nothing", ""
    for target in case.targets:
        try:
            state = press.advance(state, target)
        except Refusal as refusal:
            return Outcome(case.name, f"refused: {refusal.reason}", f"after {reached}: {refusal.text}")
        wrong = _wrong(state)
        if wrong:
            return Outcome(case.name, f"WRONG: {wrong}", f"at {target}")
        reached = f"{state.normal_n:.3f} N at {state.depth_mm:.3f} mm"
        if state.certificate and state.certificate.switched:
            buckled += f"; buckled to a stable branch on the way to {reached}"
    certificate = state.certificate
    assert certificate is not None
    return Outcome(
        case.name,
        "converged",
        f"{reached}; residual {certificate.residual:.0e}, wrench {certificate.wrench_gap:.0e}, penetration "
        f"{certificate.penetration_mm:.4f} mm ({certificate.reach_mm:.3f} between the contact's points), "
        f"{certificate.substeps} sub-steps in the last step{buckled}",
    )


def _wrong(state: State) -> str:
    certificate = state.certificate
    if certificate is None:
        return "no certificate"
    if not certificate.residual <= RESIDUAL_LIMIT:
        return f"residual {certificate.residual:.1e}"
    if not certificate.wrench_gap <= WRENCH_LIMIT:
        return f"wrench {certificate.wrench_gap:.1e}"
    if not certificate.cone_excess_mpa <= 1e-9:
        return f"friction outside its cone by {certificate.cone_excess_mpa:.1e} MPa"
    return "" if certificate.negative_pivots == 0 else f"{certificate.negative_pivots} negative pivots"
