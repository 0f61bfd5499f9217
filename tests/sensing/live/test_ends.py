"""Every end of a run: during zeroing, with cameras that hang, with full disks, of a replay, at a random moment."""

import contextlib
import gc
import inspect
import io
import os
import resource
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from live_program import camera, program
from live_stand_in import PATIENCE_S, WEIGHTS_BYTES, endless, film, frames, pipeline, stand_in, wait_for
from mcap.records import ChunkIndex

from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import Engine, LiveEndcap
from sensing.live.core.feed import CameraFeed, FileFeed, Pace
from sensing.live.ending import FLUSH_S, Stop
from sensing.live.mcap_records import CutError, read_records
from sensing.live.outputs.lines import Lines
from sensing.live.outputs.mcap.recorder import Recorder
from sensing.live.outputs.mcap.recording import OTHERS_S
from sensing.live.playback import Playback
from sensing.live.recorded_feed import replay_endcaps
from sensing.live.replay import read_config, verify
from sensing.live.run import LiveRun, run_until_stopped
from sensing.records import Frame
from sensing.sources.newest import Health
from sensing.tracking.zero import ZeroError

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "bench"))


@pytest.fixture(scope="module")
def address():
    with camera() as url:
        yield url


def test_a_reference_that_is_being_prepared_is_waited_for(monkeypatch):
    began, halted, ended = threading.Event(), threading.Event(), []

    def slow(collected, name, params):
        began.set()
        assert halted.wait(PATIENCE_S)
        ended.append(len(collected))
        raise ZeroError("moved")

    monkeypatch.setattr("sensing.live.core.reference.take_zero", slow)
    endcaps = [LiveEndcap(CameraFeed(endless(film([0]))), pipeline(f"endcap_{k}", k, zero_frames=3)) for k in range(2)]
    engine = Engine(endcaps)
    engine.start()
    assert began.wait(PATIENCE_S)
    engine.halt(PATIENCE_S)
    assert ended == []
    halted.set()
    engine.close(PATIENCE_S)
    assert ended == [3]  # the first is waited for; the second, not yet begun, is left out
    makers = [endcap.pipeline.taker._thread for endcap in endcaps]
    assert not any(maker is not None and maker.is_alive() for maker in makers)


def test_a_file_has_ended_when_its_last_frame_is_worked_on_and_not_when_it_is_read():
    endcap = LiveEndcap(FileFeed(lambda: frames(film([0, 0, 0])), Pace(0)), pipeline())
    endcap.feed.start(lambda: None)
    wait_for(lambda: endcap.feed.health.status == "ended")
    for done in range(3):
        assert endcap.health.status != "ended", done
        item = endcap.take()
        assert endcap.health.status != "ended", done
        assert endcap.process(item) is not None
    assert endcap.take() is None and endcap.health.status == "ended"


def test_a_last_frame_that_is_taken_while_somebody_looks_has_not_ended_the_file():
    class Feed:
        health = Health("ended")
        waiting = frames(film([0]))

        @property
        def ended(self):  # the loop takes it while page or terminal ask
            if self.waiting:
                endcap.take()
            return not self.waiting

        def take(self):
            return self.waiting.pop(), 0.0

    endcap = LiveEndcap(Feed(), pipeline())
    assert endcap.health.status != "ended"


def test_an_end_while_zeroing_is_clean(address):
    with program("--url", address, "--url", address, "--no-page") as process:
        for line in process.stdout:
            if any(word in line for word in ("untouched", "running", "calibrated")):  # asked for, or already done
                break
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE_S) == 0  # the interpreter's own end gave 134 in every ninth run
        assert "Traceback" not in process.stderr.read()


class HungSource:
    """A driver that never answers."""

    def __iter__(self):
        yield Frame(0.0, 0, "hung", jpeg=film([0])[0], size=(640, 480))
        threading.Event().wait()


