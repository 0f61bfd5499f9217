"""Frames and cameras of endcaps, for ``/tf_static`` and ``camera_info`` of topics and recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cad.errors import EndcapError
from sensing.frames import inverse
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.reading import EndcapReading
from sensing.live.core.robot import unplaced
from sensing.live.outputs.ros import types as ros

if TYPE_CHECKING:
    from sensing.camera.mount import MountedCamera
    from sensing.tracking.zero import Zero

ROBOT = "robot"
Transforms = dict[str, tuple[str, NDArray[np.float64]]]  # (parent, child to parent, mm) by child


def transforms_of(pipelines: Sequence[EndcapPipeline]) -> Transforms:
    """Cameras in their endcaps, endcaps in the robot; an endcap whose place on the robot is not known has no parent."""
    found: Transforms = {}
    shared = unplaced([pipeline.endcap for pipeline in pipelines])
    for pipeline in pipelines:
        endcap = pipeline.endcap
        found[ros.camera_frame(endcap.name)] = endcap.name, inverse(pipeline.camera(640, 480).T_camera_endcap)
        default = np.array_equal(endcap.T_robot_endcap, np.eye(4))  # of one endcap among others it may be the place
        if not default or (len(pipelines) > 1 and endcap.name not in shared):
            found[endcap.name] = ROBOT, endcap.T_robot_endcap
    return found


class CamerasInUse:
    """The camera of every reading; a new reference may show another one, which moves its frame, too.

    Args:
        pipelines: of the endcaps.
        failed: gets the error of a reference of which no camera can be known.
    """

    def __init__(self, pipelines: Sequence[EndcapPipeline], failed: Callable[[EndcapError], None]) -> None:
        self._pipelines = {pipeline.endcap.name: pipeline for pipeline in pipelines}
        self._failed = failed
        self._known: dict[tuple[str, int, int], tuple[Zero, MountedCamera | None]] = {}

    def transforms(self) -> Transforms:
        """The frames as they are now (:func:`transforms_of`)."""
        return transforms_of(list(self._pipelines.values()))

    def of(self, reading: EndcapReading, scale: float = 1.0) -> MountedCamera | None:
        """The camera of a reading, for pictures of its size times ``scale``.

        None for a picture of another size than the reference's, and for references of which none can be known:
        pictures that stand upright, of a method that follows no dots.
        """
        height, width = reading.zero.image.shape[:2]
        if reading.frame.size not in (None, (width, height)):
            return None
        name, *size = key = reading.endcap, round(scale * width), round(scale * height)
        zero, camera = self._known.get(key, (None, None))
        if zero is not reading.zero:
            try:
                camera = self._pipelines[name].camera(*size)
            except EndcapError as error:
                camera = None
                self._failed(error)
            self._known[key] = reading.zero, camera
        return camera
