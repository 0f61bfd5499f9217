"""Windows around the dots of a reference: how large they are, and which dots can be followed by theirs.

Units: pixels of the working picture.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cad.params import EndcapParams
from sensing.camera.dot_look import dot_look
from sensing.tracking.dots import Dots
from sensing.tracking.nearest import nearest_other
from sensing.tracking.patches import Patches

FULL_SIZE_PX = 480  # half size costs 30 to 60 % more error in a wrench and saves a tenth of the time
MOST_UNCERTAIN = 6.0  # position uncertainty over the median: beyond it a window shows an edge, not a dot
FEWEST_WHOLE = 8  # with fewer whole dots than this, dots cut by the frame's edge are used, too
LARGEST_DOTS = 2.0  # times the released size: windows grow with the dots up to it (4 mm at D = 100), then time counts


def half_width(dots: Dots, short_side_px: int, window: float, params: EndcapParams | None = None) -> int:
    """Half width of the windows of dots, px.

    Args:
        dots: of the reference.
        short_side_px: of the working picture.
        window: half width over the dots' median diameter.
        params: the design; None for the released one.
    """
    larger = float(np.clip(dot_look(params).scale, 1.0, LARGEST_DOTS))
    largest = max(12, round(12 * larger * short_side_px / FULL_SIZE_PX))
    return int(np.clip(np.rint(window * float(np.median(dots.diameter_px))), 4, largest))


def steady(dots: Dots, patches: Patches) -> NDArray[np.bool_]:
    """Dots that can be tracked: not those whose window slides along an edge, nor those cut by the frame's edge.

    The visible part of a cut dot moves differently from its centre, by up to 0.7 px, and the field's global bias
    depends most on the outermost dots.

    Args:
        dots: of the reference.
        patches: their windows.
    """
    kept = patches.uncertainty_px <= MOST_UNCERTAIN * np.median(patches.uncertainty_px)
    if np.count_nonzero(kept & ~dots.cut) >= FEWEST_WHOLE:
        kept &= ~dots.cut
    return np.asarray(kept)


def spacing(position: NDArray[np.float64], fallback: float) -> NDArray[np.float64]:
    """(N,) distance to the nearest other dot; ``fallback`` for a lone one or for coincident ones.

    Args:
        position: (N, 2) px.
        fallback: px.
    """
    if len(position) < 2:
        return np.full(len(position), fallback)
    nearest, _ = nearest_other(position)
    return np.where(nearest > 1.0, nearest, fallback)
