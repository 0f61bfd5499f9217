"""Molds are whole or not there: full disks, failing gates, interruption, workers of a command that was ended."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future
from contextlib import contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace

import pytest
import trimesh
from long_cases import others_long
from started_molds import SMALL, left_in, start, wait_until_signals_are_handled
from test_architecture import ROOT

from fab import molds
from fab.checks.check import Check
from fab.exports.whole_folder import whole_folder


def full_disk(*_args, **_kwargs):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


class Inline(Executor):
    """Runs each call at once, in this process."""

    def submit(self, fn, /, *args, **kwargs):
        future: Future = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


def gate(patch: pytest.MonkeyPatch, checks: Callable[[object], list[Check]]) -> None:
    """Let these be all the checks that a run makes."""
    patch.setattr("fab.checks.gates.start_gates", lambda *_: SimpleNamespace(checks=checks))


@pytest.fixture
def stub(monkeypatch, tmp_path_factory):
    """Everything after the design replaced by writers of one small file, and one gate that holds."""
    design = SimpleNamespace(meshes={"hanger": None}, parts={"hanger": SimpleNamespace(role="printed")})
    monkeypatch.setattr("fab.design.build_design", lambda *_, **__: design)
    monkeypatch.setattr("fab.exports.writer.write_meshes", lambda _, folder: (folder / "hanger.stl").write_text("s"))
    monkeypatch.setattr("fab.exports.part_3mf.write_3mf", lambda _mesh, _name, path: path.write_text("3mf"))
    monkeypatch.setattr("fab.exports.writer.picture_items", lambda _: ([], []))
    monkeypatch.setattr(
        "fab.exports.writer.write_pictures", lambda _, __, folder: (folder / "parts.png").write_text("png")
    )
    for name in ("write_solids", "write_assemblies"):
        monkeypatch.setattr(f"fab.exports.writer.{name}", lambda _, folder, n=name: (folder / n).write_text("x"))
    monkeypatch.setattr("fab.exports.writer.manifest", lambda *_: {})
    monkeypatch.setattr("fab.exports.writer.exploded_offsets_mm", lambda _: {})
    monkeypatch.setattr("fab.exports.preview_parts.preview_glb", lambda *_: b"glb")
    monkeypatch.setattr("fab.exports.index_page.write_index", lambda *a: (a[-1] / "index.html").write_text("page"))
    gate(monkeypatch, lambda _: [Check("shell.watertight", 1.0, low=1)])

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))

    @contextmanager
    def inline_pool(_count):
        yield Inline()

    monkeypatch.setattr(molds, "worker_pool", inline_pool)
    return monkeypatch


def test_the_stub_writes_when_nothing_fails(stub, tmp_path, capsys):
    assert molds.main([f"exports={tmp_path}"]) == 0
    assert sorted(os.listdir(tmp_path)) == ["D130_T8"]
    assert "manifest.json" in left_in(tmp_path)


def test_the_printer_that_was_asked_for_is_noted_and_its_bed_gates_every_printed_part(stub, tmp_path):
    box = trimesh.creation.box((100.0, 50.0, 20.0))
    design = SimpleNamespace(meshes={"hanger": box}, parts={"hanger": SimpleNamespace(role="printed")})
    stub.setattr("fab.design.build_design", lambda *_, **__: design)
    gated = []
    stub.setattr("fab.exports.writer.manifest", lambda _, checks, __: gated.append([c.name for c in checks]) or {})
    for words, noted in (([], None), (["printer=mk4"], "mk4"), ([], None)):  # the cache keeps them apart
        assert molds.main([f"exports={tmp_path}", *words]) == 0
        assert json.loads((tmp_path / "D130_T8" / "manifest.json").read_text()).get("printer") == noted
    assert gated == [["shell.watertight"], ["shell.watertight", "hanger.room_on_mk4_mm"]]
    box.apply_scale(3.0)
    assert molds.main([f"exports={tmp_path}", "printer=mk4", "cache=no"]) == 1


@pytest.mark.parametrize(
    "writer",
    [
        *(f"writer.write_{what}" for what in ("meshes", "solids", "assemblies", "pictures", "manifest")),
        "part_3mf.write_3mf",
        "index_page.write_index",
    ],
)
def test_a_full_disk_gets_one_line_status_2_and_leaves_nothing(stub, writer, tmp_path, capsys):
    stub.setattr(f"fab.exports.{writer}", full_disk)
    assert molds.main([f"exports={tmp_path}"]) == 2
    *steps, error = capsys.readouterr().err.splitlines()
    assert "No space left on device" in error and "exports=DIR" in error
    assert all(" s " in step for step in steps)
    assert left_in(tmp_path) == []


def test_a_full_disk_is_said_before_what_the_cache_holds_is_made_again(stub, tmp_path, capsys):
    assert molds.main([f"exports={tmp_path / 'first'}"]) == 0
    stub.setattr("fab.design.build_design", lambda *_, **__: pytest.fail("made again"))
    with stub.context() as disk:
        disk.setattr(Path, "write_bytes", lambda path, _: full_disk() if path.suffix == ".stl" else 0)
        assert molds.main([f"exports={tmp_path / 'full'}"]) == 2
    assert "No space left on device: free some space or name another folder" in capsys.readouterr().err
    assert left_in(tmp_path / "full") == []
    assert molds.main([f"exports={tmp_path / 'second'}"]) == 0


def test_a_failing_gate_names_the_check_and_leaves_nothing(stub, tmp_path, capsys):
    gate(stub, lambda _: [Check("shell.watertight", 0.0, low=1), Check("a", 0.0)])
    assert molds.main([f"exports={tmp_path}"]) == 1
    err = capsys.readouterr().err
    assert "shell.watertight = 0, wanted >= 1" in err and "1 of 2 checks failed" in err
    assert left_in(tmp_path) == []


def test_a_failing_run_keeps_what_an_earlier_one_wrote(stub, tmp_path):
    assert molds.main([f"exports={tmp_path}"]) == 0
    before = left_in(tmp_path)
    stub.setattr("fab.exports.writer.write_pictures", full_disk)
    assert molds.main([f"exports={tmp_path}", "cache=no"]) == 2
    assert left_in(tmp_path) == before


def test_interruption_leaves_nothing(stub, tmp_path, capsys):
    def interrupted(*_):
        signal.raise_signal(signal.SIGINT)

    gate(stub, interrupted)
    assert molds.main([f"exports={tmp_path}"]) == 130
    assert "interrupted" in capsys.readouterr().err
    assert left_in(tmp_path) == []


@pytest.mark.parametrize(
    "step", ["exports.writer.write_meshes", "checks.gates.start_gates", "exports.writer.write_manifest"]
)
def test_an_interruption_that_a_library_swallows_ends_the_run_at_its_next_step(stub, tmp_path, step, capsys):
    def swallowed(*_):
        with suppress(BaseException):
            signal.raise_signal(signal.SIGINT)
        return SimpleNamespace(checks=lambda _: [Check("shell.watertight", 1.0, low=1)])

    stub.setattr(f"fab.{step}", swallowed)
    stub.setattr("fab.cache.Cache.store", lambda *_: pytest.fail("kept"))
    assert molds.main([f"exports={tmp_path}"]) == 130
    assert capsys.readouterr().err.splitlines()[-1] == "make molds: interrupted; nothing was left behind"
    assert left_in(tmp_path) == []


def test_an_interruption_swallowed_at_the_last_is_asked_for_before_the_files_appear(stub, tmp_path):
    def swallowed(*_):
        with suppress(BaseException):
            signal.raise_signal(signal.SIGINT)

    stub.setattr("fab.exports.writer.write_manifest", swallowed)
    assert molds.main([f"exports={tmp_path}", "cache=no"]) == 130
    assert left_in(tmp_path) == []


INTERRUPTED_IN_TEXT = """
import sys

