"""The library of solved states, and the states of any shell from it by interpolation between its nodes.

    library = load_library()
    states = library.states(ShellRatios.of(geometry))           # in units of R, mu R^2 and mu R^3

A node is a shell; all nodes are pressed along the same paths in units of their own, so state s of one corresponds to
state s of every other. Between nodes each number is interpolated in (sqrt(T/R), 0.5 arccos(clamp/R)), the second the
clamp's angle in radians times :data:`CLAMP_SCALE`, by a polyharmonic spline r^3 with a linear part (Duchon 1977;
Wendland 2005, doi:10.1017/CBO9780511617539), as one blend of nodes for all numbers.
"""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cad.errors import FileError, ParameterError
from cad.whole_file import replace_file
from sensing.simulator.similarity.node import CAPACITY, LABELS, SolvedNode
from sensing.simulator.similarity.paths import path_digest
from sensing.simulator.similarity.ratios import ShellRatios
from sensing.simulator.solid.element import Array

FILE = Path(__file__).with_name("library.npz")  # the library that ships
CLAMP_SCALE = 0.5  # M: weight of the clamp's angle in rad against sqrt(T / R) (bench/bench_library.py --studies nodes)
LEAST_COUNT = 0.15  # of a node's weight: a node below it can be left out
LEAST_NODES = 4  # fewest nodes from which a state is interpolated
REACH = 0.015  # largest distance of a shell from the nodes' hull, in those coordinates


@dataclass(frozen=True)
class ShellStates:
    """States of one shell in units of R, mu R^2 and mu R^3, contact on azimuth 0, in the order of their paths.

    Attributes:
        surface: (S, n, 3) displacement of the inner surface at the common points.
        wrench: (S, 6) wrench on the endcap about the sphere's centre.
        labels: (S, 4) depth, normal force, patch area, share of slip.
        known: (S,) False where a node has no solution.
    """

    surface: Array
    wrench: Array
    labels: Array
    known: NDArray[np.bool_]


@dataclass(frozen=True)
class StoredStates:
    """The same states of all nodes; K nodes, S states, M modes.

    Attributes:
        coefficients: (K, S, M) coefficients of the surface modes.
        wrench: (K, S, 6) with forces in mu T^2 and torques in mu T^2 R, in which they hardly change from node to node;
            NaN where a node has no solution.
        labels: (K, S, 4) in the same units.
    """

    coefficients: NDArray[np.float16]
    wrench: NDArray[np.float32]
    labels: NDArray[np.float32]

    @property
    def solved(self) -> NDArray[np.bool_]:
        """(K, S) whether each node has each state."""
        return np.asarray(np.isfinite(self.wrench).all(axis=2))

    def mixed(self, weights: Array, name: str) -> Array:
        """(S, ...) weighted sum of the nodes' tables.

        Args:
            weights: (K, S) weights of the nodes, 0 where a node has no state.
            name: name of the table.
        """
        return np.einsum("ks,ksm->sm", weights, np.nan_to_num(getattr(self, name).astype(float)), optimize=True)


