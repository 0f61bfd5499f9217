"""The manifest of a set of labelled frames (options, number of shards, identity of the endcap), and shards' names."""

from __future__ import annotations

import fcntl
import json
from pathlib import Path
from typing import Any

from cad.errors import FileError
from cad.identity import Identity, recorded
from cad.params import EndcapParams
from cad.pattern import RELEASED_DOT_MM, RELEASED_RINGS, parse_rings, rings_text

FORMAT = 2


def read_manifest(folder: Path) -> dict[str, Any]:
    """Content of a folder's manifest.

    Raises:
        FileError: missing, unreadable or of another format.
    """
    path = folder / "manifest.json"
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if found["format"] != FORMAT:
            raise ValueError(f"format {found['format']}, need {FORMAT}")
        if not isinstance(found.get("request", {}), dict):
            raise ValueError("its request is no table")
        return dict(found)
    except OSError as error:
        raise FileError(f"{path}: cannot read ({error.strerror}): give a folder of labelled frames") from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise FileError(f"{path}: not the manifest of labelled frames ({error}): write the set again") from error


def codes_of(manifest: dict[str, Any]) -> list[str]:
    """Digest of the code of each version of the toolkit that made shards of a set, or the states in them."""
    found = manifest.get("code")
    return found if isinstance(found, list) else ["of an earlier version"]


def shard_path(folder: Path, number: int) -> Path:
    """Path of a shard's file."""
    return folder / "shards" / f"{number:05d}.npz"


def is_locked(folder: Path) -> bool:
    """Whether a writer holds the folder of a set; the lock ends with the writer's process."""
    try:
        with (folder / ".lock").open() as stream:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False  # never locked
    return False


def identity_of(folder: Path, manifest: dict[str, Any]) -> Identity:
    """Identity of the endcap in a manifest; a silicone that is named only among its options counts, too.

    Args:
        folder: for the message.
        manifest: of :func:`read_manifest`.

    Raises:
        FileError: it does not say it, or is damaged.
    """
    try:
        request = manifest["request"]
        design = _design(request)
        stated = manifest.get("identity")
        if stated is None and "c10_mpa" in request:
            stated = {"silicone": {"name": request["silicone"]} | {k: request[k] for k in ("c10_mpa", "poisson")}}
        found = recorded(stated, design)
        if found.design != design:
            raise ValueError(f"its identity is of {found.design.label}, its options of {design.label}")
        return found
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise FileError(f"{folder / 'manifest.json'}: no design in it ({error}): write the set again") from error


def _design(request: dict[str, Any]) -> EndcapParams:
    """Design from the options of a set; sets of older versions, without options for dots, have the released ones."""
    words = request.get("dot_rings", rings_text(RELEASED_RINGS))
    if not isinstance(words, str):
        raise TypeError(f"dot_rings={words!r} is no text"[:100])
    rings = parse_rings(words)
    diameter_mm, wall_mm = float(request["diameter_mm"]), float(request["wall_mm"])
    return EndcapParams(diameter_mm, wall_mm, rings, request.get("dot_mm", RELEASED_DOT_MM))
