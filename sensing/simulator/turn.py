"""Rotations about the endcap's axis: a state solved at azimuth 0 serves every azimuth (N, mm, degrees)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def turn_about_axis(azimuth_deg: float) -> Array:
    """Rotation about z (3, 3)."""
    c, s = math.cos(math.radians(azimuth_deg)), math.sin(math.radians(azimuth_deg))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def turn_wrench(wrench: Array, azimuth_deg: float) -> Array:
    """Wrench (..., 6) of a state solved at azimuth 0, for a contact at another azimuth."""
    turn = turn_about_axis(azimuth_deg)
    return np.concatenate([wrench[..., :3] @ turn.T, wrench[..., 3:] @ turn.T], axis=-1)
