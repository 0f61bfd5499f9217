"""Command line of the renderer.

python -m sensing.simulator.render --out frame.png --digit 4
python -m sensing.simulator.render --camera camera.json --beside photo.jpg --out beside.png
"""

from __future__ import annotations

import argparse
import sys
import zipfile
import zlib
from pathlib import Path

import cv2
import numpy as np

from cad.design_arguments import add_design_arguments, design_of
from cad.errors import EndcapError, FileError, ParameterError
from cad.extras import program
from cad.identity import identity
from cad.messages import LOG
from cad.params import EndcapParams
from cad.whole_file import replace_file
from sensing.arguments import number, whole
from sensing.camera.model import Array
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.sensor import Image
from sensing.simulator.render.settings import LEVELS, Lamp, Paint, RenderSettings, Sensor

TILT_DEG, AZIMUTH_DEG = 30.0, 0.0  # place of the bulge


def main(arguments: list[str] | None = None) -> int:
    """Render one frame; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        _require_used(options)
        params = design_of(options)
        mounted = MountedCamera.load(options.camera, identity(params)) if options.camera else nominal_mount(params)
        photo = _read(options.beside) if options.beside else None
        renderer = _renderer(options, params, mounted)
        image = renderer.render(_displacement(options, params, renderer.surface_mm), frame=options.frame).image_bgr
        if photo is not None:
            scale = photo.shape[0] / image.shape[0]
            fitted = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
            image = np.hstack([np.asarray(fitted, dtype=np.uint8), photo])
        _write(options.out, image)
    except EndcapError as error:
        LOG.error(f"sensing.simulator.render: {error}")
        return 2
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.simulator.render"), description="Render one frame of the endcap's camera."
    )
    add = parser.add_argument
    add("--out", required=True, help="picture to write (.png or .jpg)")
    add_design_arguments(parser)
    add("--camera", help="camera.json of sensing.calibrate (default: the nominal camera)")
    add("--beside", metavar="PHOTO", help="put this photo to the right of the rendered frame")
    add("--displacement", metavar="NPZ", help="file with surface_mm (n, 3) undeformed and displacement_mm (n, 3)")
    add("--bulge", type=number, default=0.0, metavar="MM", help="a smooth inward bulge for looks; no mechanics")
    add("--tilt", type=number, metavar="DEG", help=f"polar angle of the bulge ({TILT_DEG:g})")
    add("--azimuth", type=number, metavar="DEG", help=f"azimuth of the bulge ({AZIMUTH_DEG:g})")
    add("--level", choices=list(LEVELS), default="data", help="quality (data)")
    add("--seed", type=whole, default=0, help="paint and noise (0)")
    add("--frame", type=whole, default=0, help="frame number: other noise, same paint (0)")
    add("--digit", default="", help="text written beside the tip")
    add("--unpainted", type=number, default=0.0, help="fraction of dents without ink (0)")
    add("--missing", type=number, default=0.0, help="fraction of dots not there (0)")
    add("--smeared", type=number, default=0.06, help="fraction of smeared dots (0.06)")
    add("--extra", type=whole, default=0, help="number of false dots (0)")
    add("--exposure", type=number, default=1.0, help="factor on the light (1)")
    add("--gradient", type=number, default=0.0, help="lamp gradient across the ring, -1..1 (0)")
    return parser


def _require_used(options: argparse.Namespace) -> None:
    """Refuse options of the bulge that would change nothing in the picture.

    Raises:
        ParameterError: a bulge beside a displacement from a file, or its place without a bulge.
    """
    if options.displacement and options.bulge != 0:
        raise ParameterError(
            f"--bulge {options.bulge:g}: the displacement comes from {options.displacement}; give one of the two",
            name="bulge",
            value=options.bulge,
        )
    for name in ("tilt", "azimuth"):
        if (value := getattr(options, name)) is not None and options.bulge == 0:
            advice = "leave it out" if options.displacement else "give --bulge MM (not 0), too, or leave it out"
            raise ParameterError(
                f"--{name} {value:g} says where a bulge lies, and there is none: {advice}", name=name, value=value
            )


def _renderer(options: argparse.Namespace, params: EndcapParams, mounted: MountedCamera) -> DomeRenderer:
    paint = Paint(
        digit=options.digit,
        unpainted=options.unpainted,
        missing=options.missing,
        smeared=options.smeared,
        extra=options.extra,
    )
    settings = RenderSettings(
        seed=options.seed,
        paint=paint,
        lamp=Lamp(gradient=options.gradient),
        sensor=Sensor(exposure=options.exposure),
    ).at_level(options.level)
    surface = _load(options.displacement)[0] if options.displacement else None
    return DomeRenderer(params, mounted, settings, surface)


def _displacement(options: argparse.Namespace, params: EndcapParams, surface_mm: Array) -> Array | None:
    """Displacement from the file, or of the bulge: along the inward radius, a Gaussian of 18 mm over the sphere."""
    if options.displacement:
        return _load(options.displacement)[1]
    if options.bulge == 0:
        return None
    given = zip((options.tilt, options.azimuth), (TILT_DEG, AZIMUTH_DEG), strict=True)
    tilt, azimuth = np.radians([usual if angle is None else angle for angle, usual in given])
    axis = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
    top = params.inner_radius_mm * axis + [0, 0, params.centre_height_mm]
    share = np.exp(-((np.linalg.norm(surface_mm - top, axis=1) / 18) ** 2))
    return -options.bulge * share[:, None] * axis


def _load(path: str) -> tuple[Array, Array]:
    try:
        with np.load(path, allow_pickle=False) as archive:
            found = {name: np.asarray(archive[name]) for name in ("surface_mm", "displacement_mm")}
    except OSError as error:
        raise FileError(f"{path}: cannot read ({error.strerror or error}): give a file of numpy, .npz") from error
    except (KeyError, ValueError, TypeError, AttributeError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise FileError(f"{path}: need arrays surface_mm and displacement_mm ({error})") from error
    for name, array in found.items():
        if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu" or not np.isfinite(array).all():
            raise FileError(
                f"{path}: {name} of shape {array.shape} and type {array.dtype}: need finite real numbers (mm) of shape "
                "(n, 3), a row for each node"
            )
    return found["surface_mm"].astype(float), found["displacement_mm"].astype(float)


def _read(path: str) -> Image:
    try:
        image = cv2.imread(path, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION) if Path(path).is_file() else None
    except cv2.error:  # a header that states more pixels than OpenCV accepts
        image = None
    if image is None:
        raise FileError(f"{path}: missing, or not an image that OpenCV can decode; give a JPEG or PNG")
    return np.asarray(image, dtype=np.uint8)


def _write(path: str, image: Image) -> None:
    target = Path(path)
    if target.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise FileError(f"{path}: unknown picture format {target.suffix!r}; end the name in .png or .jpg")
    replace_file(target, cv2.imencode(target.suffix, image)[1].tobytes(), "choose a folder that can be written")


if __name__ == "__main__":
    sys.exit(main())
