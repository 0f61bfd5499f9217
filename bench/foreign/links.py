"""Where the error comes from: one link after another between a solved state and the wrench that live answers.

A chain begins with the motion of the dots as a solver knows it and ends with the picture; the wrench of each is the
model's answer less the true one (N, N m). Motions are seen through the sensor's true camera at the dots that the
tracker found, so that two chains differ by nothing but their links.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RBFInterpolator

from bench.foreign.mesh import Array
from bench.foreign.press import PlanePath, Pressed
from bench.foreign.solved import DESIGN
from bench.foreign.world import turn
from cad.materials import silicone
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.frames import T_sphere_endcap, wrench_adjoint
from sensing.learning.marker_fields import PLAIN, MarkerSensor
from sensing.live.core.model import LiveModel
from sensing.records import DotTracks, ShearField
from sensing.records_labelled import LabelledFrame, LabelledSet
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Target
from sensing.simulator.scene import Scene, SceneState
from sensing.simulator.shown import shown_mm
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.surface import OUTLINE_POINTS, outline_directions, ring_directions
from sensing.tracking.model_input import model_input

GEOMETRY = shell_geometry(130, 8)
CENTRE = np.array(GEOMETRY.centre_mm)
NEIGHBOURS = 40  # nodes that a displacement is interpolated from
Motion = Callable[[Array], Array]  # points (n, 3) of the inner sphere at azimuth 0 -> displacements (n, 3), mm


@dataclass(frozen=True)
class Link:
    """One answer about one state.

    Attributes:
        chain: how it was made. path, step: of the state. error, truth: (6,). tracked_px: rms by which tracked dots
            moved otherwise than the solver says, of chains with a picture.
    """

    chain: str
    path: int
    step: int
    error: Array
    truth: Array
    tracked_px: float = float("nan")


@dataclass(frozen=True)
class OurStates:
    """A simulator and what it found, path by path."""

    simulator: Simulator
    states: list[list[SceneState]]


class SeenDots:
    """Dots of one sensor on the inner sphere, and what the model answers about their motions.

    Args:
        item: a frame of the sensor with its reference. camera: the true one. model: the wrench model.
        data: the set.
    """

    def __init__(self, item: LabelledFrame, camera: MountedCamera, model: LiveModel, data: LabelledSet) -> None:
        self.seen = model_input(item.reference, model.shape, data.params, camera, model.radial)
        self.tracks = self.seen.track(self.seen.decode(item.frame), item.frame.time_s)
        self._camera, self._model = camera, model
        self._azimuth = float(item.labels["azimuth_deg"])
        self._on_sphere = camera.on_sphere(self.tracks.reference_px, CENTRE, GEOMETRY.inner_radius_mm) - CENTRE

    def moved_px(self, motion: Motion) -> Array:
        """(n, 2) displacement that windows would show of a motion."""
        outward = self._on_sphere / np.linalg.norm(self._on_sphere, axis=1, keepdims=True)
        ring = GEOMETRY.inner_radius_mm * ring_directions(outward, GEOMETRY)
        R = turn(self._azimuth)
        there = ring + motion(ring @ R + CENTRE) @ R.T
        found = self._camera.project(there + CENTRE) - self._camera.project(ring + CENTRE)
        return np.asarray(found.reshape(-1, OUTLINE_POINTS, 2).mean(axis=1))

    def answer(self, moved_px: Array) -> Array:
        """(6,) wrench about the sphere's centre."""
        now = self.tracks
        tracks = DotTracks(
            now.time_s, now.ids, now.reference_px, now.reference_px + moved_px, now.quality, now.lost, now.size
        )
        found = self._model.estimator.estimate(self.seen.field(tracks))
        return np.concatenate([found.force_n, found.torque_nm])


def links(data: LabelledSet, model: LiveModel, states: list[Pressed], ours: dict[str, OurStates]) -> list[Link]:
    """All chains of one sensor.

    Args:
        data: its pictures. model: the wrench model. states: CalculiX's, path by path.
        ours: states of our simulator with the plane in the same places, by the density of the mesh.
    """
    camera, found = MountedCamera.load(data.folder / "camera.json"), []
    to_sphere = wrench_adjoint(T_sphere_endcap(data.params))
    for item in data.frames():
        path, step, R = int(item.path), int(item.labels["step"]), turn(float(item.labels["azimuth_deg"]))
        dots = SeenDots(item, camera, model, data)
        truth = to_sphere @ np.concatenate([item.wrench.force_n, item.wrench.torque_nm])
        for density, solved in ours.items():
            state = solved.states[path][step]
            own = to_sphere @ np.concatenate([R @ state.wrench[:3], R @ state.wrench[3:] / 1000])
            motion = _our_motion(solved.simulator, state)
            found.append(
                Link(f"our {density} mesh, exact dots", path, step, dots.answer(dots.moved_px(motion)) - own, own)
            )
        exact = dots.moved_px(their_motion(states[path], step))
        found.append(Link("CalculiX, exact dots", path, step, dots.answer(exact) - truth, truth))
        shown = dots.tracks.displacement_px
        use = ~dots.tracks.lost & np.isfinite(exact).all(axis=1)
        apart = float(np.sqrt(((shown - exact)[use] ** 2).mean()))
        found.append(Link("picture, true camera", path, step, dots.answer(shown) - truth, truth, apart))
    return found


def our_states(paths: tuple[PlanePath, ...], density: str) -> OurStates:
    """States of our simulator with the plane in the same places.

    Args:
        paths: of the plane. density: of the mesh.
    """
    simulator = Simulator(GEOMETRY, silicone().neo_hooke(), density)
    found = []
    for path in paths:
        targets = [Target(depth_mm=depth, shift_mm=(shift, 0.0)) for depth, shift in path.places]
        found.append(list(simulator.follow(Scene(Indenter(path.tilt_deg), path.friction), targets)))
    return OurStates(simulator, found)


def nominal_answers(shown: Array, model: LiveModel) -> Array:
    """(s, 6) what the model answers where the nominal camera sees every dot in its place and without error.

    Args:
        shown: (s, d, 3) displacements in mm that windows show, dot by dot. model: the wrench model.
    """
    sensor = MarkerSensor(DESIGN, model.shape, PLAIN, np.random.default_rng(0))
    answers = [model.estimator.estimate(ShearField(0.0, field, valid=sensor.valid)) for field in sensor.fields(shown)]
    return np.array([np.concatenate([answer.force_n, answer.torque_nm]) for answer in answers])


def shown_of(states: Pressed) -> Array:
    """(s, d, 3) displacements that windows would show of CalculiX's states, dot by dot."""
    ring = CENTRE + GEOMETRY.inner_radius_mm * outline_directions(GEOMETRY)
    camera = nominal_mount(DESIGN)
    return np.array([shown_mm(GEOMETRY, their_motion(states, step)(ring), camera) for step in range(len(states.moved))])


def _our_motion(simulator: Simulator, state: SceneState) -> Motion:
    return lambda points: np.asarray(simulator.surface.interpolation(points) @ state.surface_mm)


def their_motion(pressed: Pressed, step: int) -> Motion:
    """Of both halves, interpolated between the nodes."""
    apart, mirror = pressed.rest[:, 1] > 1e-6, np.array([1.0, -1.0, 1.0])
    rest = np.concatenate([pressed.rest, pressed.rest[apart] * mirror])
    moved = np.concatenate([pressed.moved[step], pressed.moved[step][apart] * mirror])
    return RBFInterpolator(rest, moved, neighbors=NEIGHBOURS)
