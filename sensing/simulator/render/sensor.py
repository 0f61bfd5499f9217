"""From light to pixel values: shading lookup, lens blur, exposure, noise, tone curve, sharpening and JPEG."""

from __future__ import annotations

import functools

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from sensing.camera.model import FisheyeCamera
from sensing.simulator.render.settings import Optics, Sensor

Floats = NDArray[np.float32]
Image = NDArray[np.uint8]
BRONZE = np.array([0.30, 0.55, 1.0], np.float32)  # colour of dried ink's reflection, BGR (M: dots at the tip)
AMBIENT_TINT = np.array([1.0, 1.0, 0.6], np.float32)  # light that was reflected by teal silicone before (E)
TONE_STEPS = 1 << 15  # steps of the tone curve's table
TOE = 0.002  # signal below which the tone curve is straight: a power law would amplify the noise of black


def radiance_image(seen: Floats, texture: Floats, extent: float, transmission: Floats, weights: Floats) -> Floats:
    """Light (h, w, 3) of every pixel from the rasteriser's attributes.

    Args:
        seen: (5, h, w) disc x, disc y, irradiance, silicone lobe, ink lobe.
        texture: (n, n, 4) texture of the skin.
        extent: disc coordinate of the texture's edge.
        transmission: (h, w) transmission of the lens, 0 where no surface is seen.
        weights: (3, 3): ambient light, silicone gloss and ink gloss, each per colour.
    """
    n = len(texture)
    columns, rows = (plane * np.float32(n / (2 * extent)) + np.float32(n / 2 - 0.5) for plane in seen[:2])
    paint = np.asarray(cv2.remap(texture, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
    return np.asarray(_combined(paint.astype(np.float32, copy=False), seen, transmission, weights))


@numba.njit(cache=True, fastmath=True)
def _combined(paint: Floats, seen: Floats, transmission: Floats, weights: Floats) -> Floats:
    height, width = transmission.shape
    out = np.empty((height, width, 3), np.float32)
    for y in range(height):
        for x in range(width):
            ink, passed = paint[y, x, 3], transmission[y, x]
            gloss, glint = seen[3, y, x] * (np.float32(1) - ink), seen[4, y, x] * ink
            for k in range(3):
                reflected = paint[y, x, k] * (seen[2, y, x] + weights[0, k])
                out[y, x, k] = passed * (reflected + weights[1, k] * gloss + weights[2, k] * glint)
    return out


def lens_transmission(camera: FisheyeCamera, optics: Optics) -> Floats:
    """Vignetting (h, w): cos(theta/2)^p, falling to 0 at the edge of the image circle."""
    theta = pixel_angles(camera)
    falloff = np.cos(theta / 2) ** optics.vignetting
    edge = (np.radians(optics.circle_deg) - theta) / np.radians(optics.circle_soft_deg)
    edge = np.clip(edge + 0.5, 0, 1)
    return np.nan_to_num(falloff * edge * edge * (3 - 2 * edge)).astype(np.float32)


def pixel_angles(camera: FisheyeCamera) -> NDArray[np.float64]:
    """Angle from the optical axis (h, w) of every pixel, ``nan`` outside the model's view."""
    columns, rows = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
    return np.arccos(np.clip(camera.unproject(np.stack([columns, rows], -1))[..., 2], -1, 1))


def defocus(radiance: Floats, optics: Optics, edge_weight: Floats) -> Floats:
    """Blur that grows from the axis to the edge: a mix of two Gaussians.

    Args:
        radiance: (h, w, 3) light.
        optics: widths of both Gaussians, px at 480 rows.
        edge_weight: (h, w) weight of the wider one, 0..1.
    """
    scale = radiance.shape[0] / 480
    middle = _gaussian(radiance, optics.defocus_px * scale)
    if optics.defocus_edge_px == optics.defocus_px:
        return middle
    edge = _gaussian(radiance, optics.defocus_edge_px * scale)
    return np.asarray(cv2.blendLinear(middle, edge, 1 - edge_weight, edge_weight))


def _gaussian(image: Floats, sigma: float) -> Floats:
    if sigma < 0.05:
        return image
    size = 2 * int(np.ceil(2.5 * sigma)) + 1
    return np.asarray(cv2.GaussianBlur(image, (size, size), sigma))


@functools.lru_cache(maxsize=8)
def tone_table(sensor: Sensor) -> Image:
    """Pixel value at TONE_STEPS + 1 equal steps of signal from 0 to 1."""
    signal = np.linspace(0, 1, TONE_STEPS + 1)
    power = np.maximum(signal, TOE) ** (1 / sensor.gamma)
    value = np.where(signal < TOE, TOE ** (1 / sensor.gamma) * signal / TOE, power)
    return np.round(sensor.black + (255 - sensor.black) * value).astype(np.uint8)


@numba.njit(cache=True, fastmath=True)
def signal_of(radiance: Floats, noise: Floats, exposure: float, gain: float, full_well: float, read: float) -> Floats:
    """Signal (1 = white, not clipped) with shot and read noise.

    signal = gain (exposure L + n sqrt(exposure L / F + (r / F)^2)).

    Args:
        radiance: light L (h, w, 3).
        noise: n, standard normals, one for each number of ``radiance``.
        exposure, gain: factors on the light and on the signal.
        full_well: full well F, electrons at signal 1.
        read: read noise r, electrons.
    """
    out = np.empty_like(radiance)
    light, result, normal = radiance.ravel(), out.ravel(), noise.ravel()
    floor = np.float32((read / full_well) ** 2)
    for i in range(light.size):
        clean = light[i] * np.float32(exposure)
        result[i] = np.float32(gain) * (clean + normal[i] * np.sqrt(clean * np.float32(1 / full_well) + floor))
    return out


@numba.njit(cache=True, fastmath=True)
def pixel_values(signal: Floats, table: Image) -> Image:
    """8-bit values of a signal by the tone table, clipped to 0..255."""
    out = np.empty(signal.shape, np.uint8)
    flat, result = signal.ravel(), out.ravel()
    steps = np.float32(table.size - 1)
    for i in range(flat.size):
        place = np.int32(min(max(flat[i], np.float32(0)), np.float32(1)) * steps + np.float32(0.5))
        result[i] = table[place]
    return out


def develop(signal: Floats, sensor: Sensor) -> Image:
    """Apply the tone curve and the camera's sharpening."""
    image = pixel_values(signal, tone_table(sensor))
    if sensor.sharpen > 0:
        sigma = 1.2 * image.shape[0] / 480
        soft = cv2.GaussianBlur(image, (0, 0), sigma)
        image = np.asarray(cv2.addWeighted(image, 1 + sensor.sharpen, soft, -sensor.sharpen, 0))
    return image


def compress(image: Image, sensor: Sensor) -> bytes:
    """JPEG bytes; empty where the quality is 0."""
    if sensor.jpeg_quality == 0:
        return b""
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, sensor.jpeg_quality])[1].tobytes()
