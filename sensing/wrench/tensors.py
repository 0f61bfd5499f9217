"""The tensors of weights: names and shapes, and what those beside the network stand for.

Letters of the shapes: H W = C cells, D = 2 H W inputs, K components, M and S hidden, R directions.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SHAPES: dict[str, tuple[str, ...]] = {  # of every tensor: D = 2 H W inputs, K components, M and S hidden
    "linear": ("6", "D"), "principal": ("K", "D"), "units": ("6",), "calibration": ("6",),
    "mean.first.weight": ("M", "K"), "mean.first.bias": ("M",), "mean.second.weight": ("M", "M"),
    "mean.second.bias": ("M",), "mean.last.weight": ("6", "M"), "spread.0.weight": ("S", "K"), "spread.0.bias": ("S",),
    "spread.2.weight": ("S", "S"), "spread.2.bias": ("S",), "spread.4.weight": ("21", "S"), "spread.4.bias": ("21",),
}  # fmt: skip
THIRD: dict[str, tuple[str, ...]] = {"mean.third.weight": ("M", "M"), "mean.third.bias": ("M",)}  # of deeper weights
PATTERN: dict[str, tuple[str, ...]] = {"pattern": ("D", "K")}  # fields that principal parts stand for; not in all
RADIAL: dict[str, tuple[str, ...]] = {"radial.parts": ("R", "D"), "radial.cells": ("C", "R")}  # mm; not in all
TRACKING: dict[str, tuple[str, ...]] = {"tracking": ("6",)}  # what tracking adds to the spread, in units; not in all
ONSET = 1.7  # E: units of force by which half of what tracking adds is there
OPTIONAL = (THIRD, PATTERN, RADIAL, TRACKING)
BESIDE = frozenset({*PATTERN, *RADIAL})  # no parts of the network


def pattern_of(weights: dict[str, NDArray[np.float32]]) -> Array:
    """(D, K) fields of the principal parts; for weights without them, the fields of least norm with these parts.

    Args:
        weights: tensors by name.
    """
    if "pattern" in weights:
        return weights["pattern"].astype(np.float64)
    return np.asarray(np.linalg.pinv(weights["principal"].astype(np.float64)))


def onset_n_of(weights: dict[str, NDArray[np.float32]]) -> float:
    """Force by which half of what tracking adds is there, N: 0.25 N at D=130 T=8, larger where forces are.

    Args:
        weights: tensors by name.
    """
    return ONSET * float(weights["units"][2])


def tracking_of(weights: dict[str, NDArray[np.float32]]) -> Array:
    """(6,) standard deviations, N and N m, that tracking adds under load; 0 for weights without them.

    Args:
        weights: tensors by name.
    """
    return np.asarray(weights.get("tracking", np.zeros(6)) * weights["units"].astype(np.float64))


def radial_of(weights: dict[str, NDArray[np.float32]]) -> Array | None:
    """(H W, 2 H W) radial displacement of the skin in the cells by the field, mm/px; None for weights without it.

    Args:
        weights: tensors by name.
    """
    if "radial.parts" not in weights:
        return None
    return np.asarray(weights["radial.cells"].astype(np.float64) @ weights["radial.parts"].astype(np.float64))
