import asyncio
import contextlib
import itertools
import json
import os
import random
import re
import signal
import socket
import threading
from pathlib import Path

import cv2
import numpy as np
import pytest
from live_site import Site, press_button, talk
from live_stand_in import PATIENCE_S, dots, wait_for
from long_cases import others_long
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from cad.errors import ParameterError
from sensing.live.web.link import LONGEST_LINE, Press, is_fresh, parse_line, parse_request
from sensing.live.web.page import PageServer, picture
from sensing.records import Frame

ROOT = Path(__file__).resolve().parents[3]
STATIC = ROOT / "sensing/live/web/static"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    with Site(tmp_path_factory.mktemp("page")) as running:
        yield running


# --- what is shown ---------------------------------------------------------------------------------------------
def test_the_socket_gives_names_then_numbers_then_a_picture(site):
    hello, reported, picture = talk(site, '{"do":"show","endcap":1}', '{"do":"show","endcap":1}')
    assert [endcap["name"] for endcap in hello["hello"]] == ["endcap_0", "endcap_1", "endcap_2"]
    reported = json.loads(reported)
    assert (
        len(reported["endcaps"]) == 3
        and reported["selected"]["number"] == 1
        and len(reported["selected"]["dots"]) == dots()
    )
    assert len(reported["endcaps"][0]["force_n"]) == 3 and reported["endcaps"][0]["p50_ms"] > 0
    assert picture[:2] == b"\xff\xd8"


def test_buttons_zero_and_record(site):
    epoch = site.run.engine.endcaps[2].pipeline.zero.digest
    wait_for(lambda: talk(site, press_button("record_start"), press_button("record_start")) and site.recording.on)
    talk(site, press_button("record_start"))  # explicit: again is no stop
    recorder = site.recording._recorder
    wait_for(lambda: recorder.frames > 5)
    assert site.recording._recorder is recorder
    wait_for(lambda: talk(site, press_button("record_stop")) and not site.recording.on)
    assert len(list(site.folder.glob("endcap_*.mcap"))) == 1
    wait_for(
        lambda: (
            talk(site, press_button("zero_confirmed", 2)) and site.run.engine.endcaps[2].pipeline.zero.digest != epoch
        )
    )


def test_a_disk_that_takes_its_time_to_end_a_recording_holds_no_page_up(site, monkeypatch):
    asked, answers = threading.Event(), threading.Event()
    monkeypatch.setattr(os, "fsync", lambda _: (asked.set(), answers.wait(PATIENCE_S)))
    wait_for(lambda: talk(site, press_button("record_start")) and site.recording.on)
    count = len(site.recording.files)
    try:
        wait_for(lambda: talk(site, press_button("record_stop")) and asked.wait(0.1))
        reported = json.loads(talk(site, '{"do":"show","endcap":0}')[1])["recording"]
        assert not answers.is_set() and not reported["on"] and "is being finished" in reported["note"]
    finally:
        answers.set()
    wait_for(lambda: len(site.recording.files) == count + 1)
    assert "frames recorded" in site.recording.note


def test_a_button_acts_on_what_was_seen_lately_and_never_on_what_is_old():
    for age_s, fresh in ((0.0, True), (1.9, True), (2.1, False), (60.0, False), (-1.0, False)):
        assert is_fresh(int(1e3 * (500.0 - age_s)), 500.0) is fresh, age_s


def test_the_page_needs_nothing_but_this_server():
    text = "".join(path.read_text() for path in STATIC.iterdir())
    assert set(re.findall(r"""(?:https?|wss?)://[\w./]+|//cdn|@import|url\(""", text)) == {"http://www.w3.org/2000/svg"}
    named = set(re.findall(r'(?:src|href)="([^"]+)"', text))
    assert named == {path.name for path in STATIC.iterdir()} - {"index.html"}


def test_an_endcap_whose_picture_cannot_be_shown_gets_an_empty_one(site, monkeypatch):
    """The last picture stood, even another endcap's, under the name and dots of this one."""
    monkeypatch.setattr("sensing.live.web.page.picture", lambda frame: b"")
    wait_for(lambda: talk(site, *['{"do":"show","endcap":0}'] * 2)[2] == b"")


# --- fuzz ------------------------------------------------------------------------------------------------------
def test_a_picture_that_cannot_be_read_is_not_shown_as_one():
    assert picture(Frame(0.0, 0, "a", jpeg=b"a.jpg: no picture", fault="a.jpg: no picture")) == b""
    assert picture(Frame(0.0, 0, "a", image=np.zeros((4, 4, 3), np.uint8)))[:2] == b"\xff\xd8"


