"""One solved shell of the library, and its file while the library is made."""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cad.errors import FileError
from cad.whole_file import replace_file
from sensing.simulator.similarity.paths import path_digest
from sensing.simulator.similarity.ratios import ShellRatios
from sensing.simulator.solid.element import Array

LABELS = ("depth", "normal", "patch", "slip")  # in units of R, mu R^2, R^2, 1
CAPACITY_TILTS_DEG = (0.0, 25.0, 50.0)  # tilts of the capacity curves
CAPACITY_DEPTHS = tuple(float(d) for d in np.linspace(0.02, 0.30, 15))  # depths of the curves, in units of R
CAPACITY_FRICTION = 0.6  # Coulomb coefficient of the curves
CAPACITY = ("depth", "normal", "patch", "stretch")  # in units of R, mu R^2, R^2, 1


@dataclass(frozen=True)
class SolvedNode:
    """States of one shell, in units of R, mu R^2 and mu R^3; S states of all paths in their order.

    Attributes:
        ratios: ratios of the shell.
        surface: (S, n, 3) displacement of the inner surface at the common points, NaN for a missing state.
        wrench: (S, 6) wrench on the endcap about the sphere's centre, contact on azimuth 0.
        labels: (S, 4) :data:`LABELS`.
        capacity: (3, 15, 4) :data:`CAPACITY` by tilt and depth, NaN from the first refused depth on.
    """

    ratios: ShellRatios
    surface: Array
    wrench: Array
    labels: Array
    capacity: Array


def save_node(node: SolvedNode, path: Path) -> None:
    """Write a node, whole or not at all, with the digest of the paths along which it was solved."""
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        ratios=np.array([node.ratios.wall, node.ratios.clamp]),
        surface=node.surface.astype(np.float32),
        wrench=node.wrench,
        labels=node.labels,
        capacity=node.capacity,
        paths=path_digest(),
    )
    replace_file(path, buffer.getvalue())


def read_node(path: Path) -> SolvedNode:
    """Read what :func:`save_node` wrote.

    Raises:
        FileError: damaged, or solved along other paths than this version's.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            wall, clamp = data["ratios"]
            surface = data["surface"].astype(float)
            found = SolvedNode(
                ShellRatios(float(wall), float(clamp)), surface, data["wrench"], data["labels"], data["capacity"]
            )
            same = str(data["paths"]) == path_digest()
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise FileError(f"{path}: no solved shell ({error}): delete it, and it is solved anew") from None
    if not same:
        raise FileError(f"{path}: solved along other paths than this version's: delete it, and it is solved anew")
    return found
