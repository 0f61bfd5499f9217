"""The page's process: serves the page and talks to its viewers, away from the loop's interpreter lock.

    python -m sensing.live.web.process LISTENING LINK      # inherited sockets, by number; see sensing.live.web.page

It knows nothing of the run but what comes over the link (:mod:`sensing.live.web.link`), and can ask for nothing but
what the buttons do. Recordings that have ended are handed out by their number; of files it opens no others. It ends
when the link does, whatever became of the run, and yields the processor to it.
"""

from __future__ import annotations

import asyncio
import contextlib
import importlib.resources
import json
import os
import secrets
import socket
import sys
from collections.abc import Awaitable, Callable
from urllib.parse import urlsplit

import uvicorn
from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, HTMLResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from sensing.live.web.domes import dome_curves
from sensing.live.web.link import DETAIL, FILES, HEAD, PICTURE, STATE, Press, is_loopback, parse_request

MOST_VIEWERS = 8
FASTEST_S = 0.04  # between looks at the run, of all viewers together
MESSAGE_BYTES = 4096  # largest message from a viewer
NICE = 5  # the loop has priority
COOKIE = "endcap_token_{}"  # a browser sends a cookie to all ports of a host
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob:; style-src 'self' 'unsafe-inline'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Frame-Options": "DENY",  # a click in another page must not press a button here
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
LOCKED = """\
<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>Endcaps: locked</title>
<style>body {{ font: 18px/1.5 system-ui, sans-serif; max-width: 34em; margin: 3em auto; padding: 1em; }}</style></head>
<body><h1>This page is locked</h1><p>{}</p></body></html>
"""
SCRIPTS = ("elements", "draw", "words", "plots", "scene", "dome", "picture", "recording", "health", "page")
STATIC = {
    "/": ("index.html", "text/html"),
    **{f"/{name}.css": (f"{name}.css", "text/css") for name in ("theme", "style")},
    "/favicon.svg": ("favicon.svg", "image/svg+xml"),
    **{f"/{name}.js": (f"{name}.js", "text/javascript") for name in SCRIPTS},
}


def main(arguments: list[str]) -> None:
    """Serve until the link ends."""
    listening, link = (socket.socket(fileno=int(number)) for number in arguments)
    if hasattr(os, "nice"):
        os.nice(NICE)
    asyncio.run(_serve(listening, link))


async def _serve(listening: socket.socket, link: socket.socket) -> None:
    run = Link(*await asyncio.open_connection(sock=link))
    await run.begin()
    config = uvicorn.Config(
        build_app(run, listening.getsockname()[1]), log_level="critical", ws_max_size=MESSAGE_BYTES, lifespan="off",
        timeout_graceful_shutdown=1, server_header=False, ws_max_queue=4, limit_concurrency=64,
    )  # fmt: skip
    server = uvicorn.Server(config)

    async def talk() -> None:
        with contextlib.suppress(asyncio.IncompleteReadError, OSError):
            await run.talk()
        server.should_exit = True

    talking = asyncio.create_task(talk())
    await server.serve(sockets=[listening])
    talking.cancel()


class Link:
    """The run as the page sees it.

    Attributes:
        hello: what every viewer gets first.
        token: it must know; empty for none.
        endcaps: their number.
        pictures: by endcap, (count of its changes, JPEG).
        files: recordings that have ended.
    """

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer
        self.hello, self.token, self.endcaps = "", "", 0
        self.pictures: dict[int, tuple[int, bytes]] = {}
        self.files: list[str] = []
        self.designs: list[tuple[float, float, str]] = []
        self._details: dict[int, str] = {}
        self._state = "{}"
        self._wanted: set[int] = set()
        self._asked, self._answered = asyncio.Event(), asyncio.Event()
        self._answer: asyncio.Future[None] = asyncio.get_running_loop().create_future()

    async def begin(self) -> None:
        """Hear what does not change."""
        _, self.endcaps, data = await self._receive()
        reported = json.loads(data)
        self.designs = [(each["diameter_mm"], each["wall_mm"], each["silicone"]) for each in reported["hello"]]
        self.token, self.hello = reported.pop("token"), json.dumps(reported)

    def ask(self, press: Press) -> None:
        """Press a button."""
        self._writer.write(press.line())

    async def look(self, endcap: int) -> str:
        """The newest state as JSON, with the details of one endcap; all viewers that wait get the same look."""
        self._wanted.add(endcap)
        self._asked.set()
        await asyncio.shield(self._answer)
        return f'{self._state[:-1]},"selected":{self._details.get(endcap, "null")}}}'

    async def talk(self) -> None:
        """Ask for looks and take what comes; raises asyncio.IncompleteReadError or OSError when the link ends."""
        asking = asyncio.create_task(self._ask_for_looks())
        try:
            while True:
                kind, endcap, data = await self._receive()
                if kind == STATE:
                    self._state = data.decode()
                    self._answered.set()
                elif kind == FILES:
                    self.files = json.loads(data)
                elif kind == DETAIL:
                    self._details[endcap] = data.decode()
                elif kind == PICTURE:
                    self.pictures[endcap] = self.pictures.get(endcap, (0, b""))[0] + 1, data
        finally:
            asking.cancel()

    async def _ask_for_looks(self) -> None:
        """One look at a time, and none while nobody wants it."""
        while True:
            await self._asked.wait()
            self._asked.clear()
            wanted, self._wanted = self._wanted, set()
            answer, self._answer = self._answer, asyncio.get_running_loop().create_future()
            self._answered.clear()
            self._writer.write(f"look {' '.join(map(str, sorted(wanted)))}\n".encode())
            await self._answered.wait()
            answer.set_result(None)
            await asyncio.sleep(FASTEST_S)

    async def _receive(self) -> tuple[bytes, int, bytes]:
        kind, endcap, length = HEAD.unpack(await self._reader.readexactly(HEAD.size))
        return kind, endcap, await self._reader.readexactly(length)