def test_what_is_no_request_is_none():
    good = {("show", 0, 0), ("zero", 2, 7), ("record_start", 0, 1), ("zero_all", 1, 2), ("undo", 1, 3)}
    assert {parse_request(json.dumps({"do": d, "endcap": c, "seen": s}), 3) for d, c, s in good} == {
        Press(*each) for each in good
    }
    for seen in (-1, True, 1.5, "1", None, 10**20):
        assert parse_request(json.dumps({"do": "zero", "endcap": 0, "seen": seen}), 3) is None
    for word, value in (("zero", 1), ("record_start", 3), ("replay_pause", 2), ("replay_seek", -1), ("note", "1")):
        assert parse_request(json.dumps({"do": word, "value": value}), 3) is None, word
    for word, text in (("note", "x" * 201), ("note", "\x1b[2J"), ("note", "a\nb"), ("note", 3), ("zero", "x")):
        assert parse_request(json.dumps({"do": word, "text": text}), 3) is None, word
    rng = random.Random(0)
    values = [None, True, -1, 3, 1.0, "0", "../../x", [], {}, 10**30, float("nan"), "show", "zero\n", "record "]
    for do, endcap in itertools.product(values, values):
        if (do, endcap) != ("show", 0):
            assert parse_request(json.dumps({"do": do, "endcap": endcap}), 3) is None or do == "show"
    for extra in ({"do": "record", "path": "/etc/x"}, {"do": "show", "endcap": True}, [], "show", 7, None):
        assert parse_request(json.dumps(extra), 3) is None
    for _ in range(2000):
        text = "".join(
            chr(rng.choice((34, 123, 125, 91, 93, 58, 44, 48, 92, 100, 0, 8364))) for _ in range(rng.randrange(40))
        )
        assert parse_request(text, 3) is None or text == '{"do":"show"}'
    assert parse_request("[" * 100_000, 3) is None


def test_what_the_pages_process_may_say_are_known_words_and_numbers_within_limits():
    assert parse_line(b"look 0 2\n", 3) == [0, 2] and parse_line(b"zero 1 55 0 \n", 3) == Press("zero", 1, 55)
    for press in (Press("replay_seek", 0, 9, 12_500), Press("note", 2, 7, 0, "\u00e4 %20 'x' 50 %"), Press("note")):
        assert parse_line(press.line(), 3) == press
    longest = Press("note", 0, 10**15 - 1, 0, "\U0001f600" * 200).line()
    assert len(longest) <= LONGEST_LINE and parse_line(longest, 3) is not None
    for line in (b"", b"\n", b"look\n", b"look 3\n", b"look -1\n", b"erase 0\n", b"zero 0x1\n", b"zero \xb2\n",
                 b"record ../x\n", b"\xff\xfe 0\n", b"look 1.0\n", b"look 00000000001x\n", b"zero 1\n", b"zero 1 2\n",
                 b"zero 1 2 3\n", b"zero 1 2 0 x\n", b"note 0 1 0 a b\n", b"note 0 1 0 %1B%5B2J\n", b"show 0 1 0\n",
                 b"note 0 1 0 " + b"x" * 201):  # fmt: skip
        assert parse_line(line, 3) is None, line


def test_a_page_whose_process_dies_is_reported_and_the_loop_goes_on(tmp_path):
    with Site(tmp_path) as doomed:
        talk(doomed, '{"do":"show","endcap":0}')
        os.kill(doomed.server.pid, signal.SIGKILL)
        wait_for(lambda: "page: gone" in doomed.server.note)
        count = doomed.run.engine.endcaps[0].stats.frames
        wait_for(lambda: doomed.run.engine.endcaps[0].stats.frames > count + 3)


def test_the_pages_process_ends_when_the_run_is_no_more(tmp_path):
    with Site(tmp_path) as orphan:
        talk(orphan)
        orphan.server._link.shutdown(socket.SHUT_RDWR)  # as the kernel does for a killed run
        assert orphan.server._process.wait(PATIENCE_S) == 0


def test_malformed_requests_and_messages_leave_the_page_and_the_loop_running(site):
    rng = random.Random(1)
    port = int(site.url.split(":")[2].strip("/"))
    for kind in range(30):
        with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as raw:
            junk = bytes(rng.randrange(256) for _ in range(rng.randrange(1, 400)))
            head = b"GET /ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            key = b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
            raw.sendall((junk, b"GET / HTTP/1.1\r\n" + junk, head + key + junk)[kind % 3])
            if kind % 2:
                raw.settimeout(0.2)
                with contextlib.suppress(OSError):
                    raw.recv(1000)
    for text in ("", "{", '{"do":"show","endcap":99}', '{"do":"erase"}', "\x00", "x" * 900, '{"do":' * 100):
        with pytest.raises(ConnectionClosed):
            talk(site, text)
    with pytest.raises(ConnectionClosed):
        talk(site, "x" * 100_000)  # longer than any request
    count = site.run.engine.endcaps[0].stats.frames
    wait_for(lambda: site.run.engine.endcaps[0].stats.frames > count + 5)
    talk(site, '{"do":"show","endcap":0}')
    assert [(h.faults, h.message) for h in site.run.engine.health() if h.faults] == []


