"""Paint on the undeformed inner surface: silicone, core seams, dents, ink, smears and dirt, as one texture.

The texture is the disc of :mod:`sensing.simulator.render.mesh` (azimuth kept, radius = polar angle), so a texel has
about the size of a pixel everywhere. Channels: linear reflectance blue, green, red, and fraction of ink in the texel.
Lengths in mm on the sphere, endcap frame. One texture serves many frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cad.dots import dot_pattern, dot_position_mm
from cad.params import EndcapParams
from sensing.simulator.render.canvas import Array, Canvas, Floats
from sensing.simulator.render.ink import dent, dirt, ink_dot
from sensing.simulator.render.settings import Paint

# Reflectance (blue, green, red) against polar angle, such that the nominal lamp gives the released photos' medians (M).
# It is that of the whole wall: toward the rim the dark interlock shows through the silicone, in red first.
SILICONE = np.array(
    [
        (0, 0.274, 0.332, 0.215),
        (16, 0.275, 0.332, 0.201),
        (38, 0.288, 0.350, 0.196),
        (59, 0.310, 0.379, 0.199),
        (79, 0.355, 0.447, 0.202),
        (88, 0.396, 0.511, 0.200),
        (97, 0.439, 0.561, 0.169),
        (104, 0.445, 0.542, 0.100),
        (108, 0.475, 0.507, 0.055),
        (180, 0.494, 0.494, 0.055),
    ]
)
SEAM_WIDTH_MM = 0.35  # E
SEAM_DEPTH = 0.14  # E: relative darkening
BAND_WIDTH_MM = 1.1  # E: toward the rim the joints of the key pieces show as soft blue bands
BAND_DEPTH = (0.10, 0.16, 0.45)  # E: relative darkening of blue, green and red at the rim
KEY_FACE = 0.60  # distance of a key piece's inner face from the axis over the core's radius
KEY_HALF_WIDTH = 0.58  # half the width of that face over the core's radius
TAB_RADIUS_MM = 4.0  # E: circles beside the tip on the photos
CORE_CLEARANCE_MM = 0.5  # the core's radius is smaller than the bore by this


@dataclass(frozen=True)
class Skin:
    """The painted surface.

    Attributes:
        texture: (n, n, 4) float32 reflectance B, G, R and ink.
        extent: disc coordinate (radians) of the texture's edge; the centre of texel (row, column) is at
            ``((column + 0.5) / n * 2 - 1) * extent`` along x, rows along y.
        ink_mm: (d, 3) centre of each dot's ink on the undeformed sphere, mm; of its dent where there is no ink.
        painted: (d,) whether the dot has ink.
    """

    texture: Floats
    extent: float
    ink_mm: Array
    painted: NDArray[np.bool_]


def paint_skin(params: EndcapParams, paint: Paint, texels: int, seed: int) -> Skin:
    """Paint the inner surface of a design.

    Args:
        params: the design.
        paint: ink and marks.
        texels: width of the texture, texels.
        seed: seed of the unpainted dots, of the ink's edges and of the dirt; the same at every ``texels``.
    """
    rng = np.random.default_rng([seed, 1])
    canvas = Canvas.blank(params, texels)
    _silicone(canvas, rng, paint.clouds)
    if paint.seams:
        _seams(canvas, params, rng.spawn(1)[0])
    dents = np.array([dot_position_mm(params, dot) for dot in dot_pattern(params)])
    fate = rng.random(len(dents))
    missing, unpainted = fate < paint.missing, (fate >= paint.missing) & (fate < paint.missing + paint.unpainted)
    smeared = rng.random(len(dents)) < paint.smeared
    jitter = rng.normal(0, 1, (len(dents), 2)) * paint.jitter_mm
    ink = np.array([canvas.shifted(place, shift) for place, shift in zip(dents, jitter, strict=True)])
    for index, place in enumerate(dents):
        own = np.random.default_rng([seed, 2, index])
        if not missing[index]:
            dent(canvas, place, params.dot_radius_mm, params.dent_depth_mm)
            if not unpainted[index]:
                ink_dot(canvas, ink[index], params.dot_radius_mm, paint, own, bool(smeared[index]))
    dirt(canvas, params, paint, seed)
    painted = ~(missing | unpainted)
    return Skin(canvas.texture, canvas.extent, np.where(painted[:, None], ink, dents), painted)


def _silicone(canvas: Canvas, rng: np.random.Generator, strength: float) -> None:
    """Paint the base colour with faint clouds."""
    n = len(canvas.texture)
    polar = np.degrees(np.arccos(np.clip((canvas.points[..., 2] - canvas.centre[2]) / canvas.radius, -1, 1)))
    clouds = smooth_noise(rng, 24, n)
    for channel in range(3):
        canvas.texture[..., channel] = np.interp(polar, SILICONE[:, 0], SILICONE[:, channel + 1])
    canvas.texture[..., :3] *= (1 + strength * clouds)[..., None]


def _seams(canvas: Canvas, params: EndcapParams, rng: np.random.Generator) -> None:
    """Paint thin dark lines where the core's vertical joints meet the sphere.

    Seen from above: a centre piece with three wide faces (key pieces, at azimuths 0, 120, 240) and three narrow ones
    (wedge pieces), a round tab in the middle of every wide face, and the straight sides of the keys out to the rim.
    """
    core = params.bore_radius_mm - CORE_CLEARANCE_MM
    face, half = KEY_FACE * core, KEY_HALF_WIDTH * core
    corner = np.array([face, half])
    narrow = float(corner @ [np.cos(np.pi / 3), np.sin(np.pi / 3)])
    narrow_half = abs(float(corner @ [np.sin(np.pi / 3), -np.cos(np.pi / 3)]))
    height = canvas.points[..., 2] - canvas.centre[2]
    distance, sides = np.full(height.shape, np.inf, np.float32), np.full(height.shape, np.inf, np.float32)
    for turn in np.radians([0, 120, 240]):
        x, y = _turned(canvas, turn)
        sides = np.minimum(sides, np.where(x > face, np.abs(np.abs(y) - half), np.inf))
        distance = np.minimum(distance, np.where(height > 0, _face_distance(x, y, face, half), np.inf))
        x, y = _turned(canvas, turn + np.pi / 3)
        plain = np.where(np.abs(y) <= narrow_half, np.abs(x - narrow), np.inf)
        distance = np.minimum(distance, np.where(height > 0, plain, np.inf))
    texel = 2 * canvas.extent * canvas.radius / len(canvas.texture)
    line = np.clip((SEAM_WIDTH_MM / 2 - np.minimum(distance, sides)) / texel + 0.5, 0, 1) * min(
        1.0, SEAM_WIDTH_MM / texel
    )
    line *= np.clip(0.65 + 0.35 * smooth_noise(rng, 40, len(line)), 0.1, 1.3)
    rim = np.clip(1 - height / canvas.radius, 0, 1.2) ** 2  # 0 at the tip, 1 at the equator
    band = (
        rim * np.exp(-((sides / BAND_WIDTH_MM) ** 2)) * np.clip(0.7 + 0.3 * smooth_noise(rng, 24, len(line)), 0.2, 1.3)
    )
    canvas.texture[..., :3] *= (1 - SEAM_DEPTH * line)[..., None] * (1 - band[..., None] * np.array(BAND_DEPTH))


def smooth_noise(rng: np.random.Generator, cells: int, texels: int) -> Array:
    """(texels, texels) standard normals at ``cells`` x ``cells`` points, smooth between.

    Args:
        rng: source of random numbers.
        cells: number of points along a side.
        texels: width of the result, texels.
    """
    return np.asarray(cv2.resize(rng.normal(0, 1, (cells, cells)), (texels, texels), interpolation=cv2.INTER_CUBIC))


def _turned(canvas: Canvas, angle: float) -> tuple[Floats, Floats]:
    x, y = canvas.points[..., 0], canvas.points[..., 1]
    c, s = np.float32(np.cos(angle)), np.float32(np.sin(angle))
    return c * x + s * y, c * y - s * x


def _face_distance(x: Floats, y: Floats, face: float, half: float) -> Floats:
    """Distance (mm, in plan) to a face at ``x = face`` with a round tab in its middle."""
    tab = min(TAB_RADIUS_MM, 0.6 * half)
    neck = 0.8 * tab  # the circle is offset, so that its neck is narrower than the tab
    centre = face + np.sqrt(tab**2 - neck**2)
    flat = np.where((np.abs(y) <= half) & (np.abs(y) >= neck), np.abs(x - face), np.inf)
    circle = np.where(x >= face, np.abs(np.hypot(x - centre, y) - tab), np.inf)
    return np.minimum(flat, circle).astype(np.float32)
