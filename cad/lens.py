"""The camera module in use, a row of ``cameras.csv`` (standard library only, because ``sensing`` uses it, too).

    export ENDCAP_CAMERA=ELP-USBFHD01M-L170       # for all commands of this shell; without it the released module

A row is a board with its lens, as it is sold. Base, dots, renderer, calibration, weights and the identity of files all
depend on it and call :func:`camera_module`; a process uses one module only. The numbers of the released row were fitted
to four photos; :mod:`sensing.camera.nominal` describes how and makes a camera from them.
"""

from __future__ import annotations

import math
import os
import shlex
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from cad.data_table import number, positive, read_table
from cad.errors import ParameterError

TABLE = Path(__file__).with_name("cameras.csv")
VARIABLE = "ENDCAP_CAMERA"  # environment variable with the module's name
RELEASED_MODULE = "ELP-USBFHD01M-L180"
SEAT_BOARD_MM, SEAT_PITCH_MM = 32.0, 28.0  # M, GEO15 and GEO16: board and hole pitch that the base fits
STACK_RANGE_MM = (14.0, 22.0)  # E: range about the released 18 in which ring, bore and view were checked
HALF_ANGLE_RANGE_DEG = (60.0, 110.0)  # accepted for both angles of a row
STEPS_PER_DEG = 10  # at which the image radius is checked to grow with the angle


@dataclass(frozen=True)
class CameraModule:
    """One row of the table.

    Attributes:
        name: name of the module with its lens.
        board_mm: side of its square board, mm.
        hole_pitch_mm: pitch of its four holes, mm.
        stack_mm: height of the entrance pupil over the board's back, mm.
        focal_per_row: focal length, px per radian and image row, for a 4:3 frame of the image sensor's full height.
        k: radial coefficients k1..k4 of the fisheye model.
        circle_deg: angle off the axis at which the lens's image circle ends, degrees.
        max_half_angle_deg: largest angle off the axis at which the lens model is valid, degrees.
        price_usd: its price.
        order_as: text for the order.
        provenance: letters of docs/provenance.md, with reasons.
    """

    name: str
    board_mm: float
    hole_pitch_mm: float
    stack_mm: float
    focal_per_row: float
    k: tuple[float, float, float, float]
    circle_deg: float
    max_half_angle_deg: float
    price_usd: float
    order_as: str
    provenance: str


@cache
def camera_modules() -> dict[str, CameraModule]:
    """All rows: name -> module.

    Raises:
        FileError: the table is missing or unreadable, lacks a column, or has a bad row; the message names its line.
    """
    return read_table(TABLE, _module)


def camera_module() -> CameraModule:
    """The module whose name is in :data:`VARIABLE`; without it, the released one.

    Raises:
        ParameterError: there is no such row.
        FileError: the table cannot be read (:func:`camera_modules`).
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


def other_module() -> str:
    """Name of the module where it is another one than the released; else empty.

    Raises:
        ParameterError: there is no such row.
        FileError: the table cannot be read (:func:`camera_modules`).
    """
    name = camera_module().name
    return "" if name == RELEASED_MODULE else name


def camera_setting() -> str:
    """Environment setting of a module other than the released one, as it is typed before a command; else empty.

    Raises:
        ParameterError: there is no such row.
        FileError: the table cannot be read (:func:`camera_modules`).
    """
    name = other_module()
    return name and f"{VARIABLE}={shlex.quote(name)} "


def _module(row: dict[str, str]) -> CameraModule:
    found = CameraModule(
        row["name"], positive(row, "board_mm"), positive(row, "hole_pitch_mm"), positive(row, "stack_mm"),
        positive(row, "focal_per_row"), (number(row, "k1"), number(row, "k2"), number(row, "k3"), number(row, "k4")),
        positive(row, "circle_deg"), positive(row, "max_half_angle_deg"),
        positive(row, "price_usd"), row["order_as"], row["provenance"],
    )  # fmt: skip
    if (found.board_mm, found.hole_pitch_mm) != (SEAT_BOARD_MM, SEAT_PITCH_MM):
        raise ValueError(
            f"board of {found.board_mm:g} mm with holes {found.hole_pitch_mm:g} mm apart: the base's seat takes "
            f"{SEAT_BOARD_MM:g} mm with {SEAT_PITCH_MM:g} mm (cad/base.py)"
        )
    ranges = {"stack_mm": STACK_RANGE_MM} | dict.fromkeys(("circle_deg", "max_half_angle_deg"), HALF_ANGLE_RANGE_DEG)
    for name, (low, high) in ranges.items():
        if not low <= getattr(found, name) <= high:
            raise ValueError(f"{name}={getattr(found, name):g} outside {low:g}..{high:g}")
    if found.circle_deg > found.max_half_angle_deg:
        raise ValueError(
            f"circle_deg={found.circle_deg:g} over max_half_angle_deg={found.max_half_angle_deg:g}: where the picture "
            "ends is computed by the lens model, which must hold up to there"
        )
    _require_growing(found)
    return found


def _require_growing(module: CameraModule) -> None:
    """Refuse a lens model that is not monotonic: r(theta) = theta + k1 theta^3 + ... must grow up to its last angle."""
    for step in range(math.floor(module.max_half_angle_deg * STEPS_PER_DEG) + 1):
        theta = math.radians(step / STEPS_PER_DEG)
        slope = 1.0 + sum((2 * n + 1) * k * theta ** (2 * n) for n, k in enumerate(module.k, start=1))
        if not 0 < slope < math.inf:
            raise ValueError(
                f"k1..k4={', '.join(f'{k:g}' for k in module.k)}: the picture's radius stops growing at "
                f"{step / STEPS_PER_DEG:g} degrees off the axis, and must grow up to max_half_angle_deg="
                f"{module.max_half_angle_deg:g}, or a pixel would belong to two rays: calibrate the lens again, or "
                "lower the angle"
            )
