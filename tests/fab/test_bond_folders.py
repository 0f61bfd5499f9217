"""Folders of bond tests: which files are read, in any case of their names, and that those left out are named."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fab.bond_tests.__main__ import main, read_folder


def write(path: Path) -> None:
    """A record of both tests: a ramp to 40 N, a fall to 20 N, and 20 N to the end."""
    travel = np.linspace(0.0, 420.0, 1000)
    load = np.interp(travel, [0, 20, 24, 420], [0, 40, 20, 20])
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        "\n".join(["Extension (mm),Load (N)", *(f"{x:.4f},{y:.4f}" for x, y in zip(travel, load, strict=True))])
    )


def test_files_count_whatever_the_case_of_their_ending(tmp_path):
    method = tmp_path / "tensile" / "mechanical"
    for name in ("a.csv", "B.CSV"):
        write(method / name)
    (method / "notes.txt").write_text("of the same tests")
    assert [specimen.name for specimen in read_folder(tmp_path)] == ["B.CSV", "a.csv"]


def test_folders_count_in_any_case_and_files_elsewhere_are_named(tmp_path, capsys):
    for place in ("Tensile/mechanical/a.csv", "PEEL/mechanical/b.csv"):
        write(tmp_path / place)
    assert main([str(tmp_path)]) == 0 and "left out" not in capsys.readouterr().err
    for place in ("Tensile/c.csv", "peel_2/mechanical/d.csv", "tensile/mechanical/old/E.CSV"):
        write(tmp_path / place)
    assert main([str(tmp_path)]) == 0
    warning = capsys.readouterr().err
    assert "3 CSV files are left out, not in tensile/METHOD/*.csv or peel/METHOD/*.csv: Tensile/c.csv, peel_" in warning
    assert [(s.kind, s.name) for s in read_folder(tmp_path)] == [("tensile", "a.csv"), ("peel", "b.csv")]


def test_an_interruption_is_one_line(tmp_path, monkeypatch, capsys):
    def interrupted(_: Path) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("fab.bond_tests.__main__.read_folder", interrupted)
    assert main([str(tmp_path)]) == 130
    assert capsys.readouterr().err == "bond_tests: interrupted\n"
