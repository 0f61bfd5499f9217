"""HTTP server of the page: loopback only, standard library, the same rules as the page of a live run.

The Host header of a request must name this computer, which prevents DNS rebinding. A request that changes something
must have the token of the served page, which prevents requests from other sites. The page cannot be framed. Files of an
export are served unchanged from its folder, in a sandbox, and no path leaves the folder.
"""

from __future__ import annotations

import contextlib
import importlib.resources
import ipaddress
import json
import re
import secrets
import socket
import traceback
from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, unquote, urlsplit

from cad.errors import EndcapError, ParameterError
from cad.messages import LOG
from fab.command import exports_words
from fab.design_page.answer import answer, parse_choice, preview, region
from fab.design_page.jobs import Jobs

PORT = 8010
LARGEST_BODY = 4096
MOST_DIGITS = 18  # of its length: Python refuses to read thousands
MOST_FIELDS = 16  # of an address
WAIT_S = 20.0  # of a request for the state of the run
TOKEN_HEADER = "X-Endcap-Token"
LABEL = re.compile(r"D[0-9.]+_T[0-9.]+(_[A-Za-z0-9.-]+)*")
HEADERS = {
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
PAGE_POLICY = (
    "default-src 'self'; img-src 'self' data:; style-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
EXPORT_POLICY = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; img-src 'self' data:; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; frame-ancestors 'none'"
)
STATIC = {
    "/": ("fab.design_page", "static/index.html", "text/html; charset=utf-8"),
    "/page.js": ("fab.design_page", "static/page.js", "text/javascript; charset=utf-8"),
    "/page.css": ("fab.design_page", "static/page.css", "text/css; charset=utf-8"),
    "/viewer.js": ("fab.exports", "viewer.js", "text/javascript; charset=utf-8"),
}
KINDS = {
    ".html": "text/html; charset=utf-8", ".png": "image/png", ".glb": "model/gltf-binary", ".pdf": "application/pdf",
    ".json": "application/json", ".csv": "text/csv; charset=utf-8", ".jpg": "image/jpeg",
}  # fmt: skip


class DesignServer(ThreadingHTTPServer):
    """Server of the page on this computer.

    Args:
        exports: folder that holds the exports.
        jobs: runs the commands.
        port: to listen on; ``None`` for 8010 or, where that is taken, any free one.

    Raises:
        ParameterError: the port is taken.
    """

    daemon_threads = True

    def __init__(self, exports: Path, jobs: Jobs, port: int | None = None) -> None:
        self.exports, self.jobs, self.token = exports.resolve(), jobs, secrets.token_urlsafe(16)
        try:
            super().__init__(("127.0.0.1", PORT if port is None else port), _Handler)
        except (OSError, OverflowError) as error:
            if port is not None:
                raise ParameterError(
                    f"port={port}: {error}: choose another, or leave port= out", name="port", value=port
                ) from error
            super().__init__(("127.0.0.1", 0), _Handler)

    @property
    def url(self) -> str:
        """Address of the page, to be opened in a browser."""
        return f"http://127.0.0.1:{self.server_port}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a browser that closes the connection.

        Args:
            request: its connection.
            client_address: of the browser.
        """


class _Handler(BaseHTTPRequestHandler):
    server: DesignServer
    protocol_version = "HTTP/1.1"
    timeout = 60

    def do_GET(self) -> None:
        self._answered(self._get)

    def do_POST(self) -> None:
        self._answered(self._post)

    def _answered(self, work: Callable[[], None]) -> None:
        """Answer a request; report an error in one line, in the reply and in the terminal."""
        try:
            work()
        except (ConnectionError, TimeoutError):
            self._close_after()  # the browser closed the connection
        except EndcapError as error:
            LOG.error(f"design page: {error}")
            self._text(HTTPStatus.INTERNAL_SERVER_ERROR, str(error))
        except Exception as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            what = f"{type(error).__name__}: {error} ({Path(place.filename).name}, line {place.lineno})"
            LOG.error(f"design page: {self.path.partition('?')[0]}: {what}")
            self._close_after()  # what is left of the request is unread
            self._text(HTTPStatus.INTERNAL_SERVER_ERROR, f"An error of the program, please report it: {what}")

    def _get(self) -> None:
        if self._refused():
            return
        try:
            address = urlsplit(self.path)
            path, query = unquote(address.path), dict(parse_qsl(address.query, True, max_num_fields=MOST_FIELDS))
        except ValueError as error:
            self._text(HTTPStatus.BAD_REQUEST, f"This address cannot be read: {error}.")
            return
        if path in STATIC:
            self._static(path)
        elif path == "/region.json":
            self._json(region())
        elif path == "/answer.json":
            self._json(answer(query, exports_words(self.server.exports)))
        elif path == "/preview.glb":
            self._preview(query)
        elif path == "/job.json":
            self._json(self._news(query.get("seen", "")))
        elif path.startswith("/exports/"):
            self._export(path.removeprefix("/exports/"))
        else:
            self._text(HTTPStatus.NOT_FOUND, "There is nothing under this address.")

    def _post(self) -> None:
        if self._refused():
            return
        given = self.headers.get(TOKEN_HEADER, "")
        origin = self.headers.get("Origin")
        is_own = origin is None or urlsplit(origin).netloc == self.headers.get("Host")
        if not is_own or not secrets.compare_digest(given.encode(), self.server.token.encode()):
            self._close_after()
            self._text(HTTPStatus.FORBIDDEN, "This button belongs to the page: open it again.")
            return
        body = self._body()
        if body is None:
            return
        if self.path == "/make":
            self._make(body)
        elif self.path == "/stop":
            self.server.jobs.stop()
            self._json({})
        else:
            self._text(HTTPStatus.NOT_FOUND, "There is nothing under this address.")

    def log_message(self, format: str, *args: object) -> None:
        """Print nothing: the terminal shows the run."""

    def _make(self, body: Mapping[str, Any]) -> None:
        knobs = {name: value for name, value in body.items() if name != "whole"}
        is_whole = body.get("whole", False)
        if not isinstance(is_whole, bool) or not all(isinstance(value, str) for value in knobs.values()):
            self._text(HTTPStatus.BAD_REQUEST, 'Knobs are texts, such as "D": "130", and whole is true or false.')
            return
        try:
            choice = parse_choice(knobs)
        except ParameterError as error:
            self._text(HTTPStatus.BAD_REQUEST, str(error))
            return
        if not self.server.jobs.start(choice.words, choice.printer, choice.variant.label, is_whole):
            self._text(HTTPStatus.CONFLICT, "A run is going on: wait for its end, or stop it.")
            return
        self._json({"label": choice.variant.label})

    def _preview(self, query: Mapping[str, str]) -> None:
        try:
            data = preview(query)
        except ParameterError as error:
            self._text(HTTPStatus.BAD_REQUEST, str(error))
            return
        self._send(HTTPStatus.OK, data, KINDS[".glb"])

    def _news(self, seen: str) -> dict[str, Any]:
        number = int(seen) if seen.isdecimal() and len(seen) < 12 else -1
        return self.server.jobs.seen(number, WAIT_S if seen else 0.0)

    def _static(self, path: str) -> None:
        package, name, kind = STATIC[path]
        text = importlib.resources.files(package).joinpath(name).read_text("utf-8")
        self._send(HTTPStatus.OK, text.replace("{{token}}", self.server.token).encode(), kind)

    def _export(self, path: str) -> None:
        """A file of an export's folder; nothing outside the exports, nothing hidden, no folder listing."""
        label, _, name = path.partition("/")
        folder = self.server.exports / label
        if not LABEL.fullmatch(label) or not name or any(part.startswith(".") for part in name.split("/")):
            self._text(HTTPStatus.NOT_FOUND, "No such file.")
            return
        with contextlib.suppress(OSError, ValueError):
            file = (folder / name).resolve(strict=True)
            inside = file.is_relative_to(folder.resolve())
            if inside and file.is_dir():  # index.html links slice/, which a browser lists where it reads files itself
                self._text(HTTPStatus.NOT_FOUND, f"A folder, which this page does not list: its files are in {file}")
                return
            if inside and file.is_file():
                kind = KINDS.get(file.suffix.lower(), "application/octet-stream")
                self._send(HTTPStatus.OK, file.read_bytes(), kind, EXPORT_POLICY)
                return
        self._text(HTTPStatus.NOT_FOUND, "No such file.")

    def _refused(self) -> bool:
        """Answer a request that does not name this computer; return whether it did so."""
        host = self.headers.get("Host", "")
        with contextlib.suppress(ValueError):
            name = urlsplit(f"//{host}").hostname or ""
            if name == "localhost" or _is_loopback(name):
                return False
        self._close_after()
        self._text(HTTPStatus.FORBIDDEN, "This page is shown on the computer that it runs on only.")
        return True

    def _body(self) -> dict[str, Any] | None:
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or len(length) > MOST_DIGITS or int(length) > LARGEST_BODY:
            self._close_after()
            self._text(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "Too long.")
            return None
        with contextlib.suppress(ValueError, RecursionError):
            body = json.loads(self.rfile.read(int(length)) or b"{}")
            if isinstance(body, dict):
                return body
        self._text(HTTPStatus.BAD_REQUEST, "Not a request of the page.")
        return None

    def _close_after(self) -> None:
        self.close_connection = True

    def _json(self, content: Mapping[str, Any]) -> None:
        self._send(HTTPStatus.OK, json.dumps(content, allow_nan=False).encode(), KINDS[".json"])

    def _text(self, status: HTTPStatus, words: str) -> None:
        self._send(status, words.encode(errors="backslashreplace"), "text/plain; charset=utf-8")

    def _send(self, status: HTTPStatus, data: bytes, kind: str, policy: str = PAGE_POLICY) -> None:
        with contextlib.suppress(BrokenPipeError, ConnectionResetError, socket.timeout):
            self.send_response(status)
            for name, value in (HEADERS | {"Content-Security-Policy": policy, "Content-Type": kind}).items():
                self.send_header(name, value)
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)


def _is_loopback(name: str) -> bool:
    try:
        return ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False
