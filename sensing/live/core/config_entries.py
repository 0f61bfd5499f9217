"""Changes single entries of one endcap in endcaps.toml and leaves everything else as its owner wrote it."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cad.errors import FileError
from cad.whole_file import replace_file
from sensing.live.core.endcaps_file import load_config

_TABLE = re.compile(r"\s*\[")
_ENDCAP = re.compile(r"\s*\[\[\s*endcap\s*\]\]")


def change_entries(path: Path, endcap: str, entries: Mapping[str, Any]) -> None:
    """Set entries of the endcap of that name, comments and order kept; written under a temporary name, then renamed.

    Args:
        path: of endcaps.toml. endcap: its name. entries: by key; numbers, text or lists of them.

    Raises:
        FileError: no such file or endcap, or lines that cannot be changed safely (then nothing is).
    """
    names = [each.name for each in load_config(path).endcaps]
    if endcap not in names:
        raise FileError(f"{path}: no endcap {endcap}: it has {', '.join(names)}")
    text = path.read_text(encoding="utf-8")
    lines = text.splitlines()
    heads = [k for k, line in enumerate(lines) if _ENDCAP.match(line)]
    wanted = [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in entries.items()]
    if len(heads) == len(names):
        begin = heads[names.index(endcap)] + 1
        end = next((k for k in range(begin, len(lines)) if _TABLE.match(lines[k])), len(lines))
        kept = [line for line in lines[begin:end] if line.partition("=")[0].strip() not in entries]
        last = max((k for k, line in enumerate(kept) if line.strip()), default=-1) + 1
        changed = "\n".join([*lines[:begin], *kept[:last], *wanted, *kept[last:], *lines[end:]]) + "\n"
        if _only_changed(text, changed, names.index(endcap), entries):
            replace_file(path, changed.encode())
            return
    said = "; ".join(wanted)
    raise FileError(f"{path}: cannot be changed without touching other lines: put these under {endcap} by hand: {said}")


def _only_changed(before: str, after: str, number: int, entries: Mapping[str, Any]) -> bool:
    """Whether the new text differs from the old in these entries alone."""
    wanted = tomllib.loads(before)
    wanted["endcap"][number] |= json.loads(json.dumps(dict(entries)))
    try:
        return tomllib.loads(after) == wanted
    except tomllib.TOMLDecodeError:
        return False
