"""Outputs that raise: they are named with the error and removed; endcaps and other outputs go on."""

import io
from contextlib import ExitStack

import pytest
from live_stand_in import film, frames, pipeline, wait_for

from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import FileFeed, Pace
from sensing.live.core.state import Condition, State
from sensing.live.core.stats import EndcapStats
from sensing.live.ending import Stop
from sensing.live.outputs.beat import Beat
from sensing.live.outputs.json_lines import JsonLines
from sensing.live.outputs.lines import Lines
from sensing.live.run import LiveRun, run_until_stopped
from sensing.sources.newest import Health

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
    run_until_stopped(run, Lines(stream), None, ExitStack(), Stop())
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


def test_what_is_done_again_and_again_goes_on_after_an_error_and_reports_it():
    done, errors = [], []

    def work():
        done.append(1)
        if len(done) == 2:
            raise ZeroDivisionError("planted")

    beat = Beat(0.001, work, errors.append)
    beat.start()
    wait_for(lambda: len(done) > 3)
    beat.stop()
    assert [str(error) for error in errors] == ["planted"]


def test_lines_for_endcaps_without_frames_say_why_they_stopped():
    class Full(io.StringIO):
        def write(self, _):
            raise OSError(28, "No space left on device")

    unplugged = EndcapStats("endcap_0").health(Health(), Condition(State.UNPLUGGED, "pulled"), 0)
    lines = JsonLines(Full(), lambda: [unplugged])
    lines.start()
    wait_for(lambda: lines.failed)
    lines.close()
    assert lines.loss == "--json: stopped after 0 lines (No space left on device)"
