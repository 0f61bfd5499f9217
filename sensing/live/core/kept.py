"""State that an endcap keeps when tracker, filter and contact restart with the same reference.

Most of it comes from the last frame without a touch. A restart while something touches (a recording begins, the clock
is set, a camera comes back) would lose them until the endcap is let go, and each wrench until then would be wrong. A
touch that began above one force and ends below another would end at the restart.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass

from sensing.tracking.own_weight import MOST_G

LONGEST_REASON = 300  # letters


@dataclass(frozen=True)
class Kept:
    """Of one endcap against one reference.

    Attributes:
        own_weight_g: change of gravity since the reference, in g along the endcap's axes; zero where no turn was seen.
        moved: why camera or lens are thought to have moved since the reference; empty where they have not.
        loaded: why the reference is thought to have been taken under load; empty where nothing shows it.
        touching: whether it was in contact.
    """

    own_weight_g: tuple[float, float, float] = (0.0, 0.0, 0.0)
    moved: str = ""
    loaded: str = ""
    touching: bool = False

    def text(self) -> str:
        """As JSON, from which :func:`kept_of` reads exactly the same numbers."""
        return json.dumps(asdict(self))


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
    moved, loaded = (str(reason)[:LONGEST_REASON] for reason in (said["moved"], said.get("loaded", "")))
    return Kept((x, y, z), moved, loaded, said.get("touching") is True)  # recordings of before have not all of it
