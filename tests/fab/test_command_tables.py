"""A row of a table that cannot be read is one line in every command that names the table's choices."""

from __future__ import annotations

from importlib import import_module

import pytest

from cad import materials
from cad.errors import FileError
from fab.slice import printers
from fab.slice.settings import LINE_MM


@pytest.fixture
def no_constants(tmp_path, monkeypatch):
    """A silicone that has no hyperelastic constants, in the last line of the table; the number of that line."""
    table = tmp_path / "materials.csv"
    rows = materials.TABLE.read_text(encoding="utf-8") + "My Rubber,1.1,1A:1B,30,20,8,20A,0.4,400,0.49,,,,,,,mine\n"
    table.write_text(rows, encoding="utf-8")
    monkeypatch.setattr(materials, "TABLE", table)
    materials.silicones.cache_clear()
    yield rows.count("\n")
    monkeypatch.undo()
    materials.silicones.cache_clear()


@pytest.mark.parametrize(
    "module", ["fab.molds", "fab.build_sheet.__main__", "fab.slice.__main__", "fab.coupons.__main__"]
)
@pytest.mark.parametrize("word", ["--help", "material=Smooth-Sil 950"])
def test_a_silicone_without_constants_is_one_line(no_constants, module, word, capsys):
    words = [word] if module != "fab.coupons.__main__" else []
    try:
        status = import_module(module).main(words)
    except SystemExit as end:  # help that needs no silicone is printed
        assert end.code == 0 and module == "fab.slice.__main__" and word == "--help"
        return
    errors = capsys.readouterr().err.strip().splitlines()
    assert status == 2 and len(errors) == 1
    assert f"line {no_constants} (My Rubber): neo_hooke_c10_mpa='' is not a positive number" in errors[0]


def test_a_printer_that_cannot_be_read_is_one_line(tmp_path, monkeypatch, capsys):
    table = tmp_path / "printers.csv"
    head, *rows = printers.PRINTER_TABLE.read_text().splitlines()
    table.write_text("\n".join([head, rows[0].replace(",", ",wide,", 1), *rows[1:]]))
    monkeypatch.setattr(printers, "PRINTER_TABLE", table)
    printers.printers.cache_clear()
    try:
        assert import_module("fab.slice.__main__").main(["--help"]) == 2
    finally:
        monkeypatch.undo()
        printers.printers.cache_clear()
    errors = capsys.readouterr().err.strip().splitlines()
    assert len(errors) == 1 and errors[0].startswith("make slice: printers.csv line 2")


@pytest.mark.parametrize(("nozzle", "is_refused"), [("0.25", True), ("0.3", False), ("0.4", False), ("0.6", True)])
def test_a_nozzle_that_lays_no_line_of_our_width_is_refused(nozzle, is_refused, tmp_path, monkeypatch):
    assert pytest.approx((LINE_MM / 1.5, LINE_MM)) == printers.NOZZLE_RANGE_MM
    table = tmp_path / "printers.csv"
    head, first, *_ = printers.PRINTER_TABLE.read_text().splitlines()
    table.write_text(f"{head}\n{first.replace(',0.4,', f',{nozzle},', 1)}\n")
    monkeypatch.setattr(printers, "PRINTER_TABLE", table)
    if not is_refused:
        assert printers.printers.__wrapped__()["mk4"].nozzle_mm == float(nozzle)
        return
    with pytest.raises(FileError, match=rf"printers.csv line 2 \(mk4\): nozzle_mm={nozzle} outside 0.3..0.45: .*0.4"):
        printers.printers.__wrapped__()
