"""State that an endcap keeps when tracker, filter and contact restart with the same reference.

Most of it comes from the last frame without a touch, and the silicone relaxes on from the last one. A restart while
something touches (a recording begins, the clock is set) would lose them until the endcap is let go, and each wrench
until then would be wrong. A touch that began above one force and ends below another would end at the restart.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, replace
from typing import Any

from sensing.tracking.own_weight import MOST_G
from sensing.wrench.relaxation import Overstress

LONGEST_REASON = 300  # letters


@dataclass(frozen=True)
class Kept:
    """Of one endcap against one reference.

    Attributes:
        own_weight_g: change of gravity since the reference, in g along the endcap's axes; zero where no turn was seen.
        moved: why camera or lens are thought to have moved since the reference; empty where they have not.
        loaded: why the reference is thought to have been taken under load; empty where nothing shows it.
        touching: whether it was in contact.
        overstress: of silicone that relaxes; None where it is taken as relaxed.
        offset: (6,) force and torque that the untouched endcap reads, about the sphere's centre; empty for none.
        compressed: why its pictures are thought to come from a video that keeps parts of them; empty where they do not.
        mixed: why its pictures are thought to hold a part of those before; empty where they do not.
    """

    own_weight_g: tuple[float, float, float] = (0.0, 0.0, 0.0)
    moved: str = ""
    loaded: str = ""
    touching: bool = False
    overstress: Overstress | None = None
    offset: tuple[float, ...] = ()
    compressed: str = ""
    mixed: str = ""

    @property
    def of_events(self) -> Kept:
        """What changes with events alone, not all the time."""
        return replace(self, overstress=None, offset=())

    @property
    def on_another_clock(self) -> Kept:
        """The same where the clock of the frames was set, and the time of the last one says nothing."""
        if self.overstress is None:
            return self
        return replace(self, overstress=Overstress(self.overstress.by_term))

    def text(self) -> str:
        """As JSON, from which :func:`kept_of` reads exactly the same numbers."""
        return json.dumps({name: value for name, value in asdict(self).items() if value not in (None, ())})


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
    reasons = said["moved"], *(said.get(name, "") for name in ("loaded", "compressed", "mixed"))  # not all of before
    moved, loaded, compressed, mixed = (str(reason)[:LONGEST_REASON] for reason in reasons)
    overstress = None if "overstress" not in said else _overstress_of(said["overstress"])
    offset = tuple(map(float, said.get("offset", ())))
    if len(offset) not in (0, 6) or not all(map(math.isfinite, offset)):
        raise ValueError(f"offset of {len(offset)} numbers")
    return Kept((x, y, z), moved, loaded, said.get("touching") is True, overstress, offset, compressed, mixed)


def _overstress_of(said: dict[str, Any]) -> Overstress:
    time_s = said["time_s"]
    by_term = tuple(tuple(map(float, row)) for row in said["by_term"])
    return Overstress(by_term, None if time_s is None else float(time_s), tuple(map(float, said["long_term"])))
