"""The same press in an independent code: CalculiX (``ccx``, Debian's calculix-ccx), with its input deck (mm, N, MPa).

Half a shell, clamped, pressed by a rigid plane that moves in and then sideways, with Coulomb friction and the same
penalties. CalculiX has other elements (C3D20R: 20 nodes, reduced integration), another contact discretisation (surface
to surface) and another solver; law and geometry are the same: its neo-Hooke takes D1 = 2 / K. The meshes share corner
and edge nodes.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cad.errors import EndcapError
from cad.materials import silicone
from sensing.simulator.contact.indenter import Indenter, translation
from sensing.simulator.press.press import Press, Target
from sensing.simulator.press.state import State
from sensing.simulator.solid.element import INNER_FACE, Array
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.mesh import Index, MeshDensity
from sensing.simulator.solid.shell import ShellModel, shell_model

# Local hex27 node i + 3 j + 9 k of every C3D20 node: corners, then edges below, above and upright.
C3D20 = np.array([0, 2, 8, 6, 18, 20, 26, 24, 1, 5, 7, 3, 19, 23, 25, 21, 9, 11, 17, 15])
BLOCK_MM = 150.0  # side of the block that carries the rigid plane
TIME_LIMIT_S = 900  # timeout of ccx


@dataclass(frozen=True)
class Comparison:
    """Results of both codes at the end of a path.

    Attributes:
        ours, theirs: force on the whole shell by this code and by CalculiX, N, (2, 3): after the press, after the pull.
        force_gap: (2,) norm of the difference over the norm.
        marker_gap: (2,) rms difference of the inner surface's corner and edge nodes over their rms.
    """

    ours: Array
    theirs: Array
    force_gap: Array
    marker_gap: Array


def compare(
    density: MeshDensity, depth_mm: float, shift_mm: float, tilt_deg: float, friction: float, increments: int = 10
) -> Comparison:
    """Press to a depth, then pull along the meridian, in both codes.

    Args:
        density: density of the mesh.
        depth_mm: depth of the press, mm.
        shift_mm: travel of the pull along the meridian, mm.
        tilt_deg: polar angle of first contact, degrees.
        friction: Coulomb's mu.
        increments: number of increments of the press, and of the pull.

    Raises:
        EndcapError: ccx is missing, or did not finish.
    """
    model = shell_model(shell_geometry(130, 8), silicone().neo_hooke(), density, half=True)
    press = Press(model, Indenter(tilt_deg), friction)
    states = _ours(press, depth_mm, shift_mm, increments)
    inner = _inner_nodes(model)
    with tempfile.TemporaryDirectory() as folder:
        deck = Path(folder) / "press.inp"
        deck.write_text(_deck(press, inner, depth_mm, shift_mm, increments), encoding="ascii")
        _run(deck)
        moved, forces = _read(deck.with_suffix(".dat"), inner)
    ours = np.array([state.wrench[:3] for state in states])
    theirs = np.stack([2 * forces[:, 0], np.zeros(2), 2 * forces[:, 2]], axis=1)  # with the other half
    marker = [state.displacement[inner] for state in states]
    return Comparison(
        ours,
        theirs,
        np.linalg.norm(ours - theirs, axis=1) / np.linalg.norm(ours, axis=1),
        np.array([np.sqrt(((a - b) ** 2).sum() / (b**2).sum()) for a, b in zip(moved, marker, strict=True)]),
    )


def _ours(press: Press, depth_mm: float, shift_mm: float, steps: int) -> list[State]:
    state = press.start()
    for k in range(1, steps + 1):
        state = press.advance(state, Target(depth_mm=depth_mm * k / steps))
    states = [state]
    for k in range(1, steps + 1):
        state = press.advance(state, Target(depth_mm=depth_mm, shift_mm=(shift_mm * k / steps, 0.0)))
    return [*states, state]


def _inner_nodes(model: ShellModel) -> Index:
    mesh = model.solid.mesh
    return np.unique(mesh.cells[mesh.inner][:, np.intersect1d(INNER_FACE, C3D20)])


def _deck(press: Press, inner: Index, depth_mm: float, shift_mm: float, increments: int) -> str:
    model = press.model
    mesh, law, surface = model.solid.mesh, model.solid.law, model.surface
    used = np.unique(mesh.cells[:, C3D20])
    count = len(mesh.points)
    block = _block(press)
    on_mirror = used[np.abs(mesh.points[used, 1]) < 1e-6]
    lines = ["*NODE, NSET=NALL"]
    lines += [f"{n + 1}, {x:.12g}, {y:.12g}, {z:.12g}" for n, (x, y, z) in zip(used, mesh.points[used], strict=True)]
    lines += [f"{count + k + 1}, {x:.12g}, {y:.12g}, {z:.12g}" for k, (x, y, z) in enumerate(block)]
    lines.append("*ELEMENT, TYPE=C3D20R, ELSET=SHELL")
    for number, cell in enumerate(mesh.cells[:, C3D20] + 1):
        numbers = [number + 1, *cell.tolist()]
        lines += [", ".join(map(str, numbers[:11])) + ",", ", ".join(map(str, numbers[11:]))]
    lines.append("*ELEMENT, TYPE=C3D8, ELSET=BLOCK")
    lines.append(", ".join(map(str, [len(mesh.cells) + 1, *range(count + 1, count + 9)])))
    for name, nodes in (("CLAMP", np.intersect1d(model.clamped, used)), ("MIRROR", on_mirror), ("INNER", inner)):
        lines += [f"*NSET, NSET={name}", *(f"{n + 1}," for n in nodes)]
    lines += ["*NSET, NSET=PLANE", *(f"{count + k + 1}," for k in range(8))]
    lines += ["*SURFACE, NAME=DOME", *(f"{e + 1}, S2" for e in mesh.outer)]
    lines += ["*SURFACE, NAME=TOOL", f"{len(mesh.cells) + 1}, S1"]
    lines += ["*MATERIAL, NAME=SILICONE", "*HYPERELASTIC, NEO HOOKE", f"{law.c10_mpa:.12g}, {2 / law.bulk_mpa:.12g}"]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", "1000., 0.3"]
    lines += ["*SOLID SECTION, ELSET=SHELL, MATERIAL=SILICONE", "*SOLID SECTION, ELSET=BLOCK, MATERIAL=STEEL"]
    lines += ["*SURFACE INTERACTION, NAME=TOUCH", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR"]
    lines.append(f"{surface.normal_mpa_mm:.12g}")
    if press.friction > 0:
        lines += ["*FRICTION", f"{press.friction:.12g}, {surface.tangential_mpa_mm:.12g}"]
    lines += ["*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE", "DOME, TOOL"]
    lines += ["*BOUNDARY", "CLAMP, 1, 3", "MIRROR, 2, 2"]
    lines += _steps(press, depth_mm, shift_mm, increments)
    return "\n".join(lines) + "\n"


def _steps(press: Press, depth_mm: float, shift_mm: float, increments: int) -> list[str]:
    """The press straight in, then sideways."""
    lines: list[str] = []
    for shift in (0.0, shift_mm):
        move = translation(press.frame, depth_mm, (shift, 0.0))
        lines += [
            "*STEP, NLGEOM, INC=200",
            "*STATIC",
            f"{1 / increments:.6g}, 1., 1e-4, {1 / increments:.6g}",
            "*BOUNDARY",
        ]
        lines += [f"PLANE, {i + 1}, {i + 1}, {move[i]:.12g}" for i in range(3)]
        lines += ["*NODE PRINT, NSET=INNER, FREQUENCY=1000", "U"]
        lines += ["*NODE PRINT, NSET=CLAMP, TOTALS=ONLY, FREQUENCY=1000", "RF", "*END STEP"]
    return lines


def _block(press: Press) -> Array:
    """Corners (8, 3) of the plane's block; its face 1-2-3-4 (S1) touches the dome."""
    outward, meridian, lateral = press.frame.T
    touch = np.array(press.model.geometry.centre_mm) + press.model.geometry.outer_radius_mm * outward
    square = BLOCK_MM / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    face = touch + square @ np.stack([lateral, meridian])
    if np.dot(np.cross(face[1] - face[0], face[3] - face[0]), outward) < 0:  # the block lies outward of the face
        face = touch + square @ np.stack([meridian, lateral])
    return np.concatenate([face, face + 20.0 * outward])


