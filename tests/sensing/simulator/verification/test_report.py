"""The verification report: its sections in their order, whenever each was written."""

import errno
import os
from pathlib import Path

import pytest

from cad.errors import EndcapError
from sensing.simulator.verification import report as verify
from sensing.simulator.verification.levels import NOT_INSTALLED

REPORT = Path(__file__).parents[4] / "docs" / "verification.md"


def test_the_report_is_in_order() -> None:
    titles = list(verify._read(REPORT))
    assert titles == sorted(titles, key=verify._place)


def test_the_report_begins_with_what_is_compared_and_what_the_words_of_its_tables_mean() -> None:
    text = REPORT.read_text(encoding="utf-8")
    assert text.startswith(verify.HEAD)
    assert [name for name in verify.ORDER if f"| {name}" not in verify.HEAD and not name.startswith("Level")] == []
    assert all(f"*{word}*" in verify.HEAD.lower() for word in ("markers", "estimate", "fall-backs", "residual"))


def test_renewing_one_section_keeps_the_others_and_the_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known = REPORT.read_text(encoding="utf-8")
    (tmp_path / "verification.md").write_text(known, encoding="utf-8")
    before = verify._read(tmp_path / "verification.md")
    monkeypatch.setitem(verify.SECTIONS, "solid", lambda _: "## The solid\n\nanew\n")
    assert verify.main(["--out", str(tmp_path), "--only", "solid"]) == 0
    after = verify._read(tmp_path / "verification.md")
    assert list(after) == sorted(before, key=verify._place)
    assert after["## The solid"].startswith("\nanew\n")
    assert all(after[title] == body for title, body in before.items() if title != "## The solid")


def test_where_calculix_is_missing_its_comparison_stays(tmp_path: Path, monkeypatch, capsys) -> None:
    """Renewing the whole report put "Not installed" in place of the table that another computer had made."""
    monkeypatch.setattr("sensing.simulator.verification.levels.shutil.which", lambda _: None)
    path = tmp_path / "verification.md"
    assert verify.main(["--out", str(tmp_path), "--only", "calculix"]) == 0
    assert NOT_INSTALLED in path.read_text(encoding="utf-8")
    path.write_bytes(REPORT.read_bytes())
    assert verify.main(["--out", str(tmp_path), "--only", "calculix"]) == 0
    assert path.read_bytes() == REPORT.read_bytes()
    assert "CalculiX is not installed (apt-get install calculix-ccx): its section stays" in capsys.readouterr().err


def test_a_full_disk_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    """Behind minutes of computing it was a traceback."""

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setitem(verify.SECTIONS, "solid", lambda _: "## The solid\n\nanew\n")
    monkeypatch.setattr("cad.whole_file.os.replace", full)
    assert verify.main(["--out", str(tmp_path), "--only", "solid"]) == 2
    error = capsys.readouterr().err
    assert "verification.md: No space left on device: free some space" in error and error.count("\n") == 1


def test_a_section_without_a_place_is_a_fault() -> None:
    with pytest.raises(ValueError):
        verify._place("## Something else")
    assert verify._place("## Hard cases, part 2 of 12") < verify._place("## Hard cases, part 10 of 12")


def test_a_section_that_fails_costs_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def failed(_: Path) -> str:
        raise EndcapError("no such shell")

    monkeypatch.setitem(verify.SECTIONS, "solid", lambda _: "## The solid\n\nanew\n")
    monkeypatch.setitem(verify.SECTIONS, "contact", failed)
    assert verify.main(["--out", str(tmp_path), "--only", "solid", "contact"]) == 2
    assert list(verify._read(tmp_path / "verification.md")) == ["## The solid"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("# Notes\n\nOurs.\n\n## The solid\n\nmine\n", "its first line"),
        (f"{verify.HEAD}\n## Wear\n\nmine\n", "its section 'Wear'"),
        ("\xff", "cannot read"),
    ],
)
def test_a_file_that_is_no_report_is_refused_before_anything_is_computed(tmp_path, monkeypatch, capsys, text, said):
    path = tmp_path / "verification.md"
    path.write_text(text, encoding="latin-1" if text == "\xff" else "utf-8")
    before = path.read_bytes()
    monkeypatch.setitem(verify.SECTIONS, "solid", lambda _: pytest.fail("computed"))
    assert verify.main(["--out", str(tmp_path), "--only", "solid"]) == 2
    assert said in capsys.readouterr().err and path.read_bytes() == before
