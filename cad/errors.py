"""The project's error tree (standard library only, so that every layer may raise from it).

    EndcapError (also a ValueError)
    ├── ParameterError   a number or option outside what can be built
    ├── GeometryError    the CAD kernel returned something that is not the part we asked for
    └── FileError        a file or folder that cannot be read, written or trusted

Every message is one line: name=value, the accepted range or form, the reason, the fix.
"""

from __future__ import annotations


class EndcapError(ValueError):
    """Base of all errors that a user can cause and fix. The command line prints it and exits with status 2."""


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
