"""The five tutorials are notebooks without outputs, and every code cell runs, in order, in an empty folder."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "tutorials"
NOTEBOOKS = sorted(path.stem for path in FOLDER.glob("*.ipynb"))
LONG = ("own_network", "read_a_recording")  # a training and a robot's run, a minute of a processor


def code_cells(name: str) -> list[str]:
    notebook = json.loads((FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))
    assert notebook["nbformat"] == 4
    return ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]


def test_there_are_five():
    assert NOTEBOOKS == ["calibrate_and_run", "own_network", "press_it", "read_a_recording", "your_size"]


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_no_output_is_committed(name):
    notebook = json.loads((FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.long] * (name in LONG)) for name in NOTEBOOKS])
def test_every_cell_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    namespace: dict[str, object] = {"__name__": "__main__"}
    for number, source in enumerate(code_cells(name), 1):
        exec(compile(source, f"{name}.ipynb, code cell {number}", "exec"), namespace)
