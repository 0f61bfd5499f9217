"""Plug-ins: what an installed distribution adds by entry points, found by name and loaded when asked for.

    [project.entry-points."endcap.field_methods"]
    mine = "my_package:MyField"

docs/plugins has one page for each kind. Names are read without importing anything; what fails to load, or is
not what it should be, is one line that names the plug-in and its distribution. Standard library only.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from functools import cache
from importlib import metadata
from typing import Any

from cad.errors import EndcapError, ParameterError, printable


class Kind(Enum):
    """What can be added; the value is the group of entry points."""

    CAMERA = "endcap.cameras"
    FIELD_METHOD = "endcap.field_methods"
    INDENTER = "endcap.indenters"
    WRENCH_MODEL = "endcap.wrench_models"
    OUTPUT = "endcap.outputs"


def names(kind: Kind) -> tuple[str, ...]:
    """Names that installed distributions add, in alphabetical order; nothing is imported."""
    return tuple(sorted({entry.name for entry in _entries().select(group=kind.value)}))


def load(kind: Kind, name: str) -> Callable[..., Any]:
    """The object of an entry point.

    Args:
        kind: what it adds.
        name: one of :func:`names`.

    Raises:
        ParameterError: two distributions add the name, or it cannot be imported or called.
    """
    found = list(_entries().select(group=kind.value, name=name))
    if not found:
        raise ParameterError(f"{name!r} is none of {', '.join(names(kind)) or 'no plug-in'}", name=name)
    if len(found) > 1:
        owners = " and ".join(sorted(_owner(entry) for entry in found))
        raise ParameterError(f"{kind.value}: {owners} both add {name!r}: uninstall one of them", name=name)
    try:
        made = found[0].load()
    except Exception as error:  # code of others: whatever it raises is its fault, and named as such
        raise _broken(kind, name, f"cannot be imported ({_said(error)})") from error
    if not callable(made):
        raise _broken(kind, name, f"is {type(made).__name__}, not something that can be called")
    return made


def make(kind: Kind, name: str, needs: str, *arguments: Any) -> Any:
    """Call a plug-in and check what it gives.

    Args:
        kind, name: which.
        needs: attribute that its answer must have, for example ``update``.
        arguments: passed on.

    Raises:
        ParameterError: it fails, or gives something else.
        EndcapError: one that it raises on purpose.
    """
    factory = load(kind, name)
    try:
        made = factory(*arguments)
    except EndcapError:
        raise
    except Exception as error:
        raise _broken(kind, name, f"failed ({_said(error)})") from error
    if not hasattr(made, needs):
        raise _broken(kind, name, f"gave {type(made).__name__} without {needs}")
    return made


@cache
def _entries() -> Any:
    """Of everything that is installed, read once: some hundredths of a second."""
    return metadata.entry_points()


def _broken(kind: Kind, name: str, what: str) -> ParameterError:
    entry = next(iter(_entries().select(group=kind.value, name=name)))
    return ParameterError(
        f"plug-in {name!r} of {_owner(entry)} ({kind.value}: {entry.value}) {what}: repair or uninstall it", name=name
    )


def _owner(entry: metadata.EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else "an unknown distribution"


def _said(error: BaseException) -> str:
    return printable(f"{type(error).__name__}: {' '.join(str(error).split())}")[:200]
