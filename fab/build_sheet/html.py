"""Renderer of a build sheet as one HTML file with embedded pictures and without scripts, printed on A4 at true size."""

from __future__ import annotations

import base64
import re
from html import escape
from pathlib import Path

from fab.build_sheet.blocks import WORD, Block, Document, Drawing, Heading, Paragraph, Picture, Step, Table

_STYLE = """
@page { size: A4; margin: 16mm 15mm; }
body { font: 10.5pt/1.45 "DejaVu Sans", Verdana, sans-serif; color: #20242a; max-width: 180mm; margin: 8mm auto; }
h1 { font-size: 17pt; border-bottom: 2px solid #2f6f6a; break-before: page; padding-bottom: 1mm; }
h1.first { break-before: auto; border: 0; font-size: 24pt; margin-bottom: 0; }
h2 { font-size: 12.5pt; margin: 6mm 0 2mm; break-after: avoid; }
p.sub { color: #5a626c; margin-top: 1mm; }
figure { margin: 3mm 0; break-inside: avoid; text-align: center; }
figcaption { color: #5a626c; font-size: 9pt; }
img { max-width: 100%; }
table { border-collapse: collapse; width: 100%; margin: 2mm 0 4mm; font-size: 9pt; table-layout: fixed; }
table.small { font-size: 7.5pt; }
th { text-align: left; border-bottom: 1.5px solid #2f6f6a; }
th, td { padding: 1mm 1.5mm; vertical-align: middle; overflow-wrap: anywhere; }
tr { border-bottom: 1px solid #d5dade; break-inside: avoid; }
td img { max-height: 18mm; }
section.step { display: grid; grid-template-columns: 1fr 84mm; gap: 5mm; break-inside: avoid;
  border-top: 1px solid #d5dade; padding: 3mm 0; }
section.words { grid-template-columns: 1fr; }
section.step h2 { margin: 0 0 1mm; font-size: 11pt; }
section.step ul { margin: 0; padding-left: 5mm; }
.word { display: inline-block; max-width: 100%; overflow-wrap: anywhere; }
.drawing { display: inline-block; vertical-align: top; break-inside: avoid; margin: 1mm; }
"""


def write_html(document: Document, path: Path) -> None:
    """Write the document, pictures included.

    Args:
        document: the sheet.
        path: of the HTML file.
    """
    body = "\n".join(_block(block) for block in document.blocks)
    path.write_text(
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{escape(document.title)}</title>\n'
        f"<style>{_STYLE}</style>\n</head>\n<body>\n<main>\n"
        f'<h1 class="first">{escape(document.title)}</h1>\n<p class="sub">{escape(document.subtitle)}</p>\n'
        f"{body}\n</main>\n</body>\n</html>\n",
        encoding="utf-8",
    )


def _words(text: str) -> str:
    """Escaped text, in which a word is broken only if it is longer than a line."""
    parts = re.split(f"({WORD})", text)  # words that are kept whole have odd indices
    return "".join(
        f'<span class="word">{escape(part)}</span>' if number % 2 else escape(part) for number, part in enumerate(parts)
    )


def _block(block: Block) -> str:
    if isinstance(block, Heading):
        return f"<h{block.level}>{escape(block.text)}</h{block.level}>"
    if isinstance(block, Paragraph):
        return f"<p>{_words(block.text)}</p>"
    if isinstance(block, Picture):
        width = f' style="width:{100 * block.width_ratio:.0f}%"'
        return f"<figure>{_image(block.path, width)}<figcaption>{escape(block.caption)}</figcaption></figure>"
    if isinstance(block, Table):
        return _table(block)
    if isinstance(block, Step):
        return _step(block)
    if isinstance(block, Drawing):
        caption = f"<div>{escape(block.caption)}</div>" if block.caption else ""
        return f'<div class="drawing">{block.svg}{caption}</div>'
    raise TypeError(f"no way to print {type(block).__name__}")


def _image(path: Path, style: str = "", words: str = "") -> str:
    kind = "png" if path.suffix == ".png" else "jpeg"
    data = base64.b64encode(path.read_bytes()).decode()
    return f'<img alt="{escape(words or path.stem)}" src="data:image/{kind};base64,{data}"{style}>'


def _table(table: Table) -> str:
    total = sum(table.widths)
    columns = "".join(f'<col style="width:{100 * width / total:.1f}%">' for width in table.widths)
    cells = "".join(f"<th>{escape(cell)}</th>" for cell in table.header)
    head = f"<thead><tr>{cells}</tr></thead>" if cells else ""
    rows = "\n".join("<tr>" + "".join(f"<td>{_cell(cell)}</td>" for cell in row) + "</tr>" for row in table.rows)
    style = ' class="small"' if table.is_small else ""
    return f"<table{style}><colgroup>{columns}</colgroup>{head}<tbody>\n{rows}\n</tbody></table>"


def _cell(cell: str | Path) -> str:
    return _image(cell) if isinstance(cell, Path) else _words(cell)


def _step(step: Step) -> str:
    lines = "".join(f"<li>{_words(line)}</li>" for line in step.lines)
    text = f"<div><h2>{escape(step.number)} {escape(step.title)}</h2><ul>{lines}</ul></div>"
    if not step.picture:
        return f'<section class="step words">{text}</section>'
    return f'<section class="step">{text}<div>{_image(step.picture, words=step.title)}</div></section>'
