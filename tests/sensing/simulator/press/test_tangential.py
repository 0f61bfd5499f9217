"""A wanted tangential force against a law of springs that is known, and the targets that no travel can reach."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.press.press import Target
from sensing.simulator.press.state import Refusal
from sensing.simulator.press.tangential import reach, tangential_n

FRAME = Indenter(30.0).frame()
SPRINGS = np.array([[3.0, 0.4], [-0.3, 2.0]])  # N/mm, each direction a little by the other
PRESSED = Target(normal_n=10.0, tangential_n=(2.0, -1.5))


def advance(_, target: Target) -> SimpleNamespace:
    """A state whose tangential force goes with its travel, and stiffens."""
    assert target.tangential_n is None
    shift = np.array(target.shift_mm)
    meridian, lateral = SPRINGS @ shift * (1 + 0.1 * float(shift @ shift))
    force = FRAME @ np.array([-10.0, meridian, lateral])
    return SimpleNamespace(shift_mm=target.shift_mm, wrench=np.append(force, np.zeros(3)))


REST = SimpleNamespace(shift_mm=(0.0, 0.0), certificate=None, normal_n=10.0)


def test_the_travel_is_found_that_gives_the_force():
    found = reach(advance, REST, PRESSED, FRAME, 0.5, half=False)
    assert tangential_n(found, FRAME) == pytest.approx((2.0, -1.5), abs=2e-3 * 10.0)
    mirrored = reach(advance, REST, replace(PRESSED, tangential_n=(2.0, 0.0)), FRAME, 0.5, half=True)
    assert tangential_n(mirrored, FRAME)[0] == pytest.approx(2.0, abs=2e-3 * 10.0) and mirrored.shift_mm[1] == 0


@pytest.mark.parametrize(
    ("target", "half", "reason"),
    [
        (replace(PRESSED, tangential_n=(2.95, 3.95)), False, "range: "),  # 4.93 of 5 N: within a hair of sliding
        (PRESSED, True, "path: .*leaves the mirror plane"),
        (Target(depth_mm=3.0, tangential_n=(1.0, 0.0)), False, "path: .*needs a positive normal_n"),
    ],
)
def test_what_no_travel_can_give_is_refused(target, half, reason):
    with pytest.raises(Refusal, match=reason):
        reach(advance, REST, target, FRAME, 0.5, half)
    assert reach(advance, REST, replace(PRESSED, tangential_n=(2.9, 3.8)), FRAME, 0.5, False)  # 4.78 N
