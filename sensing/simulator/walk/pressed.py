"""Shells pressed as hard and as slantingly as a robot presses them, and the states between those that were solved.

    presses = [solve_tilt(simulator, tilt) for tilt in TILTS_DEG]     # some minutes of one core; level 2
    library = fit_presses(simulator, presses)                         # level 4, sensing.simulator.reduced.library
    states = states_of(library, contacts)                             # with what had to be clamped

The library that data sets use ends at 38 N and 54 degrees; a robot of 12 kg on three endcaps presses with 50 N at 60
degrees and lands with more. The fit is the same, the range is not: tilts 46 to 71.6 degrees, 1 to 80 N, pulls to 0.75
of the load. Forces in N, mm, N mm; azimuth 0.
"""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Callable, Sequence
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
from sensing.simulator.reduced.library import Library, LibraryStates
from sensing.simulator.reduced.library_fit import DEGREE, Sample, fit
from sensing.simulator.reduced.library_level import LIMIT
from sensing.simulator.scene import Scene, SceneState
from sensing.simulator.solid.surface import turn_wrench
from sensing.simulator.walk.contacts import Contacts

Array = NDArray[np.float64]
TILTS_DEG = (46.0, 50.4, 61.0, 71.6)  # at 76 degrees and 80 N single states take minutes
LOADS_N = (1.0, 80.0)
CONE = 0.75  # largest pull over load: a sliding endcap's is its friction, 0.7
FRICTION = 0.9  # of the solved presses: a pull of a sliding endcap has to be held
STATES = 105  # a tilt
MOST_PATHS = 12  # begun at a tilt: a refused state ends one
LOADS_TRIED, SIZES_TRIED, ANGLES_TRIED = 13, 6, 12  # in place of a state that is not good enough
SOFTEST_N_MM, STIFFENING, STIFFEST_N_MM = 4.0, 0.2, 12.0  # tangential, by load, to steer the path (E)


@dataclass(frozen=True)
class Presses:
    """Solved states at one tilt, contact on azimuth 0.

    Attributes:
        tilt_deg: of the plane. normal_n: (s,). tangential_n: (s, 2) along (meridian, lateral).
        depth_mm, patch_mm2: (s,). shift_mm: (s, 2). wrench: (s, 6) on the endcap at its origin, N and N mm.
        surface_mm: (s, k, 3) displacement of the simulator's inner surface.
        refused: (r, 3) load and pull asked for where the simulator refused.
    """

    tilt_deg: float
    normal_n: Array
    tangential_n: Array
    depth_mm: Array
    patch_mm2: Array
    shift_mm: Array
    wrench: Array
    surface_mm: NDArray[np.float32]
    refused: Array


def solve_tilt(
    simulator: Simulator,
    tilt_deg: float,
    states: int = STATES,
    seed: int = 0,
    loads_n: tuple[float, float] = LOADS_N,
    progress: Callable[[int], None] = lambda done: None,
) -> Presses:
    """Press a shell at one tilt along winding paths through the range of loads and pulls.

    Args:
        simulator: of the shell, level 1 or 2. tilt_deg: of the plane. states: how many. seed: of the paths.
        loads_n: least and most. progress: called with the count of states solved.

    Raises:
        Refusal: too many of the states were refused.
    """
    rng = np.random.default_rng([seed, round(1000 * tilt_deg)])
    found: list[SceneState] = []
    refused: list[tuple[float, float, float]] = []
    for _ in range(MOST_PATHS):
        walk, shift, pull = simulator.walk(Scene(Indenter(tilt_deg), FRICTION)), np.zeros(2), np.zeros(2)
        for normal, wanted in _winding(rng, states - len(found), loads_n):
            shift = shift + (wanted - pull) / min(SOFTEST_N_MM + STIFFENING * normal, STIFFEST_N_MM)
            try:
                state = walk(Target(normal_n=normal, shift_mm=(float(shift[0]), float(shift[1]))))
            except Refusal as refusal:
                LOG.debug(f"tilt {tilt_deg:g}, {normal:.0f} N: {refusal}")
                refused.append((normal, float(wanted[0]), float(wanted[1])))
                break
            pull = np.array(state.tangential_n)
            found.append(state)
            progress(len(found))
        if len(found) >= states:
            return _gathered(tilt_deg, found, refused)
    raise Refusal("unconverged", f"only {len(found)} of {states} states at tilt {tilt_deg:g} could be solved")


def _winding(rng: np.random.Generator, states: int, loads_n: tuple[float, float]) -> list[tuple[float, Array]]:
    """Loads and pulls (2,) asked for, even over the root of the load: half of them lie below a third of the most."""
    low, high = np.sqrt(loads_n)
    angle, phase = rng.uniform(0, 2 * math.pi, 2)
    sense, press, found = float(rng.choice([-1.0, 1.0])), 0.0, []
    for _ in range(states):
        normal = float((low + (high - low) * (1 - math.cos(press)) / 2) ** 2)
        size = CONE * math.sqrt((1 - math.cos(phase)) / 2) * normal  # even over the disc of the pulls
        found.append((normal, size * np.array([math.cos(angle), math.sin(angle)])))
        press += float(rng.uniform(0.03, 0.09))  # steps that level 2 takes on a tangent it has
        phase += float(rng.uniform(0.06, 0.14))
        angle += sense * float(rng.uniform(0.06, 0.16))
    return found


def _gathered(tilt_deg: float, states: Sequence[SceneState], refused: list[tuple[float, float, float]]) -> Presses:
    def column(name: str) -> Array:
        return np.array([getattr(state, name) for state in states], dtype=float)

    return Presses(
        tilt_deg, column("normal_n"), column("tangential_n"), column("depth_mm"), column("patch_mm2"),
        column("shift_mm"), column("wrench"), column("surface_mm").astype(np.float32),
        np.array(refused, dtype=float).reshape(-1, 3),
    )  # fmt: skip