@dataclass(frozen=True)
class Library:
    """Solved nodes.

    Attributes:
        ratios: (K, 2) T/R and clamp/R.
        modes: (M, n, 3) modes of the surface.
        travel: states of the library's paths.
        standing: of the simulated robot's stands.
        curves: (K, 3, 15, 4) :data:`sensing.simulator.similarity.node.CAPACITY` by tilt and depth, forces in mu T^2.
        paths: digest of the library's paths.
    """

    ratios: Array
    modes: NDArray[np.float16]
    travel: StoredStates
    standing: StoredStates
    curves: NDArray[np.float32]
    paths: str

    def blend(self, ratios: ShellRatios, nodes: NDArray[np.bool_] | None = None) -> Array:
        """(K,) weights of the nodes for a shell; they sum to 1, and are 1 and 0 at a node.

        Args:
            ratios: ratios of the shell.
            nodes: (K,) whether each node may be used; all by default.

        Raises:
            ParameterError: a shell outside the nodes' range.
        """
        places = _coordinates(self.ratios)
        wanted = _coordinates(np.array([[ratios.wall, ratios.clamp]]))
        low, high = places.min(axis=0) - REACH, places.max(axis=0) + REACH
        if not ((wanted >= low) & (wanted <= high)).all():
            span = [f"{a:.3g}..{b:.3g}" for a, b in zip(self.ratios.min(0), self.ratios.max(0), strict=True)]
            raise ParameterError(
                f"T/R={ratios.wall:.3g}, clamp/R={ratios.clamp:.3g} outside the library's {span[0]} and {span[1]}: "
                "choose a design of the valid region (make molds names it)",
                name="ratios",
                value=ratios,
            )
        use = np.ones(len(places), dtype=bool) if nodes is None else nodes
        weights = np.zeros(len(places))
        weights[use] = _spline(places[use], wanted[0])
        return weights

    def states(self, ratios: ShellRatios) -> ShellStates:
        """States of a shell along the library's paths."""
        return self._states(self.travel, ratios)

    def stands(self, ratios: ShellRatios) -> ShellStates:
        """States of a shell in the stands of the simulated robot."""
        return self._states(self.standing, ratios)

    def state_weights(self, stored: StoredStates, ratios: ShellRatios) -> tuple[Array, NDArray[np.bool_]]:
        """((K, S) weights of the nodes for each state, (S,) whether each state is known).

        The thinnest node has only some of the paths. For a shell in which its weight is small, the other nodes replace
        it; otherwise the state is left out.

        Args:
            stored: states of the nodes.
            ratios: ratios of the shell.
        """
        solved, weights = stored.solved, self.blend(ratios)
        found, known = np.zeros(solved.shape), np.zeros(solved.shape[1], dtype=bool)
        for pattern in np.unique(solved, axis=1).T:
            if np.abs(weights[~pattern]).max(initial=0.0) > LEAST_COUNT or pattern.sum() < LEAST_NODES:
                continue
            same = (solved == pattern[:, None]).all(axis=0)
            found[:, same] = (weights if pattern.all() else self.blend(ratios, pattern))[:, None]
            known |= same
        return found, known

    def _states(self, stored: StoredStates, ratios: ShellRatios) -> ShellStates:
        weights, known = self.state_weights(stored, ratios)
        surface = np.tensordot(stored.mixed(weights, "coefficients"), self.modes.astype(float), axes=1)
        wrench = stored.mixed(weights, "wrench") * ratios.wall**2
        return ShellStates(surface, wrench, stored.mixed(weights, "labels") * _units(LABELS, ratios.wall), known)

    def capacity(self, ratios: ShellRatios) -> Array:
        """(3, 15, 4) curves of a shell, NaN past the depth at which a node with weight was refused."""
        weights = self.blend(ratios)
        found = np.einsum("k,kabj->abj", weights, np.nan_to_num(self.curves.astype(float)))
        found *= _units(CAPACITY, ratios.wall)
        counts = np.abs(weights) > LEAST_COUNT
        found[~np.isfinite(self.curves[counts]).all(axis=(0, 3))] = np.nan
        return found


def joined(travel: list[SolvedNode], standing: list[SolvedNode], count: int) -> Library:
    """Library of solved nodes; it stores their surfaces by the leading modes of all of them.

    Args:
        travel, standing: the nodes' states along the two kinds of paths.
        count: number of modes.
    """
    tables = [
        np.nan_to_num([node.surface.reshape(len(node.surface), -1) for node in part]) for part in (travel, standing)
    ]
    gram = sum(table.reshape(-1, table.shape[2]).T @ table.reshape(-1, table.shape[2]) for table in tables)
    modes = np.linalg.eigh(gram)[1][:, ::-1][:, :count].T.astype(np.float16)
    solver = np.linalg.pinv(modes.astype(float).T)
    coefficients = [table @ solver.T for table in tables]
    curves = [node.capacity / _units(CAPACITY, node.ratios.wall) for node in travel if node.capacity.size]
    return Library(
        np.array([[node.ratios.wall, node.ratios.clamp] for node in travel]),
        modes.reshape(count, -1, 3),
        _stored(travel, coefficients[0]),
        _stored(standing, coefficients[1]),
        np.array(curves, dtype=np.float32),
        path_digest(),
    )


