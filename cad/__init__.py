"""Parametric CAD of the endcap: solids (build123d) from two numbers. Importing this package loads no CAD kernel."""

from __future__ import annotations


def __getattr__(name: str) -> str:
    """``cad.__version__``: version of the installed distribution, read on first use."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("endcap-toolkit")
    except PackageNotFoundError:  # a checkout whose libraries were installed without it
        return "not installed"
