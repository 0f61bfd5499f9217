"""Plug-ins: entry points of installed distributions, found by name and loaded on demand.

    [project.entry-points."endcap.field_methods"]
    mine = "my_package:MyField"

docs/plugins has one page for each kind. Names are read without importing a plug-in. A plug-in that fails to load, or
that is not of the expected kind, raises an error of one line that names it and its distribution. Standard library only.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from functools import cache
from importlib import metadata
from typing import Any

from cad.errors import EndcapError, ParameterError, printable


class Kind(Enum):
    """Kinds of plug-ins; the value is the group of entry points."""

    CAMERA = "endcap.cameras"
    FIELD_METHOD = "endcap.field_methods"
    INDENTER = "endcap.indenters"
    WRENCH_MODEL = "endcap.wrench_models"
    OUTPUT = "endcap.outputs"


def names(kind: Kind) -> tuple[str, ...]:
    """Names of the installed plug-ins of a kind, in alphabetical order; no plug-in is imported."""
    return tuple(sorted({entry.name for entry in _entries().select(group=kind.value)}))


def load(kind: Kind, name: str) -> Callable[..., Any]:
    """Load the object of an entry point.

    Args:
        kind: kind of the plug-in.
        name: one of :func:`names`.

    Raises:
        ParameterError: no distribution or more than one has the name, or the object cannot be imported or called.
    """
    found = list(_entries().select(group=kind.value, name=name))
    if not found:
        raise ParameterError(f"{name!r} is none of {', '.join(names(kind)) or 'no plug-in'}", name=name)
    if len(found) > 1:
        owners = " and ".join(sorted(_owner(entry) for entry in found))
        raise ParameterError(f"{kind.value}: {owners} both add {name!r}: uninstall one of them", name=name)
    try:
        made = found[0].load()
    except Exception as error:  # foreign code may raise anything; the message names its distribution
        raise _broken(kind, name, f"cannot be imported ({_error_text(error)})") from error
    if not callable(made):
        raise _broken(kind, name, f"is {type(made).__name__}, not something that can be called")
    return made


def make(kind: Kind, name: str, needs: str, *arguments: Any) -> Any:
    """Call a plug-in and check its result.

    Args:
        kind: kind of the plug-in.
        name: one of :func:`names`.
        needs: attribute that the result must have, for example ``update``.
        arguments: positional arguments of the call.

    Raises:
        ParameterError: the plug-in fails, or its result lacks the attribute.
        EndcapError: the plug-in raised it.
    """
    factory = load(kind, name)
    try:
        made = factory(*arguments)
    except EndcapError:
        raise
    except Exception as error:
        raise _broken(kind, name, f"failed ({_error_text(error)})") from error
    if not hasattr(made, needs):
        raise _broken(kind, name, f"gave {type(made).__name__} without {needs}")
    return made


@cache
def _entries() -> Any:
    """Entry points of all installed distributions, read once (some hundredths of a second)."""
    return metadata.entry_points()


def _broken(kind: Kind, name: str, what: str) -> ParameterError:
    entry = next(iter(_entries().select(group=kind.value, name=name)))
    return ParameterError(
        f"plug-in {name!r} of {_owner(entry)} ({kind.value}: {entry.value}) {what}: repair or uninstall it", name=name
    )


def _owner(entry: metadata.EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else "an unknown distribution"


def _error_text(error: BaseException) -> str:
    return printable(f"{type(error).__name__}: {' '.join(str(error).split())}")[:200]
