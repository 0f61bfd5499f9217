"""Ends a bench as the toolkit's commands end: what a user can correct in one line and status 2, without a traceback."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from cad.errors import EndcapError


def in_one_line(main: Callable[[], int | None]) -> int:
    """Exit status of a bench's ``main``; 2 where what it was given, or needs, is not there.

    Args:
        main: does the work; None as its status counts as 0.
    """
    try:
        return main() or 0
    except EndcapError as error:
        print(f"{Path(sys.argv[0]).stem}: {error}", file=sys.stderr)
        return 2
