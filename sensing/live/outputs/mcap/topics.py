"""Topics of an endcap in a recording, with the ROS 2 types of their messages."""

from __future__ import annotations

from sensing.live.outputs.ros import types as ros
from sensing.live.outputs.ros.messages import CAMERA_INFO, NUMBERS

TOPICS: dict[str, str] = {  # below the name of the endcap
    "image/compressed": ros.IMAGE,
    "image/capture_time": ros.FLOAT64,
    "camera_info": CAMERA_INFO,
    "zero": ros.IMAGE,
    "zero_error_px": ros.FLOAT64,
    "kept": ros.STRING,
    "array/shear_vector": ros.ARRAY,
    "wrench/estimate": ros.WRENCH,
    **NUMBERS,
}
