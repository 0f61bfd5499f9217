"""The shell pressed by a rigid plane in CalculiX (``ccx``): deck, run, results (mm, N, MPa; endcap frame, y >= 0).

A path is a list of places of the plane, each a static step: it goes in, slides along the meridian with Coulomb's
friction, and comes back. Of every step the displacement of the inner surface and the wrench of the whole shell about
the sphere's centre, from the clamp's reactions.
"""

from __future__ import annotations

import math
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.foreign.mesh import GRAINS, Array, BrickMesh, Grain, Index, Shell, brick_mesh
from cad.errors import EndcapError

CONTACT_MPA_MM, STICK_MPA_MM = 6.0, 1.5  # penalties
BLOCK_MM, DEEP_MM = 160.0, 25.0
STEP_MM = 2.4  # of the plane in one increment, halved where it does not converge (M: 0.8 changes forces by 0.1 %)
SECONDS = 1800  # E: longest time for one path


@dataclass(frozen=True)
class PlanePath:
    """A path of the plane.

    Attributes:
        tilt_deg: polar angle of first touch. friction: Coulomb's.
        places: (depth, travel along the meridian) at the end of each step, mm.
    """

    tilt_deg: float
    friction: float
    places: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Pressed:
    """Results of a path.

    Attributes:
        inner: (q, 8) quadrangles of the inner surface, into ``rest``. rest: (m, 3) its nodes. moved: (s, m, 3).
        wrench: (s, 6) of the whole shell, on the endcap about the sphere's centre, N and N m.
    """

    inner: Index
    rest: Array
    moved: Array
    wrench: Array


@dataclass(frozen=True)
class Silicone:
    """Neo-Hooke: C10 and bulk modulus, MPa."""

    c10_mpa: float
    bulk_mpa: float


def pressed(shell: Shell, law: Silicone, path: PlanePath, folder: Path, grain: Grain = GRAINS["middle"]) -> Pressed:
    """Solve a path; its deck and CalculiX's own files stay in a folder.

    Args:
        shell: the solid. law: its silicone. path: of the plane. folder: to work in.
        grain: of the mesh.

    Raises:
        EndcapError: ccx is not installed.
        RuntimeError: it did not finish.
    """
    program = shutil.which("ccx")
    if program is None:
        raise EndcapError("ccx is not installed: install the Debian package calculix-ccx")
    mesh = brick_mesh(shell, path.tilt_deg, grain)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "press.inp").write_text(deck(mesh, shell, law, path), encoding="ascii")
    with (folder / "ccx.log").open("w") as log:
        done = subprocess.run(
            [program, "press"], cwd=folder, stdout=log, stderr=subprocess.STDOUT, timeout=SECONDS, check=False
        )
    if done.returncode != 0 or "Job finished" not in (folder / "ccx.log").read_text():
        raise RuntimeError(f"ccx did not finish: see {folder / 'ccx.log'}")
    return _results(folder / "press.dat", mesh, shell, len(path.places))


