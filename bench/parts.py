"""Where a bench puts its table: what is published comes from whole runs alone."""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def table_of(name: str, whole: bool) -> Path:
    """The published table for a whole run; one of that name in ``build/`` for a part, and a line that says so.

    Args:
        name: of the table, as in ``fields.csv``.
        whole: whether all rows are made, with as many frames as the published ones.
    """
    published = ROOT / "bench" / name
    if whole:
        return published
    part = ROOT / "build" / name
    part.parent.mkdir(exist_ok=True)
    print(f"only a part is run: its table goes to {part}, and bench/{name} stays as it is", file=sys.stderr)
    return part
