"""Command lines of the benches: help runs nothing, and one study leaves the published rows of the others alone."""

import ast
import csv
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from unittest.mock import Mock

import pytest
from test_architecture import ROOT

from bench import bench_similarity, bench_wrench, parts
from bench.one_line import in_one_line
from cad.errors import EndcapError
from sensing.simulator.dataset.cluster import Origin

OURS = ("bench", "cad", "endcap", "fab", "sensing")
FOREIGN = ("bpy", "addon_utils", "mathutils", "gtsam")  # of Blender, and what the lock does not have
PARSERS = ("ArgumentParser(", "variant_on_one_core(", "asked_film(")


def without_parser(texts: dict[str, str]) -> list[str]:
    """Benches that run whatever the command line says."""
    return [name for name, text in texts.items() if not any(parser in text for parser in PARSERS)]


def not_found(path: Path) -> set[str]:
    """Modules of this repository, or of nobody, that a bench imports and that are not there."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names = {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    names |= {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    return {name for name in names if name.split(".")[0] not in FOREIGN and not _is_there(name)}


def _is_there(name: str) -> bool:
    places = [folder / name.replace(".", "/") for folder in (ROOT, ROOT / "bench", ROOT / "tests")]
    ours = any(place.is_dir() or place.with_suffix(".py").is_file() for place in places)
    return ours or (name.split(".")[0] not in OURS and find_spec(name.split(".")[0]) is not None)


def test_what_benches_import_is_there(tmp_path: Path):
    """mypy leaves out modules that it does not find: four benches imported what had been moved into folders."""
    assert set().union(*(not_found(path) for path in (ROOT / "bench").rglob("*.py"))) == set()
    (tmp_path / "a.py").write_text(
        "import numpy as np\nfrom sensing.nothing import a\nimport live_plans, bench.live.plans\n"
    )
    assert not_found(tmp_path / "a.py") == {"sensing.nothing", "live_plans"}


def test_help_of_a_bench_does_not_run_it():
    """``--help`` of eleven benches ran them for minutes and wrote their tables over the published ones."""
    texts = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / "bench").glob("bench_*.py")}
    assert len(texts) > 30 and without_parser(texts) == []
    assert without_parser({"bench_nothing.py": "def main() -> None: ..."}) == ["bench_nothing.py"]


def test_one_study_of_the_wrench_leaves_the_rows_of_the_others(tmp_path: Path):
    """The command of docs/wrench.md for the tracker's error once left nothing but its own rows in bench/wrench.csv."""
    table = tmp_path / "wrench.csv"
    empty = dict.fromkeys(bench_wrench.ROWS, "")
    bench_wrench.save(
        [empty | {"study": "size", "name": "ridge", "force_rmse_n": 0.1}, empty | {"study": "tracking", "x": 1.0}],
        table,
    )
    bench_wrench.save([empty | {"study": "tracking", "name": "centre", "x": 0.056}], table)
    with table.open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [(row["study"], row["name"], row["force_rmse_n"], row["x"]) for row in rows] == [
        ("size", "ridge", "0.1", ""), ("tracking", "centre", "", "0.056"),
    ]  # fmt: skip
    assert bench_wrench.read(table)[0]["force_rmse_n"] == 0.1
    assert list(tmp_path.iterdir()) == [table]


@pytest.mark.parametrize(
    ("words", "said"),
    [(["nothing"], "'nothing' is no study"), (["data", "--train", "no_such"], "no_such: no frames here yet")],
)
def test_what_the_bench_of_the_wrench_cannot_do_is_said_in_one_line(words, said, capsys):
    with pytest.raises(SystemExit) as ended:
        bench_wrench.main(words)
    assert ended.value.code == 2 and said in capsys.readouterr().err


def run(name: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A bench in a process of its own, without the settings of the tests' own: as a user starts it."""
    command = [sys.executable, str(ROOT / "bench" / f"bench_{name}.py"), *arguments]
    clean = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT, env=clean)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("floor no_such --states no_such", "no_such/manifest.json"),
        ("similarity --designs 165x11", "'165x11'"),
        ("live --seconds 0 --weights-paper no_such.pth", "no_such.pth"),
    ],
)
def test_what_a_bench_lacks_is_said_in_one_line(words: str, said: str):
    """A mistyped folder, design or file was a traceback; of --weights-paper after all live runs, whose rows it lost."""
    done = run(*words.split())
    assert done.returncode == 2 and said in done.stderr and len(done.stderr.splitlines()) == 1, done.stderr


def test_every_bench_ends_in_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    """A bench that is stopped by Ctrl-C, as long ones are, ended in a traceback."""
    programs = list((ROOT / "bench").glob("bench_*.py"))
    ending = "sys.exit(in_one_line(main))\n"
    assert [path.name for path in programs if not path.read_text(encoding="utf-8").endswith(ending)] == []
    monkeypatch.setattr(sys, "argv", ["bench/bench_any.py"])
    for error, status, said in ((KeyboardInterrupt(), 130, "interrupted"), (EndcapError("D=1: no"), 2, "D=1: no")):
        assert in_one_line(Mock(side_effect=error)) == status
        assert capsys.readouterr().err == f"bench_any: {said}\n"
    assert [in_one_line(lambda status=status: status) for status in (None, 0, 1)] == [0, 0, 1]


def test_a_picture_that_is_none_leaves_the_table_of_fields(tmp_path: Path):
    """It once wrote an empty table over the published one, and then ended in a traceback."""
    table = tmp_path / "fields.csv"
    table.write_text("kept\n")
    done = run("fields", "--only", "no_such", "--out", str(table))
    assert done.returncode == 2 and "'no_such' is no picture" in done.stderr and table.read_text() == "kept\n"


def test_a_part_of_a_bench_leaves_the_published_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """``bench_fields.py --patterns 2``, an example of its own help, wrote fewer rows of fewer frames over all."""
    monkeypatch.setattr(parts, "ROOT", tmp_path)
    whole, part = (parts.table_of("fields.csv", whole) for whole in (True, False))
    assert (whole, part) == (tmp_path / "bench" / "fields.csv", tmp_path / "build" / "fields.csv")
    assert part.parent.is_dir()
    texts = [(ROOT / "bench" / f"bench_{name}.py").read_text() for name in ("fields", "fields_knobs", "stages", "live")]
    assert all("table_of(" in text for text in texts)


def test_states_of_an_older_simulator_are_solved_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """They are kept in build/, where those of a simulator of weeks ago passed for today's."""
    solved: list[Path] = []
    monkeypatch.setattr(bench_similarity, "solve_node", lambda *_: "a node")
    monkeypatch.setattr(bench_similarity, "save_node", lambda _, path: (solved.append(path), path.write_text("")))
    monkeypatch.setattr(bench_similarity, "read_node", str)
    for code in ("older", "older", "newer"):
        monkeypatch.setattr(bench_similarity.Origin, "here", staticmethod(lambda code=code: Origin(code, "")))
        assert bench_similarity.own_states((110.0, 11.0), tmp_path).node == str(solved[-1])
    assert [path.parent.name for path in solved] == ["older", "newer"]
