"""Radial displacement of the skin, learned from simulated states as a linear map of the field.

    tensors = radial_tensors(["exports/data"], (16, 16))            # of the weights, beside those of the network

One camera does not measure it, and the wrench does not need it; but a camera beside its nominal place has a parallax
that depends on it, which :mod:`sensing.tracking.parallax` removes.

Notes:
    Ridge regression (X'X + lambda I)^-1 X'Y of the radial displacement Y in the cells (of dots as windows show them,
    smoothed as fields are) on the fields X of domain-randomised sensors, with all eight symmetric copies. The
    directions of the answer that vary most over the states are kept: M = C F, of rank 32. On paths held out (D=130,
    T=8) 4 to 10 % of Y is left (rms).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cad.dots import dot_pattern
from cad.messages import transient
from cad.params import EndcapParams
from sensing.camera.nominal import nominal_mount
from sensing.learning.found_camera import FRAME_PX
from sensing.learning.marker_fields import MarkerSensor, Scatter
from sensing.learning.samples import shown_column
from sensing.learning.symmetry import disc_cells, symmetric_cell_moments, symmetric_gram
from sensing.records_labelled import LabelledSet, read_shard
from sensing.tracking.field.operator import displacement_to_cells

Array = NDArray[np.float64]
Weights = dict[str, NDArray[np.float32]]
STATES, SENSORS = 16_000, 32  # E: number of states over all folders, and of the sensors that view them
DAMPING = 1e-3  # E: lambda over the mean square of the inputs
RANK = 32  # E: a larger rank improves less than the sensors' noise
BEYOND_PX = 60.0  # dots this far outside the picture still determine the skin's motion in its outer cells


def radial_tensors(folders: Sequence[str | Path], shape: tuple[int, int]) -> Weights:
    """``radial.parts`` (R, 2 H W) and ``radial.cells`` (H W, R) of weights; empty if no set has dots in mm.

    Args:
        folders: folders of labelled frames of one design.
        shape: (H, W) of the field, square.

    Raises:
        FileError: a folder that cannot be read, or that is incomplete.
    """
    sets = _sets_with_dots(folders)
    if not sets:
        return {}
    rng, design, cells = np.random.default_rng(0), sets[0].params, shape[0] * shape[1]
    sensors = [MarkerSensor(design, shape, Scatter(), rng) for _ in range(SENSORS)]
    skin = _Skin(design, sensors[0].rest_mm, shape)
    gram, moment = np.zeros((2 * cells, 2 * cells)), np.zeros((2 * cells, cells))
    most = -(-STATES // sum(len(data.shards) for data in sets))  # of a shard
    for data in sets:
        shown = shown_column(data)
        for file in data.shards:
            transient(f"{data.folder}: {file.name}")
            moved = read_shard(file, {shown})[shown]
            moved = moved[:: -(-len(moved) // most)].astype(float)
            seen = sensors[rng.integers(SENSORS)].fields(moved) * disc_cells(shape)
            x = seen.reshape(len(moved), -1).astype(float)
            gram, moment = gram + x.T @ x, moment + x.T @ skin.raised(moved)
    return _ranked(symmetric_gram(gram, shape[0]), symmetric_cell_moments(moment, shape[0]))


class _Skin:
    """Radial displacement in the cells, for the dots of a design.

    Args:
        design: design of the endcap.
        rest_mm: (d, 3) its dots at rest, mm.
        shape: (H, W) of the cells.
    """

    def __init__(self, design: EndcapParams, rest_mm: Array, shape: tuple[int, int]) -> None:
        self._rest = rest_mm - np.array([0.0, 0.0, design.centre_height_mm])
        place = nominal_mount(design, *FRAME_PX).project(rest_mm)
        self._near = ((place > -BEYOND_PX) & (place < np.array(FRAME_PX) + BEYOND_PX)).all(axis=1)  # NaN: not in view
        self._to_cells = displacement_to_cells(place[self._near], FRAME_PX, shape)

    def raised(self, moved_mm: Array) -> Array:
        """(N, H W) radial displacement, mm, outward positive, of displacements (N, d, 3), mm."""
        radius = np.linalg.norm(self._rest + moved_mm, axis=2) - np.linalg.norm(self._rest, axis=1)
        return np.asarray(radius[:, self._near] @ self._to_cells)


def _sets_with_dots(folders: Sequence[str | Path]) -> list[LabelledSet]:
    """Sets of the first one's design with the motion of every dot (recordings of real endcaps have none)."""
    sets = [LabelledSet(folder) for folder in folders]
    for data in sets:
        data.require_whole()
    design = sets[0].params
    alike, count = [data for data in sets if data.params == design], len(dot_pattern(design))
    return [data for data in alike if read_shard(data.shards[0], {"dots_mm"})["dots_mm"].shape[1:] == (count, 3)]


def _ranked(gram: Array, moment: Array) -> Weights:
    """The ridge solution of moments X'X (D, D) and X'Y (D, C), reduced to the leading directions of its answers."""
    if not gram.any():
        return {}  # states at rest alone determine nothing
    damped = gram + DAMPING * np.trace(gram) / len(gram) * np.eye(len(gram))
    root = np.linalg.cholesky(damped)
    half = np.linalg.solve(root, moment)  # L' M': its squares are those of the answers
    left, size, right = np.linalg.svd(half, full_matrices=False)
    parts = np.linalg.solve(root.T, left[:, :RANK] * size[:RANK]).T
    return {"radial.parts": parts.astype(np.float32), "radial.cells": right[:RANK].T.astype(np.float32).copy()}
