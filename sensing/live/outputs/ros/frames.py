"""Frames of endcaps and cameras, for ``/tf_static`` of topics and recordings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sensing.frames import inverse
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.robot import unplaced
from sensing.live.outputs import ros_types as ros

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
