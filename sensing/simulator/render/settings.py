"""Settings of a rendered frame: paint, light, lens and sensor, with the seed of its random numbers.

Lengths in mm; pixels at 480 rows, so that a setting means the same at any size (the scale is the height of the
rendered frame over 480); radiance such that sunlit white silicone would be 1. Defaults reproduce the released photos;
the letters are those of docs/provenance.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import Literal

from cad.errors import ParameterError
from cad.lens import camera_module

Level = Literal["draft", "data", "fine", "reference"]
CIRCLE_EDGE_DEG = 0.5  # M: from the middle of the image circle's edge to where the picture ends (circle_deg of a row)


@dataclass(frozen=True)
class Paint:
    """Ink and marks on the inner surface. Fractions are of all dots; the seed determines which dots.

    Attributes:
        unpainted: fraction of dents without ink, visible only as a faint outline.
        missing: fraction of dots without a dent.
        smeared: fraction of dots with ink dragged out of the dent.
        extra: number of false dots of the size of a real one, anywhere.
        specks: number of specks of 0.2 to 0.6 mm.
        digit: text written beside the tip, empty for none.
        seams: whether the seams of the segmented core are drawn.
        jitter_mm: standard deviation of the ink's centre about the dent's, mm (M: 0.3, 1 px on the photos).
        roughness: waviness of the ink's edge, fraction of the dot radius.
        overflow: fraction of dots whose ink spilled over the dent's edge, more of them toward the rim (M: photos).
        radius_scale: ink radius over dent radius (M: median area of the dots on the photos).
        size_spread: standard deviation of that radius from dot to dot, relative (M: likewise).
        unevenness: variation of the ink's tone inside a dot and between dots, 1 as on the photos.
        clouds: faint large-scale variation of the silicone's reflectance (E).
    """

    unpainted: float = 0.0
    missing: float = 0.0
    smeared: float = 0.06
    extra: int = 0
    specks: int = 40
    digit: str = ""
    seams: bool = True
    jitter_mm: float = 0.2
    roughness: float = 0.06
    overflow: float = 0.5
    radius_scale: float = 1.12
    size_spread: float = 0.07
    unevenness: float = 1.0
    clouds: float = 0.012


@dataclass(frozen=True)
class Lamp:
    """The LED ring.

    Attributes:
        count: number of LEDs (S: 25 V string of 2.8 V parts).
        radius_mm: ring radius, mm (E: from the brightness profile of the photos; inside the 39.0 mm recess).
        height_mm: height of the emitters above the mating plane, mm (E: likewise; on a spacer beside the lens).
        brightness: factor on all LEDs.
        gradient: relative brightness change from the ring's middle to its brightest LED.
        gradient_azimuth_deg: azimuth of that LED, degrees.
        dead: numbers of LEDs that are off.
        ambient: light scattered inside the dome, relative to the direct light at the tip (E).
        gloss: specular reflection of silicone (E: dusty, so broad and weak).
        ink_gloss: bronze reflection of dried ink, which makes the dots at the tip look orange (M: photos).
    """

    count: int = 9
    radius_mm: float = 22.0
    height_mm: float = 15.0
    brightness: float = 1.0
    gradient: float = 0.0
    gradient_azimuth_deg: float = 0.0
    dead: tuple[int, ...] = ()
    ambient: float = 0.35
    gloss: float = 0.04
    ink_gloss: float = 0.25


@dataclass(frozen=True)
class Optics:
    """Settings of the lens besides its geometry.

    Attributes:
        defocus_px: Gaussian sigma of the blur on the axis, px at 480 rows.
        defocus_edge_px: the same at the edge of the view, px at 480 rows.
        vignetting: exponent p of cos(theta / 2)^p.
        circle_deg: half angle in the middle of the image circle's edge, degrees; by default that of the camera module.
        circle_soft_deg: width of that edge, degrees.
    """

    defocus_px: float = 0.5
    defocus_edge_px: float = 0.8
    vignetting: float = 4.0
    circle_deg: float = field(default_factory=lambda: camera_module().circle_deg - CIRCLE_EDGE_DEG)
    circle_soft_deg: float = 1.2


@dataclass(frozen=True)
class Sensor:
    """Exposure, noise, tone curve and compression.

    Attributes:
        exposure: factor on the collected light.
        gain: factor on the signal after the noise of the light.
        full_well_e: electrons at signal 1.
        read_noise_e: standard deviation, electrons (M: noise of the black corners of the photos).
        gamma: the pixel value is the signal to the power 1/gamma.
        black: pixel value without light.
        sharpen: amount of the camera's unsharp mask, which leaves the pale halo round the dots (M: photos).
        jpeg_quality: 1..100, or 0 for none.
    """

    exposure: float = 1.0
    gain: float = 1.0
    full_well_e: float = 20000.0
    read_noise_e: float = 3.0
    gamma: float = 2.2
    black: float = 7.0
    sharpen: float = 0.9
    jpeg_quality: int = 92


@dataclass(frozen=True)
class RenderSettings:
    """All settings of a rendering. The same settings, displacement and frame number give the same bytes.

    Attributes:
        seed: seed of paint and noise.
        mesh: number of grid cells across the surface.
        texels: width of the painted texture, texels.
        supersample: rendered pixels per image pixel and axis.
        cell: distance, px, of the points at which the surface is traced (1: at every pixel); folds are always traced at
            every pixel.
        blur_frames: number of images averaged over the exposure when there is motion.
        fresh_noise: whether every frame's noise is drawn anew; otherwise it is read from a table (faster).
        paint: see :class:`Paint`.
        lamp: see :class:`Lamp`.
        optics: see :class:`Optics`.
        sensor: see :class:`Sensor`.

    Raises:
        ParameterError: a number outside its range; the message names it.
    """

    seed: int = 0
    mesh: int = 96
    texels: int = 1280
    supersample: int = 1
    cell: int = 8
    blur_frames: int = 4
    fresh_noise: bool = False
    paint: Paint = field(default_factory=Paint)
    lamp: Lamp = field(default_factory=Lamp)
    optics: Optics = field(default_factory=Optics)
    sensor: Sensor = field(default_factory=Sensor)

    def __post_init__(self) -> None:
        for group in (self, self.paint, self.lamp, self.optics, self.sensor):
            for item in fields(group):
                if item.name in _RANGES:
                    _check(type(group).__name__, item.name, getattr(group, item.name))
        if self.paint.unpainted + self.paint.missing > 1:
            raise ParameterError("paint.unpainted + paint.missing over 1: they are fractions of the same dots")

    def at_level(self, level: Level) -> RenderSettings:
        """The same look at another quality (see bench/bench_render.py for time and error of each)."""
        try:
            return replace(self, **LEVELS[level])  # type: ignore[arg-type]
        except KeyError:
            raise ParameterError(f"level={level!r} unknown: choose one of {', '.join(LEVELS)}", name="level") from None


# Settings of each level, fast to exact.
LEVELS: dict[str, dict[str, int | bool]] = {
    "draft": {"mesh": 48, "texels": 640, "supersample": 1, "cell": 8, "blur_frames": 2, "fresh_noise": False},
    "data": {"mesh": 96, "texels": 1280, "supersample": 1, "cell": 8, "blur_frames": 4, "fresh_noise": False},
    "fine": {"mesh": 128, "texels": 2048, "supersample": 2, "cell": 4, "blur_frames": 6, "fresh_noise": True},
    "reference": {"mesh": 256, "texels": 4096, "supersample": 4, "cell": 1, "blur_frames": 16, "fresh_noise": True},
}

# Accepted range of each setting.
_RANGES: dict[str, tuple[float, float]] = {
    "seed": (0, 2**63 - 1),
    "mesh": (8, 1024),
    "texels": (64, 8192),
    "supersample": (1, 8),
    "cell": (1, 32),
    "blur_frames": (1, 256),
    "unpainted": (0, 1),
    "missing": (0, 1),
    "smeared": (0, 1),
    "extra": (0, 1000),
    "specks": (0, 10000),
    "jitter_mm": (0, 5),
    "roughness": (0, 0.5),
    "overflow": (0, 1),
    "radius_scale": (0.2, 2),
    "size_spread": (0, 0.3),
    "unevenness": (0, 2),
    "clouds": (0, 0.2),
    "count": (1, 360),
    "radius_mm": (0, 200),
    "height_mm": (-50, 50),
    "brightness": (0, 100),
    "gradient": (-1, 1),
    "gradient_azimuth_deg": (-360, 360),
    "ambient": (0, 10),
    "gloss": (0, 10),
    "ink_gloss": (0, 10),
    "defocus_px": (0, 20),
    "defocus_edge_px": (0, 20),
    "vignetting": (0, 20),
    "circle_deg": (10, 170),
    "circle_soft_deg": (0.01, 30),
    "exposure": (0, 1000),
    "gain": (0, 1000),
    "full_well_e": (10, 1e9),
    "read_noise_e": (0, 1e6),
    "gamma": (0.2, 5),
    "black": (0, 254),
    "sharpen": (0, 5),
    "jpeg_quality": (0, 100),
}


def _check(group: str, name: str, value: float) -> None:
    low, high = _RANGES[name]
    if not (isinstance(value, (int, float)) and math.isfinite(value) and low <= value <= high):
        raise ParameterError(f"{group}.{name}={value!r} outside {low:g}..{high:g}", name=name, value=value)
