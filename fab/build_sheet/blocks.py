"""Blocks of a build sheet: plain records that :mod:`fab.build_sheet.html` and :mod:`fab.build_sheet.pdf` render.

Texts are unescaped; each renderer escapes them for its format. Lengths of drawings in mm of paper.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

# Words that must not be broken at a line end: a command broken there would be typed with a space in it.
WORD = r"\S*[-/]\S*"


@dataclass(frozen=True)
class Heading:
    """A heading; level 1 starts a new page on paper."""

    text: str
    level: int = 2


@dataclass(frozen=True)
class Paragraph:
    """Running text."""

    text: str


@dataclass(frozen=True)
class Picture:
    """A picture file with what it shows; ``width_ratio`` of the text's width."""

    path: Path
    caption: str
    width_ratio: float = 1.0


@dataclass(frozen=True)
class Table:
    """Rows of text or pictures; numbers are text already. ``widths`` are relative. A table may have no header."""

    header: tuple[str, ...]
    rows: tuple[tuple[str | Path, ...], ...]
    widths: tuple[float, ...]
    is_small: bool = False


@dataclass(frozen=True)
class Step:
    """One step of work: what to do, and how it looks."""

    number: str
    title: str
    lines: tuple[str, ...]
    picture: Path | None = None


@dataclass(frozen=True)
class Drawing:
    """A drawing at true size, as SVG text in millimetres."""

    svg: str
    width_mm: float
    height_mm: float
    caption: str = ""


Block = Heading | Paragraph | Picture | Table | Step | Drawing


@dataclass(frozen=True)
class Document:
    """A whole sheet."""

    title: str
    subtitle: str
    blocks: tuple[Block, ...]
