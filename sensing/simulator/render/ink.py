"""Hand-painted ink in the dents: its dark edge, spills, smears, specks and letters.

Shapes are drawn in the tangent plane of each dot (mm); every dot has its own random numbers, so that a change of one
setting does not change other dots. Amounts were set against the released photos (M: areas, spread and grey of the dots
by eye and histogram; tables in docs/optics.md).
"""

from __future__ import annotations

import cv2
import numpy as np

from cad.params import EndcapParams
from sensing.simulator.render.canvas import Array, Canvas, mix
from sensing.simulator.render.settings import Paint

INK = (0.022, 0.035, 0.034)  # M: reflectance (blue, green, red) of dots away from the glint
FLANK = (0.006, 0.009, 0.008)  # M: reflectance of the dark edge of a filled dent
BOTTOM_SHARE = 0.74  # E: radius of the bright bottom of a filled dent over that of the ink
FLANK_SOFT_MM = 0.35  # E: width of the transition from bottom to flank
SPILL_EDGE_MM = 0.6  # E: width of a spill's edge
OUTWARD = 0.7  # E: by how much likelier ink spills at the rim, which a hand reaches badly, than at the tip


def dent(canvas: Canvas, at: Array, radius_mm: float, depth_mm: float) -> None:
    """Paint the faint outline of a dent without ink, whose flank faces away from the light.

    Args:
        canvas: canvas that is painted.
        at: centre of the dent on the sphere (3,), mm.
        radius_mm, depth_mm: radius and depth of the dent, mm.
    """
    window, a, b, texel = canvas.patch(at, radius_mm + 0.5)
    width = max(0.5 * depth_mm, texel)
    ring = np.exp(-(((np.hypot(a, b) - radius_mm + width / 2) / width) ** 2))
    window[..., :3] *= (1 - 0.10 * ring)[..., None]


def ink_dot(canvas: Canvas, at: Array, radius_mm: float, paint: Paint, rng: np.random.Generator, smeared: bool) -> None:
    """Fill a dent, with ink spilled over its edge and smeared by a sleeve.

    Args:
        canvas: canvas that is painted.
        at: centre of the ink on the sphere (3,), mm.
        radius_mm: radius of the dent, mm.
        paint: look of the ink.
        rng: random numbers of this dot alone.
        smeared: whether a sleeve dragged ink along.
    """
    radius = radius_mm * paint.radius_scale * (1 + paint.size_spread * rng.standard_normal())
    away = np.arccos(np.clip((at[2] - canvas.centre[2]) / canvas.radius, -1, 1)) / (np.pi / 2)
    spilt = rng.random() < paint.overflow * (1 + OUTWARD * (2 * away - 1))
    streak, spill, fill = rng.spawn(3)
    if smeared:
        _smear(canvas, at, radius, streak)
    if spilt:
        _spill(canvas, at, radius, paint, spill)
    _fill(canvas, at, radius, paint, fill)


def _fill(canvas: Canvas, at: Array, radius: float, paint: Paint, rng: np.random.Generator) -> None:
    """Paint the ink in a dent: a wavy outline, an uneven bottom off the middle, and the dark flank between them."""
    window, a, b, texel = canvas.patch(at, 1.5 * radius)
    wave, inner_wave = (_wave(np.arctan2(b, a), rng) for _ in range(2))
    inside = radius * (1 + paint.roughness * wave) - np.hypot(a, b)
    heading, off = rng.random() * 2 * np.pi, paint.unevenness * radius * rng.uniform(0.0, 0.3)
    x, y = a - off * np.cos(heading), b - off * np.sin(heading)
    bottom = radius * (BOTTOM_SHARE + paint.unevenness * 0.08 * inner_wave) - np.hypot(x, y)
    flank = np.clip(0.5 - bottom / FLANK_SOFT_MM, 0, 1)
    tone = 1 + paint.unevenness * rng.uniform(-0.5, 1.1)
    uneven = paint.unevenness * (0.2 * x / radius + 0.2 * inner_wave * np.hypot(x, y) / radius)
    middle = np.array(INK) * (tone * np.clip(1 + uneven, 0.3, 2) * (1 - flank))[..., None]
    mix(window, middle + np.array(FLANK) * flank[..., None], np.clip(inside / texel + 0.5, 0, 1), 1 - flank)


