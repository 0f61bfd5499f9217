import threading
import time
from dataclasses import replace

import cv2
import numpy as np
import pytest
from live_stand_in import endless, film, pipeline, stand_in, wait_for

from cad.errors import FileError, ParameterError
from sensing import setup
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.endcaps_file import load_config
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import CameraFeed, FileFeed, Pace
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.demo.scene_server import mjpeg_server
from sensing.live.endcap import Endcap, open_endcap
from sensing.sources.newest import SourceError
from sensing.tracking.zero import load_zero


class Hand:
    """Cameras that show a press while the hand is on them."""

    def __init__(self, count: int) -> None:
        pictures, rng = film([0] + [1.0] * 4), np.random.default_rng(7)
        rest = cv2.imdecode(np.frombuffer(pictures[0], np.uint8), cv2.IMREAD_COLOR).astype(float)
        noisy = [np.clip(rest + rng.normal(0, 3, rest.shape), 0, 255).astype(np.uint8) for _ in range(40)]
        self.rest, self.pressed = [cv2.imencode(".jpg", each)[1].tobytes() for each in noisy], pictures[1:]
        self.on: int | None = None
        self.gone: int | None = None  # the camera that is unplugged
        self.knocked: int | None = None  # the camera that has moved
        moved = np.roll(rest, 2, axis=1) + rng.normal(0, 3, rest.shape)
        self.aside = [cv2.imencode(".jpg", np.clip(moved, 0, 255).astype(np.uint8))[1].tobytes()]
        self.count = count

    def endcaps(self, config, models=None):
        return [
            LiveEndcap(CameraFeed(self.camera(k)), pipeline(endcap.name, k, 10, endcap.source))
            for k, endcap in enumerate(config.endcaps)
        ]

    def camera(self, number: int):
        rng = np.random.default_rng(7)  # all untouched endcaps look alike, to have one camera

        def source():
            for count, frame in enumerate(endless(self.rest, 100)()):
                if self.gone == number:
                    raise SourceError("/dev/video9: no such camera")
                pictures = self.pressed if self.on == number else self.aside if self.knocked == number else self.rest
                jpeg = pictures[rng.integers(len(pictures))]  # a period would be taken for drift
                yield type(frame)(frame.time_s, count, "test", jpeg=jpeg, size=frame.size)

        return source


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(setup, "REST_S", 1.0)
    monkeypatch.setattr("sensing.wrench.contact.LEAST_TAIL", 2)  # a threshold of fewer frames: test_contact has all
    for name in ("sensing.live.core.first_reference.ZERO_S", "sensing.setup.TOUCH_S"):
        monkeypatch.setattr(name, 180.0)  # patience only: each wait ends with what it waits for


def config(count: int) -> LiveConfig:
    return LiveConfig(tuple(EndcapConfig(f"camera_{k}", str(k)) for k in range(count)), weight_n=50.0)


def test_endcaps_are_named_in_the_order_in_which_they_are_touched(tmp_path, monkeypatch, quick):
    hand = Hand(2)
    monkeypatch.setattr(setup, "open_endcaps", hand.endcaps)
    touches = iter([None, 1, 0, None])  # the last question asks for a release

    def ask(text):
        hand.on = next(touches)
        return ""

    said = []
    setup.set_up(config(2), tmp_path / "endcaps.toml", ask, lambda text: said.append(text) or "", lambda _: stand_in())
    found = load_config(tmp_path / "endcaps.toml")
    assert [(endcap.name, endcap.source) for endcap in found.endcaps] == [("endcap_0", "1"), ("endcap_1", "0")]
    assert found.weight_n == 50 and all(load_zero(endcap.zero).sensor == endcap.name for endcap in found.endcaps)
    assert all(
        0.2 <= endcap.contact_on_n < 5 and endcap.contact_off_n <= endcap.contact_on_n for endcap in found.endcaps
    )
    assert "written" in said[-1]


