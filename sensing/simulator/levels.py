"""The simulator's one door: a scene and a path in, states out, at the level asked for (mm, N, N mm; endcap frame).

    simulator = Simulator(shell_geometry(130, 8), silicone().neo_hooke(), level=2)
    scene = Scene(Indenter(tilt_deg=30), friction=0.5)
    for state in simulator.follow(scene, [Target(normal_n=5), Target(normal_n=20, shift_mm=(1.0, 0.0))]):
        print(state.level, state.wrench, simulator.markers(state, azimuth_deg=45))

==  ==========================================================  =====================================================
1   Newton on the full model                                    nothing left out
2   stored tangents, contact condensed on the patch             nothing; residual below ``tolerance`` instead of 1e-9
3   50 modes, a tenth of the elements, contact as in 1          what modes cannot show: the report measures it
4   polynomials fitted to level 2 (a library)                   path, stick and slip; planes only; no contact patch
==  ==========================================================  =====================================================

A state that a level cannot certify is answered by the level above it; ``SceneState.level`` says which. Paths in the
mirror plane (``shift`` and tangential force along the meridian only) are solved on half of the mesh. A caller asks for
azimuth 0 and turns the result: ``markers`` samples the turned field, :func:`sensing.simulator.surface.turn_wrench`
turns the wrench. Level 4 answers targets given by normal and tangential force (``Target(normal_n, tangential_n=...)``,
or :meth:`Simulator.bulk` for many at once); it knows no path, so a fall-back presses and then pulls. Level 3 trains
itself when it first meets a plane at a tilt (some hundred level 2 states): for many states at few tilts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cad.errors import ParameterError
from cad.materials import HyperelasticLaw
from sensing.simulator import tangential
from sensing.simulator.condensed import StoredTangent
from sensing.simulator.element import Array
from sensing.simulator.frozen import FrozenPress
from sensing.simulator.geometry import ShellGeometry
from sensing.simulator.indenter import Indenter
from sensing.simulator.library import Library, shell_key
from sensing.simulator.mesh import Index, MeshDensity
from sensing.simulator.press import Press, Target
from sensing.simulator.reduced_basis import ReducedModel
from sensing.simulator.reduced_press import ReducedPress, trained
from sensing.simulator.shell import ShellModel, shell_model
from sensing.simulator.state import Certificate, Patch, Refusal, State, contact_patch
from sensing.simulator.surface import InnerSurface, SurfaceSampler, dot_directions, inner_surface, turn_wrench

LEVELS = (1, 2, 3, 4)
TOLERANCE = 1e-3  # of level 2: residual over contact force
MAX_TOLERANCE = 1e-2
MAX_SAMPLERS = 64  # azimuths kept ready
LIBRARY_LIMIT = 0.06  # error estimate over which level 4 leaves a state to level 2


@dataclass(frozen=True)
class Scene:
    """What presses on the shell: the body, where it first touches, and its friction (Coulomb's mu)."""

    indenter: Indenter
    friction: float = 0.5


@dataclass(frozen=True)
class SceneState:
    """One answer, whatever level gave it; contact on azimuth 0.

    Attributes:
        level: that answered (1 is the full model).
        depth_mm, shift_mm: place of the body from first touch.
        normal_n: force along the inward normal at first touch.
        tangential_n: force on the shell along (meridian, lateral).
        wrench: on the endcap at its origin (6,), N and N mm.
        surface_mm: displacement of :attr:`Simulator.surface` (k, 3).
        patch_mm2: area in contact, whole shell. slip_share: share of the normal force on slipping points; NaN at
            level 4.
        error_estimate: expected relative rms error of the markers against level 1 on the same mesh; 0 at level 1.
        patch: points in contact with pressure, friction and slip (both halves), or None at level 4.
        certificate: of the equilibrium, or None at level 4.
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


@dataclass(frozen=True)
class BulkStates:
    """Many states at once: markers (s, m, 3), wrench (s, 6), error estimate (s,), level that answered (s,)."""

    marker_mm: Array
    wrench: Array
    error_estimate: Array
    level: Index


class Simulator:
    """A shell ready for scenes at one level; meshes and tangents are built when first needed and kept.

    Args:
        geometry, law: the shell. density: of the mesh.
        level: 1 to 4 (see the module's text).
        tolerance: of level 2.
        library: what level 4 answers from (:mod:`sensing.simulator.library_fit`).

    Raises:
        ParameterError: unknown level or density, tolerance out of range, no library or one of another shell or mesh.
    """

    def __init__(
        self,
        geometry: ShellGeometry,
        law: HyperelasticLaw,
        density: MeshDensity | str = "data",
        level: int = 2,
        tolerance: float = TOLERANCE,
        library: Library | None = None,
    ) -> None:
        if level not in LEVELS:
            raise ParameterError(
                f"level={level} is unknown: choose one of {', '.join(map(str, LEVELS))} (1 is the full model)",
                name="level",
                value=level,
            )
        if not 0 < tolerance <= MAX_TOLERANCE:
            raise ParameterError(
                f"tolerance={tolerance:g} outside 0..{MAX_TOLERANCE:g}: above it labels would be wrong by percents",
                name="tolerance",
                value=tolerance,
            )
        self.geometry, self.law, self.density = geometry, law, density
        self.level, self.tolerance = level, tolerance
        self._models: dict[bool, ShellModel] = {}
        self._surfaces: dict[bool, InnerSurface] = {}
        self._tangents: dict[tuple[Indenter, bool], list[StoredTangent]] = {}
        self._reduced: dict[tuple[Indenter, bool], ReducedModel | None] = {}
        self.surface = self._surface(half=True)
        self._samplers = {0.0: self.surface.sampler(dot_directions(geometry))}
        self.library = self._checked(library) if level == 4 else None

    def follow(self, scene: Scene, targets: Sequence[Target]) -> Iterator[SceneState]:
        """States along a path from the untouched shell, one for each target.

        Raises:
            Refusal: the state at that target has no trustworthy answer; those before it stand.
        """
        half = scene.indenter.keeps_mirror and all(_in_mirror_plane(target) for target in targets)
        walk = self.walk(scene, half)
        for target in targets:
            found = self._from_library(scene, target)
            yield found if found is not None else walk(target)

    def walk(self, scene: Scene, half: bool = False) -> Callable[[Target], SceneState]:
        """A function that goes from state to state, for a path that is not known beforehand; never from the library.

        Args:
            scene: what presses. half: the path will stay in the mirror plane.
        """
        press = Press(self._model(half), scene.indenter, scene.friction)
        fast = FrozenPress(press, self.tolerance, self._tangents.setdefault((scene.indenter, half), []))
        model = self._reduced_model(scene.indenter, half) if self.level == 3 else None
        reduced = ReducedPress(fast, model) if model is not None else None
        solver = press if self.level == 1 else reduced or fast
        here = solver.start()

        def step(target: Target) -> SceneState:
            nonlocal here
            before = fast.fallbacks, reduced.fallbacks if reduced else 0
            if target.tangential_n is None:
                here = solver.advance(here, target)
            else:
                here = tangential.reach(solver.advance, here, target, press.frame, scene.friction, half)
            if reduced is not None and reduced.fallbacks == before[1]:
                return self._answer(press, here, 3, reduced.error_estimate)
            return self._answer(press, here, 1 if self.level == 1 or fast.fallbacks > before[0] else 2)

        return step

    def bulk(
        self, tilt_deg: Array, normal_n: Array, tangential_n: Array, friction: float = 0.5, azimuth_deg: float = 0.0
    ) -> BulkStates:
        """Level 4 states of a plane at tilts (s,), normal forces (s,) and tangential forces (s, 2), N.

        States out of the library's range, or with too large an estimate, are solved on level 2, one by one.

        Raises:
            ParameterError: the simulator has no library. Refusal: a state that no level can answer.
        """
        library = self._library()
        found = library.states(tilt_deg, normal_n, tangential_n)
        sampler = self._sampler(azimuth_deg)
        marker = library.fields(found.weights, np.array([sampler.sample(mode) for mode in library.modes]))
        wrench, estimate = turn_wrench(found.wrench, azimuth_deg), found.error_estimate.copy()
        sliding = np.linalg.norm(tangential_n, axis=1) > tangential.MAX_CONE_SHARE * friction * np.asarray(normal_n)
        level = np.where(found.inside & (estimate <= LIBRARY_LIMIT) & ~sliding, 4, 2)
        for k in np.flatnonzero(level == 2):
            force = (float(tangential_n[k, 0]), float(tangential_n[k, 1]))
            state = self.walk(Scene(Indenter(float(tilt_deg[k])), friction))(
                Target(float(normal_n[k]), tangential_n=force)
            )
            marker[k], wrench[k] = self.markers(state, azimuth_deg), turn_wrench(state.wrench, azimuth_deg)
            estimate[k], level[k] = state.error_estimate, state.level
        return BulkStates(marker, wrench, estimate, level)

    def forget(self) -> None:
        """Drop the stored tangents: what follows depends on nothing that went before (a shard begins so).

        Level 3's models stay: they depend on shell and body alone.
        """
        self._tangents.clear()

    def markers(self, state: SceneState, azimuth_deg: float = 0.0) -> Array:
        """Displacement (m, 3) of the painted dots, in the order of their pattern, for a contact at an azimuth."""
        return self._sampler(azimuth_deg).sample(state.surface_mm)

    def _sampler(self, azimuth_deg: float) -> SurfaceSampler:
        if azimuth_deg not in self._samplers:
            if len(self._samplers) > MAX_SAMPLERS:
                self._samplers = {0.0: self._samplers[0.0]}
            self._samplers[azimuth_deg] = self.surface.sampler(dot_directions(self.geometry), azimuth_deg)
        return self._samplers[azimuth_deg]

    def _library(self) -> Library:
        if self.library is None:
            raise ParameterError(
                f"level={self.level} has no library: give level=4 and the library of this shell",
                name="level",
                value=self.level,
            )
        return self.library

    def _checked(self, library: Library | None) -> Library:
        if library is None:
            raise ParameterError(
                "library=None: level 4 answers from a library; fit one with python -m sensing.simulator.library_fit",
                name="library",
                value=None,
            )
        wanted = shell_key(self.geometry, self.law)
        if not np.allclose(library.shell, wanted, rtol=1e-9) or library.modes.shape[1] != len(self.surface.position):
            raise ParameterError(
                f"library of the shell {np.round(library.shell, 4).tolist()} with {library.modes.shape[1]} points, but "
                f"this one is {np.round(wanted, 4).tolist()} with {len(self.surface.position)} (diameter, wall, C10, "
                "C20, C30, bulk): fit one for this shell and mesh",
                name="library",
                value=library.shell.tolist(),
            )
        return library

    def _from_library(self, scene: Scene, target: Target) -> SceneState | None:
        """Level 4's answer, or None where it has none to give."""
        if self.library is None or scene.indenter.kind != "plane" or target.tangential_n is None:
            return None
        if target.normal_n is None or not target.normal_n > 0:
            return None
        if math.hypot(*target.tangential_n) > tangential.MAX_CONE_SHARE * scene.friction * target.normal_n:
            return None
        found = self.library.states(
            np.array([scene.indenter.tilt_deg]), np.array([target.normal_n]), np.array([target.tangential_n])
        )
        if not (found.inside[0] and found.error_estimate[0] <= LIBRARY_LIMIT):
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

    def _reduced_model(self, indenter: Indenter, half: bool) -> ReducedModel | None:
        """Level 3's model, trained when first asked for; None where level 2 must do: other bodies, or a shell that
        cannot be followed through the training (a thin one snaps).
        """
        if indenter.kind != "plane":
            return None
        if (indenter, half) not in self._reduced:
            try:
                self._reduced[indenter, half] = trained(self._model(half), indenter)
            except Refusal:
                self._reduced[indenter, half] = None
        return self._reduced[indenter, half]

    def _answer(self, press: Press, state: State, level: int, estimate: float | None = None) -> SceneState:
        patch = contact_patch(press.model, state)
        if press.model.half:
            patch = patch.mirrored()
        certificate = state.certificate
        return SceneState(
            level=level,
            depth_mm=state.depth_mm,
            shift_mm=state.shift_mm,
            normal_n=state.normal_n,
            tangential_n=tangential.tangential_n(state, press.frame),
            wrench=state.wrench,
            surface_mm=self._surface(press.model.half).field(state.displacement),
            patch_mm2=patch.area_mm2,
            slip_share=patch.slip_share,
            error_estimate=estimate or (0.0 if level == 1 or certificate is None else certificate.residual),
            patch=patch,
            certificate=certificate,
        )

    def _model(self, half: bool) -> ShellModel:
        if half not in self._models:
            self._models[half] = shell_model(self.geometry, self.law, self.density, half)
        return self._models[half]

    def _surface(self, half: bool) -> InnerSurface:
        """Surface read from the half or the whole model, always in the half model's numbering."""
        if half not in self._surfaces:
            found = inner_surface(self._model(half))
            self._surfaces[half] = found if half else found.renumbered(self._surfaces[True])
        return self._surfaces[half]


def _in_mirror_plane(target: Target) -> bool:
    return (target.tangential_n or target.shift_mm)[1] == 0
