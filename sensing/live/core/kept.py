"""What an endcap keeps of the frames before when tracker, filter and contact begin anew with the same reference.

All of it comes from the last frame without a touch. A restart while something touches (a recording begins, the clock
is set, a camera comes back) would lose them until the endcap is let go, and each wrench until then would be wrong.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass

from sensing.tracking.own_weight import MOST_G

LONGEST_REASON = 300  # letters


@dataclass(frozen=True)
class Kept:
    """Of one endcap against one reference.

    Attributes:
        own_weight_g: change of gravity since the reference, in g along the endcap's axes; zero where no turn was seen.
        moved: why camera or lens are thought to have moved since the reference; empty where they have not.
        loaded: why the reference is thought to have been taken under load; empty where nothing shows it.
    """

    own_weight_g: tuple[float, float, float] = (0.0, 0.0, 0.0)
    moved: str = ""
    loaded: str = ""

    def text(self) -> str:
        """As JSON, from which :func:`kept_of` reads the very same numbers."""
        return json.dumps({"own_weight_g": self.own_weight_g, "moved": self.moved, "loaded": self.loaded})


NOTHING_KEPT = Kept()


def kept_of(text: str) -> Kept:
    """What :meth:`Kept.text` wrote.

    Raises:
        ValueError, KeyError, TypeError: text that is none of ours.
    """
    said = json.loads(text)
    x, y, z = (float(value) for value in said["own_weight_g"])
    if not math.hypot(x, y, z) <= MOST_G:
        raise ValueError(f"own weight of {x:g}, {y:g}, {z:g} g")
    reasons = str(said["moved"]), str(said.get("loaded", ""))  # recordings of before have no second
    return Kept((x, y, z), *(reason[:LONGEST_REASON] for reason in reasons))
