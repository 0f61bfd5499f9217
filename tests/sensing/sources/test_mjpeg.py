"""MJPEG over HTTP on loopback: length or none, passwords, streams that never end a picture."""

import base64
import hashlib
import http.server
import io
import re
import threading
import time

import cv2
import numpy as np
import pytest
from made_jpeg import jpeg

from cad.errors import ParameterError
from sensing.sources.choose import open_frames
from sensing.sources.mjpeg import MjpegSource, split_jpegs
from sensing.sources.newest import SourceError


class Stream(http.server.BaseHTTPRequestHandler):
    with_length = True

    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=b")
        self.end_headers()
        for level in (10, 90, 170):
            data = jpeg(level)
            length = f"Content-Length: {len(data)}\r\n" if self.with_length else ""
            head = f"--b\r\nContent-Type: image/jpeg\r\n{length}\r\n"
            self.wfile.write(head.encode() + data + b"\r\n")

    def log_message(self, *_):
        pass


@pytest.mark.parametrize("with_length", [True, False])
def test_mjpeg_over_loopback(with_length):
    handler = type("Handler", (Stream,), {"with_length": with_length})
    server = http.server.HTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        got = []
        with pytest.raises(SourceError, match="the stream ended"):
            for frame in MjpegSource(f"http://127.0.0.1:{server.server_port}/"):
                got.append(cv2.imdecode(np.frombuffer(frame.jpeg, np.uint8), 0)[2, 2])
        assert np.abs(np.array(got, int) - [10, 90, 170]).max() < 12
    finally:
        server.shutdown()
        server.server_close()


class Steady(Stream):
    """A camera that sends 30 pictures in 1.5 s, each sent whole at its time."""

    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=b")
        self.end_headers()
        for level in range(30):
            data = jpeg(5 * level)
            head = f"--b\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
            self.wfile.write(head.encode() + data + b"\r\n")
            time.sleep(0.05)


def test_a_reader_that_pauses_gets_every_picture_with_the_time_at_which_it_came():
    """A recording pauses to make its reference: pictures that came meanwhile were paired with forces of 0.5 s later."""
    server = http.server.HTTPServer(("127.0.0.1", 0), Steady)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    came_s = []
    try:
        address = f"http://127.0.0.1:{server.server_port}/"
        with pytest.raises(SourceError, match="the stream ended"), open_frames(address) as frames:
            for frame in frames:
                came_s.append(frame.time_s)
                time.sleep(0.6 * (len(came_s) == 5))
    finally:
        server.shutdown()
        server.server_close()
    assert len(came_s) == 30 and np.diff(came_s).max() < 0.3


class Locked(Stream):
    """A camera with user and password: ``scheme`` is Basic or Digest."""

    scheme, user, password = "Basic", "a user", "p@ss/w:rd"

    def do_GET(self):
        asked = {"Basic": 'Basic realm="camera"', "Digest": 'Digest realm="camera", nonce="n0", qop="auth"'}
        if not self.allowed(self.headers.get("Authorization", "")):
            self.send_response(401)
            self.send_header("WWW-Authenticate", asked[self.scheme])
            self.end_headers()
            return
        super().do_GET()

    def allowed(self, given: str) -> bool:
        if self.scheme == "Basic":
            return given == "Basic " + base64.b64encode(f"{self.user}:{self.password}".encode()).decode()
        said = dict(re.findall(r'(\w+)="?([^",]+)"?', given.removeprefix("Digest ")))
        md5 = lambda *words: hashlib.md5(":".join(words).encode()).hexdigest()  # noqa: E731
        secret, asked = md5(self.user, "camera", self.password), md5("GET", self.path)
        return given.startswith("Digest ") and said["response"] == md5(
            secret, "n0", said["nc"], said["cnonce"], "auth", asked
        )


@pytest.mark.parametrize("scheme", ["Basic", "Digest"])
def test_user_and_password_open_a_camera_and_are_never_shown(scheme):
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), type("Handler", (Locked,), {"scheme": scheme}))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    place = f"127.0.0.1:{server.server_port}/stream?a=b"
    try:
        found = []
        with pytest.raises(SourceError, match="the stream ended") as ended:
            for frame in MjpegSource(f"http://a%20user:p%40ss%2Fw%3Ard@{place}"):
                found.append(frame)
        assert len(found) == 3 and {frame.source for frame in found} == {f"http://***@{place}"}
        assert "user" not in str(ended.value)
        for wrong in (f"http://a%20user:guess@{place}", f"http://{place}"):
            with pytest.raises(SourceError, match="USER:PASSWORD@HOST") as refused:
                list(MjpegSource(wrong))
            assert "guess" not in str(refused.value)
    finally:
        server.shutdown()
        server.server_close()


def parts(*pictures):
    """A stream of pictures without their lengths."""
    return io.BytesIO(b"".join(b"--b\r\nContent-Type: image/jpeg\r\n\r\n" + data + b"\r\n" for data in pictures))


def test_a_thumbnail_in_a_picture_does_not_end_it():
    whole = jpeg(90)
    segment = b"Exif\0\0" + jpeg(10) + b"\n" * 300  # of more than one line, as all of a JPEG may be
    data = whole[:2] + b"\xff\xe1" + (len(segment) + 2).to_bytes(2, "big") + segment + whole[2:]
    assert [found[: len(data)] for found in split_jpegs(parts(data, data))] == [data, data]
    assert [found[:4] for found in split_jpegs(parts(b"\xff\xd8\xff\xd9", whole))] == [b"\xff\xd8\xff\xd9", whole[:4]]


def test_a_large_picture_without_a_length_is_searched_once():
    """Searched anew from its last 64 kB with every line, one of 640 x 480 took longer than its 33 ms."""
    head = jpeg(90)[:-2]
    data = head + b"\x10" * 60 + b"\n" * 20_000 + (b"\x11" * 250 + b"\n") * 4000 + b"\xff\xd9"
    begin_s = time.thread_time()
    (found,) = split_jpegs(parts(data))
    assert found[: len(data)] == data and time.thread_time() - begin_s < 0.3


def test_stream_that_never_ends_a_picture_is_refused():
    class Endless:
        def readline(self, size):
            return b"\xff\xd8" + b"x" * (size - 2)

    with pytest.raises(ValueError, match="no end of picture"):
        list(split_jpegs(Endless()))


def test_dead_address_is_said():
    with pytest.raises(SourceError, match="check address"):
        list(MjpegSource("http://127.0.0.1:9/", timeout_s=1))
    for address in ("file:///etc/passwd", "http://[::1"):
        with pytest.raises(ParameterError, match="give an http address"):
            MjpegSource(address)
