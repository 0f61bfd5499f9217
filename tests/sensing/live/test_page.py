import asyncio
import contextlib
import itertools
import json
import os
import random
import re
import signal
import socket
import time
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path

import cv2
import numpy as np
import pytest
from live_stand_in import PATIENCE_S, dots, endless, film, pipeline, wait_for
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from cad.errors import ParameterError
from sensing.live.core.config import EndcapConfig, LiveConfig
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import CameraFeed
from sensing.live.outputs.recording import Recording
from sensing.live.run import LiveRun
from sensing.live.web.access import page_address, page_token, qr_code
from sensing.live.web.link import LONGEST_LINE, Press, is_fresh, parse_line, parse_request
from sensing.live.web.page import PageServer

ROOT = Path(__file__).resolve().parents[3]
STATIC = ROOT / "sensing/live/web/static"


class Site:
    """A running page with what is behind it."""

    def __init__(self, folder: Path, host: str = "127.0.0.1") -> None:
        pose = np.eye(4)
        endcaps = []
        for k in range(3):
            pose[:3, 3] = 250 * np.cos(2.1 * k), 250 * np.sin(2.1 * k), 0
            endcaps.append(EndcapConfig(f"endcap_{k}", "test", T_robot_endcap=pose))
        pictures = film([0] * 4 + [0.5, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.5])
        live = [LiveEndcap(CameraFeed(endless(pictures, 20)), pipeline(f"endcap_{k}", k)) for k in range(3)]
        self.run = LiveRun(LiveConfig(tuple(endcaps), weight_n=30.0), live)
        self.recording = Recording(self.run, folder)
        self.server = PageServer(self.run, self.recording, host, 0)
        self.url = self.server.url
        self.folder = folder

    def __enter__(self):
        self.run.engine.__enter__()
        self.server.start()
        wait_for(lambda: len(self.run.latest.all()) == 3)
        return self

    def __exit__(self, *_):
        self.server.close()
        self.recording.stop()
        self.run.engine.close()


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    with Site(tmp_path_factory.mktemp("page")) as running:
        yield running


def fetch(url: str, **headers: str) -> tuple[int, bytes]:
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=PATIENCE_S) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


def press(word: str, endcap: int = 0) -> str:
    """A viewer's message for a button, pressed on the state of this moment."""
    return json.dumps({"do": word, "endcap": endcap, "seen": int(1e3 * time.monotonic())})


def talk(site: Site, *messages: str, **options) -> list:
    """Answers to messages: a text and, if there is a new picture, bytes, each."""

    async def go():
        got = []
        async with connect(site.url.replace("http", "ws", 1) + "ws", **options) as websocket:
            got.append(json.loads(await websocket.recv()))
            for message in messages:
                await websocket.send(message)
                got.append(await asyncio.wait_for(websocket.recv(), PATIENCE_S))
        return got

    return asyncio.run(go())


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
    wait_for(lambda: talk(site, press("record_start"), press("record_start")) and site.recording.on)
    talk(site, press("record_start"))  # explicit: again is no stop
    recorder = site.recording._recorder
    wait_for(lambda: recorder.frames > 5)
    assert site.recording._recorder is recorder
    wait_for(lambda: talk(site, press("record_stop")) and not site.recording.on)
    assert len(list(site.folder.glob("endcap_*.mcap"))) == 1
    wait_for(
        lambda: talk(site, press("zero_confirmed", 2)) and site.run.engine.endcaps[2].pipeline.zero.digest != epoch
    )


def test_a_button_acts_on_what_was_seen_lately_and_never_on_what_is_old():
    for age_s, fresh in ((0.0, True), (1.9, True), (2.1, False), (60.0, False), (-1.0, False)):
        assert is_fresh(int(1e3 * (500.0 - age_s)), 500.0) is fresh, age_s


def test_the_page_needs_nothing_but_this_server():
    text = "".join(path.read_text() for path in STATIC.iterdir())
    assert set(re.findall(r"""(?:https?|wss?)://[\w./]+|//cdn|@import|url\(""", text)) == {"http://www.w3.org/2000/svg"}
    named = set(re.findall(r'(?:src|href)="([^"]+)"', text))
    assert named == {path.name for path in STATIC.iterdir()} - {"index.html"}


# --- who may see it --------------------------------------------------------------------------------------------
def test_it_binds_to_loopback_and_answers_only_to_its_own_names(site):
    port = int(site.url.split(":")[2].strip("/"))
    assert site.server.address[0] == "127.0.0.1"
    assert fetch(site.url)[0] == 200 and fetch(site.url, Host=f"localhost:{port}")[0] == 200
    for host in ("evil.example", f"evil.example:{port}", "127.0.0.1.evil.example", "", "[::1", "10.0.0.7"):
        status, _ = fetch(site.url + "state.json", Host=host)
        assert status in (400, 403), host  # a page of another name that points here (DNS rebinding)
    with pytest.raises(InvalidStatus):
        talk(site, origin="http://evil.example")
    talk(site, origin=site.url.strip("/"))


