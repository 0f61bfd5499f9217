"""Irradiance of the LED ring on the inside of the dome, and its evenness by the number of LEDs.

Endcap frame, millimetres; irradiance in 1/mm2 of the ring's whole flux (multiply by lumens for lumens per mm2).

    direct      E(p) = sum_k  Phi/n  cos(a_k) cos(b_k) / (pi d_k^2)        Lambertian LEDs facing along the axis
    scattered   E_s  = rho E_mean / (1 - rho)                              the same everywhere: an integrating sphere

a is the angle at the LED, b at the wall, d the distance; the sum of the scattered orders is that of a closed diffuse
sphere of reflectance rho (Goebel, Appl. Opt. 6 (1967) 125, doi:10.1364/AO.6.000125). Tall parts between the LEDs cast
shadows, by their envelopes. Neglected are the camera's head, gloss, and light inside the silicone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cad import ring_spacer
from cad.errors import ParameterError
from cad.led_ring.board import BOARD_THICKNESS_MM
from cad.led_ring.placement import LED_COUNT, Placement, placements
from cad.lens import camera_module
from cad.params import EndcapParams
from fab.checks.check import Check
from fab.variant import size_words

REFLECTANCE = 0.5  # E: white silicone, translucent
AZIMUTHS = 360
POLAR_STEP_DEG = 2.0  # at most
INK_SHARE = 0.105  # M (LED09): reflectance of ink over that of silicone
CONTRAST = 4.0  # E: the darkest silicone of a circle over a dot at the circle's brightest place
# (1 - r) / (INK_SHARE (1 + r)) = CONTRAST, where r is half of the swing round a circle over its mean
RIPPLE = (1 - CONTRAST * INK_SHARE) / (1 + CONTRAST * INK_SHARE)
DARKEST = 0.4  # E: darkest over mean


@dataclass(frozen=True)
class DomeLight:
    """Irradiance on the part of the dome that the camera sees.

    Attributes:
        polar_deg: (p,) polar angles from the tip about the sphere's centre.
        azimuth_deg: (a,).
        direct: (p, a) straight from the LEDs, per mm2 of the whole flux.
        total: (p, a) with the scattered light.
    """

    polar_deg: np.ndarray
    azimuth_deg: np.ndarray
    direct: np.ndarray
    total: np.ndarray

    @property
    def ripple(self) -> float:
        """Largest half swing round a circle of equal polar angle over that circle's mean."""
        return float((np.ptp(self.total, axis=1) / 2 / self.total.mean(axis=1)).max())

    @property
    def darkest(self) -> float:
        """Darkest place over the mean by area."""
        return float(self.total.min() / self.mean)

    @property
    def brightest(self) -> float:
        """Brightest place over the mean by area."""
        return float(self.total.max() / self.mean)

    @property
    def mean(self) -> float:
        """Mean by area."""
        return float(np.average(self.total.mean(axis=1), weights=np.sin(np.radians(self.polar_deg)) + 1e-12))


def dome_light(params: EndcapParams, led_count: int = LED_COUNT, reflectance: float = REFLECTANCE) -> DomeLight:
    """Light on the visible inner surface.

    Args:
        params: the endcap.
        led_count: LEDs on the ring.
        reflectance: of the silicone, 0 for direct light alone.

    Raises:
        ParameterError: LED count outside the range of the board.
    """
    rim = params.view_rim_polar_deg
    polar = np.linspace(0.0, rim, math.ceil(rim / POLAR_STEP_DEG) + 1)
    azimuth = np.arange(AZIMUTHS) * 360.0 / AZIMUTHS
    theta, phi = np.meshgrid(np.radians(polar), np.radians(azimuth), indexing="ij")
    outward = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    wall = params.inner_radius_mm * outward + (0.0, 0.0, params.centre_height_mm)
    places = placements(led_count)
    tall = [place for place in places if place.side == "top" and place.kind != "led"]
    direct = np.zeros(wall.shape[:2])
    for place in places:
        if place.kind == "led":
            source = led_position_mm(place)
            seen = ~np.any([blocked(source, wall, body) for body in tall], axis=0)
            direct += np.where(seen, irradiance(source, wall, -outward), 0.0) / led_count
    area = 4 * math.pi * params.inner_radius_mm**2
    return DomeLight(polar, azimuth, direct, direct + reflectance / (1 - reflectance) / area)


