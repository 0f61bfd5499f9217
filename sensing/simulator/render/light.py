"""Light of the LED ring on the deformed inner surface, at the mesh's vertices. Endcap frame, mm.

Each LED is a Lambertian point source looking up (+z): irradiance I cos(theta_s) cos(theta_i) / d^2. Light scattered
inside the dome adds a constant (it fills a sphere evenly). Reflections are Blinn-Phong lobes: broad for dusty silicone,
narrower for ink. Values are relative to the direct light at the undeformed tip.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from sensing.simulator.render.settings import Lamp

Array = NDArray[np.float64]
SILICONE_SHININESS_LOG2 = 5  # E: log2 of the exponent, 32
INK_SHININESS_LOG2 = 8  # M: log2 of the exponent, 256: the glint ends before the second ring of dots


def led_positions_mm(lamp: Lamp) -> tuple[Array, Array]:
    """LED positions (k, 3) and brightnesses (k,), which sum to ``lamp.brightness`` while none is dead."""
    azimuth = 2 * np.pi * np.arange(lamp.count) / lamp.count
    positions = np.stack(
        [lamp.radius_mm * np.cos(azimuth), lamp.radius_mm * np.sin(azimuth), np.full(lamp.count, lamp.height_mm)], -1
    )
    brightness = 1 + lamp.gradient * np.cos(azimuth - np.radians(lamp.gradient_azimuth_deg))
    brightness[[number for number in lamp.dead if 0 <= number < lamp.count]] = 0.0
    return positions, lamp.brightness * brightness / lamp.count


def tip_irradiance(lamp: Lamp, tip_height_mm: float) -> float:
    """Direct irradiance at the tip of one ring of total intensity 1: h^2 / (h^2 + r^2)^2."""
    height = tip_height_mm - lamp.height_mm
    return float(height**2 / (height**2 + lamp.radius_mm**2) ** 2)


@numba.njit(cache=True, fastmath=True, inline="always")
def unit(x: float, y: float, z: float) -> tuple[float, float, float]:
    """The vector scaled to length 1.

    Args:
        x, y, z: components of the vector.
    """
    inverse = 1.0 / np.sqrt(x * x + y * y + z * z)
    return x * inverse, y * inverse, z * inverse


@numba.njit(cache=True, fastmath=True, inline="always")
def lobe(cosine: float, shininess_log2: int) -> float:
    """``cosine`` to the power 2^shininess_log2; 0 for light from behind."""
    cosine = max(cosine, 0.0)
    for _ in range(shininess_log2):
        cosine *= cosine
    return cosine


@numba.njit(cache=True, fastmath=True)
def shade(vertices: Array, normals: Array, pupil: Array, leds: Array, brightness: Array) -> NDArray[np.float32]:
    """Direct irradiance and the two reflections at each vertex, before division by the tip's irradiance.

    Args:
        vertices: (n, 3) positions.
        normals: (n, 3) unit normals into the dome.
        pupil: (3,) entrance pupil of the camera.
        leds: (k, 3) LED positions.
        brightness: (k,) LED intensities.

    Returns:
        (n, 3): irradiance; silicone's lobe, summed over the LEDs; ink's lobe, of the ring as a whole from its centre
        (single LEDs do not show in the dots of the photos).
    """
    out = np.zeros((vertices.shape[0], 3), np.float32)
    count = leds.shape[0]
    rx, ry, rz = leds[:, 0].mean(), leds[:, 1].mean(), leds[:, 2].mean()
    for i in range(vertices.shape[0]):
        px, py, pz = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
        ex, ey, ez = unit(pupil[0] - px, pupil[1] - py, pupil[2] - pz)
        direct, gloss = 0.0, 0.0
        for k in range(count):
            lx, ly, lz = leds[k, 0] - px, leds[k, 1] - py, leds[k, 2] - pz
            square = lx * lx + ly * ly + lz * lz
            lx, ly, lz = unit(lx, ly, lz)
            received = nx * lx + ny * ly + nz * lz
            if lz < 0 and received > 0:
                flux = -brightness[k] * lz / square
                direct += flux * received
                hx, hy, hz = unit(lx + ex, ly + ey, lz + ez)
                gloss += flux * lobe(nx * hx + ny * hy + nz * hz, SILICONE_SHININESS_LOG2)
        lx, ly, lz = unit(rx - px, ry - py, rz - pz)
        hx, hy, hz = unit(lx + ex, ly + ey, lz + ez)
        out[i, 0], out[i, 1] = direct, gloss
        out[i, 2] = direct * lobe(nx * hx + ny * hy + nz * hz, INK_SHININESS_LOG2)
    return out
