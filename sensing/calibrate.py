"""Camera calibration: from one photo of the sensor's own dots, or from views of a board.

    python -m sensing.calibrate --photo a.jpg --diameter 130 --wall 8 --out camera.json --picture fit.png
    python -m sensing.calibrate --zero endcap_0.npz --out endcap_0.json
    python -m sensing.calibrate --board board*.jpg --corners 9x6 --square 10 --out lens.json
    python -m sensing.calibrate --photo a.jpg --lens lens.json --diameter 130 --wall 8 --out camera.json

Lengths in mm, pixels in px. What the dots determine and what they do not: :mod:`sensing.calibration.from_dots`. A
photo that another diameter fits clearly better is refused (``--trust-design`` overrules); where it fits alike, a
warning says so.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cad.design_arguments import add_design_arguments, agreed_design, design_of
from cad.errors import EndcapError, ParameterError
from cad.extras import program
from cad.identity import identity, require_same
from cad.messages import LOG, show
from cad.params import EndcapParams
from cad.whole_file import require_place
from sensing.arguments import number, pair, refuse_unused
from sensing.calibration.dots import CalibrationError, find_blobs, pattern_points, read_dots
from sensing.calibration.from_board import BoardView, calibrate_from_board, find_board, read_views, require_board
from sensing.calibration.from_dots import Calibration, calibrate_from_dots
from sensing.calibration.other_design import OtherDesignError, design_fit, require_design
from sensing.calibration.picture import draw_fit, read_image, require_format, write_image
from sensing.calibration.rest_camera import most_misplaced_px
from sensing.calibration.rest_picture import light_doubts, picture_doubts
from sensing.calibration.turns import best_turn
from sensing.camera.light import light_of
from sensing.camera.mount import MountedCamera, mount
from sensing.tracking.zero import load_zero


def main(arguments: list[str] | None = None) -> int:
    """Command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        _require_used(options)
        for name in filter(None, (options.out, options.picture)):
            require_place(Path(name))
        if options.picture:
            require_format(options.picture)
        return _from_board(options) if options.board else _from_dots(options)
    except EndcapError as error:
        LOG.error(f"sensing.calibrate: {error}")
        return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.calibrate"),
        description="Camera calibration: from one photo of the sensor's own dots, or from views of a board.",
    )
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--photo", help="one photo of the undeformed sensor")
    source.add_argument("--zero", metavar="FILE.npz", help="the same from a reference of sensing.zero or sensing.setup")
    source.add_argument(
        "--board", nargs="+", metavar="FILE", help="chessboard photos, or one CSV view,x_mm,y_mm,u_px,v_px"
    )
    parser.add_argument("--dots", help="CSV of dot centres (u_px,v_px) instead of finding them in the photo")
    add_design_arguments(parser, with_defaults=False)
    parser.add_argument("--lens", help="camera.json whose lens is held fixed; only the pose is fitted")
    parser.add_argument(
        "--azimuth-hint",
        type=number,
        default=0.0,
        metavar="DEG",
        help="expected turn of the image, to within half of the angle after which the dots repeat: 90 degrees for the "
        "released ones (0)",
    )
    parser.add_argument(
        "--trust-design", action="store_true", help="calibrate even where another diameter fits the photo better"
    )
    parser.add_argument(
        "--corners", type=pair, default=(9, 6), metavar="NxM", help="inner corners of the chessboard (9x6)"
    )
    parser.add_argument("--square", type=number, default=10.0, metavar="MM", help="side of its squares (10)")
    parser.add_argument(
        "--size", type=pair, default=(640, 480), metavar="WxH", help="image size when board views come as CSV (640x480)"
    )
    parser.add_argument("--out", required=True, help="camera.json to write")
    parser.add_argument("--picture", help="photo with the fit drawn in")
    return parser


def _require_used(options: argparse.Namespace) -> None:
    """Refuse options that would do nothing."""
    parser, board = _parser(), options.board
    if not board:
        flags, what = "--corners --square --size", "--photo" if options.photo else "--zero"
        refuse_unused(parser, options, flags, what, "it is of --board; leave it out")
        return
    design = "--dots --diameter --wall --dot-rings --dot-mm --lens --azimuth-hint --trust-design --picture"
    refuse_unused(parser, options, design, "--board", "it is of --photo and --zero; leave it out")
    if len(board) > 1 and any(_is_csv(name) for name in board):
        raise ParameterError("--board with a CSV among others: one holds all views, by its column view", name="board")
    flags, what = ("--corners --square", "CSV") if _is_csv(board[0]) else ("--size", "photos")
    refuse_unused(parser, options, flags, f"--board and {what}", "nothing reads it; leave it out")


def _is_csv(name: str) -> bool:
    return name.lower().endswith(".csv")