def test_cameras_that_hang_are_left_behind_together():
    endcaps = [LiveEndcap(CameraFeed(HungSource), pipeline(f"endcap_{k}", k)) for k in range(6)]
    engine = Engine(endcaps)
    engine.start()
    wait_for(lambda: all(endcap.feed.health.frames for endcap in endcaps))
    waited = []
    for endcap in endcaps:  # how long each may take is what is tested, not how long it takes here
        endcap.feed.close = lambda wait_s: waited.append(wait_s) or time.sleep(wait_s)
    engine.close(0.4)
    assert sum(waited) <= 0.4 and all(endcap.feed._live._stop.is_set() for endcap in endcaps)


def test_all_that_hangs_shares_less_than_two_seconds_after_a_signal(monkeypatch):
    """The waits that each may take are added up: how long this computer takes for the rest does not count."""
    clock = SimpleNamespace(now_s=50.0)
    monkeypatch.setattr("sensing.live.run.time", SimpleNamespace(monotonic=lambda: clock.now_s))

    def hang(wait_s: float) -> None:
        clock.now_s += wait_s

    endcaps = [LiveEndcap(CameraFeed(endless(film([0]))), pipeline(f"endcap_{k}", k)) for k in range(2)]
    run = LiveRun(LiveConfig(tuple(EndcapConfig(f"endcap_{k}", "test") for k in range(2))), endcaps)
    engine = SimpleNamespace(halt=hang, close=hang, wait=lambda _: False, health=lambda **_: [], failures=())
    monkeypatch.setattr(run, "engine", engine)
    stop, outputs, given = Stop(), contextlib.ExitStack(), []
    engine.start = stop.asked.set
    for _ in range(4):  # numbers, topics, viewer, page
        outputs.callback(lambda: given.append(run.patience_s) or hang(run.patience_s))
    outputs.callback(lambda: given.append(run.patience_s - OTHERS_S) or hang(run.patience_s - OTHERS_S))  # the file
    lines = Lines(io.StringIO())
    run_until_stopped(run, lines, None, outputs, stop)
    closing_s = inspect.signature(Lines.close).parameters["wait_s"].default
    assert clock.now_s - 50.0 + closing_s + FLUSH_S <= 2.2 and given[0] > 0.6  # most of it is for the file


def test_a_camera_is_not_called_silent_because_outputs_take_their_time_to_close():
    endcap = LiveEndcap(CameraFeed(endless(film([0, 0]))), pipeline("endcap_0", 0))
    run = LiveRun(LiveConfig((EndcapConfig("endcap_0", "test"),)), [endcap])
    stop, outputs, stream = Stop(), contextlib.ExitStack(), io.StringIO()
    outputs.callback(lambda: wait_for(lambda: endcap.feed.health.status == "silent"))  # a slow disk
    run.stop_when(lambda: endcap.feed.health.frames > 3)
    run_until_stopped(run, Lines(stream), None, outputs, stop)
    assert endcap.feed.health.status == "silent" and "silent" not in stream.getvalue()


def test_a_signal_closes_the_recording_although_cameras_hang(address, tmp_path):
    with socket.create_server(("127.0.0.1", 0), backlog=20) as silent:
        hung = [word for _ in range(4) for word in ("--url", f"http://127.0.0.1:{silent.getsockname()[1]}/")]
        path = tmp_path / "run.mcap"
        with program("--url", address, *hung, "--no-page", "--record", str(path)) as process:
            wait_for(lambda: path.exists() and path.stat().st_size > WEIGHTS_BYTES + 600_000)
            process.send_signal(signal.SIGHUP)
            assert process.wait(PATIENCE_S) == 0  # of five cameras that took two seconds each before
    check = verify(path, read_config(path), lambda _: stand_in())
    assert check.frames > 3 and check.end is None


def test_a_full_disk_while_recording_is_reported_and_gives_status_1(address, tmp_path):
    path = tmp_path / "run.mcap"
    most = WEIGHTS_BYTES + 1_200_000
    room = {"preexec_fn": lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))}
    with program("--url", address, "--no-page", "--record", str(path), **room) as process:
        wait_for(lambda: path.exists() and path.stat().st_size == most)  # the write behind that is refused
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 1
        said = process.stderr.read()
    assert f"sensing.live: {path}: recording stopped (File too large); " in said and "Traceback" not in said
    check = verify(path, read_config(path), lambda _: stand_in())
    assert f"; {check.frames} frames are kept" in said and check.frames > 0 and isinstance(check.end, CutError)


