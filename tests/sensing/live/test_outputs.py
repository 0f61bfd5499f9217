"""What a run puts out as text: lines of JSON, the terminal's line, the summary."""

import io
import json
from collections import deque
from contextlib import ExitStack
from types import SimpleNamespace

import numpy as np
import pytest
from live_stand_in import PATIENCE_S, dots, film, frames, pipeline

from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import Engine, LiveEndcap
from sensing.live.core.feed import FileFeed, Pace
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.reading import plain
from sensing.live.core.state import Condition, State
from sensing.live.core.stats import EndcapStats
from sensing.live.ending import Stop
from sensing.live.outputs.json_lines import JsonLines
from sensing.live.outputs.lines import Lines
from sensing.live.outputs.terminal import Terminal, endcap_line, summary
from sensing.live.run import LiveRun, run_until_stopped
from sensing.records import Frame
from sensing.sources.newest import Health


@pytest.fixture(scope="module")
def press() -> list[bytes]:
    return film([0] * 12 + [0.3, 0.7, 1.0, 1.0, 0.7, 0.3] + [0] * 4)


def readings(pipe: EndcapPipeline, given: list[Frame]) -> list:
    return [pipe.update(frame) for frame in given]


def test_json_lines_are_json_and_a_reader_that_leaves_ends_them_quietly(press):
    found = readings(pipeline(), frames(press))
    stream = io.StringIO()
    lines = JsonLines(stream)
    lines.start()
    for reading in found:
        lines.put(reading)
    lines.close(PATIENCE_S)
    reported = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert [t["sequence"] for t in reported] == [r.frame.sequence for r in found]
    assert (
        reported[15]["force_n"] == pytest.approx(found[15].wrench.force_n, abs=1e-5) and reported[15]["contact"] is True
    )
    assert reported[0]["centre_mm"] == [None] * 3  # no force, no place: null, not NaN
    assert reported[0]["place_mm"] == reported[0]["normal"] == [None] * 3 and reported[0]["normal_sd_deg"] is None
    pushed = reported[15]
    assert pushed["normal"] == pytest.approx(found[15].place.normal, abs=1e-5) and pushed["friction_use_sd"] > 0
    assert np.linalg.norm(pushed["normal"]) == pytest.approx(1, abs=1e-4) and 0 < pushed["normal_sd_deg"] < 90

    class Gone(io.StringIO):
        def write(self, _):
            raise BrokenPipeError(32, "Broken pipe")

    gone = JsonLines(Gone())
    gone.start()
    gone.put(found[0])
    gone.close(PATIENCE_S)
    assert gone.failed == "Broken pipe"


def test_the_terminals_line_says_what_counts(press):
    endcap = LiveEndcap(FileFeed(lambda: frames(press[:16]), Pace(0)), pipeline())
    with Engine([endcap]) as engine:
        engine.wait(PATIENCE_S)
    line = endcap_line(endcap.health, endcap.stats.last)
    assert (
        "touch" in line and f"{dots()}/{dots()} dots" in line and f"{endcap.stats.last.wrench.force_n[0]:+6.1f}" in line
    )
    assert "16 frames, 0 dropped" in summary([endcap.health], 1.0)[1]
    assert plain(endcap.stats.last)["dots"] == dots() > 90


def test_where_nobody_looks_state_and_reason_are_printed_when_they_change():
    stream = io.StringIO()
    terminal, stats = Terminal(stream), EndcapStats("endcap_0")
    for state, reason in (
        (State.STARTING, ""), (State.BLIND, "0 of 88 dots are seen"), (State.BLIND, "3 of 88 dots are seen"),
        (State.RUNNING, ""), (State.SILENT, "no frame for 1.2 s"), (State.SILENT, "no frame for 2.3 s"),
    ):  # fmt: skip
        terminal.show([stats.health(Health(), Condition(state, reason), 0)], {}, None, [])
    assert stream.getvalue().splitlines() == [
        "endcap_0: starting", "endcap_0: blind: 0 of 88 dots are seen", "endcap_0: running",
        "endcap_0: silent: no frame for 1.2 s",
    ]  # fmt: skip


def test_the_first_reading_may_come_while_the_state_is_looked_up():
    stats = EndcapStats("endcap_0")
    first = SimpleNamespace(
        latency_ms=5.0, ready_s=1.0, captured_s=1.0, stage_ms={"track": 2.0}, dots=(1, 2), drift=None
    )

    class AddedMeanwhile(deque):
        def __iter__(self):
            if not stats.frames:
                stats.add(first)
            return super().__iter__()

    stats._stages = AddedMeanwhile()
    assert np.isnan(stats.health(Health(), Condition(), 0, fresh=True).p99_ms)
    assert stats.health(Health(), Condition(), 0, fresh=True).p99_ms == 5.0


def test_a_run_ends_with_its_sources_and_a_summary(press):
    config = LiveConfig((EndcapConfig("endcap_0", "test"),))
    run = LiveRun(config, [LiveEndcap(FileFeed(lambda: frames(press), Pace(0)), pipeline())])
    stream = io.StringIO()
    run_until_stopped(run, Lines(stream), None, ExitStack(), Stop())
    assert f"{len(press)} frames" in stream.getvalue().splitlines()[-1]
