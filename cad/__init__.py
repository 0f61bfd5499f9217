"""Parametric CAD of the endcap: two numbers in, solids out (build123d). Importing this loads no CAD kernel."""

from __future__ import annotations


def __getattr__(name: str) -> str:
    """``cad.__version__``: version of the installed distribution, read when it is asked for."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import version

    return version("endcap-toolkit")
