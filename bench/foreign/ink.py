"""What a hand paints on the inside of the dome: ragged blobs beside their places, on a texture of the skin.

The texture is an azimuthal equidistant map of the undeformed inner sphere about the tip; where a picture of the skin
is wanted, not a camera's. Nothing here is shared with the simulator's renderer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

Array = NDArray[np.float64]
TEXELS = 4096
SEEN_RAD = 2.05  # polar angle at the texture's border
HARMONICS = 7


@dataclass(frozen=True)
class Hand:
    """How the dots are painted.

    Attributes:
        radius_mm, radius_sd: of the dots, and its relative scatter. beside_mm: scatter of their places, an axis.
        ragged: relative scatter of the outline. missing: share of dots that were forgotten.
        skin, ink: gray of both, linear. blotches: relative scatter of the skin's gray.
    """

    radius_mm: float = 1.9
    radius_sd: float = 0.09
    beside_mm: float = 0.15
    ragged: float = 0.07
    missing: float = 0.01
    skin: float = 0.42
    ink: float = 0.02
    blotches: float = 0.02


def texture(directions: Array, radius_mm: float, hand: Hand, seed: int) -> tuple[Array, Array]:
    """(gray, share of ink), each (TEXELS, TEXELS) in 0..1, row 0 at -y.

    Args:
        directions: (d, 3) of the dots from the sphere's centre. radius_mm: of the sphere. hand: how it is painted.
        seed: of what is random.
    """
    rng = np.random.default_rng(seed)
    ink = np.zeros((TEXELS, TEXELS), np.float32)
    for direction in directions:
        radius = hand.radius_mm * (1 + hand.radius_sd * rng.standard_normal())
        beside, outline = hand.beside_mm * rng.standard_normal(2), _outline(hand.ragged, rng)
        if rng.random() >= hand.missing:
            _blob(ink, direction, radius_mm, radius, beside, outline)
    clouds = gaussian_filter(rng.standard_normal((256, 256)), 4, mode="wrap")
    clouds = np.kron(clouds / clouds.std(), np.ones((TEXELS // 256,) * 2))
    skin = hand.skin * (1 + hand.blotches * gaussian_filter(clouds.astype(np.float32), TEXELS / 256))
    return skin + (hand.ink - skin) * ink, ink


def map_places(directions: Array) -> Array:
    """(n, 2) places on the texture, 0..1, of unit vectors (n, 3) from the sphere's centre."""
    polar = np.arctan2(np.linalg.norm(directions[:, :2], axis=1), directions[:, 2])
    azimuth = np.arctan2(directions[:, 1], directions[:, 0])
    return 0.5 + (polar / SEEN_RAD / 2)[:, None] * np.column_stack([np.cos(azimuth), np.sin(azimuth)])


def _outline(ragged: float, rng: np.random.Generator) -> Array:
    """(2, H) amplitudes of a ragged outline by angle, rms ``ragged``."""
    size = 1 / np.arange(2, HARMONICS + 2)
    waves = rng.standard_normal((2, HARMONICS)) * size
    return ragged * waves / np.sqrt((size**2).sum())


def _blob(
    ink: NDArray[np.float32], direction: Array, sphere_mm: float, radius: float, beside: Array, outline: Array
) -> None:
    """Cover the texels of one dot, its border soft over a texel.

    Args:
        ink: changed in place. direction: (3,) of the nominal dot. sphere_mm: of the inner surface. radius: of the dot.
        beside: (2,) mm beside its place. outline: of :func:`_outline`.
    """
    n = len(ink)
    across = np.cross([0, 0, 1.0], direction) if np.hypot(*direction[:2]) > 1e-9 else np.array([0, 1.0, 0])
    across = across / np.linalg.norm(across)
    down = np.cross(across, direction)
    column, row = map_places(direction[None])[0] * n
    polar = max(float(np.arccos(np.clip(direction[2], -1, 1))), 1e-3)
    reach = int(np.ceil(2.2 * radius / sphere_mm / (2 * SEEN_RAD) * n * max(1.0, polar / max(np.sin(polar), 0.2))))
    x, y = np.arange(int(column) - reach, int(column) + reach + 1), np.arange(int(row) - reach, int(row) + reach + 1)
    x, y = x[(x >= 0) & (x < n)], y[(y >= 0) & (y < n)]
    u, v = np.meshgrid(((x + 0.5) / n - 0.5) * 2 * SEEN_RAD, ((y + 0.5) / n - 0.5) * 2 * SEEN_RAD)
    angle = np.hypot(u, v)
    share = np.sinc(angle / np.pi)
    places = np.stack([share * u, share * v, np.cos(angle)], axis=-1)
    a, b = sphere_mm * (places @ down) - beside[0], sphere_mm * (places @ across) - beside[1]
    around, k = np.arctan2(b, a)[..., None], np.arange(2, HARMONICS + 2)
    border = radius * (1 + (outline[0] * np.cos(k * around) + outline[1] * np.sin(k * around)).sum(axis=-1))
    texel_mm = 2 * SEEN_RAD / n * sphere_mm
    cover = np.clip((border - np.hypot(a, b)) / texel_mm + 0.5, 0, 1) * (places @ direction > 0)
    window = ink[y[0] : y[-1] + 1, x[0] : x[-1] + 1]
    np.maximum(window, cover, out=window)
