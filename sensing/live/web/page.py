"""The page of a run: a web server in a process of its own, on loopback by default, that can never hold the loop up.

The page's process (:mod:`sensing.live.web.process`) asks for the newest state while somebody looks, one thread here
answers; nothing is made for nobody, and however many look, it is made once. What comes back from there is a word of
:data:`sensing.live.web.link.WORDS`, numbers within limits, and the text of a note: none reaches a file name. On another
address than loopback a token is needed. Everything the page needs is served from there: it works without any other
network.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2

from cad.errors import EndcapError, ParameterError
from sensing.decode import decode_bgr
from sensing.live.core.preview import Preview
from sensing.live.core.seen import Pictures
from sensing.live.outputs.mcap.recording import Recording
from sensing.live.web.access import page_address, page_token
from sensing.live.web.link import (
    DETAIL,
    FILES,
    HELLO,
    LONGEST_LINE,
    PICTURE,
    STATE,
    Press,
    is_fresh,
    is_loopback,
    message,
    parse_line,
)
from sensing.live.web.state import detail, hello, state
from sensing.records import Frame

if TYPE_CHECKING:
    from sensing.live.playback import Playback
    from sensing.live.run import LiveRun

ROOT = Path(__file__).resolve().parents[3]  # where the package lies


class PageServer:
    """Serves the page of a run.

    Args:
        run: what is shown.
        recording: what the button works on.
        host: address to listen on.
        port: None for 8008 or, where that is taken, any free one.

    Attributes:
        url: to open in a browser; holds the token where one is needed.
        address: host and port.
        pid: of the page's process, None before the start.

    Raises:
        ParameterError: no such address, or the port is taken.
    """

    def __init__(self, run: LiveRun, recording: Recording, host: str = "127.0.0.1", port: int | None = None) -> None:
        self._run, self._recording = run, recording
        self.token = "" if is_loopback(host) else page_token()
        self._socket = listen(host, port)
        self.address: tuple[str, int] = self._socket.getsockname()[:2]
        self.url = page_address(host, self.address[1], self.token)
        self._link, self._theirs = socket.socketpair()
        self._process: subprocess.Popen[bytes] | None = None
        self._sent: dict[int, tuple[str, int]] = {}
        self._files = 0  # recordings that the page's process has been sent
        self._previews = [Preview(endcap.params) for endcap in run.config.endcaps]
        self._thread = threading.Thread(target=self._talk, daemon=True)
        self._closing, self._failed = False, ""

    @property
    def pid(self) -> int | None:
        """Of the page's process."""
        return None if self._process is None else self._process.pid

    @property
    def note(self) -> str:
        """Why there is no page any more; empty while there is."""
        return f"page: gone ({self._failed}); the run goes on" if self._failed and not self._closing else ""

    def start(self) -> None:
        """Begin to serve."""
        numbers = (self._socket.fileno(), self._theirs.fileno())
        path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
        self._process = subprocess.Popen(
            [sys.executable, "-m", "sensing.live.web.process", *map(str, numbers)], pass_fds=numbers,
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, env=os.environ | {"PYTHONPATH": path},
            start_new_session=True,  # Ctrl-C is for the run, which then ends the page
        )  # fmt: skip
        self._socket.close()
        self._theirs.close()
        self._thread.start()

    def close(self, wait_s: float = 3.0) -> None:
        """Stop serving; a process that has not ended after ``wait_s`` is killed."""
        self._closing = True
        if self._process is not None:
            end_s = time.monotonic() + wait_s
            with contextlib.suppress(OSError):  # it has gone already
                self._link.shutdown(socket.SHUT_RDWR)
            self._thread.join(timeout=wait_s)
            try:
                self._process.wait(timeout=max(0.0, end_s - time.monotonic()))
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        for each in (self._link, self._theirs, self._socket):
            each.close()

    def _talk(self) -> None:
        """Answers the page's process until the link ends."""
        endcaps = len(self._run.config.endcaps)
        try:
            self._link.sendall(message(HELLO, json.dumps(hello(self._run) | {"token": self.token}).encode(), endcaps))
            with self._link.makefile("rb") as lines:
                while line := lines.readline(LONGEST_LINE):
                    request = parse_line(line, endcaps)
                    if isinstance(request, Press):
                        self._press(request)
                    elif request is not None:
                        self._show_all(request)
            self._failed = "its process ended"
        except Exception as error:  # a failure of the page must not end the run
            self._failed = f"{type(error).__name__}: {error}"

    def _show_all(self, numbers: list[int]) -> None:
        """Answer a look."""
        for number in numbers:
            self._show(number)
        files = [str(path.resolve()) for path in self._recording.files]
        if len(files) != self._files:
            self._files = len(files)
            self._link.sendall(message(FILES, json.dumps(files).encode()))
        self._link.sendall(message(STATE, _plain(state(self._run, self._recording))))

    def _press(self, press: Press) -> None:
        """Carry out a pressed button, if the viewer's picture was recent."""
        name, playback = self._run.config.endcaps[press.endcap].name, self._run.playback
        if not is_fresh(press.seen_ms, time.monotonic()):
            return
        if press.word in ("zero", "zero_confirmed"):
            self._run.zero(name, press.word == "zero_confirmed")
        elif press.word == "zero_all":
            self._run.zero()
        elif press.word == "undo":
            self._run.undo_zero(name)
        elif press.word == "note":
            self._recording.add_note(press.text)
        elif press.word == "record_start":
            self._switch(True, list(Pictures)[press.value])
        elif press.word == "record_stop":
            self._switch(False)
        elif playback is not None:
            _steer(playback, press)

    def _switch(self, *asked: bool | Pictures) -> None:
        """Start or stop the recording in a thread of its own: a disk may take its time, and the page goes on."""
        threading.Thread(target=self._recording.switch, args=asked, daemon=True).start()

    def _show(self, number: int) -> None:
        """Details of an endcap, and its picture if that is new; without a valid reading, the newest frame."""
        endcap = self._run.engine.endcaps[number]
        reading, frame = self._run.latest.get(endcap.name), endcap.frame
        now = endcap.machine.condition.valid or (reading is not None and reading.frame is frame)
        if reading is not None and reading.valid and reading.tracks is not None and now:
            frame, shown = reading.frame, detail(reading, number)
        elif frame is None or (frame.jpeg is None and frame.image is None):
            return
        else:
            shown = self._previews[number].detail(frame, number)
        self._link.sendall(message(DETAIL, _plain(shown), number))
        version = (frame.source, frame.sequence)
        if self._sent.get(number) != version:
            self._sent[number] = version
            self._link.sendall(message(PICTURE, picture(frame), number))


