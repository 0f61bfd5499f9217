"""The shell under the contacts of a run: every contact is solved by itself, from the untouched shell (N, mm, degrees).

    simulator = Simulator(shell_geometry(130, 8), silicone().neo_hooke(), tolerance=1e-2)      # level 2
    states = solve_contacts(simulator, contacts)           # 2 to 12 s of one core each; see sensing.simulator.levels
    states.wrench[0]                                       # of that very state: what its picture should read

The library of level 4 ends at 38 N and 54 degrees; a rolling robot stands on tilts of 46 to 78 degrees and pulls with
up to its friction, 0.7 of the load. No state depends on the one before it: a contact is pressed along its normal and
then pulled, whatever its history in the run.
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
FRICTION = 0.9  # Coulomb coefficient of the solved contacts: a sliding endcap pulls 0.7 of its load
LEAST_N = 1.0  # load below which the patch is smaller than an element
MOST_N, MOST_TILT_DEG = 60.0, 74.0  # load and tilt beyond which one state takes minutes
EASED = ((0.0, 1.0), (0.0, 0.7), (3.0, 1.0), (3.0, 0.7), (6.0, 0.7), (10.0, 0.5))  # degrees less tilt, part of the pull
MILLI = np.array([1.0] * 3 + [1e-3] * 3)  # N mm to N m


@dataclass(frozen=True)
class PressedStates:
    """States of the shell under n contacts.

    Attributes:
        surface_mm: (n, k, 3) displacement of the simulator's inner surface, contact on azimuth 0; 0 without contact.
        wrench: (n, 6) wrench on the endcap at its origin, endcap frame, N and N m: of the solved state, not of the run.
        clamped: (n,) whether the run's contact lies outside the solved range, so that the state is that of a near one.
    """

    surface_mm: NDArray[np.float32]
    wrench: Array
    clamped: NDArray[np.bool_]


def solve_contacts(
    simulator: Simulator, contacts: Contacts, progress: Callable[[int], None] = lambda done: None
) -> PressedStates:
    """Solve the shell under every contact.

    Below :data:`LEAST_N` the state is that of this load in proportion. Above :data:`MOST_TILT_DEG` or :data:`MOST_N` it
    is that of the limit; where the simulator refuses, tilt and pull are reduced step by step.

    Args:
        simulator: simulator of the shell, level 1 or 2.
        contacts: contacts of one endcap.
        progress: called with the number of contacts done.

    Raises:
        Refusal: the simulator solves no contact near one of them.
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
    """State of a contact or of one near it, and whether it is that of another contact."""
    reason: Refusal | None = None
    for tilt_deg, normal_n, pull_n, eased in _tried(contacts, k):
        try:
            walk = simulator.walk(Scene(Indenter(tilt_deg), FRICTION))
            return walk(Target(normal_n, tangential_n=(float(pull_n[0]), float(pull_n[1])))), eased
        except Refusal as refusal:
            LOG.debug(f"tilt {tilt_deg:.1f}, {normal_n:.1f} N, pull {pull_n}: {refusal}")
            reason = refusal
        finally:
            simulator.forget()  # a state depends only on its own contact
    assert reason is not None
    raise reason


def _tried(contacts: Contacts, k: int) -> Iterator[tuple[float, float, Array, bool]]:
    """(tilt, load, pull, whether they are another contact's) to try, in this order."""
    load, tilt = float(contacts.normal_n[k]), float(contacts.tilt_deg[k])
    taken, leaned = float(np.clip(load, LEAST_N, MOST_N)), min(tilt, MOST_TILT_DEG)
    ratio = contacts.tangential_n[k] / load
    beyond = load > MOST_N or leaned < tilt
    for less_deg, part in EASED:
        yield leaned - less_deg, taken, part * ratio * taken, beyond or (less_deg, part) != EASED[0]


def save_states(states: PressedStates, path: Path) -> None:
    """Write the states as ``.npz`` under a temporary name, then rename the file."""
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
