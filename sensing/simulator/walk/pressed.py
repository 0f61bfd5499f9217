"""The shell under the contacts of a run: every contact is solved by itself, from the untouched shell (N, mm, degrees).

    simulator = Simulator(shell_geometry(130, 8), silicone().neo_hooke(), tolerance=1e-2)      # level 2
    states = solve_contacts(simulator, contacts)           # 2 to 12 s of one core each; see sensing.simulator.levels
    states.wrench[0]                                       # of that very state: what its picture should read

The library of level 4 ends at 38 N and 54 degrees; a rolling robot stands on tilts of 46 to 78 degrees and pulls with
up to its friction, 0.7 of the load. No state knows the one before it: a contact is pressed along its normal and then
pulled, however it came about in the run.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cad.errors import FileError
from cad.messages import LOG
from cad.whole_file import put_file
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Target
from sensing.simulator.press.state import Refusal
from sensing.simulator.scene import Scene, SceneState
from sensing.simulator.solid.surface import turn_wrench
from sensing.simulator.walk.contacts import Contacts
from sensing.simulator.walk.truth import DAMAGED

Array = NDArray[np.float64]
FRICTION = 0.9  # of the solved contacts: the pull of a sliding endcap, 0.7 of its load, has to be held
LEAST_N = 1.0  # below, the patch is smaller than an element
MOST_N, MOST_TILT_DEG = 60.0, 74.0  # beyond, one state takes minutes
EASED = ((0.0, 1.0), (0.0, 0.7), (3.0, 1.0), (3.0, 0.7), (6.0, 0.7), (10.0, 0.5))  # degrees less tilt, part of the pull
MILLI = np.array([1.0] * 3 + [1e-3] * 3)  # N mm to N m


@dataclass(frozen=True)
class PressedStates:
    """The shell under n contacts.

    Attributes:
        surface_mm: (n, k, 3) displacement of the simulator's inner surface, contact on azimuth 0; 0 without contact.
        wrench: (n, 6) on the endcap at its origin, endcap frame, N and N m: of this very state, not of the run.
        clamped: (n,) True where the run's contact lies beyond what was solved: the state is of a contact near it.
    """

    surface_mm: NDArray[np.float32]
    wrench: Array
    clamped: NDArray[np.bool_]


def solve_contacts(
    simulator: Simulator, contacts: Contacts, progress: Callable[[int], None] = lambda done: None
) -> PressedStates:
    """Solve the shell under every contact.

    A load below :data:`LEAST_N` is the state of that load in proportion. A tilt or load beyond :data:`MOST_TILT_DEG`
    and :data:`MOST_N` is theirs; where the simulator refuses, tilt and pull are eased step by step.

    Args:
        simulator: of the shell, level 1 or 2.
        contacts: of one endcap.
        progress: called with the count of moments done.

    Raises:
        Refusal: no contact near one of them has an answer.
    """
    count = len(contacts.time_s)
    surface = np.zeros((count, len(simulator.surface.position), 3), dtype=np.float32)
    wrench, clamped = np.zeros((count, 6)), np.zeros(count, dtype=bool)
    for k in range(count):
        if contacts.normal_n[k] > 0:
            state, clamped[k] = _solve(simulator, contacts, k)
            share = min(1.0, float(contacts.normal_n[k]) / LEAST_N)
            surface[k] = share * state.surface_mm
            wrench[k] = share * turn_wrench(state.wrench, float(contacts.azimuth_deg[k])) * MILLI
        progress(k + 1)
    return PressedStates(surface, wrench, clamped)


def _solve(simulator: Simulator, contacts: Contacts, k: int) -> tuple[SceneState, bool]:
    """State of a contact or of one near it, and whether it is another's."""
    reason: Refusal | None = None
    for tilt_deg, normal_n, pull_n, eased in _tried(contacts, k):
        try:
            walk = simulator.walk(Scene(Indenter(tilt_deg), FRICTION))
            return walk(Target(normal_n, tangential_n=(float(pull_n[0]), float(pull_n[1])))), eased
        except Refusal as refusal:
            LOG.debug(f"tilt {tilt_deg:.1f}, {normal_n:.1f} N, pull {pull_n}: {refusal}")
            reason = refusal
        finally:
            simulator.forget()  # a state depends on its own contact alone
    assert reason is not None
    raise reason


def _tried(contacts: Contacts, k: int) -> Iterator[tuple[float, float, Array, bool]]:
    """(tilt, load, pull, whether it is another contact's) to try, in this order."""
    load, tilt = float(contacts.normal_n[k]), float(contacts.tilt_deg[k])
    taken, leaned = float(np.clip(load, LEAST_N, MOST_N)), min(tilt, MOST_TILT_DEG)
    ratio = contacts.tangential_n[k] / load
    beyond = load > MOST_N or leaned < tilt
    for less_deg, part in EASED:
        yield leaned - less_deg, taken, part * ratio * taken, beyond or (less_deg, part) != EASED[0]


def save_states(states: PressedStates, path: Path) -> None:
    """Write ``.npz`` under a temporary name, then rename."""
    np.savez_compressed(buffer := io.BytesIO(), **{one.name: getattr(states, one.name) for one in fields(states)})
    put_file(path, buffer.getvalue())


def load_states(path: Path) -> PressedStates:
    """Read what :func:`save_states` wrote; nothing is unpickled.

    Raises:
        FileError: missing, damaged, or another file.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            return PressedStates(**{one.name: data[one.name] for one in fields(PressedStates)})
    except DAMAGED as error:
        raise FileError(f"{path}: no solved contacts ({error}): remove it, and they are solved anew") from None
