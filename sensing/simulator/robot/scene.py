"""The robot that ``python -m sensing.live`` shows without cameras: lowered onto one, two and three of its endcaps.

    python -m sensing.simulator.robot.scene --out sensing/simulator/robot/scene.npz     # solves it again (minutes)

The file holds solved states only: displacement fields of the inner surface at the nodes of the renderer's draft mesh,
as a few modes, and their wrenches. Between two solved loads field and wrench are interpolated linearly. N, mm, N m;
contact on azimuth 0 as in :mod:`sensing.simulator.levels`; robot frame: the upright prism of
:mod:`sensing.simulator.robot.statics`.
"""

from __future__ import annotations

import argparse
import io
import math
import sys
import zipfile
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cad.errors import FileError
from cad.extras import program
from cad.materials import silicone
from cad.messages import LOG, show
from cad.params import EndcapParams
from cad.whole_file import put_file
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.dataset.states import path_states
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Target
from sensing.simulator.protocols.loading import LoadPath, Waypoint, timed
from sensing.simulator.render.mesh import surface_mesh
from sensing.simulator.render.settings import RenderSettings
from sensing.simulator.robot.statics import WEIGHT_N, Stand, endcap_axes, prism_mm, random_stand
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.surface import turn_about_axis, turn_wrench

Array = NDArray[np.float64]
FILE = Path(__file__).with_name("scene.npz")  # states that ship
PARAMS = EndcapParams(130.0, 8.0)  # design of the endcaps
ENDCAPS = 6  # of the robot
FRICTION = 0.6  # Coulomb coefficient between endcaps and ground
SEED = 3  # of the stands
MIRROR_N = 1e-6  # lateral force that counts as rounding, so that half of the mesh suffices
SHARES = (0.05, 0.15, 0.3, 0.5, 0.75, 1.0)  # parts of the load at which states are solved
MODE_ERROR_MM = 0.01  # largest error of a node by modes that are left out


@dataclass(frozen=True)
class RobotScene:
    """Solved states of the three stands.

    Attributes:
        T_robot_endcap: (6, 4, 4) mounting of the endcaps, mm.
        R_world_robot: (3, 3, 3) attitude of each stand.
        touching: (3, 6) whether the endcap carries load.
        azimuth_deg: (3, 6) azimuth of the contact, endcap frame, degrees.
        wrench: (3, 6, S, 6) wrench on the endcap, N and N m, at the :data:`SHARES`.
        coefficients: (3, 6, S, M) coefficients of the modes.
        modes: (M, n, 3) mm at the renderer's draft nodes.
    """

    T_robot_endcap: Array
    R_world_robot: Array
    touching: NDArray[np.bool_]
    azimuth_deg: Array
    wrench: Array
    coefficients: Array
    modes: NDArray[np.float16]

    def state(self, stand: int, endcap: int, share: float) -> tuple[Array, Array]:
        """((n, 3) displacement at azimuth 0, (6,) wrench, N and N m) of an endcap under a share of its load.

        Args:
            stand: 0, 1, 2: on one, two, three endcaps.
            endcap: number of the endcap, 0 to 5.
            share: part of its load, 0..1.
        """
        shares = (0.0, *SHARES)
        zero = np.zeros(1)
        coefficients = np.array(
            [
                np.interp(share, shares, np.concatenate([zero, column]))
                for column in self.coefficients[stand, endcap].T  # the displacement without load is zero
            ]
        )
        wrench = np.array(
            [np.interp(share, shares, np.concatenate([zero, column])) for column in self.wrench[stand, endcap].T]
        )
        return np.tensordot(coefficients, self.modes.astype(float), axes=1), wrench


