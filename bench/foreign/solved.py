"""The paths of the foreign bench and their states, solved by CalculiX once and kept in a folder (mm, N, N m)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bench.foreign.mesh import GRAINS, Shell
from bench.foreign.press import PlanePath, Pressed, Silicone, pressed
from cad.materials import silicone
from cad.params import EndcapParams

DESIGN = EndcapParams(130, 8)
GRAIN = "middle"  # of the mesh that the pictures show
PRESSES = 3  # first places of a path: straight in, compared between meshes
PATHS = (  # tilt, friction, (depth, travel) of the plane, the last on the way back; none of them chose anything
    PlanePath(0, 0.5, ((1.5, 0.0), (3.5, 0.0), (6.5, 0.0), (4.5, 0.8))),
    PlanePath(30, 0.5, ((1.5, 0.0), (3.5, 0.0), (6.5, 0.0), (4.5, -0.8))),
)
COMPARED = PATHS[1:]  # whose straight part is solved on several meshes


def solved(folder: Path, path: PlanePath, grain: str = GRAIN) -> Pressed:
    """A path's states; what lies in the folder is taken from there.

    Args:
        folder: of the states. path: of the plane. grain: a name of :data:`bench.foreign.mesh.GRAINS`.

    Raises:
        EndcapError: ccx is not installed.
        RuntimeError: it did not finish.
    """
    name = f"{grain}_{path.tilt_deg:g}_{len(path.places)}"
    file = folder / f"{name}.npz"
    if not file.exists():
        law = silicone().neo_hooke()
        shell = Shell(
            DESIGN.outer_radius_mm, DESIGN.inner_radius_mm, DESIGN.centre_height_mm, DESIGN.flange_thickness_mm
        )
        work = folder / name
        made = pressed(shell, Silicone(law.c10_mpa, law.bulk_mpa), path, work, GRAINS[grain])
        np.savez(work / "states.npz", **vars(made))
        (work / "states.npz").rename(file)
        print(f"{name}: forces", *np.linalg.norm(made.wrench[:, :3], axis=1).round(3), flush=True)
    with np.load(file) as found:
        return Pressed(**{key: found[key] for key in found.files})
