"""The camera of a labelled set as a user finds it: from its first untouched picture, not from the simulator."""

from __future__ import annotations

from cad.errors import FileError
from sensing.calibration.dots import find_dots
from sensing.calibration.from_dots import calibrate_from_dots
from sensing.camera.mount import MountedCamera
from sensing.decode import decode_bgr
from sensing.records_labelled import LabelledSet

RECORDED = "recorded"  # protocol of sets that sensing.record wrote


def camera_of_set(data: LabelledSet) -> MountedCamera | None:
    """The calibrated camera that lies beside a recording, if one does; of simulated frames what a user would find.

    Raises:
        FileError: no such camera file, or a set without frames. CalibrationError: see :func:`found_camera`.
    """
    if data.manifest["request"]["protocol"] != RECORDED:
        return found_camera(data)
    beside = data.folder / "camera.json"
    return MountedCamera.load(beside) if beside.exists() else None


def found_camera(data: LabelledSet) -> MountedCamera:
    """What ``python -m sensing.calibrate`` finds on the first reference picture of a set.

    Raises:
        FileError: a set without frames. CalibrationError: a picture from which no camera can be calibrated.
    """
    for item in data.frames():
        image = decode_bgr(item.reference)
        size = (image.shape[1], image.shape[0])
        return calibrate_from_dots(find_dots(image), data.params, size).mounted
    raise FileError(f"{data.folder}: a set without frames: let the command that writes it run first")