def _from_dots(options: argparse.Namespace) -> int:
    image, params = _rest_picture(options)
    centres, radii = find_blobs(image, params)
    found = read_dots(options.dots) if options.dots else centres
    lens = MountedCamera.load(options.lens).camera if options.lens else None
    size = (image.shape[1], image.shape[0])
    if lens is not None and (lens.width_px, lens.height_px) != size:
        raise CalibrationError(
            f"{options.lens}: lens of {lens.width_px}x{lens.height_px}, photo of {size[0]}x{size[1]}"
        )
    try:
        result = calibrate_from_dots(found, params, size, lens=lens, azimuth_hint_deg=options.azimuth_hint)
    except CalibrationError as error:
        doubts = [] if options.dots else [*light_doubts(light_of(image)).values()]
        raise CalibrationError("; ".join([str(error), *doubts])) from None
    if lens is None and not options.dots:  # the test needs a free focal length and the sizes of dots, which a CSV lacks
        fit = design_fit(result, radii, params)
        try:
            alike = require_design(fit, radii, size, options.azimuth_hint, options.trust_design)
        except OtherDesignError as error:
            raise _with_misplaced(error, result, params) from None
        if alike:
            LOG.warning(f"sensing.calibrate: {alike}")
    _warn(result, image, params, options)
    result.mounted.save(options.out, identity(params))
    if options.picture:
        write_image(options.picture, draw_fit(image, result, params))
    show(result.report())
    return 0


def _warn(result: Calibration, image: NDArray[np.uint8], params: EndcapParams, options: argparse.Namespace) -> None:
    """Warn of each doubt about the picture in one line: pressed dome, hidden dots, light, ambiguous azimuth."""
    doubts = [] if options.dots else [*picture_doubts(image, result.found_px, params, result.mounted).values()]
    if misplaced := _misplaced(result, params):
        doubts.append(f"{misplaced}: is it pressed? take the picture again; with a wrong camera forces are wrong")
    for doubt in doubts:
        LOG.warning(f"sensing.calibrate: {doubt}")
    found = result.found_px
    turn = best_turn(result.mounted, found, *pattern_points(params), options.azimuth_hint)
    if turn.is_doubtful:
        LOG.warning(
            f"sensing.calibrate: the dots look alike every {turn.repeats_deg:.3g} degrees: of all such turns the one "
            f"nearest to --azimuth-hint {options.azimuth_hint:g} is taken, {turn.away_deg:+.0f} degrees from it; a "
            f"camera turned by more than {turn.repeats_deg / 2:.3g} degrees from it would give wrong directions"
        )


def _with_misplaced(error: OtherDesignError, result: Calibration, params: EndcapParams) -> CalibrationError:
    """The error that another design fits better, or that none may fit."""
    misplaced = _misplaced(result, params)
    if not misplaced:
        return error
    return CalibrationError(
        f"{misplaced}: is the picture squeezed (a camera mode of another shape), is the dome pressed? Else {error}"
    )


def _misplaced(result: Calibration, params: EndcapParams) -> str:
    """How far the dots lie from the design's, in words; empty where an untouched dome's may lie as far."""
    away_px, most_px = result.misplaced_px, most_misplaced_px(params)
    if away_px <= most_px:
        return ""
    return f"the dots lie up to {away_px:.1f} px from the design's (at most {most_px:.1f} of an untouched dome)"


def _rest_picture(options: argparse.Namespace) -> tuple[NDArray[np.uint8], EndcapParams]:
    """The picture, and its design where it is a reference, which records it."""
    if not options.zero:
        params = design_of(options)
        return read_image(options.photo), params
    zero = load_zero(options.zero)
    params = agreed_design(options, zero.params, options.zero)
    require_same(options.zero, "a reference", zero.made_of, identity(params), "zero the sensor again", ("dots",))
    return zero.image, params


def _from_board(options: argparse.Namespace) -> int:
    if _is_csv(options.board[0]):
        size, views = options.size, read_views(options.board[0])
    else:
        size, views = _photographed(options.board, options.corners, options.square)
    result = calibrate_from_board(views, size)
    mount(result.camera, (0.0, 0.0, 0.0)).save(options.out)
    show(f"{len(views)} views, residual {result.rms_px:.3f} px rms; next: --photo with --lens {options.out}")
    return 0


def _photographed(
    paths: list[str], corners: tuple[int, int], square_mm: float
) -> tuple[tuple[int, int], list[BoardView]]:
    """Image size and the views in which the board was found; the others are named on stderr."""
    require_board(corners, square_mm)
    images = [read_image(path) for path in paths]
    sizes = {(image.shape[1], image.shape[0]) for image in images}
    if len(sizes) > 1:
        raise CalibrationError(f"board photos of different sizes {sorted(sizes)}: take all with one camera mode")
    found = [find_board(image, corners, square_mm) for image in images]
    for path, view in zip(paths, found, strict=True):
        if view is None:
            LOG.warning(f"{path}: no board of {corners[0]}x{corners[1]} inner corners found, left out")
    return sizes.pop(), [view for view in found if view is not None]


if __name__ == "__main__":
    raise SystemExit(main())
