"""Digest of the code and tables of packages: whether two runs, or two computers, have the same version of them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SUFFIXES = (".py", ".csv")


def code_digest(packages: Iterable[str]) -> str:
    """SHA-256 of the files of packages, in hexadecimal digits.

    Args:
        packages: their folders from that of the toolkit, as in ``sensing/camera``.
    """
    found = hashlib.sha256()
    for path in sorted(p for name in packages for p in (ROOT / name).rglob("*") if p.suffix in SUFFIXES):
        found.update(path.read_bytes())
    return found.hexdigest()
