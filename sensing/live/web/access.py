"""Who may open the page from another device, and how: a token that stays, an address that can be reached, its QR code.

The token lies in ``~/.config/endcap-toolkit/page_token`` (or below ``XDG_CONFIG_HOME``), readable by its owner only, so
that a bookmark on a phone goes on working. Delete the file for a new one.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import secrets
import socket
import stat
from pathlib import Path

from cad.user_folders import config_folder
from cad.whole_file import PRIVATE, put_file

TOKEN = re.compile(r"[A-Za-z0-9_-]{22,86}")
LONGEST = 128  # bytes of the file that are looked at
ANYWHERE = {socket.AF_INET: "192.0.2.1", socket.AF_INET6: "2001:db8::1"}  # addresses of documentation (RFC 5737, 3849)


def token_file() -> Path:
    """Where the token is kept."""
    return config_folder() / "page_token"


def page_token() -> str:
    """The token that is kept, or a new one; where nothing can be kept, one for this run."""
    try:
        path = token_file()
        kept = _read(path)
        if kept:
            return kept
        made = secrets.token_urlsafe(16)
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        put_file(path, (made + "\n").encode(), PRIVATE)
        return _read(path) or made
    except OSError:
        return secrets.token_urlsafe(16)


def _read(path: Path) -> str:
    """The token of a file that is ours alone; empty for any other."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return ""
    with os.fdopen(descriptor, "rb") as stream:
        found = os.fstat(descriptor)
        if not stat.S_ISREG(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
            return ""
        text = stream.read(LONGEST).decode("ascii", "replace").strip()
    return text if TOKEN.fullmatch(text) else ""


def reachable_address(host: str) -> str:
    """What another device has to type for a host that was listened on: this computer's address in its network."""
    if host not in ("0.0.0.0", "::"):
        return host
    family = socket.AF_INET6 if host == "::" else socket.AF_INET
    with contextlib.suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.connect((ANYWHERE[family], 9))  # chooses the address, sends nothing
        return str(probe.getsockname()[0])
    return socket.gethostname()


def page_address(host: str, port: int, token: str) -> str:
    """The whole address.

    Args:
        host: address that the page listens on.
        port: its port.
        token: key of the page; empty without one.
    """
    shown = reachable_address(host)
    return f"http://{f'[{shown}]' if ':' in shown else shown}:{port}/" + (f"?token={token}" if token else "")


def qr_code(address: str) -> str:
    """The address as a QR code of block characters, to be read from a terminal by a phone; empty without ``segno``."""
    try:
        import segno
    except ImportError:
        return ""
    lines = io.StringIO()
    segno.make(address, error="l", micro=False).terminal(lines, compact=True)
    return "".join(f"\x1b[97;40m{line}\x1b[0m\n" for line in lines.getvalue().splitlines())  # white on black for all