def _spill(canvas: Canvas, at: Array, radius: float, paint: Paint, rng: np.random.Generator) -> None:
    """Paint a ragged lobe of thinner ink over the dent's edge."""
    heading, size = rng.random() * 2 * np.pi, radius * rng.uniform(0.4, 0.85)
    window, a, b, texel = canvas.patch(at, 2.5 * radius)
    x, y = a - 0.75 * radius * np.cos(heading), b - 0.75 * radius * np.sin(heading)
    inside = size * (1 + 0.5 * _wave(np.arctan2(y, x), rng)) - np.hypot(x, y)
    cover = rng.uniform(0.7, 1.0) * np.clip(inside / (2 * texel) + 0.5, 0, 1)
    edge = np.clip(1 - inside / SPILL_EDGE_MM, 0, 1)
    tone = rng.uniform(0.6, 1.4) * (1 - 0.5 * edge)
    mix(window, np.array(INK) * tone[..., None], cover, 0.5 * (1 - edge))


def _smear(canvas: Canvas, at: Array, radius: float, rng: np.random.Generator) -> None:
    """Paint thin ink that was dragged to one side: streaks of different lengths that fade."""
    heading, length = rng.random() * 2 * np.pi, radius * rng.uniform(1.5, 3.0)
    window, a, b, _ = canvas.patch(at, radius + length)
    along, across = a * np.cos(heading) + b * np.sin(heading), b * np.cos(heading) - a * np.sin(heading)
    streaks = _wave(np.clip(across / radius, -1, 1) * np.pi, rng)
    reach = length * np.clip(0.75 + 0.25 * streaks, 0.3, 1.0)
    side = np.clip((0.85 * radius - np.abs(across)) / 0.5 + 0.5, 0, 1)
    fade = np.clip(1 - along / (radius + reach), 0, 1) * np.clip(0.7 + 0.3 * streaks, 0.2, 1)
    mix(window, INK, 0.8 * side * (along > 0) * fade, 0.3)


def _wave(angle: Array, rng: np.random.Generator) -> Array:
    """A smooth random function of an angle, of about unit size."""
    amplitudes, phases = rng.normal(0, 1, 4), rng.random(4) * 2 * np.pi
    return np.asarray(sum(amplitudes[k] / (k + 2) * np.cos((k + 2) * angle + phases[k]) for k in range(4)))


def dirt(canvas: Canvas, params: EndcapParams, paint: Paint, seed: int) -> None:
    """Paint false dots, specks and the written mark.

    Args:
        canvas: canvas that is painted.
        params: the design.
        paint: numbers of false dots and specks, look of the ink, text.
        seed: seed of their places.
    """
    rng = np.random.default_rng([seed, 3])
    limit = np.cos(np.radians(params.view_rim_polar_deg))
    for number in range(paint.extra + paint.specks):
        height, azimuth = rng.uniform(limit, 1), rng.random() * 2 * np.pi
        side = np.sqrt(1 - height**2)
        at = canvas.centre + canvas.radius * np.array([side * np.cos(azimuth), side * np.sin(azimuth), height])
        if number < paint.extra:
            ink_dot(canvas, at, params.dot_radius_mm, paint, rng, False)
        else:
            window, a, b, texel = canvas.patch(at, 1.5)
            size, lean, thin = rng.uniform(0.1, 0.3), rng.random() * np.pi, rng.uniform(1, 3)
            along, across = a * np.cos(lean) + b * np.sin(lean), (b * np.cos(lean) - a * np.sin(lean)) * thin
            cover = np.clip((size - np.hypot(along, across)) / texel + 0.5, 0, 1)
            mix(window, INK, 0.8 * cover * min(1.0, 2 * size / texel), 0.0)
    if paint.digit:
        _write(canvas, params, paint.digit)


def _write(canvas: Canvas, params: EndcapParams, text: str) -> None:
    """Paint letters 5 mm high between the first and the second ring of dots."""
    polar, azimuth = np.radians(20.0), np.radians(18.0)
    disc = polar * np.array([np.cos(azimuth), np.sin(azimuth)])
    n = len(canvas.texture)
    texel = 2 * canvas.extent * canvas.radius / n
    mask = np.zeros((n, n), np.uint8)
    scale = 5.0 / texel / 22  # the font is 22 px high at scale 1
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)
    column, row = ((value / canvas.extent + 1) * n / 2 for value in disc)
    origin = (round(column - width / 2), round(row + height / 2))
    cv2.putText(mask, text, origin, cv2.FONT_HERSHEY_SIMPLEX, scale, 255, max(1, round(0.7 / texel)), cv2.LINE_AA)
    mix(canvas.texture, (0.05, 0.07, 0.16), 0.85 * mask / 255.0, 0.4)