@pytest.fixture
def own_settings(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    return tmp_path / "config" / "endcap-toolkit" / "page_token"


def test_on_another_address_it_wants_the_token(tmp_path, own_settings):
    with Site(tmp_path, "0.0.0.0") as open_site:
        port = open_site.server.address[1]
        base, token = f"http://127.0.0.1:{port}/", open_site.server.token
        assert len(token) >= 20 and open_site.url.endswith(f":{port}/?token={token}")
        for path in (
            "",
            "page.js",
            "state.json",
            "domes.json",
            "recording/0",
            "?token=",
            f"?token={token[:-1]}",
            "state.json?token=ä",
        ):
            assert fetch(base + urllib.parse.quote(path, safe="?=&/"))[0] == 403, path
        status, _ = fetch(f"{base}?token={token}")
        cookie = {"Cookie": f"endcap_token_{port}={token}"}
        assert status == 200 and fetch(base + "state.json", **cookie)[0] == 200
        assert fetch(base + "state.json", Cookie=f"endcap_token_{port + 1}={token}")[0] == 403  # another run's
        status, reported = fetch(base + "?token=wrong")
        assert b"<h1>This page is locked</h1>" in reported and b"is not that of the run" in reported
        assert b"has no token" in fetch(base)[1] and b"QR code" in fetch(base)[1]
        open_site.url = base
        with pytest.raises(InvalidStatus):
            talk(open_site)
        talk(open_site, additional_headers=cookie)


def test_the_token_stays_and_is_for_its_owner_alone(own_settings):
    token = page_token()
    assert own_settings.stat().st_mode & 0o777 == 0o600 and own_settings.read_text().strip() == token
    assert page_token() == token
    own_settings.chmod(0o644)  # others have read it
    assert page_token() != token and own_settings.stat().st_mode & 0o777 == 0o600
    for content in ("", "short", "x" * 500, "\x1b[2J" * 9):
        own_settings.write_text(content)
        token = page_token()
        assert re.fullmatch(r"[\w-]{22,}", token) and page_token() == token
    own_settings.unlink()
    os.mkfifo(own_settings, 0o600)  # nothing waits for it
    assert len(page_token()) >= 22
    assert [path.name for path in own_settings.parent.iterdir()] == ["page_token"]


def test_the_printed_address_can_be_reached_from_another_device_and_its_code_read():
    shown = urllib.parse.urlsplit(page_address("0.0.0.0", 8008, "t" * 22)).hostname
    assert shown not in ("0.0.0.0", "127.0.0.1", "localhost", None)
    assert page_address("::1", 80, "") == "http://[::1]:80/"
    address = page_address("192.168.1.23", 8008, "AbCdEfGhIjKlMnOpQrStUv")
    lines = [re.sub(r"\x1b\[[\d;]*m", "", line) for line in qr_code(address).splitlines()]
    upper = np.array([[c in "█▀" for c in line] for line in lines])
    lower = np.array([[c in "█▄" for c in line] for line in lines])
    picture = np.stack([upper, lower], axis=1).reshape(-1, len(lines[0])).astype(np.uint8) * 255
    picture = np.kron(picture, np.ones((8, 8), np.uint8))
    assert cv2.QRCodeDetector().detectAndDecode(picture)[0] == address


def test_no_other_page_can_frame_this_one(site):
    with urllib.request.urlopen(site.url) as answer:
        assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]
        assert answer.headers["X-Frame-Options"] == "DENY"


def test_curves_and_recordings_are_for_this_page_alone_and_recordings_have_numbers(site):
    status, answer = fetch(site.url + "domes.json")
    curves = json.loads(answer)
    assert status == 200 and [len(found) for found in curves] == [3, 3, 3]
    for curve in curves[0]:
        for name in ("force_n", "depth_mm", "patch_mm2"):
            assert curve[name][0] == 0 and len(curve[name]) > 5 and (np.diff(curve[name]) >= 0).all(), name
    for path in ("domes.json", "state.json", "recording/0"):
        assert fetch(site.url + path, Origin="http://evil.example")[0] == 403, path
    for path in ("recording/99", "recording/-1", "recording/x", "recording/0/../../page.py", "recording/"):
        assert fetch(site.url + path)[0] == 404, path


def test_no_path_reaches_a_file(site):
    for path in (
        "page.py", "../page.py", "%2e%2e/page.py", "static/page.js", "page.js/../../page.py", "..%2f..%2fetc/passwd",
        "//etc/passwd", "etc/passwd", "page.js%00", "index.html", "state.json/x", "?file=/etc/passwd",
    ):  # fmt: skip
        status, body = fetch(site.url + path)
        assert status in (400, 403, 404) or (path.startswith("?") and b"<title>Endcaps" in body), path
        assert b"root:" not in body and b"def build_app" not in body


# --- fuzz ------------------------------------------------------------------------------------------------------
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
    with pytest.raises(ParameterError, match=f"--port {port}"):
        PageServer(site.run, site.recording, "127.0.0.1", port)
    with pytest.raises(ParameterError, match="--host nowhere"):
        PageServer(site.run, site.recording, "nowhere.invalid", 0)


# --- for a while -----------------------------------------------------------------------------------------------
def memory_mb() -> float:
    status = Path("/proc/self/status").read_text()
    return int(re.search(r"VmRSS:\s+(\d+)", status)[1]) / 1024


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


@pytest.mark.parametrize("size", [(1400, 1150), (390, 844)], ids=["desk", "phone"])
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
