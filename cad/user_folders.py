"""Folders in which a user's files stay between runs, as the XDG base directory specification has them.

A user without a home, as in some containers, keeps nothing: below the null device no file is found or written
(standard library only).
"""

from __future__ import annotations

import os
from pathlib import Path


def cache_folder() -> Path:
    """What can be made again: ``endcap-toolkit`` in XDG_CACHE_HOME or ~/.cache."""
    return _folder("XDG_CACHE_HOME", ".cache")


def data_folder() -> Path:
    """What the user has made: ``endcap-toolkit`` in XDG_DATA_HOME or ~/.local/share."""
    return _folder("XDG_DATA_HOME", ".local/share")


def config_folder() -> Path:
    """What the user has set: ``endcap-toolkit`` in XDG_CONFIG_HOME or ~/.config."""
    return _folder("XDG_CONFIG_HOME", ".config")


def _folder(variable: str, usual: str) -> Path:
    try:
        return Path(os.environ.get(variable) or Path.home() / usual) / "endcap-toolkit"
    except RuntimeError:  # of Path.home()
        return Path(os.devnull) / "endcap-toolkit"
