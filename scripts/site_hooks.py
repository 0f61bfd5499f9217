"""Hooks of the documentation site: pages link to curves under bench/, which lie beside docs/ and not in it.

Also turns each tutorial under docs/tutorials/ into its page: what the tests run is what the page shows.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parent.parent


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the bench's curves and a page for each tutorial script."""
    for path in sorted(ROOT.glob("bench/*")):
        if path.suffix in (".png", ".csv", ".jpg"):
            files.append(File.generated(config, f"bench/{path.name}", abs_src_path=str(path)))
    for path in sorted((ROOT / "docs" / "tutorials").glob("*.py")):
        source = files.get_file_from_path(f"tutorials/{path.name}")
        if source is not None:
            files.remove(source)
        files.append(File.generated(config, f"tutorials/{path.stem}.md", content=tutorial_page(path.read_text())))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Links to ../bench/ lead to the site's own copy."""
    depth = page.file.src_uri.count("/")
    return markdown.replace("](" + "../" * (depth + 1) + "bench/", "](" + "../" * depth + "bench/")


def tutorial_page(script: str) -> str:
    """Markdown of a script in cells: ``# %% [markdown]`` cells are text, ``# %%`` cells are code."""
    page = []
    for cell in re.split(r"^# %%", script, flags=re.M)[1:]:
        head, _, body = cell.partition("\n")
        if "[markdown]" in head:
            page.append("\n".join(line.removeprefix("#").removeprefix(" ") for line in body.strip().splitlines()))
        else:
            page.append(f"```python\n{body.strip()}\n```")
    return "\n\n".join(page) + "\n"