@pytest.mark.long
def test_a_touch_that_nobody_sees_writes_nothing(tmp_path, monkeypatch, quick):
    monkeypatch.setattr(setup, "TOUCH_S", 0.3)
    monkeypatch.setattr(setup, "open_endcaps", Hand(2).endcaps)
    with pytest.raises(ParameterError, match="no camera saw a touch"):
        setup.set_up(config(2), tmp_path / "endcaps.toml", lambda _: "", lambda _: "", lambda _: stand_in())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("what", "during", "said"), [
    ("gone", "rest", "1: unplugged: /dev/video9: no such camera; start again with all cameras plugged in"),
    ("gone", "touch", "no camera saw a touch in 1 s: 1: unplugged: /dev/video9: no such camera; start again"),
    ("knocked", "rest", "1: camera or lens have moved since the reference"),
    ("knocked", "touch", "1: camera or lens have moved since the reference"),
])  # fmt: skip
def test_a_camera_that_is_unplugged_or_knocked_while_it_is_set_up_is_named(
    tmp_path, monkeypatch, quick, what, during, said
):
    """It read "worth 0 independent frames: leave the endcap untouched for longer", and a knock passed for a touch."""
    hand, lines = Hand(2), []
    monkeypatch.setattr(setup, "open_endcaps", hand.endcaps)
    monkeypatch.setattr(setup, "MOST_REST_S", 2.0 if (what, during) == ("gone", "rest") else 180.0)
    if what == "gone":
        monkeypatch.setattr(setup, "TOUCH_S", 1.0)

    def say(line):
        lines.append(line)
        if during == "rest" and line.startswith("zeroed"):
            setattr(hand, what, 1)
        return ""

    def ask(line):
        if during == "touch" and line.startswith("press"):
            setattr(hand, what, 1)
        return ""

    with pytest.raises(ParameterError, match=said):
        setup.set_up(config(2), tmp_path / "endcaps.toml", ask, say, lambda _: stand_in())
    assert list(tmp_path.iterdir()) == []
    if (what, during) == ("gone", "rest"):
        assert lines[-1].startswith("waiting for 1: unplugged")


@pytest.mark.long
def test_weights_of_another_silicone_serve_until_the_endcap_is_weighed(tmp_path, monkeypatch, quick):
    """Setup refused it with the advice to weigh it, which needs the file that setup writes."""
    hand, opened = Hand(1), []

    def endcaps(given, models=None):
        opened.extend(replace(each, silicone="Smooth-Sil 940") for each in given.endcaps)
        made = [models(each) for each in opened]
        return [
            LiveEndcap(CameraFeed(hand.camera(k)), EndcapPipeline(each, model, None, k, 10))
            for k, (each, model) in enumerate(zip(opened, made, strict=True))
        ]

    monkeypatch.setattr(setup, "open_endcaps", endcaps)
    said = []
    out = tmp_path / "endcaps.toml"
    setup.set_up(config(1), out, lambda _: "", lambda text: said.append(text) or "")
    assert load_config(out).endcaps[0].silicone == "Smooth-Sil 940"
    assert "for the silicone Smooth-Sil 950, so weigh each endcap first" in said[-1] and "sensing.weigh" in said[-1]


def test_a_configuration_that_is_there_is_kept(tmp_path):
    (tmp_path / "endcaps.toml").write_text("mine")
    with pytest.raises(FileError, match="is there already"):
        setup.set_up(config(1), tmp_path / "endcaps.toml", lambda _: "")
    assert setup.main(["--out", str(tmp_path / "endcaps.toml"), "--camera", "0"]) == 2


def test_references_of_another_configuration_are_kept(tmp_path):
    (tmp_path / "endcap_1.npz").write_text("of yesterday's endcaps.toml")
    with pytest.raises(FileError, match=r"endcap_1\.npz: is there already, and another configuration may use it"):
        setup.set_up(config(2), tmp_path / "other.toml", pytest.fail)
    assert (tmp_path / "endcap_1.npz").read_text() == "of yesterday's endcaps.toml"