def _steer(playback: Playback, press: Press) -> None:
    """A button of the replay."""
    if press.word == "replay_pause":
        playback.pause(bool(press.value))
    elif press.word == "replay_loop":
        playback.loop(bool(press.value))
    elif press.word == "replay_seek":
        playback.seek(press.value / 1e3)
    elif press.word == "replay_speed":
        playback.pace(press.value / 1e3)


def picture(frame: Frame) -> bytes:
    """JPEG of a frame: as it came, or made for those that came raw; empty for one that cannot be shown."""
    if frame.fault:  # its bytes say why
        return b""
    if frame.jpeg is not None:
        return frame.jpeg
    if frame.image is None:  # a recording of dots alone
        return b""
    try:
        return cv2.imencode(".jpg", decode_bgr(frame), [cv2.IMWRITE_JPEG_QUALITY, 75])[1].tobytes()
    except EndcapError:
        return b""


def _plain(reported: dict[str, Any]) -> bytes:
    return json.dumps(reported, allow_nan=False, separators=(",", ":")).encode()


def listen(host: str, port: int | None) -> socket.socket:
    """A listening socket; without a port 8008 or, where that is taken, any free one.

    Raises:
        ParameterError: no such address, or the port is taken.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, 8008 if port is None else port), family=family)
    except (OSError, OverflowError, UnicodeError) as error:
        if port is None:
            return listen(host, 0)
        raise ParameterError(
            f"port {port} of {host}: {error}: choose another port, or leave --port out", name="port", value=port
        ) from None
