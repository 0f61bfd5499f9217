"""What the run and the page's process say to one another, over a pair of sockets; standard library only.

The page's process sends lines: ``look 0 2``, or one of the viewers' words with the number of an endcap and the time
(ms) of the state that the viewer saw: a button pressed on an old state does nothing (:func:`is_fresh`). A look is
answered by messages: details and new pictures of the endcaps named, then the state, which ends the answer. The page
asks for the next look only after that, so that nothing piles up, and what it gets is the newest.
"""

from __future__ import annotations

import ipaddress
import json
import struct

HEAD = struct.Struct(">cBI")  # kind, number of the endcap, length of what follows
HELLO, DETAIL, PICTURE, STATE = b"H", b"D", b"P", b"S"
WORDS = ("zero", "zero_confirmed", "zero_all", "undo", "record_start", "record_stop")
FRESH_MS = 2000  # a viewer may act on what it saw this long ago
LATEST_MS = 10**15  # no clock of a run shows more
LONGEST_LINE = 256


def message(kind: bytes, data: bytes, endcap: int = 0) -> bytes:
    """One message of the run.

    Args:
        kind: one byte, for example :data:`STATE`. data: content. endcap: number of the endcap, or how many with
            :data:`HELLO`.
    """
    return HEAD.pack(kind, endcap, len(data)) + data


def parse_request(text: str, endcaps: int) -> tuple[str, int, int] | None:
    """(what to do, number of the endcap, ms of the state seen) from a viewer's message; None for no request."""
    try:
        request = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(request, dict) or set(request) - {"do", "endcap", "seen"}:
        return None
    what, endcap, seen = request.get("do"), request.get("endcap", 0), request.get("seen", 0)
    if what not in ("show", *WORDS) or type(endcap) is not int or not 0 <= endcap < endcaps:
        return None
    return (what, endcap, seen) if type(seen) is int and 0 <= seen < LATEST_MS else None


def parse_line(line: bytes, endcaps: int) -> tuple[str, list[int], int] | None:
    """(word, numbers of endcaps, ms of the state seen) from a line of the page's process; None for anything else."""
    word, *numbers = line.decode("ascii", "replace").split() or [""]
    if not numbers or not all(n.isdecimal() and len(n) < 16 for n in numbers):
        return None
    seen = 0
    if word in WORDS and len(numbers) == 2:
        seen = int(numbers.pop())
    elif word != "look":
        return None
    chosen = [int(n) for n in numbers if len(n) < 4 and int(n) < endcaps]
    return (word, chosen, seen) if len(chosen) == len(numbers) else None


def is_fresh(seen_ms: int, now_s: float) -> bool:
    """Whether a viewer saw the state lately enough to act on it."""
    return -1 <= 1e3 * now_s - seen_ms <= FRESH_MS


def is_loopback(host: str) -> bool:
    """Whether a name or address is that of this computer for itself."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
