"""The nominal camera of designs and simulation, and start of calibrations: the lens of :mod:`cad.lens`, as designed.

Released lens (M, at an assumed pupil height of 17 mm, E): the mean of four photos fitted by ``sensing.calibrate`` is
f = 247 px at 480 rows (246 to 248), k1 = -0.033, k2 = -0.007, close to the equisolid r = 2 sin(theta / 2). Focal length
and pupil height go together (-3.1 to -3.2 px per mm): with another height, another focal length gives the same picture.
"""

from __future__ import annotations

from cad.errors import ParameterError
from cad.lens import camera_module
from cad.params import EndcapParams
from sensing.camera.model import FisheyeCamera
from sensing.camera.mount import MountedCamera, mount


def nominal_lens(width_px: int = 640, height_px: int = 480) -> FisheyeCamera:
    """Lens of the camera module for a frame whose height is the full height of its image sensor.

    Raises:
        ParameterError: a picture that stands upright.
    """
    if height_px > width_px:
        raise ParameterError(
            f"a picture of {width_px}x{height_px} px stands upright: cameras of endcaps give pictures at least as wide "
            "as high; take out the turn by 90 degrees",
            name="size",
            value=(width_px, height_px),
        )
    module = camera_module()
    focal = module.focal_per_row * height_px
    centre = (width_px - 1) / 2, (height_px - 1) / 2
    return FisheyeCamera(width_px, height_px, focal, focal, *centre, module.k, module.max_half_angle_deg)


def nominal_mount(params: EndcapParams, width_px: int = 640, height_px: int = 480) -> MountedCamera:
    """That lens on the endcap's axis at the design's pupil height, image x along the endcap's x.

    Args:
        params: the design.
        width_px, height_px: of the picture.

    Raises:
        ParameterError: a picture that stands upright.
    """
    return mount(nominal_lens(width_px, height_px), (0.0, 0.0, params.camera_height_mm))
