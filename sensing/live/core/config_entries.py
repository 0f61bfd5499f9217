"""Changes single entries of endcaps in endcaps.toml and leaves everything else as its owner wrote it."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cad.errors import FileError
from cad.whole_file import replace_file
from sensing.live.core.endcaps_file import load_config

_ENDCAP = re.compile(r"\s*\[\[\s*endcap\s*\]\]")  # the only tables of the file
Entries = Mapping[str, Any]  # by key; numbers, text or lists of them


def change_entries(path: Path, changes: Mapping[str, Entries]) -> None:
    """Set entries of endcaps, all or none, comments and order kept; written under a temporary name, then renamed.

    Args:
        path: of endcaps.toml.
        changes: the entries of each endcap, by its name.

    Raises:
        FileError: no such file or endcap, or lines that cannot be changed safely (then nothing is).
    """
    names = [each.name for each in load_config(path).endcaps]
    for endcap in changes:
        if endcap not in names:
            raise FileError(f"{path}: no endcap {endcap}: it has {', '.join(names)}")
    content = path.read_bytes().decode("utf-8-sig")
    text, ends = content.replace("\r\n", "\n"), "\r\n" if "\r\n" in content else "\n"
    lines = text.splitlines()
    heads = [k for k, line in enumerate(lines) if _ENDCAP.match(line)]
    if len(heads) == len(names):
        found = lines[: heads[0]]
        for name, begin, end in zip(names, heads, [*heads[1:], len(lines)], strict=True):
            found += _with_entries(lines[begin:end], changes.get(name, {}))
        changed = "\n".join(found) + "\n"
        if _only_changed(text, changed, [changes.get(name, {}) for name in names]):
            replace_file(path, changed.replace("\n", ends).encode())
            return
    said = "; ".join(f"under {name}: {'; '.join(_lines(entries))}" for name, entries in changes.items())
    raise FileError(f"{path}: cannot be changed without touching other lines: put these in by hand, {said}")


def _lines(entries: Entries) -> list[str]:
    return [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in entries.items()]


def _with_entries(section: Sequence[str], entries: Entries) -> list[str]:
    """The lines of an endcap with its entries behind the others; comments that follow may be the next one's."""
    kept, k = list[str](), 0
    while k < len(section):
        lines = 1
        if section[k].partition("=")[0].strip().strip("\"'") in entries:
            lines = next((n for n in range(1, len(section) - k + 1) if _is_toml(section[k : k + n])), 1)
        else:
            kept.append(section[k])
        k += lines
    last = max(k for k, line in enumerate(kept) if line.strip() and not line.lstrip().startswith("#")) + 1
    return [*kept[:last], *_lines(entries), *kept[last:]]


def _is_toml(lines: Sequence[str]) -> bool:
    """Whether lines are whole by themselves; a list over several lines is at its end only."""
    try:
        tomllib.loads("\n".join(lines))
    except tomllib.TOMLDecodeError:
        return False
    return True


def _only_changed(before: str, after: str, changes: Sequence[Entries]) -> bool:
    """Whether the new text differs from the old in these entries, of all endcaps in order, alone."""
    wanted = tomllib.loads(before)
    for endcap, entries in zip(wanted["endcap"], changes, strict=True):
        endcap |= json.loads(json.dumps(dict(entries)))
    try:
        return tomllib.loads(after) == wanted
    except tomllib.TOMLDecodeError:
        return False
