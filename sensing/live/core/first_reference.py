"""Wait for the first reference of an endcap that runs; a slow computer is no reason to give up.

    why = without_reference(endcap)                       # empty once there is one

Endcaps are zeroed one after the other. Each takes a second, three where other diameters are tried, and some times as
long on a small or busy computer: six of them then need more than the patience with a camera that gives no frame. s.
"""

from __future__ import annotations

import time

from sensing.live.core.engine import LiveEndcap

ZERO_S = 20.0  # wait for frames, or for a picture that is not refused
MOST_S = 300.0  # E: wait for a reference that is being computed: six endcaps at a tenth of a usual computer's speed
POLL_S = 0.05


def without_reference(endcap: LiveEndcap) -> str:
    """Wait until the endcap has a reference; returns "", or why it has none, one line.

    Args:
        endcap: endcap of a running engine. After :data:`ZERO_S` it is given up, unless a reference is being computed
            from frames that came.
    """
    begin_s = time.monotonic()
    while endcap.pipeline.zero is None:
        waited_s = time.monotonic() - begin_s
        if waited_s > MOST_S:
            return f"not zeroed in {MOST_S:.0f} s: the computer is too busy; end other programs, then start again"
        if waited_s > ZERO_S and not endcap.pipeline.taker.computing:
            return f"not zeroed in {ZERO_S:.0f} s: {endcap.health.message or 'no frame came'}"
        time.sleep(POLL_S)
    return ""
