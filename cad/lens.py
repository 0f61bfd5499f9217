"""The lens of the released camera (standard library only: the dot pattern, the lens and D, T decide on a picture).

The numbers were fitted to four photos; :mod:`sensing.camera.nominal` says how and makes a camera of them.
"""

from __future__ import annotations

FOCAL_PER_ROW = 247.0 / 480  # px per radian and image row, 4:3 frame (M, at a pupil height of 17 mm)
K = (-0.033, -0.007, 0.0, 0.0)  # M: radial terms of the fisheye model
MAX_HALF_ANGLE_DEG = 95.0  # the image circle ends at 92 degrees (M: the 720p photo)
