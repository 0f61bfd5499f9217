"""Renderer of a build sheet as PDF through Typst: A4, page numbers, drawings at true size."""

from __future__ import annotations

import json
import shutil
import tempfile
from pathlib import Path

from cad.errors import FileError
from fab.build_sheet.blocks import WORD, Block, Document, Drawing, Heading, Paragraph, Picture, Step, Table

_HEAD = """\
#set document(title: {title}, date: none)
#set page(paper: "a4", margin: (x: 15mm, top: 16mm, bottom: 17mm), numbering: "1 / 1",
  header: context if counter(page).get().first() > 1 [#text(8pt, fill: rgb("#5a626c"), {title})])
#set text(font: "DejaVu Sans", size: 9.5pt, fill: rgb("#20242a"), lang: "en")
#set par(leading: 0.62em)
#show regex({word}): it => box(it) // a word longer than its line ends it within the box
#show heading.where(level: 1): it => {{ pagebreak(weak: true); text(15pt, it.body); v(-2mm)
  line(length: 100%, stroke: 1.2pt + rgb("#2f6f6a")) }}
#show heading.where(level: 2): it => block(sticky: true, above: 5mm, below: 3mm, text(11.5pt, it.body))
#text(24pt, weight: "bold", {title})

#text(fill: rgb("#5a626c"), {subtitle})
"""


def write_pdf(document: Document, path: Path) -> None:
    """Write the document.

    Args:
        document: the sheet.
        path: of the PDF file.

    Raises:
        FileError: Typst is missing or refuses the document.
    """
    try:
        import typst
    except ImportError as error:
        raise FileError("the PDF needs the Python package typst: run `make setup` again") from error
    with tempfile.TemporaryDirectory(prefix="sheet-") as scratch:
        root = Path(scratch)
        printer = _Printer(root)
        body = "\n".join(printer.block(block) for block in document.blocks)
        head = _HEAD.format(title=_text(document.title), subtitle=_text(document.subtitle), word=_text(WORD))
        source = root / "sheet.typ"
        source.write_text(head + body, encoding="utf-8")
        try:
            path.write_bytes(typst.compile(str(source), root=str(root), font_paths=[_fonts()]))
        except RuntimeError as error:
            raise FileError(f"{path.name}: Typst refused the sheet: {str(error).splitlines()[0]}") from error


class _Printer:
    """Renderer of blocks as Typst source; pictures are copied beside the source."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.count = 0

    def block(self, block: Block) -> str:
        """Typst source of one block.

        Args:
            block: of the sheet.
        """
        if isinstance(block, Heading):
            return f"#heading(level: {block.level}, {_text(block.text)})"
        if isinstance(block, Paragraph):
            return f"#par({_text(block.text)})"
        if isinstance(block, Picture):
            image = self.image(block.path, f"width: {100 * block.width_ratio:g}%")
            caption = f'text(8.5pt, fill: rgb("#5a626c"), {_text(block.caption)})'
            return f"#block(breakable: false, align(center, stack(spacing: 2mm, {image}, {caption})))"
        if isinstance(block, Table):
            return self.table(block)
        if isinstance(block, Step):
            return self.step(block)
        if isinstance(block, Drawing):
            name = self.name("svg")
            (self.root / name).write_text(block.svg, encoding="utf-8")
            size = f"width: {block.width_mm:g}mm, height: {block.height_mm:g}mm"
            size += f", alt: {_text(block.caption or 'drawing')}"
            return f'#box(stack(spacing: 1mm, image("{name}", {size}), text(8pt, {_text(block.caption)})))'
        raise TypeError(f"no way to print {type(block).__name__}")

    def table(self, table: Table) -> str:
        """Typst source of a table that repeats its header on each page.

        Args:
            table: of the sheet.
        """
        columns = ", ".join(f"{width:g}fr" for width in table.widths)
        size = "6.8pt" if table.is_small else "8pt"
        titles = ", ".join(f"strong({_text(cell)})" for cell in table.header)
        head = f"table.header({titles}), " if titles else ""
        cells = ", ".join(
            self.image(cell, "height: 15mm") if isinstance(cell, Path) else _text(cell)
            for row in table.rows
            for cell in row
        )
        inset = "1.1mm" if table.is_small else "1.5mm"
        return (
            f"#[#set text({size})\n#table(columns: ({columns}), inset: (x: 1.5mm, y: {inset}), align: horizon + left, "
            f'stroke: (x, y) => (bottom: 0.5pt + rgb("#d5dade")), {head}{cells})]'
        )

    def step(self, step: Step) -> str:
        """Typst source of a step on one page: text at the left, picture, if there is one, at the right.

        Args:
            step: of the sheet.
        """
        lines = ", ".join(f"[#{_text(line)}]" for line in step.lines)
        words = f"stack(spacing: 2.5mm, strong({_text(step.number + ' ' + step.title)}), list(spacing: 2mm, {lines}))"
        body = words
        if step.picture:
            picture = self.image(step.picture, "width: 100%", step.title)
            body = f"grid(columns: (1fr, 86mm), gutter: 5mm, {words}, {picture})"
        return (
            '#block(breakable: false, width: 100%, above: 2mm, stroke: (top: 0.5pt + rgb("#d5dade")), '
            f"inset: (y: 2.5mm), {body})"
        )

    def image(self, path: Path, size: str, words: str = "") -> str:
        """Typst call that places a picture, with the words that stand for it in a screen reader, as in HTML.

        Args:
            path: of the picture.
            size: Typst arguments of its size.
            words: what it shows; empty for its name.
        """
        name = self.name(path.suffix[1:])
        shutil.copyfile(path, self.root / name)
        return f'image("{name}", {size}, alt: {_text(words or path.stem)})'

    def name(self, suffix: str) -> str:
        """An unused file name.

        Args:
            suffix: of the name, without its dot.
        """
        self.count += 1
        return f"f{self.count}.{suffix}"


def _text(words: str) -> str:
    """Text as a Typst string; the escapes of JSON are valid in Typst for every character that occurs."""
    return json.dumps(words, ensure_ascii=False)


def _fonts() -> str:
    """Folder of the DejaVu fonts that ship with matplotlib, so that every computer renders the same letters."""
    import matplotlib

    return str(Path(matplotlib.get_data_path()) / "fonts" / "ttf")
