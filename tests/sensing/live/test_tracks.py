"""Recordings of dots instead of pictures: same bits, far smaller, and what they cannot do is refused by name."""

import numpy as np
import pytest
from live_stand_in import PATIENCE_S, Shown, film, frames, pipeline, stand_in
from long_cases import others_long

from cad.errors import FileError, ParameterError
from sensing.live.cli import main
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import FileFeed, Pace
from sensing.live.core.seen import Pictures, SeenFrame
from sensing.live.core.state import Event
from sensing.live.outputs.mcap.recorder import Recorder
from sensing.live.outputs.mcap.recording import Recording
from sensing.live.playback import Playback
from sensing.live.recorded_feed import replay_endcaps
from sensing.live.replay import read_config, recorded_frames, recorded_pictures, recorded_wrenches, verify
from sensing.live.run import LiveRun
from sensing.live.timeline import Timeline
from sensing.sources.__main__ import main as sources

NAME = "endcap_0"
CONFIG = LiveConfig((EndcapConfig(NAME, "test"),))


def mishaps() -> list[bytes]:
    """A press with a damaged, a black and a foreign picture in it."""
    shown = Shown()
    pictures = film([0, 0, 0, *np.abs(np.sin(np.arange(21) / 4))])
    pictures[8], pictures[13] = shown._films["broken"][0], shown._films["black"][0]
    return pictures


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Path of the same frames by kind of pictures, and what was computed when they were recorded."""
    folder, given, paths = tmp_path_factory.mktemp("tracks"), frames(mishaps()), {}
    readings = [pipeline().update(frame) for frame in given[:0]]
    for kind in Pictures:
        pipe, paths[kind] = pipeline(), folder / f"{kind}.mcap"
        recorder = Recorder(paths[kind], CONFIG, {NAME: -1}, lambda _: None, pictures=kind)
        recorder.start()
        readings = [pipe.update(frame) for frame in given]
        for reading in readings:
            recorder.put(reading)
        recorder.close(PATIENCE_S)
        assert recorder.frames == len(given) and not recorder.failed
    return paths, readings


@pytest.mark.parametrize("kind", others_long(reversed(Pictures), 2))
def test_all_kinds_give_the_same_bits(recorded, kind):
    paths, readings = recorded
    assert recorded_pictures(paths[kind]) is kind
    check = verify(paths[kind], read_config(paths[kind]), lambda _: stand_in())
    assert (check.frames, check.different, check.end) == (len(readings), 0, None)
    pipe, events, flags, contacts = pipeline(zero_frames=0), [], [], []
    for each in recorded_frames(paths[kind], NAME):
        if each.zero is not None:
            pipe.set_zero(each.zero)
        reading = pipe.update(each.frame)
        events.append(reading.event)
        flags.append((reading.wrench.flags, reading.estimate.flags, reading.reason.replace(NAME, "test")))
        contacts.append(reading.contact.touching)
        assert isinstance(each.frame, SeenFrame) is (kind is not Pictures.FULL)
    assert events == [r.event for r in readings] and {Event.UNDECODED, Event.UNSEEN} <= set(events)
    assert flags == [(r.wrench.flags, r.estimate.flags, r.reason) for r in readings]
    assert contacts == [r.contact.touching for r in readings]


def test_they_are_smaller_by_what_the_pictures_take(recorded):
    paths, readings = recorded
    zero = len(next(iter(recorded_frames(paths[Pictures.FULL], NAME))).zero.image.tobytes())
    sizes = {kind: path.stat().st_size for kind, path in paths.items()}
    assert sizes[Pictures.NONE] < sizes[Pictures.HALF] < sizes[Pictures.FULL] and zero > 0
    half = [r.frame.jpeg for r in recorded_frames(paths[Pictures.HALF], NAME)]
    assert sum(picture is None for picture in half) == 1  # the damaged one
    assert max(len(picture) for picture in half if picture) < min(len(r.frame.jpeg) for r in readings[:3]) / 2


@pytest.mark.parametrize("kind", [Pictures.HALF, Pictures.NONE])
def test_frames_from_a_moment_on_have_the_size_of_the_recorded_picture(recorded, kind):
    """Dots are in its pixels: on a page that took the half picture's size they would lie twice as far from the edge."""
    path = recorded[0][kind]
    start = Timeline(path).start(NAME, 0.3)
    sizes = {each.frame.size for each in recorded_frames(path, NAME, start)}
    assert sizes == {each.frame.size for each in recorded_frames(path, NAME)} == {(640, 480)}


def test_the_check_sees_a_dot_that_moved_by_a_bit(recorded, monkeypatch):
    path = recorded[0][Pictures.NONE]
    tracks = SeenFrame.tracks

    def moved(frame, method):
        found = tracks(frame, method)
        found.position_px.setflags(write=True)
        found.position_px[3, 0] = np.nextafter(found.position_px[3, 0], 1e9)
        return found

    monkeypatch.setattr(SeenFrame, "tracks", moved)
    assert verify(path, read_config(path), lambda _: stand_in()).different > 0


def test_what_needs_pictures_is_refused_by_name(recorded, tmp_path, capsys, monkeypatch):
    paths, _ = recorded
    for kind in (Pictures.HALF, Pictures.NONE):
        with pytest.raises(FileError, match=f"holds dots instead of pictures .*{kind}.*--method needs whole pictures"):
            read_config(paths[kind], method="gelslim")
        with pytest.raises(FileError, match="whole pictures"):
            read_config(paths[kind], model="paper")
        assert sources(["check", str(paths[kind])]) == 2
        assert "holds dots instead of pictures" in capsys.readouterr().err
    playback = Playback(paths[Pictures.NONE], 0)
    endcaps = replay_endcaps(paths[Pictures.NONE], read_config(paths[Pictures.NONE]), playback, lambda _: stand_in())
    run = LiveRun(CONFIG, endcaps, playback=playback)
    with pytest.raises(ParameterError, match="that is replayed has no whole pictures"):
        Recording(run, tmp_path).start()
    other = LiveRun(CONFIG, [LiveEndcap(FileFeed(list, Pace(0)), pipeline())])
    other.engine.endcaps[0].pipeline.model = stand_in("gelslim")
    with pytest.raises(ParameterError, match="gelslim follows none: record with full pictures"):
        Recording(other, tmp_path, Pictures.NONE).start()
    assert list(tmp_path.iterdir()) == []


def test_a_replay_of_dots_recorded_again_is_the_same(recorded, tmp_path):
    source = recorded[0][Pictures.HALF]
    playback = Playback(source, 0)
    run = LiveRun(CONFIG, replay_endcaps(source, read_config(source), playback, lambda _: stand_in()), 1, playback)
    recording = Recording(run, tmp_path)
    recording.start(tmp_path / "again.mcap", Pictures.HALF)
    with run.engine:
        assert run.engine.wait(PATIENCE_S)
    recording.stop()
    again = tmp_path / "again.mcap"
    assert np.array_equal(recorded_wrenches(again, NAME), recorded_wrenches(source, NAME), equal_nan=True)
    assert [r.frame.jpeg for r in recorded_frames(again, NAME)] == [r.frame.jpeg for r in recorded_frames(source, NAME)]


def test_the_option_goes_with_a_recording_that_can_be_made(capsys):
    assert main(["--replay", "x.mcap", "--check", "--record-pictures", "none"]) == 2
    assert "--record-pictures has no effect with --check" in capsys.readouterr().err
