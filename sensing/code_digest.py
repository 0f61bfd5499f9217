"""Digest of the code and tables of packages: whether two runs, or two computers, have the same version of them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SUFFIXES = (".py", ".csv")


def code_digest(packages: Iterable[str]) -> str:
    """SHA-256 of the files of packages and modules, in hexadecimal digits.

    Args:
        packages: folders, from that of the toolkit, as in ``sensing/camera``; or single files as ``sensing/decode.py``.
    """
    found, places = hashlib.sha256(), [ROOT / name for name in packages]
    files = [path for place in places for path in ([place] if place.is_file() else place.rglob("*"))]
    for path in sorted(path for path in files if path.suffix in SUFFIXES):
        found.update(path.read_bytes())
    return found.hexdigest()
