"""Default folder of exports, and the parser of typed folder names, which expands ``~`` (standard library only)."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path

from cad.errors import ParameterError
from cad.plain_numbers import brief

_ROOT = Path(__file__).resolve().parent.parent  # folder of checkout or installed packages
# The checkout's own folder; with an installed wheel, a folder in the current one.
EXPORTS = str(_ROOT / "exports") if (_ROOT / "pyproject.toml").exists() else "exports"


def typed_folder(text: str, name: str = "exports") -> Path:
    """Folder that an option names; ``~`` is replaced by the home folder, because not every shell replaces it.

    Args:
        text: value of the option.
        name: name of the option, for the message.

    Raises:
        ParameterError: the name is too long, is a link to itself, leads to a folder that cannot be entered, or is not
            UTF-8, in which case the kernel would write elsewhere or not at all.
    """
    try:
        folder = Path(text).expanduser()
        place = folder.resolve()
        with suppress(FileNotFoundError, NotADirectoryError):  # a folder that does not exist yet is accepted
            folder.stat()  # Python 3.13 resolves a link to itself without an error
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
