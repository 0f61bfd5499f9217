"""Messages between the run and the process of the page, over a pair of sockets; standard library only.

The page's process sends lines: ``look 0 2``, or one of the viewers' words with the number of an endcap, the time (ms)
of the state that the viewer saw, a whole number and, for a note, its text, percent-encoded: ``replay_seek 0 81234
12000``. A button pressed on an old state does nothing (:func:`is_fresh`). A look is answered by messages: details and
new pictures of the endcaps named, then the state, which ends the answer. The page asks for the next look only after
that, so that nothing piles up, and what it gets is the newest.
"""

from __future__ import annotations

import ipaddress
import json
import struct
from dataclasses import dataclass
from urllib.parse import quote, unquote

HEAD = struct.Struct(">cBI")  # kind, number of the endcap, length of what follows
HELLO, DETAIL, PICTURE, STATE, FILES = b"H", b"D", b"P", b"S", b"F"
WORDS: dict[str, int] = {  # what a viewer may ask for, and the largest number that may go with it
    "zero": 0,
    "zero_confirmed": 0,
    "zero_all": 0,
    "undo": 0,
    "record_start": 2,  # which of the kinds of pictures
    "record_stop": 0,
    "note": 0,
    "replay_pause": 1,
    "replay_loop": 1,
    "replay_seek": 10**9,  # ms
    "replay_speed": 16_000,  # thousandths
}
FRESH_MS = 2000  # a viewer may act on what it saw this long ago
LATEST_MS = 10**15  # no clock of a run shows more
NOTE_CHARACTERS = 200
LONGEST_LINE = 64 + 12 * NOTE_CHARACTERS  # a character is at most four bytes, each of them three of a line


@dataclass(frozen=True)
class Press:
    """A request of a viewer.

    Attributes:
        word: of :data:`WORDS`.
        endcap: its number.
        seen_ms: time of the state that the viewer saw.
        value: a number that goes with the word.
        text: of a note.
    """

    word: str
    endcap: int = 0
    seen_ms: int = 0
    value: int = 0
    text: str = ""

    def line(self) -> bytes:
        """As the page's process sends it."""
        return f"{self.word} {self.endcap} {self.seen_ms} {self.value} {quote(self.text, safe='')}\n".encode()


def message(kind: bytes, data: bytes, endcap: int = 0) -> bytes:
    """One message of the run.

    Args:
        kind: one byte, for example :data:`STATE`.
        data: content.
        endcap: number of the endcap, or how many with :data:`HELLO`.
    """
    return HEAD.pack(kind, endcap, len(data)) + data


def parse_request(text: str, endcaps: int) -> Press | None:
    """The request in a viewer's message; None if there is none. ``show`` requests the newest numbers only."""
    try:
        request = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(request, dict) or set(request) - {"do", "endcap", "seen", "value", "text"}:
        return None
    endcap, seen, value = (request.get(name, 0) for name in ("endcap", "seen", "value"))
    word, text = request.get("do"), request.get("text", "")
    if not all(type(number) is int for number in (endcap, seen, value)) or not isinstance(word, str):
        return None
    return _allowed(Press(word, endcap, seen, value, text), endcaps)


def parse_line(line: bytes, endcaps: int) -> list[int] | Press | None:
    """Numbers of the endcaps to show, or a viewer's request, from a line of the page's process; else None."""
    word, *rest = line.decode("ascii", "replace").split() or [""]
    numbers = [int(n) for n in rest[: 3 if word in WORDS else None] if n.isdecimal() and n.isascii() and len(n) < 16]
    if word == "look":
        looked = [n for n in numbers if n < endcaps]
        return looked if looked and len(looked) == len(rest) else None
    if len(numbers) != 3 or len(rest) > 4:
        return None
    endcap, seen_ms, value = numbers
    return _allowed(Press(word, endcap, seen_ms, value, unquote("".join(rest[3:]))), endcaps, looks=False)


def _allowed(press: Press, endcaps: int, looks: bool = True) -> Press | None:
    most = 0 if looks and press.word == "show" else WORDS.get(press.word)
    if most is None or not isinstance(press.text, str) or len(press.text) > NOTE_CHARACTERS:
        return None
    if press.text and (press.word != "note" or not press.text.isprintable()):
        return None
    known = 0 <= press.endcap < endcaps and 0 <= press.seen_ms < LATEST_MS and 0 <= press.value <= most
    return press if known else None


def is_fresh(seen_ms: int, now_s: float) -> bool:
    """Whether a viewer saw the state lately enough to act on it."""
    return -1 <= 1e3 * now_s - seen_ms <= FRESH_MS


def is_loopback(host: str) -> bool:
    """Whether a name or address is that of this computer for itself."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
