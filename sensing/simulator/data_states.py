"""A loading path to solved states, at the level asked for; what the simulator refuses is listed, never lost.

All states are at azimuth 0 (N, mm, N mm, endcap frame).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from sensing.simulator.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.loading import LoadPath, Waypoint
from sensing.simulator.press import Target
from sensing.simulator.scene import Scene, SceneState
from sensing.simulator.state import Refusal


@dataclass(frozen=True)
class PathState:
    """One waypoint solved.

    Attributes:
        step: its number in the path.
        end: state when the exposure ends. begin: when it began (the same object for a state at rest).
    """

    step: int
    begin: SceneState
    end: SceneState


def path_states(simulator: Simulator, path: LoadPath) -> tuple[list[PathState], list[str]]:
    """States of a path and its refusals, one line each; after a refusal, waypoints are lost until the body is clear."""
    scene = Scene(Indenter(tilt_deg=path.tilt_deg), path.friction)
    states: list[PathState] = []
    refusals: list[str] = []
    for touching, group in groupby(enumerate(path.waypoints), key=lambda item: item[1].target is not None):
        numbered = list(group)
        if not touching:
            states += [_apart(simulator, step, point) for step, point in numbered]
            continue
        done = len(states)
        try:
            for state in _solved(simulator, scene, numbered):
                states.append(state)  # one by one: those before a refusal stand
        except Refusal as refusal:
            lost = numbered[len(states) - done :]
            refusals.append(f"path {path.number} states {lost[0][0]}..{lost[-1][0]}: {refusal}")
    return states, refusals


def _solved(simulator: Simulator, scene: Scene, numbered: list[tuple[int, Waypoint]]) -> Iterator[PathState]:
    targets: list[Target] = []
    for _, point in numbered:
        assert point.target is not None
        targets += [*point.via, *([] if point.begins is None else [point.begins]), point.target]
    answers = simulator.follow(scene, targets)
    for step, point in numbered:
        for _ in point.via:
            next(answers)
        begin = next(answers)
        yield PathState(step, begin, begin if point.begins is None else next(answers))


def _apart(simulator: Simulator, step: int, point: Waypoint) -> PathState:
    """Nothing touches: nothing to solve."""
    rest = np.zeros_like(simulator.surface.position)
    state = SceneState(
        simulator.level, -point.apart_mm, (0.0, 0.0), 0.0, (0.0, 0.0), np.zeros(6), rest, 0.0, 0.0, 0.0, None, None
    )
    return PathState(step, state, state)
