"""The camera of a labelled set, as a user has it: calibrated from an untouched picture, not taken from the simulator.

The module also gives the uncertainty of such a calibration, its own stated covariance, for domain-randomised sensors.
Focal length and pupil height are hardly separated (correlation -0.99), so that fields change by far less than either.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cad.errors import FileError
from cad.params import EndcapParams
from sensing.calibration.dots import find_dots, pattern_points
from sensing.calibration.from_dots import calibrate_from_dots
from sensing.calibration.rest_camera import rest_camera
from sensing.camera.model import Array
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.decode import decode_bgr
from sensing.records import Frame
from sensing.records_labelled import RECORDED, LabelledSet
from sensing.tracking.model_input import ModelInput
from sensing.tracking.tracker import DotTracker
from sensing.tracking.zero import single_zero

FRAME_PX = (640, 480)  # width and height of the calibrated pictures
PAINT_PX = 1.2  # error of a painted dot's place along each axis (M: docs/optics.md, 1.6 to 2 px of distance, rms)


def camera_of_set(data: LabelledSet) -> MountedCamera | None:
    """The camera that live is given for a set: that of the file beside a recording, or found in simulated frames.

    The file beside simulated frames is the true camera, which nobody has.

    Returns:
        The camera; None for a recording without one, where live takes it from each reference.

    Raises:
        FileError: a camera file of another endcap, or a set without frames.
        CalibrationError: see :func:`found_camera`.
    """
    if data.manifest["request"]["protocol"] != RECORDED:
        return found_camera(data)
    beside = camera_file(data)
    return None if beside is None else MountedCamera.load(beside, data.identity)


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
    first = next(data.frames(), None)
    if first is None:
        raise FileError(f"{data.folder}: a set without frames: let the command that writes it run first")
    image = decode_bgr(first.reference)
    return calibrate_from_dots(find_dots(image, data.params), data.params, (image.shape[1], image.shape[0])).mounted


def input_as_live(
    reference: Frame, shape: tuple[int, int], design: EndcapParams, camera: MountedCamera | None, radial: Array | None,
    doubts: list[str],
) -> ModelInput:  # fmt: skip
    """The path from pictures to fields against one reference, with the camera and the dots that live takes.

    Args:
        reference: untouched picture.
        shape: (H, W) of the field.
        design: design of the endcap.
        camera: camera of :func:`camera_of_set`.
        radial: radial map of weights (:func:`sensing.learning.samples.read_samples`).
        doubts: gets a line where the reference shows another camera, so that live would flag all readings.
    """
    frame = single_zero(reference).frame()
    tracker = DotTracker(frame, params=design)
    rest = rest_camera(frame, tracker.reference_px, design, camera)
    if rest.known(design, tracker.size) is None:
        doubts.append(rest.doubt or rest.misfit.reason)
    followed = tracker.only(rest.design_dots(tracker.reference_px, design, tracker.size))
    return ModelInput(followed, shape, design, rest.camera, radial)


def left_by_calibration(design: EndcapParams) -> Array:
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
