"""Hooks of the documentation site: curves under bench/, links out of docs/, and a page for each tutorial notebook.

MkDocs reads docs/ alone. The bench's curves lie beside it, so the site takes a copy; files of the repository that are
no pages are linked in the repository's own terms in the sources and shown as code on the site.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parent.parent
CURVES = (".png", ".csv", ".jpg")
LOADED = re.compile(r"<(?:script|img|iframe|link)\b[^>]*\b(?:src|href)=[\"']?(?:https?:)?//[^\"' >]+", re.I)
ROLE = re.compile(r":(?:mod|class|func|meth|data|attr|exc):(?=<code>)")  # docstrings keep Sphinx's roles as text
COPIED = {"CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}  # of the repository -> on the site
NOTEBOOK = re.compile(r"(\]\([^)\s:]+)\.ipynb(#[^)]*)?\)")
LINK = re.compile(r"(!?)\[([^\]]*)\]\(((?:\.\./)+)([^)#]*)(#[^)]*)?\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the bench's curves and a page for each tutorial notebook."""
    for path in sorted(ROOT.glob("bench/*")):
        if path.suffix in CURVES:
            files.append(File.generated(config, f"bench/{path.name}", abs_src_path=str(path)))
    for name, target in COPIED.items():
        text = (ROOT / name).read_text(encoding="utf-8").replace("](docs/", "](")
        files.append(File.generated(config, target, content=text))
    for path in sorted((ROOT / "docs" / "tutorials").glob("*.ipynb")):
        page = notebook_page(json.loads(path.read_text(encoding="utf-8")))
        files.append(File.generated(config, f"tutorials/{path.stem}.md", content=page))
    return files


def on_page_markdown(markdown: str, page: Any, files: Files, **_: Any) -> str:
    """Links that leave docs/ lead to the site's copy, or become plain text where the site has none.

    A notebook is linked as the file that a checkout has, and leads to its page here.
    """
    markdown = NOTEBOOK.sub(lambda found: f"{found[1]}.md{found[2] or ''})", markdown)
    depth = page.file.src_uri.count("/")

    def site_link(found: re.Match[str]) -> str:
        picture, text, ups, target, anchor = found.groups()
        if ups.count("/") <= depth:
            return found.group()
        inside = COPIED.get(target, target)
        if files.get_file_from_path(inside) is None:
            if not (ROOT / target).exists():
                return found.group()  # left for the strict build to refuse
            return text if text.startswith("`") else f"{text} (`{target}`)"
        return f"{picture}[{text}]({'../' * depth}{inside}{anchor or ''})"

    return LINK.sub(site_link, markdown)


def on_page_content(html: str, **_: Any) -> str:
    """Names of docstrings without their roles."""
    return ROLE.sub("", html)


def on_post_page(output: str, page: Any, **_: Any) -> str:
    """The site works without a network: a page that loads something from another server stops the build."""
    loaded = LOADED.findall(output)
    if loaded or '<pre class="mermaid"' in output:
        raise PluginError(f"{page.file.src_uri}: loads from another server: {loaded or 'Mermaid diagrams'}")
    return output


def notebook_page(notebook: dict[str, Any]) -> str:
    """Markdown of a notebook: its text, and its code as blocks; outputs are not kept in the repository."""
    page = []
    for cell in notebook["cells"]:
        source = "".join(cell["source"])
        page.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
    return "\n\n".join(page) + "\n"
