"""Solves the states of a loading path at the requested level; refused states are listed.

All states are at azimuth 0 (N, mm, N mm, endcap frame). A simulator with rate effects follows the path's clock. After
the first touch, it also solves the shell while the body is apart, because the shell recovers slowly.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from cad.errors import ParameterError
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Target
from sensing.simulator.press.state import Refusal
from sensing.simulator.protocols.loading import LoadPath, Waypoint
from sensing.simulator.scene import Scene, SceneState


@dataclass(frozen=True)
class PathState:
    """Solved states of one waypoint.

    Attributes:
        step: number of the waypoint in the path.
        end: state when the exposure ends.
        begin: state when the exposure began (the same object for a state at rest).
    """

    step: int
    begin: SceneState
    end: SceneState


def path_states(
    simulator: Simulator, path: LoadPath, body: Indenter | None = None
) -> tuple[list[PathState], list[str]]:
    """States of a path and its refusals, one line each; after a refusal, waypoints are skipped until the body is apart.

    With rate effects they are skipped to the end, because the material's history is unknown after a refusal.

    Args:
        simulator: solver of the states.
        path: loading path of the body.
        body: the indenter; None for a plane at the path's tilt.

    Raises:
        ParameterError: rate effects on a path without times.
    """
    scene = Scene(body or Indenter(tilt_deg=path.tilt_deg), path.friction)
    states: list[PathState] = []
    refusals: list[str] = []
    waypoints = _remembered(path) if simulator.prony else path.waypoints
    for touching, group in groupby(enumerate(waypoints), key=lambda item: item[1].target is not None):
        numbered = list(group)
        if not touching:
            states += [apart_state(simulator, step, point, simulator.level) for step, point in numbered]
            continue
        done = len(states)
        try:
            for state in _solved(simulator, scene, numbered, path.began_s or 0.0):
                states.append(state)  # one by one, so that those before a refusal are kept
        except Refusal as refusal:
            lost = numbered[len(states) - done :]
            refusals.append(f"path {path.number} states {lost[0][0]}..{lost[-1][0]}: {refusal}")
    return states, refusals


def _remembered(path: LoadPath) -> tuple[Waypoint, ...]:
    """Waypoints from the first touch on, those without contact included, which relaxation needs."""
    if path.began_s is None:
        raise ParameterError(
            f"path {path.number} carries no time: rate effects need a path that says when its targets are reached",
            name="began_s",
            value=None,
        )
    first = next((k for k, point in enumerate(path.waypoints) if point.target is not None), len(path.waypoints))
    after = [
        point if point.target else replace(point, target=Target(depth_mm=-point.apart_mm, time_s=point.time_s))
        for point in path.waypoints[first:]
    ]
    return (*path.waypoints[:first], *after)


def _solved(
    simulator: Simulator, scene: Scene, numbered: list[tuple[int, Waypoint]], began_s: float
) -> Iterator[PathState]:
    targets: list[Target] = []
    for _, point in numbered:
        assert point.target is not None
        targets += [*point.via, *([] if point.begins is None else [point.begins]), point.target]
    answers = simulator.follow(scene, targets, began_s)
    for step, point in numbered:
        for _ in point.via:
            next(answers)
        begin = next(answers)
        yield PathState(step, begin, begin if point.begins is None else next(answers))


def apart_state(simulator: Simulator, step: int, point: Waypoint, level: int) -> PathState:
    """State of the untouched shell, which needs no solution.

    Args:
        simulator: simulator of the shell.
        step, point: number of the waypoint in its path, and the waypoint.
        level: level that the state states.
    """
    rest = np.zeros_like(simulator.surface.position)
    state = SceneState(
        level, -point.apart_mm, (0.0, 0.0), 0.0, (0.0, 0.0), np.zeros(6), rest, 0.0, 0.0, 0.0, None, None
    )
    return PathState(step, state, state)
