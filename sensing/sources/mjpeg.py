"""Motion JPEG over HTTP (multipart/x-mixed-replace, RFC 2046), as network cameras and streamers serve it.

Capture time: the part's ``X-Timestamp`` header is a wall clock of another machine and is not used; frames carry their
arrival on the monotonic clock.
"""

from __future__ import annotations

import http.client
import time
from collections.abc import Callable, Iterator
from typing import BinaryIO, cast
from urllib.error import URLError
from urllib.parse import unquote, urlsplit, urlunsplit
from urllib.request import (
    HTTPBasicAuthHandler,
    HTTPDigestAuthHandler,
    HTTPPasswordMgrWithDefaultRealm,
    Request,
    build_opener,
)

from cad.errors import ParameterError, printable
from sensing.decode import jpeg_size
from sensing.records import Frame
from sensing.sources.newest import SourceError

LARGEST_FRAME = 8 * 2**20  # bytes; more than this without an end of picture is no camera


class MjpegSource:
    """Frames of a stream until it breaks (then SourceError).

    Args:
        url: http or https address of the stream, with user and password (percent-encoded) where it asks for them, as
            in ``http://user:password@10.0.0.7/stream``; they are sent to nobody else and never shown.
        timeout_s: silence after which the stream counts as broken.

    Raises:
        ParameterError: the address is not http or https.
    """

    def __init__(self, url: str, timeout_s: float = 5.0) -> None:
        self.name, self._timeout_s = printable(url), timeout_s
        try:
            if urlsplit(url).scheme not in ("http", "https") or not urlsplit(url).netloc:
                raise ValueError("no http")
            self._open = _opener(url)
        except ValueError:  # also half a bracket, as in http://[::1
            raise ParameterError(
                f"url={self.name}: give an http address such as http://127.0.0.1:8080/stream", name="url"
            ) from None

    def __iter__(self) -> Iterator[Frame]:
        try:
            with self._open(self._timeout_s) as stream:
                for sequence, jpeg in enumerate(split_jpegs(stream)):
                    yield Frame(time.monotonic(), sequence, self.name, jpeg=jpeg, size=jpeg_size(jpeg))
        except (URLError, OSError, http.client.HTTPException, ValueError) as error:
            said = printable(str(getattr(error, "reason", error)))[:200]  # words of a server
            refused = getattr(error, "code", 0) in (401, 403)
            fix = (
                "give its user and password before the host, as USER:PASSWORD@HOST"
                if refused
                else "check address and network"
            )
            raise SourceError(f"{self.name}: {said}: {fix}") from None
        raise SourceError(f"{self.name}: the stream ended: is the camera still there?")


def _opener(url: str) -> Callable[[float], BinaryIO]:
    """Opens the address; user and password answer what its server asks (RFC 7616, 7617)."""
    parts = urlsplit(url)
    bare = urlunsplit(parts._replace(netloc=parts.netloc.rpartition("@")[2]))
    director = build_opener()
    if parts.username is not None:
        known = HTTPPasswordMgrWithDefaultRealm()
        known.add_password(None, bare, unquote(parts.username), unquote(parts.password or ""))
        director = build_opener(HTTPDigestAuthHandler(known), HTTPBasicAuthHandler(known))
    return lambda timeout_s: cast(BinaryIO, director.open(Request(bare), timeout=timeout_s))


def split_jpegs(stream: BinaryIO) -> Iterator[bytes]:
    """The pictures of a multipart stream, by Content-Length where given, else by the JPEG's own markers.

    Raises:
        ValueError: more than 8 MiB without the end of a picture.
    """
    length = None
    while line := stream.readline(65536):
        header = line.strip().lower()
        if header.startswith(b"content-length:") and header[15:].strip().isdigit():
            length = int(header[15:].strip()[:20])  # bytes know only the digits 0 to 9
            if length > LARGEST_FRAME:
                raise ValueError(f"frame of {length} bytes, at most {LARGEST_FRAME} allowed")
        elif header == b"" and length is not None:
            data = stream.read(length)
            length = None
            if data:
                yield data
        elif line.startswith(b"\xff\xd8"):
            yield _read_to_end(line, stream)


def _read_to_end(start: bytes, stream: BinaryIO) -> bytes:
    """A picture without a stated length; its head is skipped, where a thumbnail may have an end of its own."""
    data, place = bytearray(start), 2
    looked, scan = 0, False  # bytes of the scan that hold no end; whether it has begun
    while True:
        if not scan:
            place, scan = _scan_begin(data, place)
            looked = place
        if scan and data.find(b"\xff\xd9", looked) >= 0:
            break
        looked = max(looked, len(data) - 1)  # of an end that is cut in two, the first byte
        if len(data) > LARGEST_FRAME:
            raise ValueError(f"no end of picture within {LARGEST_FRAME} bytes")
        line = stream.readline(65536)
        if not line:
            break
        data += line
    return bytes(data)


def _scan_begin(data: bytearray, place: int) -> tuple[int, bool]:
    """(byte, whether the pixels begin there) behind the segments from ``place`` on (ITU T.81, B.1)."""
    while place + 2 <= len(data):
        if data[place] != 0xFF or data[place + 1] in (0xDA, 0xD9):  # no segment, start of scan, end of picture
            return place, True
        if data[place + 1] == 0xFF:  # fill byte
            place += 1
        elif place + 4 <= len(data):
            place += 2 + int.from_bytes(data[place + 2 : place + 4], "big")
        else:
            break
    return place, False