def test_a_place_that_cannot_be_written_is_named_before_anything_is_asked(tmp_path):
    with pytest.raises(FileError, match=r"nodir/s\.toml: No such file or directory"):
        setup.set_up(config(1), tmp_path / "nodir" / "s.toml", pytest.fail)


# --- Python, network -------------------------------------------------------------------------------------------
def test_a_stream_gives_a_wrench_for_every_frame_and_ends_with_the_file():
    from live_stand_in import frames

    given = frames(film([0] * 3 + [1.0] * 4 + [0] * 2))
    with Endcap(LiveEndcap(FileFeed(lambda: given, Pace(0)), pipeline())) as endcap:
        found = list(endcap.stream())
        assert [w.time_s for w in found] == [f.time_s for f in given]
        assert found[5].force_n[0] > 5 and not endcap.touching and endcap.health.frames == len(given)


def test_a_stream_of_a_camera_ends_when_it_is_closed():
    endcap = Endcap(LiveEndcap(CameraFeed(endless(film([0] * 6))), pipeline()))
    with endcap:
        stream = endcap.stream()
        assert np.isfinite(next(stream).force_n).all()
        threading.Timer(0.2, endcap.close).start()
        assert len(list(stream)) < 1000


def test_a_slow_reader_of_a_camera_gets_the_newest_wrench_not_an_old_one():
    """A loop of 10 Hz at a camera of 30 was two seconds behind for as long as it ran."""
    with Endcap(LiveEndcap(CameraFeed(endless(film([0] * 6), 60)), pipeline())) as endcap:
        for number, wrench in enumerate(endcap.stream()):
            assert number < 3 or endcap._endcap.stats.last.wrench.time_s - wrench.time_s < 0.2
            if number == 20:
                break
            time.sleep(0.05)


def test_a_file_waits_for_a_slow_reader_and_ends_when_the_endcap_is_closed(monkeypatch):
    from live_stand_in import frames

    monkeypatch.setattr("sensing.live.endcap.ROOM", 4)
    given = frames(film([0] * 40))
    with Endcap(LiveEndcap(FileFeed(lambda: given, Pace(0)), pipeline())) as endcap:
        stream, found = endcap.stream(), []
        for wrench in stream:
            found.append(wrench.time_s)
            time.sleep(0.1 * (len(found) == 3))
            if len(found) == 20:
                break
        assert found == [frame.time_s for frame in given[:20]]
        wait_for(lambda: endcap._readings._full)
        begin_s = time.monotonic()
    assert time.monotonic() - begin_s < 2 and not endcap._engine.threads[0].is_alive()


def test_open_endcap_says_what_is_wrong(tmp_path):
    with pytest.raises(FileError, match="nowhere"):
        open_endcap("nowhere", model=stand_in())
    (tmp_path / "a.jpg").write_bytes(film([0])[0])
    with pytest.raises(FileError, match="no_zero"):
        open_endcap(str(tmp_path), tmp_path / "no_zero.npz", model=stand_in())


def test_two_cameras_over_http_reach_the_pipeline(monkeypatch):
    pictures = film([0] * 4 + [1.0] * 8 + [0] * 4)
    server = mjpeg_server(0, lambda number: endless(pictures, 30)())
    threading.Thread(target=server.serve_forever, daemon=True).start()
    from sensing.live.core.engine import Engine
    from sensing.live.open_endcaps import open_endcaps

    base = f"http://127.0.0.1:{server.server_port}"
    endcaps = tuple(EndcapConfig(f"endcap_{k}", f"{base}/{k}") for k in (0, 2))
    monkeypatch.setattr("sensing.live.open_endcaps.ZERO_FRAMES", 1)
    live = open_endcaps(LiveConfig(endcaps), models=lambda _: stand_in())
    touched = set()
    with Engine(live) as engine:
        wait_for(
            lambda: (
                [touched.add(c.name) for c in live if c.stats.last and c.stats.last.contact.touching]
                and len(touched) == 2
            )
        )
        assert all(h.faults == 0 for h in engine.health())
    server.shutdown()