from fab.command import Command


def act(options, interrupts):
    exec("import signal; signal.raise_signal(signal.SIGINT)")  # as the text of a data class in an import
    return 0


sys.exit(Command("make it", "", "", "", {}).run([], act))
"""


def test_an_interruption_in_code_given_as_text_ends_with_its_status_too(tmp_path):
    """``python -m`` ended by the signal instead, now and then, while the CAD kernel was loaded."""
    (tmp_path / "interrupted.py").write_text(INTERRUPTED_IN_TEXT)
    known = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    done = subprocess.run([sys.executable, "-m", "interrupted"], capture_output=True, text=True, env=known, check=False)
    assert (done.returncode, done.stderr) == (130, "make it: interrupted; nothing was left behind\n")


# While the CAD kernel is loaded, and while parts are made.
@pytest.mark.parametrize("wait_s", others_long([2.0, 8.0]))
def test_ctrl_c_in_a_terminal_stops_every_process_and_leaves_nothing(tmp_path, wait_s):
    process = start(*SMALL, f"exports={tmp_path}")
    wait_until_signals_are_handled(process)
    time.sleep(wait_s)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert out == "" and err.splitlines()[-1] == "make molds: interrupted; nothing was left behind"
    assert left_in(tmp_path) == []


def workers_of(process: subprocess.Popen[str]) -> list[int]:
    """Process ids of a command's children, as the kernel lists them."""
    listed = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    return [int(word) for word in listed.read_text().split()]


def alive(pid: int) -> bool:
    """Whether a thread of a process still runs: it holds the process's files after the first thread has ended."""
    try:
        states = [(task / "status").read_text() for task in Path(f"/proc/{pid}/task").iterdir()]
    except (FileNotFoundError, ProcessLookupError):
        return Path(f"/proc/{pid}").exists()  # a thread ended while they were listed: asked again
    return any("\nState:\tZ" not in state for state in states)


def started_with_workers(exports: Path) -> tuple[subprocess.Popen[str], list[int]]:
    """A run that makes parts at this moment, and its workers."""
    process = start(*SMALL, f"exports={exports}")
    for _ in range(1200):
        time.sleep(0.1)
        if len(workers := workers_of(process)) == molds.worker_count():
            time.sleep(1.0)  # into the work
            assert any(name.startswith(".D100_T8.partial-") for name in os.listdir(exports))
            return process, workers
        assert process.poll() is None
    raise AssertionError("no workers")


def gone_within(seconds: float, pids: list[int]) -> bool:
    for _ in range(int(10 * seconds)):
        if not any(alive(pid) for pid in pids):
            return True
        time.sleep(0.1)
    return False


def test_sigterm_ends_the_workers_and_leaves_nothing(tmp_path):
    process, workers = started_with_workers(tmp_path)
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM
    assert err.splitlines()[-1] == "make molds: ended by SIGTERM; nothing was left behind"
    assert gone_within(5, workers)
    assert left_in(tmp_path) == []


@pytest.mark.long
def test_a_killed_run_leaves_no_worker_and_the_next_start_sweeps_its_folder(tmp_path):
    process, workers = started_with_workers(tmp_path)
    process.kill()
    process.wait()
    assert gone_within(5, workers)
    assert any(".partial-" in name for name in os.listdir(tmp_path))  # nobody could tidy up
    with whole_folder(tmp_path / "D130_T8", "manifest.json") as folder:
        (folder / "manifest.json").write_text("{}")
        assert [name for name in os.listdir(tmp_path) if ".partial-" in name] == [folder.name]
    assert os.listdir(tmp_path) == ["D130_T8"]
