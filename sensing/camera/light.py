"""Whether a picture has light enough, and not too much, to show the dots; limits are estimates on drawn pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

DARK_GRAY, BRIGHT_GRAY = 50.0, 245.0  # median gray of the lit circle
WHITE_GRAY, MOST_WHITE = 250, 0.05  # share of the lit circle that may carry no pattern
LIT_RADIUS = 0.95  # of half the short side: so far every released lens lights the picture


@dataclass(frozen=True)
class Light:
    """Brightness of the lit circle.

    Attributes:
        median_gray: 0 to 255.
        white_share: of the circle that is white.
    """

    median_gray: float
    white_share: float

    @property
    def too_bright(self) -> bool:
        """Whether white has eaten the pattern."""
        return self.white_share > MOST_WHITE or self.median_gray > BRIGHT_GRAY

    @property
    def too_dark(self) -> bool:
        """Whether noise is a large part of what is left."""
        return self.median_gray < DARK_GRAY


def light_of(picture: NDArray) -> Light:
    """Brightness of a picture's lit circle.

    Args:
        picture: (h, w) gray, or (h, w, 3) BGR, of which blue and green count, as where dots are found.
    """
    gray = picture if picture.ndim == 2 else picture[..., :2].mean(axis=-1)
    rows, columns = np.indices(gray.shape)
    away = np.hypot(columns - (gray.shape[1] - 1) / 2, rows - (gray.shape[0] - 1) / 2)
    lit = gray[away < LIT_RADIUS * min(gray.shape) / 2]
    return Light(float(np.median(lit)), float((lit >= WHITE_GRAY).mean()))
