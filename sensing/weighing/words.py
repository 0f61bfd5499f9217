"""Weights and poses as people type them: ``500``, ``0.5 kg``, ``tilt=0,grams=1000,source=a.mcap``."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from cad.plain_numbers import is_plain
from sensing.tensegrity.description import GRAVITY_M_S2

# Grams in a unit of mass.
GRAMS = {
    "g": 1.0,
    "gram": 1.0,
    "grams": 1.0,
    "kg": 1000.0,
    "lb": 453.59237,
    "lbs": 453.59237,
    "oz": 28.349523,
}
NEWTONS = {"n": 1.0, "newton": 1.0, "newtons": 1.0, "lbf": 4.4482216}  # independent of local gravity
LEAST_G, MOST_G = 20.0, 6000.0  # range of a kitchen scale; 60 N
MOST_TILT_DEG = 60.0  # largest tilt of a pose
SCALE_SD_G, SCALE_SD_PART = 2.0, 0.005  # E: a kitchen scale of 1 g steps, and local gravity
_WEIGHT = re.compile(r"\s*([0-9.]+)\s*([A-Za-z]*)\s*")  # a number and its unit
# Form of a pose, for messages.
FORM = "give tilt=DEG,grams=NUMBER and, where needed, azimuth=DEG, sd=GRAMS, source=FILE"


@dataclass(frozen=True)
class PoseRequest:
    """A weight on the endcap at an attitude.

    Attributes:
        weight_g, sd_g: mass of everything that presses, and its standard deviation, g.
        tilt_deg: angle between the vertical and the endcap's axis, degrees.
        azimuth_deg: azimuth of the vertical, endcap frame, from x to y: upward if the dome is up, downward if it is
            pressed onto a scale; opposite to the weight's (fx, fy).
        source: video, folder of pictures or recording; empty for the endcap's own.
    """

    weight_g: float
    tilt_deg: float = 0.0
    azimuth_deg: float = 0.0
    sd_g: float = 0.0
    source: str = ""

    def __post_init__(self) -> None:
        number = f"{self.weight_g:g}"
        unit = f"was it {number} kg or {number} lb? write the unit" if self.weight_g < LEAST_G else "the dome's range"
        for name, value, low, high, hint in (
            ("weight_g", self.weight_g, LEAST_G, MOST_G, unit),
            ("tilt_deg", self.tilt_deg, 0.0, MOST_TILT_DEG, "beyond it the weight presses beside the dome"),
            ("azimuth_deg", self.azimuth_deg, -360.0, 360.0, "an angle"),
            ("sd_g", self.sd_g, 0.0, 1000.0, "the scale's standard deviation in g"),
        ):
            if not low <= value <= high:
                raise ParameterError(f"{name}={value:g} outside {low:g}..{high:g}: {hint}", name=name, value=value)

    @property
    def name(self) -> str:
        """Name of the pose: ``500 g``, ``500 g at 20 degrees``."""
        tilt = f" at {self.tilt_deg:g} degrees" if self.tilt_deg else ""
        return f"{self.weight_g:g} g{tilt}"

    def load_n(self, gravity_m_s2: float = GRAVITY_M_S2) -> NDArray[np.float64]:
        """(3,) force on the endcap, N: along the vertical, into the dome."""
        tilt, azimuth = math.radians(self.tilt_deg), math.radians(self.azimuth_deg)
        out = [math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt)]
        return -self.weight_g / 1000 * gravity_m_s2 * np.array(out)

    def load_sd_n(self, gravity_m_s2: float = GRAVITY_M_S2) -> float:
        """Standard deviation of the load's norm, N."""
        grams = self.sd_g or math.hypot(SCALE_SD_G, SCALE_SD_PART * self.weight_g)
        return grams / 1000 * gravity_m_s2


def parse_weight_g(text: str, gravity_m_s2: float = GRAVITY_M_S2) -> float:
    """A weight in g: a plain number is in g, others carry their unit (g, kg, lb, N).

    Args:
        text: text that the user typed.
        gravity_m_s2: local gravity, m/s2, by which a force in N is converted to g.

    Raises:
        ParameterError: no number, or an unknown unit.
    """
    found = _WEIGHT.fullmatch(text.replace(",", ".") if text.count(",") == 1 and "." not in text else text)
    if found is None or not is_plain(found[1]):
        raise ParameterError(f"{text.strip()[:40]!r} is no weight: give grams, such as 500, or 0.5 kg, 5 N, 1.1 lb")
    number, unit = float(found[1]), found[2].lower() or "g"
    if unit in NEWTONS:
        return number * NEWTONS[unit] / gravity_m_s2 * 1000
    if unit not in GRAMS:
        raise ParameterError(f"{found[2]!r} is no unit of weight here: give g, kg, lb, oz or N")
    return number * GRAMS[unit]


def parse_pose(
    text: str, gravity_m_s2: float = GRAVITY_M_S2, tilt_deg: float = 0.0, azimuth_deg: float = 0.0, sd_g: float = 0.0
) -> PoseRequest:
    """Pose of ``tilt=0,grams=1000,azimuth=0,sd=5,source=FILE``; a file's name at the end may contain commas.

    Args:
        text: text that the user typed.
        gravity_m_s2: local gravity, m/s2.
        tilt_deg, azimuth_deg, sd_g: of a pose that does not name its own, degrees and g.

    Raises:
        ParameterError: another form, a key twice or unknown, a value out of range.
    """
    head, mark, source = text.partition("source=")
    values: dict[str, str] = {}
    for part in filter(None, head.split(",")):
        key, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or key in values or key not in ("tilt", "grams", "azimuth", "sd"):
            raise ParameterError(f"--pose {text}: {part!r} is not understood: {FORM}", name="pose", value=text)
        values[key] = value
    if "grams" not in values or (mark and not source):
        raise ParameterError(f"--pose {text}: grams or the source's name missing: {FORM}", name="pose", value=text)
    numbers = {"tilt": tilt_deg, "azimuth": azimuth_deg, "sd": sd_g}
    for key in numbers.keys() & values.keys():
        if not is_plain(values[key]):
            raise ParameterError(f"--pose {text}: {key}={values[key]!r} is no number: {FORM}", name="pose", value=text)
        numbers[key] = float(values[key])
    weight_g = parse_weight_g(values["grams"], gravity_m_s2)
    return PoseRequest(weight_g, numbers["tilt"], numbers["azimuth"], numbers["sd"], source)
