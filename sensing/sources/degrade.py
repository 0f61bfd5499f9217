"""What lamp, lens, sensor and cable do to a picture: gain, gradient, noise, blur, defocus, blob, JPEG.

For tests and benches, on top of :mod:`sensing.sources.warp` or :mod:`sensing.sources.drawn`. Gray levels are 0..255.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from cad.errors import ParameterError
from sensing.records import Image

LEVELS = ("clean", "mild", "hard")


@dataclass(frozen=True)
class Degradation:
    """One set of disturbances.

    Attributes:
        gain: exposure factor.
        gradient: relative lamp change across half the picture's diagonal.
        gradient_rad: direction toward which it gets brighter.
        noise: standard deviation in gray levels.
        blur_px: standard deviation of a Gaussian blur.
        defocus_px: radius of a disc blur.
        blob_px: centre x, y and radius of a specular blob; None for none.
        jpeg_quality: 1..100.
    """

    gain: float = 1.0
    gradient: float = 0.0
    gradient_rad: float = 0.0
    noise: float = 0.0
    blur_px: float = 0.0
    defocus_px: float = 0.0
    blob_px: tuple[float, float, float] | None = None
    jpeg_quality: int = 95


def random_degradation(level: str, rng: np.random.Generator, size: tuple[int, int] = (640, 480)) -> Degradation:
    """A degradation of a level.

    Args:
        level: ``clean``; ``mild``, as a stable lamp and camera give; ``hard``, the worst that must be survived.
        rng: draws the strengths.
        size: (width, height) of the picture, px.

    Raises:
        ParameterError: unknown level.
    """
    if level not in LEVELS:
        raise ParameterError(f"level={level!r}: choose from {', '.join(LEVELS)}", name="level", value=level)
    turn = rng.uniform(0, 2 * np.pi)
    if level == "clean":
        return Degradation()
    if level == "mild":
        return Degradation(
            gain=rng.uniform(0.85, 1.15),
            gradient=rng.uniform(0, 0.15),
            gradient_rad=turn,
            noise=rng.uniform(1, 2.5),
            blur_px=rng.uniform(0, 0.7),
            jpeg_quality=int(rng.integers(80, 93)),
        )
    scale = min(size) / 480.0
    blob = (rng.uniform(0, size[0]), rng.uniform(0, size[1]), rng.uniform(12, 35) * scale)
    return Degradation(
        gain=rng.uniform(0.5, 1.5),
        gradient=rng.uniform(0.1, 0.35),
        gradient_rad=turn,
        noise=rng.uniform(2, 6),
        blur_px=rng.uniform(0, 1.3) * scale,
        defocus_px=rng.choice([0.0, rng.uniform(1, 2.5)]) * scale,
        blob_px=blob if rng.random() < 0.5 else None,
        jpeg_quality=int(rng.integers(50, 91)),
    )


def degrade(image: Image, degradation: Degradation, rng: np.random.Generator) -> bytes:
    """The JPEG bytes of a picture after all disturbances, in the order light, lens, sensor.

    Args:
        image: (H, W) or (H, W, 3) uint8.
        degradation: the disturbances.
        rng: of the noise.
    """
    d = degradation
    height, width = image.shape[:2]
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    along = (x - width / 2) * np.cos(d.gradient_rad) + (y - height / 2) * np.sin(d.gradient_rad)
    light = (d.gain * (1 + d.gradient * along / (np.hypot(width, height) / 2))).astype(np.float32)
    glow = np.zeros_like(light)
    if d.blob_px is not None:
        radius = np.hypot(x - d.blob_px[0], y - d.blob_px[1])
        glow = (200 * (1 - np.tanh((radius - d.blob_px[2]) / 6.0))).astype(np.float32)
    if image.ndim == 3:
        light, glow = light[:, :, None], glow[:, :, None]
    picture = image.astype(np.float32) * light + glow
    if d.defocus_px > 0:
        picture = cv2.filter2D(picture, -1, _disc(d.defocus_px))
    if d.blur_px > 0:
        picture = cv2.GaussianBlur(picture, (0, 0), d.blur_px)
    if d.noise > 0:
        picture = picture + d.noise * rng.standard_normal(picture.shape, dtype=np.float32)
    raw = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    return cv2.imencode(".jpg", raw, [cv2.IMWRITE_JPEG_QUALITY, d.jpeg_quality])[1].tobytes()


def _disc(radius: float) -> np.ndarray:
    reach = int(np.ceil(radius))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disc = np.clip(radius + 0.5 - np.hypot(x, y), 0, 1)
    return (disc / disc.sum()).astype(np.float32)