def solved_node(library: Library, number: int, standing: bool) -> SolvedNode:
    """A node of a library, to the accuracy of its modes; states without a solution are NaN.

    Args:
        library: the library.
        number: number of the node.
        standing: whether its stands are returned instead of its travel and curves.
    """
    stored, wall = library.standing if standing else library.travel, float(library.ratios[number, 0])
    surface = np.tensordot(stored.coefficients[number].astype(float), library.modes.astype(float), axes=1)
    surface[~stored.solved[number]] = np.nan
    curves = np.zeros((0,)) if standing else library.curves[number] * _units(CAPACITY, wall)
    return SolvedNode(
        ShellRatios(wall, float(library.ratios[number, 1])), surface, stored.wrench[number] * wall**2,
        stored.labels[number] * _units(LABELS, wall), curves,
    )  # fmt: skip


def save_library(library: Library, path: Path) -> None:
    """Write the library, whole or not at all."""
    arrays: dict[str, Any] = {name: getattr(library, name) for name in ("ratios", "modes", "curves", "paths")}
    for name in ("travel", "standing"):
        arrays |= {f"{name}_{key}": value for key, value in vars(getattr(library, name)).items()}
    np.savez_compressed(buffer := io.BytesIO(), **arrays)
    replace_file(path, buffer.getvalue())


@lru_cache(maxsize=2)
def load_library(path: Path = FILE) -> Library:
    """Read the library.

    Raises:
        FileError: missing, damaged, or solved along other paths.
    """
    again = "solve it anew with python -m sensing.simulator.similarity.solve"
    try:
        with np.load(path, allow_pickle=False) as data:
            travel, standing = (
                StoredStates(*(data[f"{name}_{key}"] for key in StoredStates.__dataclass_fields__))
                for name in ("travel", "standing")
            )
            found = Library(data["ratios"], data["modes"], travel, standing, data["curves"], str(data["paths"]))
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise FileError(f"{path}: no library of states ({error}): restore it, or {again}") from None
    if found.paths != path_digest():
        raise FileError(f"{path}: its states were solved along other paths than this version's: {again}")
    return found


def _stored(nodes: list[SolvedNode], coefficients: Array) -> StoredStates:
    return StoredStates(
        coefficients.astype(np.float16),
        np.array([node.wrench / node.ratios.wall**2 for node in nodes], dtype=np.float32),
        np.array([node.labels / _units(LABELS, node.ratios.wall) for node in nodes], dtype=np.float32),
    )


def _units(columns: tuple[str, ...], wall: float) -> Array:
    """(columns,) factors from mu T^2 to mu R^2 for the forces among the columns, 1 for the others."""
    return np.array([wall**2 if column == "normal" else 1.0 for column in columns])


def _coordinates(ratios: Array) -> Array:
    return np.stack([np.sqrt(ratios[:, 0]), CLAMP_SCALE * np.arccos(np.clip(ratios[:, 1], -1, 1))], axis=1)


def _spline(places: Array, wanted: Array) -> Array:
    """(K,) cardinal weights of the spline r^3 + linear at one point of the coordinates."""
    count = len(places)

    def kernel(a: Array, b: Array) -> Array:
        return np.linalg.norm(a[:, None] - b[None], axis=2) ** 3

    linear = np.concatenate([np.ones((count, 1)), places], axis=1)
    matrix = np.block([[kernel(places, places), linear], [linear.T, np.zeros((3, 3))]])
    right = np.concatenate([kernel(places, wanted[None])[:, 0], [1.0], wanted])
    return np.linalg.solve(matrix, right)[:count]
