"""The camera module at hand, a row of ``cameras.csv`` (standard library only: the lens and D, T decide on a picture).

    export ENDCAP_CAMERA=ELP-USBFHD01M-L170       # for every command of this shell; without it the released module

A row is a board with its lens, as it is bought. What it decides, base, dots, renderer, calibration, weights and the
identity of files, asks :func:`camera_module`; a process knows one module. The numbers of the released row were fitted
to four photos; :mod:`sensing.camera.nominal` says how and makes a camera of them.
"""

from __future__ import annotations

import os
import shlex
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from cad.data_table import positive, read_table
from cad.errors import ParameterError

TABLE = Path(__file__).with_name("cameras.csv")
VARIABLE = "ENDCAP_CAMERA"
RELEASED_MODULE = "ELP-USBFHD01M-L180"
SEAT_BOARD_MM, SEAT_PITCH_MM = 32.0, 28.0  # M, GEO15 and GEO16: what the base's corner posts and screw holes take
STACK_RANGE_MM = (14.0, 22.0)  # E: how far from the released 18 ring, bore and view have been looked at
HALF_ANGLE_RANGE_DEG = (60.0, 110.0)


@dataclass(frozen=True)
class CameraModule:
    """One row.

    Attributes:
        name: of the module, lens included.
        board_mm, hole_pitch_mm: side of its square board, pitch of its four holes.
        stack_mm: from the board's back to the entrance pupil.
        focal_per_row: px per radian and image row, 4:3 frame of the sensor's full height.
        k: radial terms of the fisheye model.
        max_half_angle_deg: off the axis, up to which the lens model holds.
        price_usd, order_as: what it costs, and what to ask for. provenance: letters of docs/provenance.md, and why.
    """

    name: str
    board_mm: float
    hole_pitch_mm: float
    stack_mm: float
    focal_per_row: float
    k: tuple[float, float, float, float]
    max_half_angle_deg: float
    price_usd: float
    order_as: str
    provenance: str


@cache
def camera_modules() -> dict[str, CameraModule]:
    """The table, name -> row.

    Raises:
        FileError: a missing or unreadable table, a missing column or a bad row, named by its line.
    """
    return read_table(TABLE, _module)


def camera_module() -> CameraModule:
    """The module that :data:`VARIABLE` names, else the released one.

    Raises:
        ParameterError: no such row. FileError: see :func:`camera_modules`.
    """
    name, known = os.environ.get(VARIABLE) or RELEASED_MODULE, camera_modules()
    if name not in known:
        raise ParameterError(
            f"{VARIABLE}={name}: no such camera module: choose one of {', '.join(known)}, or add a row to "
            f"cad/{TABLE.name}",
            name=VARIABLE,
            value=name,
        )
    return known[name]


def camera_setting() -> str:
    """The setting of another module than the released one, as it is typed before a command; else empty.

    Raises:
        ParameterError, FileError: see :func:`camera_module`.
    """
    name = camera_module().name
    return "" if name == RELEASED_MODULE else f"{VARIABLE}={shlex.quote(name)} "


def _module(row: dict[str, str]) -> CameraModule:
    found = CameraModule(
        row["name"], positive(row, "board_mm"), positive(row, "hole_pitch_mm"), positive(row, "stack_mm"),
        positive(row, "focal_per_row"), (float(row["k1"]), float(row["k2"]), float(row["k3"]), float(row["k4"])),
        positive(row, "max_half_angle_deg"), positive(row, "price_usd"), row["order_as"], row["provenance"],
    )  # fmt: skip
    if (found.board_mm, found.hole_pitch_mm) != (SEAT_BOARD_MM, SEAT_PITCH_MM):
        raise ValueError(
            f"board of {found.board_mm:g} mm with holes {found.hole_pitch_mm:g} mm apart: the base's seat takes "
            f"{SEAT_BOARD_MM:g} mm with {SEAT_PITCH_MM:g} mm (cad/base.py)"
        )
    for name, (low, high) in (("stack_mm", STACK_RANGE_MM), ("max_half_angle_deg", HALF_ANGLE_RANGE_DEG)):
        if not low <= getattr(found, name) <= high:
            raise ValueError(f"{name}={getattr(found, name):g} outside {low:g}..{high:g}")
    return found
