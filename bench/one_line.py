"""Ends a bench as the toolkit's commands end: in one line, without a traceback; status 2 where a user can fix it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from cad.errors import EndcapError


def in_one_line(main: Callable[[], int | None]) -> int:
    """Exit status of a bench's ``main``; 2 where what it was given, or needs, is not there, 130 after Ctrl-C.

    Args:
        main: does the work; None as its status counts as 0.
    """
    try:
        return main() or 0
    except EndcapError as error:
        print(f"{Path(sys.argv[0]).stem}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"{Path(sys.argv[0]).stem}: interrupted", file=sys.stderr)
        return 130
