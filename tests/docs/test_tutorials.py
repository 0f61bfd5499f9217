"""The five tutorials are notebooks without outputs, and every code cell runs, in order, in an empty folder."""

from __future__ import annotations

import json
import re
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
    run_cells(name, code_cells(name))


@pytest.mark.parametrize("name", ["calibrate_and_run", "own_network", "press_it"])
def test_an_endcap_is_named_once(name):
    """Whoever tries another size edits one line; a second one would mix two endcaps in one result."""
    sources = "\n".join(code_cells(name))
    assert len(re.findall(r"(?:EndcapParams|shell_geometry)\(\s*\d", sources)) == 1
    assert sources.count('"Smooth-Sil 950"') == 1 and "silicone()" not in sources
    assert all("**" in words for words in re.findall(r"(?:EndcapConfig|DataRequest)\(([^)]*)\)", sources))


@pytest.mark.long
def test_your_own_network_runs_for_another_endcap(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    changes = {"EndcapParams(130, 8)": "EndcapParams(172, 12.5)", '"Smooth-Sil 950"': '"Ecoflex 00-50"'}
    sources = code_cells("own_network")
    for usual, other in changes.items():
        assert sum(usual in source for source in sources) == 1
        sources = [source.replace(usual, other) for source in sources]
    run_cells("own_network", sources)


def run_cells(name: str, sources: list[str]) -> None:
    namespace: dict[str, object] = {"__name__": "__main__"}
    for number, source in enumerate(sources, 1):
        exec(compile(source, f"{name}.ipynb, code cell {number}", "exec"), namespace)
