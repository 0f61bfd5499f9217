"""Packages for other programs, from their sources in this toolkit: what their commands share."""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Sequence
from pathlib import Path

from cad.errors import EndcapError, FileError
from cad.extras import program
from cad.messages import LOG, show
from cad.whole_file import new_folder


def export_packages(sources: Path, folder: Path) -> list[str]:
    """Copy the packages; the folder appears when all of it is there. Returns the names of the packages.

    Raises:
        FileError: the folder is not empty, or cannot be written.
    """
    leave = shutil.ignore_patterns("__pycache__")
    try:
        with new_folder(folder) as place:
            shutil.copytree(sources, place, dirs_exist_ok=True, copy_function=shutil.copyfile, ignore=leave)
    except OSError as error:
        raise FileError(f"{folder}: cannot be written ({error.strerror}): choose another folder") from error
    return sorted(path.name for path in folder.iterdir() if path.is_dir())


def package_command(module: str, description: str, sources: Path, arguments: Sequence[str] | None) -> int:
    """The command line of one that writes packages; returns the exit status.

    Args:
        module: that is run.
        description: for ``--help``.
        sources: folder of the packages.
        arguments: words of the user.
    """
    parser = argparse.ArgumentParser(
        prog=program(f"python -m {module}"),
        description=description,
        epilog="exit status: 0 written, 2 no place to write",
    )
    parser.add_argument("--out", type=Path, required=True, help="folder to write; must be new or empty")
    options = parser.parse_args(arguments)
    try:
        names = export_packages(sources, options.out)
    except EndcapError as error:
        LOG.error(f"{module}: {error}")
        return 2
    show(f"{options.out}: {', '.join(names)}; README.md says how to build or install")
    return 0
