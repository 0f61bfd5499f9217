"""What the fuzzers begin with: pictures of a drawn dome, a reference, a recording, cameras that behave badly."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from sensing.live.cli import main
from sensing.live.core.warm_up import warm_up
from sensing.live.demo.scene_server import mjpeg_server
from sensing.records import Frame
from sensing.sources.drawn import Drawing, draw_dots
from sensing.sources.warp import Bump, Displacement, warp_image
from sensing.tracking.zero import save_zero, single_zero

SHARES = (0.0,) * 12 + (0.5, 1.0, 1.0, 0.5)  # of the push, picture by picture
PUSH = Displacement(bumps=(Bump((330.0, 230.0), (3.0, 2.0), 90.0),))
RATE_HZ = 30.0


def prepare() -> None:
    """Load and compile what every case needs, without leaving a thread behind (a fork would lose it)."""
    cv2.setNumThreads(1)
    warm_up(print)


def pictures() -> list[bytes]:
    """JPEGs; no two are equal."""
    rest, _ = draw_dots(Drawing())
    warped = {share: warp_image(rest, PUSH.scaled(share)) if share else rest for share in set(SHARES)}
    found = []
    for number, share in enumerate(SHARES):
        picture = warped[share].copy()
        picture[-4:, : 1 + number] ^= 8  # a corner without dots
        found.append(cv2.imencode(".jpg", picture)[1].tobytes())
    return found


def write_inputs(folder: Path, count: int = len(SHARES)) -> None:
    """``photos/`` of so many pictures, ``zero.npz`` and ``run.mcap`` in a folder."""
    (folder / "photos").mkdir()
    jpegs = pictures()[-count:]
    for number, jpeg in enumerate(jpegs):
        (folder / "photos" / f"{number:02d}.jpg").write_bytes(jpeg)
    save_zero(single_zero(Frame(0.0, 0, "drawn", jpeg=jpegs[0])), folder / "zero.npz")
    arguments = ["--photos", str(folder / "photos"), "--no-page", "--speed", "0", "--rate", "30"]
    assert main([*arguments, "--record", str(folder / "run.mcap")]) == 0


@contextlib.contextmanager
def cameras() -> Iterator[dict[str, str]]:
    """Addresses of cameras in a process of their own: ``good``, ``silent`` (never answers), ``slow`` (drips)."""
    ours, theirs = socket.socketpair()
    pid = os.fork()
    if pid == 0:
        ours.close()
        _serve(theirs)
        os._exit(0)
    theirs.close()
    ports = np.frombuffer(ours.recv(12), ">i4")
    try:
        yield {name: f"http://127.0.0.1:{port}/0" for name, port in zip(("good", "silent", "slow"), ports, strict=True)}
    finally:
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        ours.close()


def _serve(link: socket.socket) -> None:
    jpegs = pictures()

    def film() -> Iterator[Frame]:
        for number in range(1 << 30):
            time.sleep(1 / RATE_HZ)
            yield Frame(time.monotonic(), number, "drawn", jpeg=jpegs[number % len(jpegs)])

    good = mjpeg_server(0, lambda _: film())
    threading.Thread(target=good.serve_forever, daemon=True).start()
    silent, slow = (socket.create_server(("127.0.0.1", 0), backlog=1000) for _ in range(2))
    threading.Thread(target=_drip, args=(slow,), daemon=True).start()
    link.sendall(np.array([good.server_port, silent.getsockname()[1], slow.getsockname()[1]], ">i4").tobytes())
    link.recv(1)


def _drip(server: socket.socket) -> None:
    """A stream that gives a byte now and then."""
    held: list[socket.socket] = []
    server.settimeout(0.2)
    head = b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=x\r\n\r\n"
    while True:
        with contextlib.suppress(TimeoutError):
            held.append(server.accept()[0])
            held[-1].sendall(head)
        for each in held:
            with contextlib.suppress(OSError):
                each.sendall(b"x")