def led_position_mm(place: Placement) -> np.ndarray:
    """Centre (3,) of an LED's light-emitting face, mm.

    Args:
        place: of the LED on the board.
    """
    height = ring_spacer.SEAT_Z_MM + BOARD_THICKNESS_MM + place.part.height_mm
    return np.array([*place.centre_mm, height])


def irradiance(source: np.ndarray, wall: np.ndarray, inward: np.ndarray) -> np.ndarray:
    """Irradiance of one Lambertian source of unit flux that faces along +z.

    Args:
        source: (3,) mm.
        wall: (..., 3) mm.
        inward: (..., 3) unit normals of the wall.

    Returns:
        (...) per mm2.
    """
    ray = wall - source
    square = (ray**2).sum(-1)
    leaves, arrives = ray[..., 2], -(ray * inward).sum(-1)
    return np.maximum(leaves, 0) * np.maximum(arrives, 0) / (math.pi * square**2)


def blocked(source: np.ndarray, wall: np.ndarray, body: Placement) -> np.ndarray:
    """Whether the line from a source to a point passes through the box of a part: slab test in the box's frame, (...,).

    Args:
        source: (3,) position of the light, mm.
        wall: (..., 3) points that are lit, mm.
        body: the part in between.
    """
    angle = math.radians(-body.rotation_deg)
    turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]])
    foot = ring_spacer.SEAT_Z_MM + BOARD_THICKNESS_MM
    start = turn @ (source - (*body.centre_mm, foot))
    ray = (wall - source) @ turn.T
    part = body.part
    low = np.array([-part.length_mm / 2, -part.width_mm / 2, 0.0])
    high = np.array([part.length_mm / 2, part.width_mm / 2, part.height_mm])
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (low - start) / ray, (high - start) / ray
    enter = np.nanmax(np.minimum(first, second), axis=-1)
    leave = np.nanmin(np.maximum(first, second), axis=-1)
    return (enter < leave) & (leave > 0) & (enter < 1)


def require_even(light: DomeLight, params: EndcapParams, led_count: int) -> None:
    """Refuse a ring whose light is too uneven where the dome lies near it.

    Args:
        light: of this ring.
        params: the endcap that it lights.
        led_count: LEDs in the string.

    Raises:
        ParameterError: the light varies too much; the message names a sufficient number of LEDs or, where the ring has
            no room for it, another remedy.
    """
    if light.ripple <= RIPPLE:
        return
    counts = range(led_count + 1, LED_COUNT + 1)
    enough = next((count for count in counts if dome_light(params, count).ripple <= RIPPLE), None)
    module = camera_module()
    low = f"{module.name} sees down to it from {module.stack_mm:g} mm over its seat"
    fix = f"take leds={enough}" if enough else f"{low}: take a thinner wall, a larger D or a camera with a higher stack"
    raise ParameterError(
        f"leds={led_count} lights the rim of {size_words(params)} too unevenly: +-{light.ripple:.0%} round it, at most "
        f"{RIPPLE:.0%}, so that silicone stays {CONTRAST:g} times as bright as a dot; {fix}",
        name="leds",
        value=led_count,
    )


def light_checks(light: DomeLight) -> list[Check]:
    """Check the evenness of the light that the camera sees.

    Args:
        light: on the dome.
    """
    return [
        Check("ring.light_ripple", light.ripple, high=RIPPLE),
        Check("ring.light_darkest", light.darkest, low=DARKEST),
    ]
