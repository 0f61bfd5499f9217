"""Level 4: states from a library, where it covers a scene; others are left to level 2 (mm, N, N mm, degrees)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from sensing.simulator.press import tangential
from sensing.simulator.press.press import Target
from sensing.simulator.reduced.library.library import Library, LibraryStates, shell_key
from sensing.simulator.scene import BulkStates, Scene, SceneState
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.shell_halves import ShellHalves
from sensing.simulator.solid.surface import turn_wrench

LIMIT = 0.06  # error estimate over which level 2 solves the state


class LibraryLevel:
    """A library applied to one shell.

    Raises:
        ParameterError: no library, or one of another shell or mesh.
    """

    def __init__(self, library: Library | None, shell: ShellHalves) -> None:
        if library is None:
            raise ParameterError(
                "library=None: level 4 answers from a library; fit one with "
                "python -m sensing.simulator.reduced.library.fit",
                name="library",
                value=None,
            )
        wanted = shell_key(shell.geometry, shell.law)
        points = len(shell.surface.position)
        if not np.allclose(library.shell, wanted, rtol=1e-9) or library.modes.shape[1] != points:
            raise ParameterError(
                f"library of the shell {np.round(library.shell, 4).tolist()} with {library.modes.shape[1]} points, but "
                f"this one is {np.round(wanted, 4).tolist()} with {points} (diameter, wall, C10, "
                "C20, C30, bulk): fit one for this shell and mesh",
                name="library",
                value=library.shell.tolist(),
            )
        self.library, self.shell = library, shell

    def answer(self, scene: Scene, target: Target) -> SceneState | None:
        """One state, or None where the library does not cover it."""
        if scene.indenter.kind != "plane" or target.tangential_n is None:
            return None
        if target.normal_n is None or not target.normal_n > 0:
            return None
        normal, pull = np.array([target.normal_n]), np.array([target.tangential_n])
        found = self.library.states(np.array([scene.indenter.tilt_deg]), normal, pull)
        if not trusted(found, normal, pull, scene.friction)[0]:
            return None
        return SceneState(
            level=4,
            depth_mm=float(found.depth_mm[0]),
            shift_mm=(float(found.shift_mm[0, 0]), float(found.shift_mm[0, 1])),
            normal_n=target.normal_n,
            tangential_n=target.tangential_n,
            wrench=found.wrench[0],
            surface_mm=self.library.fields(found.weights)[0],
            patch_mm2=float(found.patch_mm2[0]),
            slip_share=math.nan,
            error_estimate=float(found.error_estimate[0]),
            patch=None,
            certificate=None,
        )

    def bulk(
        self, tilt_deg: Array, normal_n: Array, tangential_n: Array, friction: float, azimuth_deg: float
    ) -> BulkStates:
        """Many states of a plane; ``level`` is 2 where the library's result must not be used (see :func:`trusted`).

        Args:
            tilt_deg, normal_n: (s,) tilts, degrees, and normal forces, N.
            tangential_n: tangential forces along (meridian, lateral) (s, 2), N.
            friction: Coulomb's mu.
            azimuth_deg: azimuth of all contacts, degrees.
        """
        found = self.library.states(tilt_deg, normal_n, tangential_n)
        sampler = self.shell.sampler(azimuth_deg)
        marker = self.library.fields(found.weights, np.array([sampler.sample(mode) for mode in self.library.modes]))
        level = np.where(trusted(found, normal_n, tangential_n, friction), 4, 2)
        return BulkStates(marker, turn_wrench(found.wrench, azimuth_deg), found.error_estimate.copy(), level)


def trusted(found: LibraryStates, normal_n: Array, tangential_n: Array, friction: float) -> NDArray[np.bool_]:
    """Which states (s,) lie in the fitted range, within the friction cone and under the limit of the error estimate.

    Args:
        found: results of the library.
        normal_n: wanted normal forces (s,), N.
        tangential_n: wanted tangential forces along (meridian, lateral) (s, 2), N.
        friction: Coulomb's mu.
    """
    sliding = np.linalg.norm(tangential_n, axis=1) > tangential.MAX_CONE_SHARE * friction * np.asarray(normal_n)
    return np.asarray(found.inside & (found.error_estimate <= LIMIT) & ~sliding)
