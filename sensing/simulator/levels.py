"""The simulator's facade: states of a scene along a path, at a chosen level (mm, N, N mm; endcap frame).

    simulator = Simulator(shell_geometry(130, 8), silicone().neo_hooke(), level=2)
    scene = Scene(Indenter(tilt_deg=30), friction=0.5)
    for state in simulator.follow(scene, [Target(normal_n=5), Target(normal_n=20, shift_mm=(1.0, 0.0))]):
        print(state.level, state.wrench, simulator.markers(state, azimuth_deg=45))

==  ==========================================================  =====================================================
1   Newton on the full model                                    nothing left out
2   stored tangents, contact condensed on the patch             nothing; residual below ``tolerance`` instead of 1e-9
3   50 modes, 60 elements at most, contact as in 1              fields outside the modes' span: see the report
4   polynomials fitted to level 2 (a library)                   path, stick and slip; planes only; no contact patch
==  ==========================================================  =====================================================

A state that a level cannot certify is solved by the level above it; ``SceneState.level`` states which one. Paths in
the mirror plane (``shift`` and tangential force along the meridian only) are solved on half of the mesh. Contacts lie
on azimuth 0: ``markers`` turns the field, :func:`sensing.simulator.solid.surface.turn_wrench` the wrench. Level 4
takes targets given by normal and tangential force (``Target(normal_n, tangential_n=...)``, or :meth:`Simulator.bulk`
for many at once); it has no path: a fall-back of ``bulk`` presses in steps, then pulls; one of ``follow`` goes
straight from the last one. Level 3 is trained when it first meets a plane at a tilt (some hundred level 2 states).

Rate effects (levels 1 and 2) need the silicone's series, and targets then state the times at which they are reached:

    simulator = Simulator(shell_geometry(130, 8), silicone().neo_hooke(), prony=silicone().prony_series())
    simulator.follow(scene, [Target(depth_mm=4, time_s=0.05), Target(depth_mm=4, time_s=1.0)])
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cad.errors import ParameterError
from cad.materials import HyperelasticLaw
from sensing.camera.mount import MountedCamera
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.press import tangential, validity
from sensing.simulator.press.condensed import StoredTangent
from sensing.simulator.press.frozen import TOLERANCE, FrozenPress
from sensing.simulator.press.press import Press, Target
from sensing.simulator.press.ramp import by_force, ramp
from sensing.simulator.press.state import Refusal, State, contact_patch
from sensing.simulator.reduced.basis import ReducedModel
from sensing.simulator.reduced.library.level import LibraryLevel
from sensing.simulator.reduced.library.library import Library
from sensing.simulator.reduced.press import ReducedPress, trained
from sensing.simulator.scene import BulkStates, Scene, SceneState
from sensing.simulator.shown import shown_mm
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.geometry import ShellGeometry
from sensing.simulator.solid.mesh import MeshDensity
from sensing.simulator.solid.rate_effects import Prony
from sensing.simulator.solid.shell import PLAIN
from sensing.simulator.solid.shell_halves import ShellHalves
from sensing.simulator.solid.surface import turn_wrench

LEVELS = (1, 2, 3, 4)  # see the module's text
RATE_LEVELS = (1, 2)  # levels with rate effects; the others are fitted to elastic states
MAX_TOLERANCE = 1e-2  # largest tolerance that is accepted
Answer = Callable[[Target], SceneState]


class Simulator:
    """A shell ready for scenes at one level; meshes and tangents are built when first needed and kept.

    Args:
        geometry, law, density: the shell, its silicone, and the density of its mesh.
        level: 1 to 4 (see the module's text).
        tolerance: relative residual of level 2.
        library: fitted library of level 4 (:mod:`sensing.simulator.reduced.library.fit`).
        prony: rate effects of the silicone, pairs (g, tau_s); none by default.
        interlock: stiffness of the zone with the TPU gyroid over that of silicone.

    Raises:
        ParameterError: unknown level or density, tolerance out of range, no library or one of another shell or mesh,
            rate effects on a level that has none, an interlock out of range.
    """

    def __init__(
        self,
        geometry: ShellGeometry,
        law: HyperelasticLaw,
        density: MeshDensity | str = "data",
        level: int = 2,
        tolerance: float = TOLERANCE,
        library: Library | None = None,
        prony: Prony = (),
        interlock: float = PLAIN,
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
        _require_in_level(level, prony, interlock)
        self.geometry, self.law, self.prony = geometry, law, prony
        self.level, self.tolerance = level, tolerance
        self._shell = ShellHalves(geometry, law, density, interlock)
        self.surface = self._shell.surface
        self._tangents: dict[tuple[Indenter, bool], list[StoredTangent]] = {}
        self._reduced: dict[tuple[Indenter, bool], ReducedModel | None] = {}
        self._library = LibraryLevel(library, self._shell) if level == 4 else None

    def follow(self, scene: Scene, targets: Sequence[Target], began_s: float = 0.0) -> Iterator[SceneState]:
        """States along a path from the untouched shell, one for each target.

        Args:
            scene: the indenter, its first touch and its friction.
            targets: end of each step, in order.
            began_s: time at which the shell was last untouched, on the path's clock, s.

        Raises:
            Refusal: the simulator cannot solve that target reliably; the states before it are valid.
        """
        yield from map(self._answers(scene, targets, began_s), targets)

    def press(
        self, normal_n: float | None = None, tilt_deg: float = 0.0, shift_mm: tuple[float, float] = (0.0, 0.0),
        depth_mm: float | None = None, **scene: Any,
    ) -> SceneState:  # fmt: skip
        """One press from the untouched shell to a force or a depth, in steps; those too small for the mesh are skipped.

        Args:
            normal_n: force along the inward normal at first touch, N; None under a given depth.
            tilt_deg: polar angle of first contact from the tip, degrees.
            shift_mm: tangential travel along (meridian, lateral) at the end, mm.
            depth_mm: approach from first touch, mm, which also passes states where the force falls (a snap).
            scene: friction (0.5), and kind, radius_mm, axis_deg of the :class:`Indenter` (a plane).

        Raises:
            ParameterError: both or neither of force and depth are given.
            Refusal: the simulator cannot solve the state reliably.
        """
        friction = float(scene.pop("friction", 0.5))
        targets = ramp(self.geometry, self.law, normal_n, depth_mm, shift_mm)
        states: list[SceneState] = []
        answer = self._answers(Scene(Indenter(tilt_deg, **scene), friction), targets)
        for target in targets:
            try:
                states.append(answer(target))
            except Refusal as refusal:  # a small body lies between the points of contact until it is pressed deeper
                if refusal.reason != "mesh" or (target.normal_n, target.depth_mm) == (normal_n, depth_mm):
                    raise validity.after(refusal, states[-1:]) from refusal
        validity.warn_of_fall(states)
        return states[-1]

    def walk(self, scene: Scene, half: bool = False, began_s: float = 0.0) -> Answer:
        """A function from target to state, for a path that is not known beforehand; it never uses the library.

        Args:
            scene: the indenter, its first touch and its friction.
            half: whether the path stays in the mirror plane.
            began_s: time at which the path starts, s.
        """
        press = Press(self._shell.model(half), scene.indenter, scene.friction, self.prony)
        fast = FrozenPress(press, self.tolerance, self._tangents.setdefault((scene.indenter, half), []))
        model = self._reduced_model(scene.indenter, half) if self.level == 3 else None
        reduced = ReducedPress(fast, model) if model is not None else None
        solver = press if self.level == 1 else reduced or fast
        here = replace(solver.start(), time_s=began_s)

        def step(target: Target) -> SceneState:
            nonlocal here
            if target.tangential_n is None:
                here = solver.advance(here, target)
            else:
                here = tangential.reach(solver.advance, here, target, press.frame, scene.friction, half)
            return self._answer(press, here)

        return step

    def bulk(
        self, tilt_deg: Array, normal_n: Array, tangential_n: Array, friction: float = 0.5, azimuth_deg: float = 0.0
    ) -> BulkStates:
        """Level 4 states of a plane.

        States outside the library's range, or with too large an error estimate, are pressed one by one on level 2.

        Args:
            tilt_deg: polar angles of first contact (s,), degrees.
            normal_n: normal forces (s,), N.
            tangential_n: tangential forces along (meridian, lateral) (s, 2), N.
            friction: Coulomb's mu.
            azimuth_deg: azimuth of all contacts, degrees.

        Raises:
            ParameterError: the simulator has no library.
            Refusal: a state that no level can solve.
        """
        if self._library is None:
            raise ParameterError(
                f"level={self.level} has no library: give level=4 and the library of this shell",
                name="level",
                value=self.level,
            )
        found = self._library.bulk(tilt_deg, normal_n, tangential_n, friction, azimuth_deg)
        for k in np.flatnonzero(found.level == 2):
            walk, load_n = self.walk(Scene(Indenter(float(tilt_deg[k])), friction)), float(normal_n[k])
            pulled = Target(load_n, tangential_n=(float(tangential_n[k, 0]), float(tangential_n[k, 1])))
            *_, state = map(walk, [*by_force(self.geometry, self.law, load_n), pulled])
            found.marker_mm[k] = self.markers(state, azimuth_deg)
            found.wrench[k] = turn_wrench(state.wrench, azimuth_deg)
            found.error_estimate[k], found.level[k] = state.error_estimate, state.level
        return found

    def forget(self) -> None:
        """Drop the stored tangents, so that later states do not depend on earlier ones (at the start of a shard).

        The models of level 3 are kept, because they depend on shell and body alone.
        """
        self._tangents.clear()

    def markers(self, state: SceneState, azimuth_deg: float = 0.0) -> Array:
        """Displacement (m, 3) of the painted dots, in the order of their pattern, for a contact at an azimuth."""
        return self._shell.sampler(azimuth_deg).sample(state.surface_mm)

    def outlines(self, state: SceneState, camera: MountedCamera, azimuth_deg: float = 0.0) -> Array:
        """Displacement (m, 3), mm, that tracked windows show of the dots: the mean of rings round them in the picture.

        Args:
            state: a state of the scene.
            camera: camera in which the dots are tracked.
            azimuth_deg: azimuth of the contact, degrees.
        """
        return shown_mm(self.geometry, self._shell.outlines(azimuth_deg).sample(state.surface_mm), camera)

    def _answers(self, scene: Scene, targets: Sequence[Target], began_s: float = 0.0) -> Answer:
        """Solver of the targets in turn: the library where it can, else a walk from the untouched shell."""
        half = scene.indenter.keeps_mirror and all(_in_mirror_plane(target) for target in targets)
        walk, library = self.walk(scene, half, began_s), self._library
        return lambda target: (library.answer(scene, target) if library else None) or walk(target)

    def _reduced_model(self, indenter: Indenter, half: bool) -> ReducedModel | None:
        """Level 3's model, trained when it is first needed; None for other bodies than planes, or a shell that cannot
        follow the training path (a thin one snaps): then level 2 is used.
        """
        if indenter.kind != "plane":
            return None
        if (indenter, half) not in self._reduced:
            try:
                self._reduced[indenter, half] = trained(self._shell.model(half), indenter)
            except Refusal:
                self._reduced[indenter, half] = None
        return self._reduced[indenter, half]

    def _answer(self, press: Press, state: State) -> SceneState:
        half = contact_patch(press.model, state)
        patch = half.mirrored() if press.model.half else half
        return SceneState(
            level=state.level,
            depth_mm=state.depth_mm,
            shift_mm=state.shift_mm,
            normal_n=state.normal_n,
            tangential_n=tangential.tangential_n(state, press.frame),
            wrench=state.wrench,
            surface_mm=self._shell.surface_of(press.model.half).field(state.displacement),
            patch_mm2=patch.area_mm2,
            slip_share=patch.slip_share,
            error_estimate=_error_estimate(state),
            patch=patch,
            certificate=state.certificate,
        )


def _error_estimate(state: State) -> float:
    """Level 3's expected relative error of the markers; at level 2 the residual of the forces, at level 1 zero."""
    if state.error_estimate is not None:
        return state.error_estimate
    return 0.0 if state.level == 1 or state.certificate is None else state.certificate.residual


def _in_mirror_plane(target: Target) -> bool:
    return (target.tangential_n or target.shift_mm)[1] == 0


def _require_in_level(level: int, prony: Prony, interlock: float) -> None:
    """Refuse rate effects on a fitted level, and an interlock on the library's."""
    if prony and level not in RATE_LEVELS:
        raise ParameterError(
            f"level={level} has no rate effects: choose {' or '.join(map(str, RATE_LEVELS))}, or leave prony out",
            name="level",
            value=level,
        )
    if level == 4 and interlock != PLAIN:
        raise ParameterError(
            f"interlock={interlock:g} at level 4: its library was fitted to plain silicone; choose level 1, 2 or 3",
            name="interlock",
            value=interlock,
        )
