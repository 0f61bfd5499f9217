"""The project's exception classes (standard library only, so that every layer can raise them).

    EndcapError (also a ValueError)
    ├── ParameterError   a number or option outside what can be built
    ├── GeometryError    the CAD kernel did not return the requested part
    └── FileError        a file or folder that cannot be read, written or trusted

Every message is one line: name=value, the accepted range or form, the reason, the fix.
"""

from __future__ import annotations

import re

_CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]")  # not printable

_CREDENTIALS = re.compile(r"://[^/\s?#]*@")  # user name and password in an address


def printable(text: str, newlines: bool = False) -> str:
    r"""Text that is safe to print: control and direction characters become escapes like ``\x1b``.

    User name and password of an address are removed, too.

    Args:
        text: the text.
        newlines: whether newlines are kept.
    """
    text = _CREDENTIALS.sub("://***@", text)
    text = text if newlines else text.replace("\n", "\\n")
    return _CONTROL.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


class EndcapError(ValueError):
    """Base of all errors that a user can cause and fix. The command line prints it and exits with status 2.

    A message may contain text of files and servers, so that control characters in it are escaped.
    """

    def __str__(self) -> str:
        return printable(super().__str__(), newlines=True)


class ParameterError(EndcapError):
    """A parameter outside the range that can be made.

    Attributes:
        name: name of the parameter with its unit suffix, for example ``wall_mm``.
        value: the refused value.
    """

    def __init__(self, message: str, *, name: str = "", value: object = None) -> None:
        super().__init__(message)
        self.name = name
        self.value = value


class GeometryError(EndcapError):
    """The CAD kernel failed, or produced an invalid or empty solid."""


class FileError(EndcapError):
    """A file or folder that cannot be read, written or trusted."""
