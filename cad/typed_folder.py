"""The folder of exports, and a folder as people type it: a home folder that no shell put there (standard library)."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path

from cad.errors import ParameterError
from cad.plain_numbers import brief

_ROOT = Path(__file__).resolve().parent.parent
# In a checkout its own folder; where the wheel is installed, one in the current folder.
EXPORTS = str(_ROOT / "exports") if (_ROOT / "pyproject.toml").exists() else "exports"


def typed_folder(text: str, name: str = "exports") -> Path:
    """The folder that an option names; ``~`` is the home folder, which not every shell puts there.

    Args:
        text: value of the option.
        name: of the option.

    Raises:
        ParameterError: a name too long for any folder, a link that leads to itself, a place that cannot be entered, or
            one whose name is no UTF-8: the kernel would write beside it, or not at all.
    """
    try:
        folder = Path(text).expanduser()
        place = folder.resolve()
        with suppress(FileNotFoundError, NotADirectoryError):  # a folder that is not there yet is none of this
            folder.stat()  # Python 3.13 resolves a link that leads to itself without a word
    except (OSError, RuntimeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "a link that leads to itself, or no such user"
        raise ParameterError(
            f"{name}={brief(text)}: {reason}: name a folder you may write with {name}=DIR", name=name, value=text
        ) from error
    if os.fsencode(place) != str(place).encode(errors="replace"):
        raise ParameterError(
            f"{name}={brief(text)}: the name of this folder, or of one above it, is no UTF-8 where names are "
            f"{sys.getfilesystemencoding()}, and the CAD kernel takes no other: rename it, name another with "
            f"{name}=DIR, or set LC_ALL=C.UTF-8",
            name=name,
            value=text,
        )
    return folder
