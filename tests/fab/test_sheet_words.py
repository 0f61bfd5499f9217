"""Commands on paper: a line of the sheet ends at a space, so that what is typed from it has no space too many."""

from __future__ import annotations

import re
import shutil
import subprocess

import pytest
from PIL import Image

from fab.build_sheet.blocks import Block, Document, Paragraph, Step, Table
from fab.build_sheet.html import write_html
from fab.build_sheet.pdf import write_pdf

COMMAND = (
    "ENDCAP_CAMERA=ELP-USBFHD01M-L170 .venv/bin/python -m sensing.setup --diameter 101.2 --dot-rings 1-5-9 --silicone "
    "'Ecoflex 00-50' --photo a.jpg exports='my endcaps-of-mine'"
)
KEPT = [word for word in COMMAND.split() if "-" in word or "/" in word]
LONG = "exports=/" + "/".join(["one-long-folder"] * 12)  # longer than any line


def blocks(words: str, picture) -> tuple[Block, ...]:
    return (
        Paragraph(words),
        Table(("a", "b"), ((words, words),), (5, 4)),
        Step("C1", "Pour", (words,)),
        Step("C2", "Pour", (words,), picture),
    )


@pytest.fixture
def picture(tmp_path):
    Image.new("RGB", (40, 30), (200, 90, 20)).save(tmp_path / "a.jpg")
    return tmp_path / "a.jpg"


def test_no_line_of_html_ends_within_a_word_of_a_command(picture, tmp_path):
    write_html(Document("Endcap", "a test", blocks(f"type: {COMMAND}.", picture)), tmp_path / "a.html")
    text = (tmp_path / "a.html").read_text()
    kept = re.findall(r'<span class="word">(.*?)</span>', text)
    assert len(kept) == 5 * len(KEPT) and kept[0] == KEPT[0] and ".venv/bin/python" in kept
    style = re.search(r"\.word \{(.*?)\}", text)[1]
    assert "inline-block" in style and "max-width: 100%" in style and "overflow-wrap: anywhere" in style
    assert re.sub(r"<.*?>", "", text).count("&#x27;Ecoflex 00-50&#x27; --photo a.jpg") == 5


@pytest.mark.skipif(shutil.which("pdftotext") is None, reason="pdftotext reads the PDF: apt install poppler-utils")
def test_no_line_of_the_pdf_ends_within_a_word_of_a_command(picture, tmp_path):
    pytest.importorskip("typst")
    path = tmp_path / "a.pdf"
    shifted = [block for before in range(0, 60, 3) for block in blocks("i" * before + f" {COMMAND}", picture)]
    write_pdf(Document("Endcap", "a test", tuple(shifted)), path)
    read = subprocess.run(["pdftotext", "-raw", path, "-"], capture_output=True, text=True, check=True).stdout
    found = [word for word in read.split() if word in set(KEPT)]
    assert len(found) == 5 * 20 * len(KEPT)


@pytest.mark.skipif(shutil.which("pdftotext") is None, reason="pdftotext reads the PDF: apt install poppler-utils")
def test_a_word_longer_than_its_line_stays_on_the_page(picture, tmp_path):
    pytest.importorskip("typst")
    path = tmp_path / "a.pdf"
    write_pdf(Document("Endcap", "a test", blocks(f"make molds {LONG} D=130", picture)), path)
    read = subprocess.run(["pdftotext", "-raw", path, "-"], capture_output=True, text=True, check=True).stdout
    assert "".join(read.split()).count(LONG) == 5  # what runs over the page's edge is not read