def test_a_viewer_that_stalls_or_vanishes_costs_nothing(site):
    async def stall():
        websocket = await connect(site.url.replace("http", "ws", 1) + "ws", max_queue=1)
        for _ in range(5):
            await websocket.send('{"do":"show","endcap":0}')  # asks and never reads
        count = site.run.engine.endcaps[0].stats.frames
        await asyncio.to_thread(wait_for, lambda: site.run.engine.endcaps[0].stats.frames > count + 20)
        websocket.transport.abort()  # no goodbye

    asyncio.run(stall())
    talk(site, '{"do":"show","endcap":0}')


def test_more_viewers_than_allowed_are_turned_away_and_room_comes_back(site):
    async def many():
        url = site.url.replace("http", "ws", 1) + "ws"
        open_ones = [await connect(url) for _ in range(8)]
        with pytest.raises(InvalidStatus):
            await connect(url)
        for websocket in open_ones:
            await websocket.close()

    asyncio.run(many())
    wait_for(lambda: talk_quietly(site))


def talk_quietly(site: Site) -> bool:
    try:
        return bool(talk(site))
    except InvalidStatus:
        return False


def test_a_taken_port_is_refused_when_asked_for_and_avoided_when_not(site, tmp_path):
    port = int(site.url.split(":")[2].strip("/"))
    with pytest.raises(ParameterError, match=rf"port {port} of 127\.0\.0\.1"):
        PageServer(site.run, site.recording, "127.0.0.1", port)
    with pytest.raises(ParameterError, match=r"of nowhere\.invalid"):
        PageServer(site.run, site.recording, "nowhere.invalid", 0)


# --- for a while -----------------------------------------------------------------------------------------------
def memory_mb() -> float:
    status = Path("/proc/self/status").read_text()
    return int(re.search(r"VmRSS:\s+(\d+)", status)[1]) / 1024


@pytest.mark.long
def test_a_short_soak_with_viewer_and_recordings_keeps_memory_flat(site):
    """What an hour would show by hundreds of MB shows here by some: pictures, readings or messages that are kept."""

    def work(rounds: int) -> float:
        for _ in range(rounds):
            site.recording.start()
            frames = site.run.engine.endcaps[0].stats.frames
            wait_for(lambda frames=frames: site.run.engine.endcaps[0].stats.frames > frames + 8)
            talk(site, *['{"do":"show","endcap":1}'] * 6)
            site.recording.stop()
        return memory_mb()

    before, counts = work(4), [endcap.stats.frames for endcap in site.run.engine.endcaps]
    after = work(12)
    reported = [endcap.stats.frames - count for endcap, count in zip(site.run.engine.endcaps, counts, strict=True)]
    assert min(reported) > 90 and after - before < 12  # 300 pictures of 47 kB alone would be 14 MB


# --- in a browser ----------------------------------------------------------------------------------------------
LOOK = """JSON.stringify({
  drawn: window.drawn, lamps: document.querySelectorAll(".lamp.touch").length,
  endcaps: document.querySelectorAll(".endcap").length, health: document.getElementById("health").innerText,
  wide: document.documentElement.scrollWidth, inner: window.innerWidth,
  colours: [...document.querySelectorAll("canvas")].map((c) => {
    const d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data, s = new Set();
    for (let k = 0; k < d.length; k += 4 * 97) s.add(d[k] << 16 | d[k + 1] << 8 | d[k + 2]);
    return s.size; }),
  others: performance.getEntriesByType("resource").map((e) => e.name).filter((n) => !n.startsWith(location.origin)),
})"""


@pytest.mark.parametrize("size", others_long([(390, 844), (1400, 1150)]), ids=["phone", "desk"])
def test_the_page_draws_everything_in_a_browser(site, tab, size):
    with tab.sized(*size):
        tab.open(site.url)
        touching = "window.drawn > 5 && document.querySelectorAll('.lamp.touch').length > 0"
        reported = json.loads(tab.until(touching, LOOK))
        image = cv2.imdecode(np.frombuffer(tab.picture(), np.uint8), cv2.IMREAD_COLOR)
    assert reported["endcaps"] == 3 and reported["lamps"] >= 1 and reported["others"] == []
    assert len(reported["colours"]) == 10 and min(reported["colours"]) > 3  # picture, scene, dome, plots are not blank
    assert f"{dots()} of {dots()}" in reported["health"] and reported["wide"] <= reported["inner"]
    assert image.shape[:2] == (size[1], size[0]) and len(np.unique(image.reshape(-1, 3)[::53], axis=0)) > 100