def deck(mesh: BrickMesh, shell: Shell, law: Silicone, path: PlanePath) -> str:
    """CalculiX's input.

    Args:
        mesh: of the half shell. shell: the solid. law: its silicone. path: of the plane.
    """
    count, cells = len(mesh.points), len(mesh.bricks)
    block, axes = _block(shell, path.tilt_deg)
    lines = ["*NODE, NSET=NALL", *(_row(n + 1, p) for n, p in enumerate(np.concatenate([mesh.points, block])))]
    lines.append("*ELEMENT, TYPE=C3D20R, ELSET=SHELL")
    for number, cell in enumerate((mesh.bricks + 1).tolist()):
        lines += [", ".join(map(str, [number + 1, *cell[:10]])) + ",", ", ".join(map(str, cell[10:]))]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=BLOCK", ", ".join(map(str, [cells + 1, *range(count + 1, count + 9)]))]
    sets = {"CLAMP": mesh.clamp, "MIRROR": mesh.mirror, "INNER": np.unique(mesh.inner), "PLANE": count + np.arange(8)}
    for name, nodes in sets.items():
        lines += [f"*NSET, NSET={name}", *(f"{n + 1}," for n in nodes)]
    lines += ["*SURFACE, NAME=DOME", *(f"{e + 1}, S2" for e in mesh.top)]
    lines += ["*SURFACE, NAME=TOOL", f"{cells + 1}, S1"]
    lines += ["*MATERIAL, NAME=SILICONE", "*HYPERELASTIC, NEO HOOKE", f"{law.c10_mpa:.12g}, {2 / law.bulk_mpa:.12g}"]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", "1000., 0.3"]
    lines += ["*SOLID SECTION, ELSET=SHELL, MATERIAL=SILICONE", "*SOLID SECTION, ELSET=BLOCK, MATERIAL=STEEL"]
    lines += ["*SURFACE INTERACTION, NAME=TOUCH", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR"]
    lines += [f"{CONTACT_MPA_MM:g}", "*FRICTION", f"{path.friction:g}, {STICK_MPA_MM:g}"]
    lines += ["*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE", "DOME, TOOL"]
    lines += ["*BOUNDARY", "CLAMP, 1, 3", "MIRROR, 2, 2"]
    before = (0.0, 0.0)
    for place in path.places:
        first = 1 / max(1, math.ceil(max(abs(a - b) for a, b in zip(place, before, strict=True)) / STEP_MM))
        move = -place[0] * axes[0] + place[1] * axes[1]
        lines += ["*STEP, NLGEOM, INC=300", "*STATIC", f"{first:.6g}, 1., 1e-4, {first:.6g}", "*BOUNDARY"]
        lines += [f"PLANE, {i + 1}, {i + 1}, {move[i]:.12g}" for i in range(3)]
        lines += ["*NODE PRINT, NSET=INNER, FREQUENCY=1000", "U"]
        lines += ["*NODE PRINT, NSET=CLAMP, FREQUENCY=1000", "RF", "*END STEP"]
        before = place
    return "\n".join(lines) + "\n"


def _row(number: int, point: Array) -> str:
    return f"{number}, " + ", ".join(f"{x:.12g}" for x in point)


def _block(shell: Shell, tilt_deg: float) -> tuple[Array, Array]:
    """(corners (8, 3) of the plane's block, its face 1-2-3-4 on the dome; outward normal and meridian (2, 3))."""
    s, c = math.sin(math.radians(tilt_deg)), math.cos(math.radians(tilt_deg))
    outward, meridian = np.array([s, 0, c]), np.array([c, 0, -s])
    touch = np.array([0, 0, shell.centre_mm]) + shell.outer_mm * outward
    sides = BLOCK_MM / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    face = touch + sides @ np.stack([meridian, np.cross(outward, meridian)])
    return np.concatenate([face, face + DEEP_MM * outward]), np.stack([outward, meridian])


def _results(path: Path, mesh: BrickMesh, shell: Shell, steps: int) -> Pressed:
    """Read the printed displacements and reactions; the other half is the mirror image."""
    tables: dict[str, list[dict[int, list[float]]]] = {"displacements": [], "forces": []}
    current: dict[int, list[float]] = {}
    for line in path.read_text(encoding="ascii").splitlines():
        words = line.split()
        if words and words[0] in tables:
            current = {}
            tables[words[0]].append(current)
        elif len(words) == 4 and words[0].isdigit():
            current[int(words[0]) - 1] = [float(word) for word in words[1:]]
    moved, forces = tables["displacements"], tables["forces"]
    if len(moved) != steps or len(forces) != steps:
        raise RuntimeError(f"{path}: {len(moved)} displacements and {len(forces)} reactions of {steps} steps")
    nodes, back = np.unique(mesh.inner, return_inverse=True)
    return Pressed(
        back.reshape(mesh.inner.shape), mesh.points[nodes], np.array([[table[n] for n in nodes] for table in moved]),
        np.array([_wrench(table, mesh, shell) for table in forces]),
    )  # fmt: skip


def _wrench(reactions: dict[int, list[float]], mesh: BrickMesh, shell: Shell) -> Array:
    """(6,) of both halves: the plane's wrench on the shell balances the clamp's."""
    at = mesh.points[mesh.clamp] - [0, 0, shell.centre_mm]
    force = -np.array([reactions[n] for n in mesh.clamp])
    half = np.concatenate([force.sum(axis=0), np.cross(at, force).sum(axis=0) / 1000])
    return 2 * half * [1, 0, 1, 0, 1, 0]
