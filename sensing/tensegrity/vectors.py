"""Products of single 3-vectors; numpy.cross is made for stacks of them and takes ten times as long for one."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from sensing.tensegrity.description import Array


def cross(a: Iterable[float], b: Iterable[float]) -> Array:
    """(3,) a x b, bit for bit the result of numpy.cross.

    Args:
        a, b: (3,) vectors.
    """
    ax, ay, az = a
    bx, by, bz = b
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def minus_cross(arm: Iterable[float]) -> Array:
    """(3, 3) matrix of -arm x: derivative of a point at the arm by a small rotation about the origin.

    Args:
        arm: (3,) vector.
    """
    x, y, z = arm
    return np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