def build_app(run: Link, port: int) -> Starlette:
    """The web application of the page."""
    viewers, cookie = 0, COOKIE.format(port)

    async def socket_(websocket: WebSocket) -> None:
        nonlocal viewers
        if refusal(websocket, run.token, cookie) or not same_origin(websocket) or viewers >= MOST_VIEWERS:
            await websocket.close(1008)
            return
        viewers += 1  # before the first await: other viewers may connect meanwhile
        try:
            await websocket.accept()
            await _answer(websocket, run)
        except (WebSocketDisconnect, RuntimeError):  # RuntimeError: it went away while being answered
            pass
        finally:
            viewers -= 1

    return Starlette(routes=[*_files(run, cookie), *_answers(run, cookie), WebSocketRoute("/ws", socket_)])


def _files(run: Link, cookie: str) -> list[Route]:
    """The page itself."""

    async def file(request: Request) -> Response:
        said = refusal(request, run.token, cookie)
        if said:
            return HTMLResponse(LOCKED.format(said), 403, HEADERS)
        name, kind = STATIC[request.url.path]
        text = importlib.resources.files("sensing.live.web").joinpath("static", name).read_text("utf-8")
        response = Response(text, media_type=kind, headers=HEADERS)
        if run.token:
            response.set_cookie(cookie, run.token, httponly=True, samesite="strict")
        return response

    return [Route(path, file) for path in STATIC]


def _answers(run: Link, cookie: str) -> list[Route]:
    """What else may be fetched: the state, the curves of pressed domes, recordings that have ended."""

    async def reported(_: Request) -> Response:
        return Response(await run.look(0), media_type="application/json", headers=HEADERS)

    async def domes(_: Request) -> Response:
        curves = await asyncio.to_thread(dome_curves, run.designs)
        return Response(json.dumps(curves), media_type="application/json", headers=HEADERS)

    async def recording(request: Request) -> Response:
        number = request.path_params["number"]
        if number >= len(run.files) or not os.path.isfile(run.files[number]):
            return PlainTextResponse("There is no such recording.", 404, HEADERS)
        name = os.path.basename(run.files[number])
        return FileResponse(run.files[number], media_type="application/octet-stream", filename=name, headers=HEADERS)

    def guarded(answer: Callable[[Request], Awaitable[Response]]) -> Callable[[Request], Awaitable[Response]]:
        async def checked(request: Request) -> Response:
            said = refusal(request, run.token, cookie)
            if said or not same_origin(request):
                return PlainTextResponse(said or "Asked for by another page.", 403, HEADERS)
            return await answer(request)

        return checked

    paths = {"/state.json": reported, "/domes.json": domes, "/recording/{number:int}": recording}
    return [Route(path, guarded(answer)) for path, answer in paths.items()]


async def _answer(websocket: WebSocket, run: Link) -> None:
    """Answers one viewer until it leaves or says something that is no request."""
    await websocket.send_text(run.hello)
    seen = (-1, -1)
    while True:
        request = parse_request(await websocket.receive_text(), run.endcaps)
        if request is None:
            await websocket.close(1003)
            return
        if request.word != "show":
            run.ask(request)
        await websocket.send_text(await run.look(request.endcap))
        count, jpeg = run.pictures.get(request.endcap, (0, b""))
        if (request.endcap, count) != seen:  # an empty one, too: or the last endcap's stands under this one's name
            seen = (request.endcap, count)
            await websocket.send_bytes(jpeg)


def refusal(connection: HTTPConnection, token: str, cookie: str) -> str:
    """Why a request is refused, and what to do; empty if it is not.

    Args:
        connection: what asks.
        token: that it must know; empty for none, on loopback.
        cookie: name under which it may.
    """
    if token:
        given = connection.query_params.get("token") or connection.cookies.get(cookie) or ""
        if secrets.compare_digest(given.encode(), token.encode()):
            return ""
        known = "The token in this address is not that of the run." if given else "This address has no token."
        return (
            f"{known} Open the whole address that was printed where sensing.live was started (it ends in ?token=...), "
            "or scan the QR code beside it."
        )
    host = _host(connection.headers.get("host", ""))
    return "" if is_loopback(host) else (
        "It is shown on the computer that it runs on only. To see it on another device, start sensing.live there with "
        "--host 0.0.0.0 and open the address that it prints."
    )  # fmt: skip


def same_origin(connection: HTTPConnection) -> bool:
    """Pages of other sites may not talk to this one through a viewer's browser."""
    origin = connection.headers.get("origin")
    return origin is None or urlsplit(origin).netloc == connection.headers.get("host", "")


def _host(netloc: str) -> str:
    try:
        return urlsplit(f"//{netloc}").hostname or ""
    except ValueError:
        return ""


if __name__ == "__main__":
    main(sys.argv[1:])
