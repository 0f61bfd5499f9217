"""The plug-ins of docs/plugins, one of each kind: the very blocks of the pages, in one module of somebody else."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "plugins"
PAGES = ("camera_source", "field_method", "indenter", "wrench_model", "output")
ENTRY_POINTS = ""
for _page in PAGES:
    _text = (FOLDER / f"{_page}.md").read_text(encoding="utf-8")
    (_code,), (_named,) = (re.findall(rf"^```{_kind}\n(.*?)^```", _text, re.M | re.S) for _kind in ("python", "toml"))
    exec(compile(_code, f"docs/plugins/{_page}.md", "exec"), globals())
    for _group, _names in tomllib.loads(_named)["project"]["entry-points"].items():
        _lines = (f"{name} = {place.replace('my_endcap_parts', __name__)}\n" for name, place in _names.items())
        ENTRY_POINTS += f"[{_group}]\n{''.join(_lines)}\n"