def fit_presses(simulator: Simulator, presses: Sequence[Presses], degree: int = DEGREE) -> Library:
    """The library between solved presses.

    Args:
        simulator: that solved them. presses: at two tilts or more. degree: of the polynomials in load and pull.

    Raises:
        ParameterError: too few states at a tilt.
    """
    samples = [Sample(part.tilt_deg, _state(part, k)) for part in presses for k in range(len(part.normal_n))]
    return fit(simulator, samples, degree)


def _state(part: Presses, k: int) -> SceneState:
    shift, pull = part.shift_mm[k], part.tangential_n[k]
    return SceneState(
        2, float(part.depth_mm[k]), (float(shift[0]), float(shift[1])), float(part.normal_n[k]),
        (float(pull[0]), float(pull[1])), part.wrench[k], part.surface_mm[k].astype(float), float(part.patch_mm2[k]),
        math.nan, 0.0, None, None,
    )  # fmt: skip


@dataclass(frozen=True)
class PressedStates:
    """The shell under n contacts.

    Attributes:
        weights: (n, r) of the library's modes, mm, contact on azimuth 0.
        wrench: (n, 6) on the endcap at its origin, endcap frame, N and N m: of this very state, not of the run.
        clamped: (n,) True where the contact lies beyond what was solved, or the library expects an error over
            :data:`sensing.simulator.reduced.library_level.LIMIT` there: the state is the nearest that is good enough.
        error_estimate: (n,) expected relative error of the surface; over the limit only where no load and pull at the
            tilt is good enough, and the best of them was taken.
    """

    weights: Array
    wrench: Array
    clamped: NDArray[np.bool_]
    error_estimate: Array


def states_of(library: Library, contacts: Contacts) -> PressedStates:
    """States of the shell under a run's contacts; the untouched shell without contact.

    Tilt, load and pull beyond the range of the library are those of its edge. Below its least load, where the patch is
    smaller than an element, a state is that of the least load in proportion, and counts as solved. A state whose error
    estimate is over the limit is replaced by the nearest in load and pull at its tilt that is not.

    Args:
        library: of the shell. contacts: of one endcap.
    """
    low, high = library.normal_n
    load = np.clip(contacts.normal_n, low, high)
    touching = contacts.normal_n > 0
    tilt = np.clip(contacts.tilt_deg, library.tilt_deg[0], library.tilt_deg[-1])
    ratio = contacts.tangential_n / np.maximum(contacts.normal_n, 1e-9)[:, None]
    size = np.linalg.norm(ratio, axis=1)
    ratio *= np.minimum(1.0, library.cone[0] / np.maximum(size, 1e-9))[:, None]
    found = library.states(tilt, load, ratio * load[:, None])
    refused = touching & ~(found.error_estimate <= LIMIT)
    for k in np.flatnonzero(refused):
        _put(found, int(k), _nearest_accepted(library, float(tilt[k]), float(load[k]), ratio[k] * load[k]))
    share = np.where(touching, np.minimum(1.0, contacts.normal_n / low), 0.0)[:, None]
    wrench = share * found.wrench / ([1.0] * 3 + [1000.0] * 3)
    turned = [turn_wrench(one, float(azimuth)) for one, azimuth in zip(wrench, contacts.azimuth_deg, strict=True)]
    beyond = (contacts.normal_n > high) | (tilt != contacts.tilt_deg) | (size > library.cone[0] * (1 + 1e-6))
    return PressedStates(
        share * found.weights, np.array(turned).reshape(-1, 6), touching & (beyond | refused), found.error_estimate
    )


def _nearest_accepted(library: Library, tilt_deg: float, normal_n: float, tangential_n: Array) -> LibraryStates:
    """One state under the limit at a tilt, the nearest in force; the best one where none is under it."""
    low, high = np.sqrt(library.normal_n)
    loads = np.append(np.linspace(low, high, LOADS_TRIED) ** 2, normal_n)
    sizes = np.linspace(0, library.cone[0], SIZES_TRIED)
    own = math.atan2(tangential_n[1], tangential_n[0])
    load, size, angle = (
        grid.ravel() for grid in np.meshgrid(loads, sizes, own + 2 * math.pi * np.arange(ANGLES_TRIED) / ANGLES_TRIED)
    )
    pull = (size * load)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    tried = library.states(np.full_like(load, tilt_deg), load, pull)
    accepted = tried.error_estimate <= LIMIT
    far = np.hypot(load - normal_n, np.linalg.norm(pull - tangential_n, axis=1))
    best = np.argmin(np.where(accepted, far, np.inf)) if accepted.any() else np.argmin(tried.error_estimate)
    return LibraryStates(**{entry.name: getattr(tried, entry.name)[best] for entry in fields(LibraryStates)})


def _put(states: LibraryStates, k: int, one: LibraryStates) -> None:
    for entry in fields(LibraryStates):
        getattr(states, entry.name)[k] = getattr(one, entry.name)


def save_presses(presses: Presses, path: Path) -> None:
    """Write ``.npz`` under a temporary name, then rename."""
    np.savez_compressed(
        buffer := io.BytesIO(), **{entry.name: getattr(presses, entry.name) for entry in fields(Presses)}
    )
    put_file(path, buffer.getvalue())


def load_presses(path: Path) -> Presses:
    """Read what :func:`save_presses` wrote; nothing is unpickled.

    Raises:
        FileError: missing, damaged, or another file.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            values = {entry.name: data[entry.name] for entry in fields(Presses)}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise FileError(f"{path}: no solved presses ({error}): remove it, and they are solved anew") from None
    return Presses(float(values.pop("tilt_deg")), **values)