def _run(deck: Path) -> None:
    program = shutil.which("ccx")
    if program is None:
        raise EndcapError("ccx is not installed: install the package calculix-ccx, or leave this comparison out")
    try:
        done = subprocess.run(
            [program, deck.stem], cwd=deck.parent, capture_output=True, text=True, timeout=TIME_LIMIT_S, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise EndcapError(f"ccx did not finish within {TIME_LIMIT_S} s") from error
    if done.returncode != 0 or "Job finished" not in done.stdout:
        raise EndcapError(f"ccx failed: {' '.join(done.stdout.split()[-40:])}")


def _read(path: Path, inner: Index) -> tuple[list[Array], Array]:
    """(displacements (inner, 3) of each step, mm; total force of the plane on the shell (steps, 3), N)."""
    moved: list[Array] = []
    forces: list[list[float]] = []
    rows: dict[int, list[float]] = {}
    kind = ""
    for line in [*path.read_text(encoding="ascii").splitlines(), " displacements"]:
        words = line.split()
        if line.startswith((" displacements", " total force")):
            if rows:
                moved.append(np.array([rows[int(n) + 1] for n in inner]))
            rows, kind = {}, words[0]
        elif len(words) == 4 and kind == "displacements":
            rows[int(words[0])] = [float(w) for w in words[1:]]
        elif len(words) == 3 and kind == "total":
            forces.append([-float(w) for w in words])
    if len(moved) != 2 or len(forces) != 2:
        raise EndcapError(f"ccx wrote {len(moved)} of 2 displacements and {len(forces)} of 2 forces")
    return moved, np.array(forces)
