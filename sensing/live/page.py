"""The page: a small web server of its own thread, on loopback unless told, that looks at the run and never holds it up.

The browser asks, the server answers with the newest state: a viewer that is slow or gone costs nothing. What comes from
the network selects a cap by number or presses one of two buttons; no word of it reaches a file name. On another address
than loopback a token is needed. Everything the page needs is served from here: it works without any other network.
"""

from __future__ import annotations

import asyncio
import importlib.resources
import ipaddress
import json
import secrets
import socket
import threading
import time
from typing import Any
from urllib.parse import urlsplit

import cv2
import uvicorn
from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from cad.errors import ParameterError
from sensing.decode import decode_bgr
from sensing.live.page_state import hello, state
from sensing.live.reading import CapReading
from sensing.live.recording import Recording
from sensing.live.run import LiveRun

MOST_VIEWERS = 8
FASTEST_S = 0.04  # between answers to one viewer
MESSAGE_BYTES = 1024  # largest message from a viewer
COOKIE = "endcap_token"
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob:; style-src 'self' 'unsafe-inline'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
STATIC = {
    "/": ("index.html", "text/html"),
    "/page.js": ("page.js", "text/javascript"),
    "/scene.js": ("scene.js", "text/javascript"),
}


class PageServer:
    """Serves the page of a run.

    Args:
        run: what is shown. recording: what the button works on. host: address to listen on. port: None for 8008 or,
            where that is taken, any free one.

    Attributes:
        url: to open in a browser; holds the token where one is needed.

    Raises:
        ParameterError: no such address, or the port is taken.
    """

    def __init__(self, run: LiveRun, recording: Recording, host: str = "127.0.0.1", port: int | None = None) -> None:
        self.token = "" if _is_loopback(host) else secrets.token_urlsafe(16)
        self._socket = _listen(host, port)
        every = host in ("0.0.0.0", "::")  # what another computer types is this one's name
        shown = socket.gethostname() if every else f"[{host}]" if ":" in host else host
        self.url = f"http://{shown}:{self._socket.getsockname()[1]}/" + (f"?token={self.token}" if self.token else "")
        config = uvicorn.Config(
            build_app(run, recording, self.token), log_level="critical", ws_max_size=MESSAGE_BYTES, lifespan="off",
            timeout_graceful_shutdown=1, server_header=False, ws_max_queue=4, limit_concurrency=64,
        )  # fmt: skip
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._server.run, args=([self._socket],), daemon=True)

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def close(self) -> None:
        """Stop serving."""
        self._server.should_exit = True
        self._thread.join(timeout=3.0)
        self._socket.close()


def build_app(run: LiveRun, recording: Recording, token: str = "") -> Starlette:
    """The application; ``token`` empty for loopback."""
    viewers = _Viewers()

    async def file(request: Request) -> Response:
        refusal = _refusal(request, token)
        if refusal:
            return PlainTextResponse(refusal, 403, HEADERS)
        name, kind = STATIC[request.url.path]
        text = importlib.resources.files("sensing.live").joinpath("static", name).read_text("utf-8")
        response = Response(text, media_type=kind, headers=HEADERS)
        if token:
            response.set_cookie(COOKIE, token, httponly=True, samesite="strict")
        return response

    async def told(request: Request) -> Response:
        refusal = _refusal(request, token)
        if refusal:
            return PlainTextResponse(refusal, 403, HEADERS)
        return JSONResponse(state(run, 0, recording.note, recording.on), headers=HEADERS)

    async def socket_(websocket: WebSocket) -> None:
        if _refusal(websocket, token) or not _same_origin(websocket) or viewers.count >= MOST_VIEWERS:
            await websocket.close(1008)
            return
        await websocket.accept()
        viewers.count += 1
        try:
            await _serve(websocket, run, recording)
        except (WebSocketDisconnect, RuntimeError):  # RuntimeError: it went away while being answered
            pass
        finally:
            viewers.count -= 1

    routes: list[Any] = [Route(path, file) for path in STATIC]
    return Starlette(routes=[*routes, Route("/state.json", told), WebSocketRoute("/ws", socket_)])


class _Viewers:
    count = 0


async def _serve(websocket: WebSocket, run: LiveRun, recording: Recording) -> None:
    """Answers one viewer until it leaves or says something that is no request."""
    await websocket.send_text(json.dumps(hello(run)))
    seen, last_s = (-1, -1, -1), 0.0
    while True:
        request = parse_request(await websocket.receive_text(), len(run.config.caps))
        if request is None:
            await websocket.close(1003)
            return
        if request[0] == "zero":
            run.zero(run.config.caps[request[1]].name)
        elif request[0] == "zero_all":
            run.zero()
        elif request[0] == "record":
            await asyncio.to_thread(recording.toggle)
        await asyncio.sleep(max(0.0, last_s + FASTEST_S - time.monotonic()))
        last_s = time.monotonic()
        told = state(run, request[1], recording.note, recording.on)
        await websocket.send_text(json.dumps(told, allow_nan=False, separators=(",", ":")))
        reading = run.latest.get(run.config.caps[request[1]].name)
        if reading is not None:
            now = (request[1], reading.epoch, reading.frame.sequence)
            if now != seen:
                seen = now
                await websocket.send_bytes(picture(reading))


def parse_request(text: str, caps: int) -> tuple[str, int] | None:
    """(what to do, number of the cap) from a viewer's message; None for anything that is no request."""
    try:
        told = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(told, dict) or set(told) - {"do", "cap"}:
        return None
    what, cap = told.get("do"), told.get("cap", 0)
    if what not in ("show", "zero", "zero_all", "record") or type(cap) is not int or not 0 <= cap < caps:
        return None
    return what, cap


def picture(reading: CapReading) -> bytes:
    """JPEG of the frame: as it came, or made for those that came raw."""
    if reading.frame.jpeg is not None:
        return reading.frame.jpeg
    return cv2.imencode(".jpg", decode_bgr(reading.frame), [cv2.IMWRITE_JPEG_QUALITY, 75])[1].tobytes()


def _refusal(connection: HTTPConnection, token: str) -> str:
    """Why a request is refused; empty if it is not."""
    if token:
        given = connection.query_params.get("token") or connection.cookies.get(COOKIE) or ""
        if not secrets.compare_digest(given.encode(), token.encode()):
            return "the address with its token is printed where sensing.live was started"
        return ""
    host = _host(connection.headers.get("host", ""))
    return "" if host == "localhost" or _is_loopback(host) else "this page is for the computer that it runs on"


def _same_origin(connection: HTTPConnection) -> bool:
    """Pages of other sites may not talk to this one through a viewer's browser."""
    origin = connection.headers.get("origin")
    return origin is None or urlsplit(origin).netloc == connection.headers.get("host", "")


def _host(netloc: str) -> str:
    try:
        return urlsplit(f"//{netloc}").hostname or ""
    except ValueError:
        return ""


def _is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _listen(host: str, port: int | None) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, 8008 if port is None else port), family=family)
    except (OSError, OverflowError, UnicodeError) as error:
        if port is None:
            return _listen(host, 0)
        raise ParameterError(
            f"--host {host} --port {port}: {error}: choose another port, or leave --port out", name="port", value=port
        ) from None