@lru_cache(maxsize=1)
def load_scene(path: Path = FILE) -> RobotScene:
    """Read the scene.

    Raises:
        FileError: missing or damaged.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            return RobotScene(**{name: data[name] for name in RobotScene.__dataclass_fields__})
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise FileError(f"{path}: no robot scene ({error}): run python -m sensing.simulator.robot.scene") from None


def solve_scene() -> RobotScene:
    """Solve all states of the scene (minutes)."""
    plan = plan_scene()
    simulator = Simulator(shell_geometry(PARAMS.diameter_mm, PARAMS.wall_mm), silicone().neo_hooke(), tolerance=1e-4)
    solved = {place: solve_endcap(simulator, plan, *place) for place in plan.places()}
    return assemble_scene(plan, solved)


@dataclass(frozen=True)
class ScenePlan:
    """Plan of a scene: three stands, and the azimuths of the endcaps."""

    stands: tuple[Stand, ...]
    T_robot_endcap: Array
    R_world_robot: Array

    def places(self) -> list[tuple[int, int]]:
        """(stand, endcap) of every endcap that carries load."""
        return [(s, int(endcap)) for s, stand in enumerate(self.stands) for endcap in np.flatnonzero(stand.touching)]

    def path(self, stand: int, endcap: int) -> tuple[LoadPath, float]:
        """Loading path of an endcap, and azimuth of its contact, degrees."""
        return _path(self.stands[stand], endcap, self.R_world_robot[stand] @ self.T_robot_endcap[endcap, :3, :3])


def plan_scene() -> ScenePlan:
    """Stands on one, two and three endcaps; the cables are slack, so that the ground pushes straight up."""
    stands = []
    for contacts in (1, 2, 3):
        stand = random_stand(np.random.default_rng([SEED, contacts]), contacts, FRICTION)
        stands.append(replace(stand, force_n=stand.force_n * [0.0, 0.0, 1.0]))
    rotation = np.array([_attitude(stand) for stand in stands])
    return ScenePlan(tuple(stands), _screwed_on(np.random.default_rng(SEED)), rotation)


def solve_endcap(simulator: Simulator, plan: ScenePlan, stand: int, endcap: int) -> tuple[Array, Array]:
    """((S, n, 3) displacement at azimuth 0 at the renderer's draft nodes, (S, 6) wrench in N and N m).

    Args:
        simulator: simulator of the shell.
        plan: plan of the scene.
        stand, endcap: one of :meth:`ScenePlan.places`.

    Raises:
        FileError: a state that the simulator refuses.
    """
    path, azimuth = plan.path(stand, endcap)
    states, refused = path_states(simulator, path)
    if refused:
        raise FileError(f"the scene cannot be solved: {refused[0]}")
    nodes = surface_mesh(PARAMS, RenderSettings().at_level("draft").mesh).vertices_mm
    to_nodes = simulator.surface.interpolation(nodes)
    fields = np.array([to_nodes @ state.end.surface_mm for state in states])
    wrench = np.array([turn_wrench(state.end.wrench, azimuth) for state in states])
    wrench[:, 3:] /= 1000
    LOG.info(f"stand {stand} endcap {endcap}: {states[-1].end.normal_n:.2f} N")
    return fields, wrench


def assemble_scene(plan: ScenePlan, solved: dict[tuple[int, int], tuple[Array, Array]]) -> RobotScene:
    """The scene of the states of its solved endcaps."""
    nodes = next(iter(solved.values()))[0].shape[1]
    fields, wrench = np.zeros((3, ENDCAPS, len(SHARES), nodes, 3)), np.zeros((3, ENDCAPS, len(SHARES), 6))
    azimuth = np.zeros((3, ENDCAPS))
    for place, (field, column) in solved.items():
        fields[place], wrench[place], azimuth[place] = field, column, plan.path(*place)[1]
    coefficients, modes = _modes(fields)
    touching = np.array([stand.touching for stand in plan.stands])
    return RobotScene(plan.T_robot_endcap, plan.R_world_robot, touching, azimuth, wrench, coefficients, modes)


def save_scene(scene: RobotScene, path: Path) -> None:
    """Write the scene under a temporary name, then rename the file."""
    content = {name: getattr(scene, name) for name in RobotScene.__dataclass_fields__}
    np.savez_compressed(buffer := io.BytesIO(), **content)
    put_file(path, buffer.getvalue())


def _screwed_on(rng: np.random.Generator) -> Array:
    """(6, 4, 4) T_robot_endcap, mm: z outward along the bar, turned at random; tip sphere at the prism's corner."""
    endcaps = prism_mm()
    poses = np.tile(np.eye(4), (ENDCAPS, 1, 1))
    poses[:, :3, :3] = endcap_axes(rng, endcaps)
    poses[:, :3, 3] = endcaps - poses[:, :3, 2] * PARAMS.centre_height_mm
    return poses


def _attitude(stand: Stand) -> Array:
    """(3, 3) rotation from robot to world axes of a stand (Kabsch 1976, doi:10.1107/S0567739476001873)."""
    upright = prism_mm()
    covariance = (stand.centre_mm - stand.centre_mm.mean(0)).T @ (upright - upright.mean(0))
    left, _, right = np.linalg.svd(covariance)
    return np.asarray(left @ np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))]) @ right)


def _path(stand: Stand, endcap: int, rotation: Array) -> tuple[LoadPath, float]:
    """Loading path of one endcap in its own frame, and azimuth of its contact, degrees."""
    outward = -rotation[2]  # straight down
    tilt = math.degrees(math.acos(float(np.clip(outward[2], -1, 1))))
    azimuth = math.degrees(math.atan2(outward[1], outward[0]))
    _, meridian, lateral = (turn_about_axis(azimuth) @ Indenter(tilt).frame()).T
    force, normal = rotation.T @ stand.force_n[endcap], float(stand.force_n[endcap, 2])
    pull = float(force @ meridian), float(force @ lateral)
    if abs(pull[1]) < MIRROR_N:
        pull = pull[0], 0.0  # rounding must not require the whole mesh
    points = [Waypoint("stand", Target(normal_n=s * normal, tangential_n=(s * pull[0], s * pull[1]))) for s in SHARES]
    return LoadPath(endcap, tilt, FRICTION, (azimuth,), timed(points)), azimuth


def _modes(fields: Array) -> tuple[Array, NDArray[np.float16]]:
    """Coefficients (3, 6, S, M) and modes (M, n, 3): as few as keep every node within :data:`MODE_ERROR_MM`."""
    table = fields.reshape(-1, fields.shape[-2] * 3)
    _, size, right = np.linalg.svd(table, full_matrices=False)
    for count in range(1, len(size) + 1):
        modes = right[:count].astype(np.float16)
        coefficients = np.linalg.lstsq(modes.astype(float).T, table.T, rcond=None)[0].T
        if np.abs(coefficients @ modes.astype(float) - table).max() < MODE_ERROR_MM:
            break
    return coefficients.reshape(*fields.shape[:3], count), modes.reshape(count, -1, 3)


def main(arguments: list[str] | None = None) -> int:
    """Solve and write the scene; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.simulator.robot.scene"), description="Solve the scene."
    )
    parser.add_argument("--out", type=Path, default=FILE, help="file to write (default: the one that ships)")
    options = parser.parse_args(arguments)
    scene = solve_scene()
    save_scene(scene, options.out)
    show(f"{options.out}: {scene.modes.shape[0]} modes, weight {WEIGHT_N:.1f} N, {options.out.stat().st_size} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
