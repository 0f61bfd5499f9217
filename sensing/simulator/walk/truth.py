"""True states of a simulated run, sample by sample, and their file."""

from __future__ import annotations

import io
import zipfile
import zlib
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from cad.errors import FileError
from cad.whole_file import put_file
from sensing.tensegrity.description import Array

DAMAGED = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error)  # raised by a damaged ``.npz``


@dataclass(frozen=True)
class Walk:
    """True motion of a run; B bars, E endcaps, C cables, N samples; world axes (z up) unless stated.

    Attributes:
        terrain, seed, friction: terrain, seed, and Coulomb's mu of the ground.
        time_s: (N,) times, s.
        T_world_bar: (N, B, 4, 4) m.
        velocity: (N, B, 6) velocity of each bar's origin (m/s), and angular velocity in bar axes (rad/s).
        force_n, torque_nm: (N, E, 3) of the ground on each endcap, N, N m; torque about ``point_m``; 0 without contact.
        point_m: (N, E, 3) contact point, m.
        normal: (N, E, 3) unit normal of the ground there, outward.
        slip_m_s: (N, E, 3) velocity of the skin there along the ground, m/s.
        length_m, tension_n: (N, C) lengths, m, and tensions, N, of the cables.
    """

    terrain: str
    seed: int
    friction: float
    time_s: Array
    T_world_bar: Array
    velocity: Array
    force_n: Array
    torque_nm: Array
    point_m: Array
    normal: Array
    slip_m_s: Array
    length_m: Array
    tension_n: Array

    @property
    def centre_m(self) -> Array:
        """(N, 3) mean of the bars' origins."""
        return np.asarray(self.T_world_bar[:, :, :3, 3].mean(axis=1))

    def path_m(self, smooth_s: float = 1.0) -> float:
        """Length of the centre's path along the ground, m, smoothed over ``smooth_s``."""
        step = max(1, round(smooth_s / float(self.time_s[1] - self.time_s[0])))
        return float(np.linalg.norm(np.diff(self.centre_m[::step, :2], axis=0), axis=1).sum())


def save_walk(walk: Walk, path: Path) -> None:
    """Write the run as ``.npz`` under a temporary name, then rename the file."""
    np.savez_compressed(buffer := io.BytesIO(), **{entry.name: getattr(walk, entry.name) for entry in fields(Walk)})
    put_file(path, buffer.getvalue())


def load_walk(path: Path) -> Walk:
    """Read what :func:`save_walk` wrote; nothing is unpickled.

    Raises:
        FileError: missing, damaged, or another file.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            values = {entry.name: data[entry.name] for entry in fields(Walk)}
    except DAMAGED as error:
        raise FileError(f"{path}: no run of the robot ({error}): simulate it anew") from None
    terrain, seed, friction = (values.pop(name) for name in ("terrain", "seed", "friction"))
    return Walk(str(terrain), int(seed), float(friction), **values)
