"""Records of a simulation at any level: the scene, and its states (mm, N, N mm; endcap frame, azimuth 0)."""

from __future__ import annotations

from dataclasses import dataclass

from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.press.state import Certificate, Patch
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.mesh import Index


@dataclass(frozen=True)
class Scene:
    """The indenter with its place of first touch, and Coulomb's mu of its friction."""

    indenter: Indenter
    friction: float = 0.5


@dataclass(frozen=True)
class SceneState:
    """One solved state, of any level; contact on azimuth 0.

    Attributes:
        level: level that solved it (1 is the full model).
        depth_mm, shift_mm: travel of the body from first touch, mm: against the outward normal; (meridian, lateral).
        normal_n: force along the inward normal at first touch, N.
        tangential_n: force on the shell along (meridian, lateral), N.
        wrench: wrench on the endcap at its origin (6,), N and N mm.
        surface_mm: displacement at :attr:`sensing.simulator.levels.Simulator.surface` (k, 3), mm.
        patch_mm2: contact area of the whole shell, mm2: undeformed area of the Gauss points with pressure (at level 4 a
            fit of that), some 20 % wrong under loads and a factor of two under light touches (docs/simulator.md).
        slip_share: share of the normal force on points that slipped in the last load step; 0 without friction, NaN at
            level 4.
        error_estimate: at levels 3 and 4 the expected relative rms error of the markers (level 3: against level 1 on
            the same mesh); at level 2 the certificate's residual, force imbalance over contact force, which is no error
            of the markers; 0 at level 1, and in states interpolated in :mod:`sensing.simulator.similarity`, whose error
            is not estimated.
        patch: points in contact with pressure, friction and slip (both halves), or None at level 4.
        certificate: certificate of the equilibrium, or None at level 4.
    """

    level: int
    depth_mm: float
    shift_mm: tuple[float, float]
    normal_n: float
    tangential_n: tuple[float, float]
    wrench: Array
    surface_mm: Array
    patch_mm2: float
    slip_share: float
    error_estimate: float
    patch: Patch | None
    certificate: Certificate | None

    @property
    def force_n(self) -> Array:
        """(3,) force on the endcap, N."""
        return self.wrench[:3]

    @property
    def torque_nm(self) -> Array:
        """(3,) torque on the endcap about its origin, N m."""
        return self.wrench[3:] / 1000


@dataclass(frozen=True)
class BulkStates:
    """Many states at once: markers (s, m, 3), wrench (s, 6), level that answered (s,).

    ``error_estimate`` (s,) is that of :class:`SceneState`.
    """

    marker_mm: Array
    wrench: Array
    error_estimate: Array
    level: Index
