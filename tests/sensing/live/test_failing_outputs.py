"""Outputs that raise: they are named with the error and removed; endcaps and other outputs go on."""

import io

import pytest
from live_stand_in import film, frames, pipeline

from sensing.live.core.config import EndcapConfig, LiveConfig
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import FileFeed, Pace
from sensing.live.run import LiveRun, run_until_stopped

COUNT = 6


@pytest.fixture(scope="module")
def rest() -> list[bytes]:
    return film([0] * COUNT)


class Raises:
    """Raises at its third reading."""

    def __init__(self) -> None:
        self.given = 0

    def put(self, reading):
        self.given += 1
        if self.given == 3:
            raise ZeroDivisionError("planted")


class Keeps:
    """Keeps what it is given."""

    def __init__(self) -> None:
        self.got = []

    def put(self, reading):
        self.got.append(reading.frame.sequence)


@pytest.mark.parametrize("workers", [1, 2])
def test_an_output_that_raises_is_named_and_the_others_go_on(rest, workers):
    names = [f"endcap_{k}" for k in range(2)]
    endcaps = [LiveEndcap(FileFeed(lambda: frames(rest), Pace(0)), pipeline(name, k)) for k, name in enumerate(names)]
    run = LiveRun(LiveConfig(tuple(EndcapConfig(name, "test") for name in names)), endcaps, workers)
    bad, good, stream = Raises(), Keeps(), io.StringIO()
    run.add_output(bad, "--output bad")
    run.add_output(good, "--output good")
    run_until_stopped(run, stream)
    said = "--output bad: stopped (ZeroDivisionError: planted)"
    assert bad.given < 2 * COUNT and sorted(good.got) == sorted(2 * list(range(COUNT)))
    assert [loss for each in run.losses if (loss := each())] == [said]
    assert stream.getvalue().splitlines()[-1] == said
    assert all(endcap.health.frames == COUNT for endcap in endcaps)


def test_an_output_that_stopped_by_itself_is_named_too():
    class Stopped(Keeps):
        failed = "No space left on device"

    endcap = LiveEndcap(FileFeed(lambda: iter(()), Pace(0)), pipeline())
    run = LiveRun(LiveConfig((EndcapConfig("endcap_0", "test"),)), [endcap])
    run.add_output(Stopped(), "--output disk")
    assert [loss for each in run.losses if (loss := each())] == ["--output disk: stopped (No space left on device)"]
