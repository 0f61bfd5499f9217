"""Who may see the page and what it gives away: loopback, token, other pages, paths."""

import asyncio
import json
import os
import re
import urllib.error
import urllib.parse
import urllib.request
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from live_site import Site, fetch, talk
from websockets.exceptions import InvalidStatus

from sensing.live.web.access import page_address, page_token, qr_code
from sensing.live.web.process import MOST_VIEWERS, build_app


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    with Site(tmp_path_factory.mktemp("page")) as running:
        yield running


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


def test_viewers_who_come_at_once_are_counted_before_one_waits():
    """Accepting is waited for: whoever came meanwhile found the same count."""
    run = SimpleNamespace(token="", endcaps=1, hello="{}")
    app, accepted, go_on = build_app(run, 8008), [], asyncio.Event()
    scope = {
        "type": "websocket", "path": "/ws", "headers": [(b"host", b"127.0.0.1:8008")], "query_string": b"",
        "subprotocols": [], "state": {}, "app": app,
    }  # fmt: skip

    async def viewer():
        events = iter(("websocket.connect", "websocket.disconnect"))

        async def receive():
            return {"type": next(events), "code": 1001}

        async def send(message):
            if message["type"] == "websocket.accept":
                accepted.append(1)
                await go_on.wait()

        await app(scope, receive, send)

    async def all_at_once():
        come = [asyncio.create_task(viewer()) for _ in range(MOST_VIEWERS + 4)]
        await asyncio.sleep(0.1)
        go_on.set()
        await asyncio.gather(*come)

    asyncio.run(all_at_once())
    assert len(accepted) == MOST_VIEWERS
