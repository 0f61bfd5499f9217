"""Paint on the undeformed inner surface: silicone, core seams, dents, ink, smears and dirt, as one texture.

The texture is the disc of :mod:`sensing.simulator.render_mesh` (azimuth kept, radius = polar angle), so a texel has
about the size of a pixel everywhere. Channels: linear reflectance blue, green, red, and how much of the texel is ink.
Lengths in mm on the sphere, endcap frame. It is painted once for many frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from cad.dots import DENT_DEPTH_MM, DOT_RADIUS_MM, dot_pattern, dot_position_mm
from cad.params import EndcapParams
from sensing.simulator.render_mesh import rim_polar, sphere_points
from sensing.simulator.render_settings import Paint

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

# Reflectance (blue, green, red) against polar angle, such that the nominal lamp gives the released photos' medians (M).
# It is the look of the whole wall: toward the rim the dark interlock shows through the silicone, in red first.
SILICONE = np.array(
    [
        (0, 0.288, 0.349, 0.226),
        (16, 0.289, 0.350, 0.212),
        (38, 0.303, 0.368, 0.206),
        (59, 0.326, 0.399, 0.210),
        (79, 0.374, 0.471, 0.213),
        (88, 0.417, 0.538, 0.211),
        (97, 0.462, 0.591, 0.178),
        (104, 0.468, 0.571, 0.105),
        (108, 0.500, 0.534, 0.058),
        (180, 0.520, 0.520, 0.058),
    ]
)
INK = (0.022, 0.035, 0.034)  # M: dots away from the glint
FLANK = (0.006, 0.009, 0.008)  # M: the dark edge of a filled dent
FLANK_WIDTH_MM = 0.45  # E
SEAM_WIDTH_MM = 0.35  # E
SEAM_DEPTH = 0.14  # how much darker (E)
KEY_FACE = 0.55  # inner face of a key piece over the core's radius
KEY_HALF_WIDTH = 0.60
TAB_RADIUS_MM = 4.0  # E: circles beside the tip on the photos
CORE_CLEARANCE_MM = 0.5


@dataclass(frozen=True)
class Skin:
    """The painted surface.

    Attributes:
        texture: (n, n, 4) float32 reflectance B, G, R and ink.
        extent: disc coordinate (radians) of the texture's edge; texel (row, column) centres are at
            ``((column + 0.5) / n * 2 - 1) * extent`` along x, rows along y.
        ink_mm: (d, 3) centre of each dot's ink on the undeformed sphere; of its dent where there is no ink.
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
        paint: what to paint.
        texels: width of the texture.
        seed: fixes which dots are unpainted, their edges, and the dirt; the same at every ``texels``.
    """
    rng = np.random.default_rng([seed, 1])
    canvas = _Canvas.blank(params, texels)
    _silicone(canvas, rng, paint.clouds)
    if paint.seams:
        _seams(canvas, params)
    dents = np.array([dot_position_mm(params, dot) for dot in dot_pattern(params)])
    fate = rng.random(len(dents))
    missing, unpainted = fate < paint.missing, (fate >= paint.missing) & (fate < paint.missing + paint.unpainted)
    smeared = rng.random(len(dents)) < paint.smeared
    jitter = rng.normal(0, 1, (len(dents), 2)) * paint.jitter_mm
    ink = np.array([canvas.shifted(dent, shift) for dent, shift in zip(dents, jitter, strict=True)])
    for index, dent in enumerate(dents):
        own = np.random.default_rng([seed, 2, index])
        if not missing[index]:
            _dent(canvas, dent)
            if not unpainted[index]:
                _ink(canvas, ink[index], paint, own, bool(smeared[index]))
    _dirt(canvas, params, paint, seed)
    painted = ~(missing | unpainted)
    return Skin(canvas.texture, canvas.extent, np.where(painted[:, None], ink, dents), painted)


@dataclass(frozen=True)
class _Canvas:
    texture: Floats
    points: Floats  # (n, n, 3) on the sphere, mm
    extent: float
    centre: Array
    radius: float

    @classmethod
    def blank(cls, params: EndcapParams, texels: int) -> _Canvas:
        extent = rim_polar(params) * 1.02
        axis = ((np.arange(texels) + 0.5) / texels * 2 - 1) * extent
        disc = np.stack(np.meshgrid(axis, axis), -1)
        centre = np.array([0, 0, params.centre_height_mm])
        points = sphere_points(params, disc).astype(np.float32)
        return cls(np.zeros((texels, texels, 4), np.float32), points, extent, centre, params.inner_radius_mm)

    def frame(self, at: Array) -> tuple[Array, Array]:
        """Unit tangents at a point: away from the tip, and round the axis."""
        unit = (at - self.centre) / self.radius
        around = np.array([-unit[1], unit[0], 0.0])
        length = np.linalg.norm(around)
        around = np.array([0, 1.0, 0]) if length < 1e-9 else around / length
        return np.cross(around, unit), around

    def shifted(self, at: Array, shift_mm: Array) -> Array:
        """A point moved along the sphere."""
        away, around = self.frame(at)
        moved = at - self.centre + shift_mm[0] * away + shift_mm[1] * around
        return self.centre + moved / np.linalg.norm(moved) * self.radius

    def patch(self, at: Array, reach_mm: float) -> tuple[Floats, Array, Array, float]:
        """Texture window round a point, tangent coordinates (mm) of its texels, and the texel size (mm)."""
        n = len(self.texture)
        unit = (at - self.centre) / self.radius
        polar = np.arccos(np.clip(unit[2], -1, 1))
        azimuth = np.arctan2(unit[1], unit[0])
        texel = 2 * self.extent * self.radius / n
        column, row = ((polar * f(azimuth) / self.extent + 1) * n / 2 - 0.5 for f in (np.cos, np.sin))
        half = int(np.ceil(reach_mm / texel * max(1.0, polar / max(np.sin(polar), 0.3)))) + 1
        rows = slice(max(0, int(row) - half), max(0, int(row) + half + 2))
        columns = slice(max(0, int(column) - half), max(0, int(column) + half + 2))
        offset = self.points[rows, columns] - at
        away, around = self.frame(at)
        return self.texture[rows, columns], offset @ away, offset @ around, texel


def _silicone(canvas: _Canvas, rng: np.random.Generator, strength: float) -> None:
    """Base colour with faint clouds."""
    n = len(canvas.texture)
    polar = np.degrees(np.arccos(np.clip((canvas.points[..., 2] - canvas.centre[2]) / canvas.radius, -1, 1)))
    clouds = cv2.resize(rng.normal(0, 1, (24, 24)), (n, n), interpolation=cv2.INTER_CUBIC)
    for channel in range(3):
        canvas.texture[..., channel] = np.interp(polar, SILICONE[:, 0], SILICONE[:, channel + 1])
    canvas.texture[..., :3] *= (1 + strength * clouds)[..., None]


def _seams(canvas: _Canvas, params: EndcapParams) -> None:
    """Thin dark lines where the core's vertical joints cut the sphere.

    Seen from above: a centre piece with three wide faces (key pieces, at azimuths 0, 120, 240) and three narrow ones
    (wide pieces), a round tab in the middle of every face, and the straight sides of the key pieces out to the rim.
    """
    core = params.bore_radius_mm - CORE_CLEARANCE_MM
    face, half = KEY_FACE * core, KEY_HALF_WIDTH * core
    corner = np.array([face, half])
    narrow = float(corner @ [np.cos(np.pi / 3), np.sin(np.pi / 3)])
    narrow_half = abs(float(corner @ [np.sin(np.pi / 3), -np.cos(np.pi / 3)]))
    upper = canvas.points[..., 2] > canvas.centre[2]
    distance = np.full(upper.shape, np.inf, np.float32)
    for turn in np.radians([0, 120, 240]):
        x, y = _turned(canvas, turn)
        distance = np.minimum(distance, np.where(x > face, np.abs(np.abs(y) - half), np.inf))
        distance = np.minimum(distance, np.where(upper, _face_distance(x, y, face, half), np.inf))
        x, y = _turned(canvas, turn + np.pi / 3)
        distance = np.minimum(distance, np.where(upper, _face_distance(x, y, narrow, narrow_half), np.inf))
    texel = 2 * canvas.extent * canvas.radius / len(canvas.texture)
    line = np.clip((SEAM_WIDTH_MM / 2 - distance) / texel + 0.5, 0, 1) * min(1.0, SEAM_WIDTH_MM / texel)
    canvas.texture[..., :3] *= (1 - SEAM_DEPTH * line)[..., None]


def _turned(canvas: _Canvas, angle: float) -> tuple[Floats, Floats]:
    x, y = canvas.points[..., 0], canvas.points[..., 1]
    c, s = np.float32(np.cos(angle)), np.float32(np.sin(angle))
    return c * x + s * y, c * y - s * x


def _face_distance(x: Floats, y: Floats, face: float, half: float) -> Floats:
    """Distance (mm, in plan) to a face at ``x = face`` whose middle bulges out in a round tab."""
    tab = min(TAB_RADIUS_MM, 0.6 * half)
    neck = 0.8 * tab  # the tab's circle stands off so that its neck is narrower than the tab
    centre = face + np.sqrt(tab**2 - neck**2)
    flat = np.where((np.abs(y) <= half) & (np.abs(y) >= neck), np.abs(x - face), np.inf)
    circle = np.where(x >= face, np.abs(np.hypot(x - centre, y) - tab), np.inf)
    return np.minimum(flat, circle).astype(np.float32)


def _dent(canvas: _Canvas, at: Array) -> None:
    """The faint outline of a dent: its flank turns away from the light."""
    window, a, b, texel = canvas.patch(at, DOT_RADIUS_MM + 0.5)
    width = max(0.5 * DENT_DEPTH_MM, texel)
    ring = np.exp(-(((np.hypot(a, b) - DOT_RADIUS_MM + width / 2) / width) ** 2))
    window[..., :3] *= (1 - 0.10 * ring)[..., None]


def _ink(canvas: _Canvas, at: Array, paint: Paint, rng: np.random.Generator, smeared: bool) -> None:
    """Fill a dent: wavy edge, dark flank, uneven middle, and a smear dragged to one side."""
    radius = DOT_RADIUS_MM * paint.radius_scale
    amplitudes, phases = rng.normal(0, 1, 4), rng.random(4) * 2 * np.pi
    drag, length = rng.random() * 2 * np.pi, radius * rng.uniform(1.5, 3.0)
    tone = 1 + paint.unevenness * rng.uniform(-0.3, 0.5)
    if smeared:
        window, a, b, texel = canvas.patch(at, radius + length)
        along, across = a * np.cos(drag) + b * np.sin(drag), b * np.cos(drag) - a * np.sin(drag)
        streak = np.clip((0.8 * radius - np.abs(across)) / texel + 0.5, 0, 1) * (along > 0)
        _mix(window, INK, 0.65 * streak * np.clip(1 - along / (radius + length), 0, 1), 0.3)
    window, a, b, texel = canvas.patch(at, 1.5 * radius)
    angle = np.arctan2(b, a)
    wave = sum(amplitudes[k] / (k + 2) * np.cos((k + 2) * angle + phases[k]) for k in range(4))
    inside = radius * (1 + paint.roughness * wave) - np.hypot(a, b)
    cover = np.clip(inside / texel + 0.5, 0, 1)
    flank = np.clip(1.2 - inside / FLANK_WIDTH_MM, 0, 1)
    slope = (a * np.cos(drag) + b * np.sin(drag)) / radius
    uneven = 0.45 * slope + 0.3 * wave * (np.hypot(a, b) / radius) ** 2
    middle = np.array(INK) * (tone * np.clip(1 + paint.unevenness * uneven, 0.3, 2) * (1 - flank))[..., None]
    color = middle + np.array(FLANK) * flank[..., None]
    _mix(window, color, cover, 1 - flank)


def _dirt(canvas: _Canvas, params: EndcapParams, paint: Paint, seed: int) -> None:
    """False dots, specks and the written mark."""
    rng = np.random.default_rng([seed, 3])
    limit = np.cos(np.radians(params.view_rim_polar_deg))
    for number in range(paint.extra + paint.specks):
        height, azimuth = rng.uniform(limit, 1), rng.random() * 2 * np.pi
        side = np.sqrt(1 - height**2)
        at = canvas.centre + canvas.radius * np.array([side * np.cos(azimuth), side * np.sin(azimuth), height])
        if number < paint.extra:
            _ink(canvas, at, paint, rng, False)
        else:
            window, a, b, texel = canvas.patch(at, 1.5)
            size, lean, thin = rng.uniform(0.1, 0.3), rng.random() * np.pi, rng.uniform(1, 3)
            along, across = a * np.cos(lean) + b * np.sin(lean), (b * np.cos(lean) - a * np.sin(lean)) * thin
            cover = np.clip((size - np.hypot(along, across)) / texel + 0.5, 0, 1)
            _mix(window, INK, 0.8 * cover * min(1.0, 2 * size / texel), 0.0)
    if paint.digit:
        _write(canvas, params, paint.digit)


def _write(canvas: _Canvas, params: EndcapParams, text: str) -> None:
    """Letters 5 mm high between the first and the second ring of dots."""
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
    _mix(canvas.texture, (0.05, 0.07, 0.16), 0.85 * mask / 255.0, 0.4)


def _mix(window: Floats, color: ArrayLike, cover: ArrayLike, glossy: ArrayLike) -> None:
    """Lay a colour over a texture window by coverage; ``glossy`` is the share of it that reflects like ink."""
    cover = np.asarray(cover)[..., None]
    window[..., :3] += cover * (np.asarray(color) - window[..., :3])
    window[..., 3:] += cover * (np.broadcast_to(np.asarray(glossy), cover.shape[:2])[..., None] - window[..., 3:])
