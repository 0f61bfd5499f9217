"""The project's error tree (standard library only, so that every layer may raise from it).

    EndcapError (also a ValueError)
    ├── ParameterError   a number or option outside what can be built
    ├── GeometryError    the CAD kernel returned something that is not the part we asked for
    └── FileError        a file or folder that cannot be read, written or trusted

Every message is one line: name=value, the accepted range or form, the reason, the fix.
"""

from __future__ import annotations

import re

_CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]")

_CREDENTIALS = re.compile(r"://[^/\s?#]*@")


def printable(text: str, newlines: bool = False) -> str:
    r"""Text without what a terminal obeys: control and direction characters as ``\x1b``; newlines only if asked for.

    User and password of an address are left out, too.
    """
    text = _CREDENTIALS.sub("://***@", text)
    text = text if newlines else text.replace("\n", "\\n")
    return _CONTROL.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


class EndcapError(ValueError):
    """Base of all errors that a user can cause and fix. The command line prints it and exits with status 2.

    Words of files and servers may be part of the message: what a terminal would obey is escaped.
    """

    def __str__(self) -> str:
        return printable(super().__str__(), newlines=True)


class ParameterError(EndcapError):
    """A parameter outside what can be made.

    Attributes:
        name: the parameter, with its unit suffix, for example ``wall_mm``.
        value: what was given.
    """

    def __init__(self, message: str, *, name: str = "", value: object = None) -> None:
        super().__init__(message)
        self.name = name
        self.value = value


class GeometryError(EndcapError):
    """The CAD kernel failed, or produced an invalid or empty solid."""


class FileError(EndcapError):
    """A file or folder that cannot be read, written or trusted."""
