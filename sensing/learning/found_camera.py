"""The camera of a labelled set, calibrated as a user would: from its first untouched picture, not from the simulator.

The module also gives the uncertainty of such a calibration, its own stated covariance, for domain-randomised sensors.
Focal length and pupil height are hardly separated (correlation -0.99), so that fields change by far less than either.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cad.errors import FileError
from cad.params import EndcapParams
from sensing.calibration.dots import find_dots, pattern_points
from sensing.calibration.from_dots import calibrate_from_dots
from sensing.calibration.rest_camera import rest_camera
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.decode import decode_bgr
from sensing.records import Frame
from sensing.records_labelled import RECORDED, LabelledSet
from sensing.tracking.tracker import DotTracker

FRAME_PX = (640, 480)  # width and height of the calibrated pictures
PAINT_PX = 1.2  # error of a painted dot's place along each axis (M: docs/optics.md, 1.6 to 2 px of distance, rms)


def camera_of_set(data: LabelledSet) -> MountedCamera | None:
    """The camera that the live pipeline would use: the file beside a recording, else that of the first reference.

    For simulated frames it is always the latter, because the file beside them is the true camera.

    Returns:
        The camera; None for the nominal one.

    Raises:
        FileError: a camera file of another endcap, or a set without frames.
        CalibrationError: see :func:`found_camera`.
    """
    if data.manifest["request"]["protocol"] != RECORDED:
        return found_camera(data)
    beside = camera_file(data)
    if beside is not None:
        return MountedCamera.load(beside, data.identity)
    reference = _first_reference(data)
    return rest_camera(reference, DotTracker(reference, params=data.params).reference_px, data.params).camera


def camera_file(data: LabelledSet) -> Path | None:
    """The camera file beside a recording; None without one, and for simulated frames."""
    beside = data.folder / "camera.json"
    return beside if data.manifest["request"]["protocol"] == RECORDED and beside.exists() else None


def found_camera(data: LabelledSet) -> MountedCamera:
    """The result of ``python -m sensing.calibrate`` on the first reference picture of a set.

    Raises:
        FileError: a set without frames.
        CalibrationError: a picture from which no camera can be calibrated.
    """
    image = decode_bgr(_first_reference(data))
    return calibrate_from_dots(find_dots(image, data.params), data.params, (image.shape[1], image.shape[0])).mounted


def _first_reference(data: LabelledSet) -> Frame:
    for item in data.frames():
        return item.reference
    raise FileError(f"{data.folder}: a set without frames: let the command that writes it run first")


def left_by_calibration(design: EndcapParams) -> NDArray[np.float64]:
    """(11, 11) covariance of the designed camera, calibrated from hand-painted dots (sensing.camera.parameters).

    Args:
        design: design of the endcap.

    Raises:
        CalibrationError: a pattern from which no camera can be calibrated.
    """
    camera = nominal_mount(design, *FRAME_PX)
    place = camera.project(pattern_points(design)[0])
    place = place[((place > 0) & (place < np.array(FRAME_PX) - 1)).all(axis=1)]
    beside = PAINT_PX * np.random.default_rng(0).standard_normal(place.shape)
    found = calibrate_from_dots(place + beside, design, FRAME_PX, near=camera).mounted.covariance
    assert found is not None
    return found
