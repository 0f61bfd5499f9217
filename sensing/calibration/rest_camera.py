"""The camera of an endcap that nobody has calibrated, as its rest picture shows it.

    rest = rest_camera(reference, tracker.reference_px, params)
    seen = ModelInput(tracker, shape, params, rest.camera, radial)        # camera None: it sits as the design has it

Live and the training on pictures take camera and dots from here. A camera that fits the picture is left alone. One that
does not is replaced by the one that ``python -m sensing.calibrate`` finds on the same picture, unless that is in doubt:
a diameter that fits clearly better, or dots that lie too far from where the found camera sees them, as those of a
pressed dome do. A calibration file is never overruled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cad.params import EndcapParams
from cad.pattern import RELEASED_DOT_MM
from sensing.calibration.dots import CalibrationError, find_blobs
from sensing.calibration.from_dots import calibrate_from_dots
from sensing.calibration.misfit import Misfit, camera_misfit
from sensing.calibration.other_design import OtherDesignError, design_fit, require_design
from sensing.calibration.rest_picture import pattern_dots
from sensing.camera.dot_look import dot_look
from sensing.camera.model import Array
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.decode import decode_bgr
from sensing.records import Frame

MISPLACED_PX = 3.1  # E: at 480 and D = 130: nine dots of ten lie nearer to the fitted design; the photos 2.1 to 2.6


@dataclass(frozen=True)
class RestCamera:
    """Outcome.

    Attributes:
        camera: to be used; None for the nominal one.
        misfit: of the camera that was given, or of the nominal one.
        found: whether the camera comes from this picture.
        doubt: why none is taken from it although the nominal one does not fit, one line; else empty.
        other_design: whether that is another diameter that fits clearly better.
    """

    camera: MountedCamera | None
    misfit: Misfit
    found: bool = False
    doubt: str = ""
    other_design: bool = False

    def known(self, params: EndcapParams, size_px: tuple[int, int]) -> MountedCamera | None:
        """The camera that sees the picture, the nominal one where that fits; None where none does.

        Args:
            params: the endcap.
            size_px: width and height of the picture.
        """
        if not (self.misfit.fits or self.found):
            return None
        return self.camera or nominal_mount(params, *size_px)

    def design_dots(self, dots_px: Array, params: EndcapParams, size_px: tuple[int, int]) -> NDArray[np.intp]:
        """Ascending numbers of the dots to follow: the design's where the camera is known, else all that look like one.

        A speck on the lens keeps its place when the skin moves, and would hold the field back.

        Args:
            dots_px: (n, 2) found in the picture.
            params: the endcap.
            size_px: width and height of the picture.
        """
        camera = self.known(params, size_px) if len(dots_px) > 1 else None
        return np.arange(len(dots_px)) if camera is None else pattern_dots(dots_px, params, camera)


def most_misplaced_px(params: EndcapParams) -> float:
    """How far dots painted by hand may lie from their places, at 480 rows: so many mm at every design.

    Args:
        params: the design; a dome of 100 mm is seen twice as large as one of 130 mm, one of 250 mm half as large.
    """
    return MISPLACED_PX * dot_look(params).scale * RELEASED_DOT_MM / params.dot_mm


def rest_camera(
    reference: Frame, dots_px: Array, params: EndcapParams, given: MountedCamera | None = None
) -> RestCamera:
    """The camera to be used for an endcap whose untouched picture is this one.

    Args:
        reference: the picture.
        dots_px: (n, 2) of the tracker in it.
        params: the endcap.
        given: the calibrated camera; None where there is none.

    Raises:
        FrameError: a picture that cannot be decoded.
    """
    image_bgr = decode_bgr(reference)
    size_px = image_bgr.shape[1], image_bgr.shape[0]
    misfit = camera_misfit(dots_px, size_px, params, given)
    if misfit.fits or given is not None:
        return RestCamera(given, misfit)
    try:
        centres, radii = find_blobs(image_bgr, params)
        found = calibrate_from_dots(centres, params, size_px)
        fit = design_fit(found, radii, params)
        if fit.is_doubtful:  # else a second is saved
            require_design(fit, radii, size_px)
    except OtherDesignError as error:
        return RestCamera(None, misfit, doubt=error.found, other_design=True)
    except CalibrationError as error:
        return RestCamera(None, misfit, doubt=str(error))
    if found.misplaced_px > most_misplaced_px(params):
        away_px = found.misplaced_px
        why = "is it pressed? Or is the picture squeezed (a camera mode of another shape)?"
        return RestCamera(None, misfit, doubt=f"the dots lie up to {away_px:.1f} px from the design's: {why}")
    return RestCamera(found.mounted, misfit, found=True)
