"""Streams that drip or break, over HTTP, as the running program reports them."""

import contextlib
import itertools
import json
import signal
import threading
import time
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from live_program import program
from live_stand_in import PATIENCE_S, film, wait_for

HEAD = b"--x\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n"
Answer = Callable[[int, BaseHTTPRequestHandler], None]


@contextlib.contextmanager
def served(answer: Answer) -> Iterator[str]:
    """Address of a server; ``answer`` gets the number of each connection."""
    numbers = itertools.count()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            with contextlib.suppress(OSError):
                answer(next(numbers), self)

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/"
    finally:
        server.shutdown()
        server.server_close()


def begin(handler: BaseHTTPRequestHandler) -> None:
    handler.send_response(200)
    handler.send_header("Content-Type", "multipart/x-mixed-replace; boundary=x")
    handler.end_headers()


def send(handler: BaseHTTPRequestHandler, jpeg: bytes) -> None:
    handler.wfile.write(HEAD % len(jpeg) + jpeg + b"\r\n")
    time.sleep(1 / 30)


@contextlib.contextmanager
def read(address: str):
    """(process, its JSON lines so far, its other lines so far)."""
    lines, said = [], []
    with program("--url", address, "--json", "--no-page") as process:
        readers = [
            threading.Thread(target=lambda: lines.extend(map(json.loads, process.stdout)), daemon=True),
            threading.Thread(target=lambda: said.extend(process.stderr), daemon=True),
        ]
        for reader in readers:
            reader.start()
        yield process, lines, said
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE_S) == 0
        for reader in readers:
            reader.join(PATIENCE_S)


def test_a_stream_that_drips_is_silent_and_not_starting_for_ever():
    jpeg = film([0])[0]

    def drip(_, handler):
        begin(handler)
        handler.wfile.write(HEAD % len(jpeg))
        for place in range(len(jpeg) - 1):  # hours, and never whole
            handler.wfile.write(jpeg[place : place + 1])
            time.sleep(0.2)

    with served(drip) as address, read(address) as (_, lines, said):
        wait_for(lambda: lines)
        assert (lines[0]["state"], lines[0]["valid"], lines[0]["force_n"]) == ("silent", False, [None] * 3)
        assert "no whole picture in" in lines[0]["reason"]
    assert any("silent: no whole picture in" in line for line in said)


def test_a_stream_that_begins_to_drip_is_silent_and_comes_back():
    pictures, again = itertools.cycle(film([0] * 30)), threading.Event()

    def falter(_, handler):
        begin(handler)
        for number in itertools.count():
            jpeg = next(pictures)
            if number == 40:
                handler.wfile.write(HEAD % len(jpeg) + jpeg[:9])
                for place in range(9, len(jpeg)):
                    if not again.is_set():
                        time.sleep(0.1)
                    handler.wfile.write(jpeg[place : place + 1])
            else:
                send(handler, jpeg)

    with served(falter) as address, read(address) as (_, lines, said):
        wait_for(lambda: any(line["state"] == "silent" for line in lines))
        assert not any(line["valid"] for line in lines[-1:])
        again.set()
        wait_for(lambda: lines[-1]["state"] == "running")
    assert not any("reopened" in line for line in said)  # the stream was never broken


@pytest.mark.long
def test_reopened_counts_returns_not_attempts():
    pictures = itertools.cycle(film([0] * 30))
    refused = []

    def flap(number, handler):
        if number in (1, 2):
            refused.append(number)
            handler.send_error(503)
            return
        begin(handler)
        for _ in range(40) if number == 0 else itertools.count():
            send(handler, next(pictures))

    with served(flap) as address, read(address) as (_, lines, said):
        wait_for(lambda: len(refused) == 2)
        before = len(lines)
        wait_for(lambda: len(lines) > before + 20 and lines[-1]["state"] == "running")
    assert any(line["state"] == "unplugged" for line in lines)
    assert any(", reopened once" in line for line in said), said[-1]