@pytest.mark.long
def test_json_to_a_full_disk_is_reported_and_gives_status_1(address):
    with open("/dev/full", "w") as full, program("--url", address, "--no-page", "--json", stdout=full) as process:
        assert process.wait(PATIENCE_S) == 1
        assert "sensing.live: --json: stopped after 0 lines (No space left on device)" in process.stderr.read()


def test_a_closed_pipe_ends_the_run_quietly(address):
    with program("--url", address, "--no-page") as process:
        process.stdout.readline()
        process.stdout.close()
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 0
        assert "Traceback" not in process.stderr.read()


def test_a_terminal_that_has_stopped_holds_nothing_up():
    out, into = os.pipe()
    with contextlib.suppress(BrokenPipeError), os.fdopen(into, "w") as stream:  # what is left cannot be flushed
        lines = Lines(stream)
        for _ in range(400):
            lines.write("x" * 1000)  # the pipe takes 64 kB, nobody reads
        lines.close(0.1)
        assert lines._thread.is_alive() and not lines.failed
        os.close(out)
        wait_for(lambda: lines.gone)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Sixty frames."""
    path = tmp_path_factory.mktemp("ends") / "run.mcap"
    recorder = Recorder(path, LiveConfig((EndcapConfig("endcap_0", "test"),)), {"endcap_0": 0}, lambda _: None)
    recorder.start()
    pipe = pipeline()
    for frame in frames(film([0, 0, 0.5, 1.0] * 15)):
        recorder.put(pipe.update(frame))
    recorder.close(PATIENCE_S)
    assert recorder.frames == recorder.kept == 60
    return path


def test_a_replay_keeps_no_frames_and_is_not_zeroing(recording):
    seen, most = set(), 0

    class Sink:
        def put(self, reading):
            nonlocal most
            seen.add(endcaps[0].health.status)
            most = max(most, sum(type(each) is Frame for each in gc.get_objects()))

    endcaps = replay_endcaps(recording, read_config(recording), Playback(recording, 0), lambda _: stand_in())
    before = sum(type(each) is Frame for each in gc.get_objects())
    with Engine(endcaps, [Sink()]) as engine:
        assert engine.wait(PATIENCE_S)
    assert endcaps[0].stats.frames == 60 and most - before < 15  # some wait for the loop
    assert "zeroing" not in seen and endcaps[0].health.message.startswith("camera not calibrated")


def test_the_index_of_a_recording_does_not_grow_in_memory(tmp_path):
    config = LiveConfig((EndcapConfig("endcap_0", "test"),))
    recorder = Recorder(tmp_path / "long.mcap", config, {"endcap_0": 0}, lambda _: None)
    recorder.idle = lambda: None  # this test writes in its own thread
    recorder.start()
    pipe = pipeline()
    for frame in frames(film([0, 0.5] * 10)):
        recorder.write(pipe.update(frame))
        recorder._flush()
    kept = [each for each in gc.get_objects() if type(each) is ChunkIndex]  # a weak proxy may be dead
    recorder.close(PATIENCE_S)
    assert kept == []
    from mcap.reader import make_reader

    with recorder.path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert len(summary.chunk_indexes) == 20 and summary.statistics.chunk_count == 20
    assert sum(1 for _ in read_records(recorder.path)) >= 150


@pytest.mark.long
def test_random_ends_are_clean():
    """A sample of ``python bench/bench_robust_ends.py``, in a process of its own: it forks."""
    bench = Path(__file__).resolve().parents[3] / "bench"
    code = "from bench_robust_ends import ends; print([fault for *_, fault in ends(6, 2, 7) if fault])"
    environment = {**os.environ, "PYTHONPATH": f"{bench}{os.pathsep}{bench.parent}"}
    reported = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=3 * PATIENCE_S
    )
    assert reported.stdout.splitlines()[-1:] == ["[]"], reported.stdout + reported.stderr
