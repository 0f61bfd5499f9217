"""What the run and the page's process tell one another, over a pair of sockets; standard library only.

The page's process sends lines, ``look 0 2`` or one of the viewers' words with the number of a cap. A look is answered
by messages: details and new pictures of the caps named, then the state, which ends the answer. The page asks for the
next look only after that, so that nothing piles up, and what it gets is the newest.
"""

from __future__ import annotations

import ipaddress
import json
import struct

HEAD = struct.Struct(">cBI")  # kind, number of the cap, length of what follows
HELLO, DETAIL, PICTURE, STATE = b"H", b"D", b"P", b"S"
WORDS = ("zero", "zero_all", "record")
LONGEST_LINE = 256


def message(kind: bytes, data: bytes, cap: int = 0) -> bytes:
    """One message of the run."""
    return HEAD.pack(kind, cap, len(data)) + data


def parse_request(text: str, caps: int) -> tuple[str, int] | None:
    """(what to do, number of the cap) from a viewer's message; None for anything that is no request."""
    try:
        told = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(told, dict) or set(told) - {"do", "cap"}:
        return None
    what, cap = told.get("do"), told.get("cap", 0)
    if what not in ("show", *WORDS) or type(cap) is not int or not 0 <= cap < caps:
        return None
    return what, cap


def parse_line(line: bytes, caps: int) -> tuple[str, list[int]] | None:
    """(word, numbers of caps) from a line of the page's process; None for anything else."""
    word, *numbers = line.decode("ascii", "replace").split() or [""]
    if word not in ("look", *WORDS) or not all(n.isdecimal() and len(n) < 4 and int(n) < caps for n in numbers):
        return None
    return (word, [int(n) for n in numbers]) if numbers else None


def is_loopback(host: str) -> bool:
    """Whether a name or address is that of this computer for itself."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
