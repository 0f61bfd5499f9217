"""A computer that is too slow for its cameras: diagnostics warn while frames are dropped, and stop when it keeps up."""

import pytest

from sensing.live.core import stats
from sensing.live.core.state import Condition, State
from sensing.live.core.stats import EndcapStats
from sensing.live.outputs.diagnosis import diagnosis
from sensing.sources.newest import Health


class Clock:
    """A clock that the test moves."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s


@pytest.fixture
def run(monkeypatch):
    """One second of a camera at 30 Hz of whose frames some are dropped; the diagnosis after it."""
    clock, endcap, dropped = Clock(), EndcapStats("endcap_0"), 0
    monkeypatch.setattr(stats, "time", clock)

    def second(lost: int, state: State = State.RUNNING) -> tuple[int, str, dict[str, str]]:
        nonlocal dropped
        clock.now_s += 1.0
        endcap.frames += 30 - lost
        dropped += lost
        health = endcap.health(Health(dropped=dropped), Condition(state), 0)
        return diagnosis(health)[1:]

    return second


def test_diagnostics_warn_while_a_run_is_overloaded(run):
    assert [run(0)[0] for _ in range(3)] == [0, 0, 0]
    seen = [run(20) for _ in range(6)]
    level, message, values = seen[-1]
    assert level == 1 and message.startswith("running: 67 % of frames dropped") and "--workers" in message
    assert values["dropped_share"] == "0.67"
    assert [run(0)[0] for _ in range(8)][-1] == 0


def test_a_few_drops_are_no_overload_and_a_worse_state_keeps_its_level(run):
    assert [run(3)[:2] for _ in range(6)][-1] == (0, "running")
    blind = [run(25, State.BLIND) for _ in range(6)][-1]
    assert blind[:2] == (2, "blind")
