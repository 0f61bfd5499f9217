"""A small JPEG of one gray level with stripes."""

import cv2
import numpy as np


def jpeg(level: int, size: tuple[int, int] = (64, 48)) -> bytes:
    image = np.full((size[1], size[0], 3), level, np.uint8)
    image[::5] = 255 - level
    return cv2.imencode(".jpg", image)[1].tobytes()
