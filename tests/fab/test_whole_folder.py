"""Whole folders: what is ours is replaced at once, what is the user's stays, and dead runs are tidied up."""

from __future__ import annotations

import errno
import os
import signal
from pathlib import Path

import pytest

from cad.errors import FileError
from fab.exports import whole_folder as module
from fab.exports.whole_folder import listed_files, whole_folder, write_record

RECORD = "record.json"


def write(final: Path, **files: str) -> None:
    with whole_folder(final, RECORD) as folder:
        for name, text in files.items():
            (folder / f"{name}.stl").write_text(text)
        write_record(folder, RECORD, {"parts": []})


def contents(folder: Path) -> dict[str, str]:
    return {p.relative_to(folder).as_posix(): p.read_text() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture
def final(tmp_path: Path) -> Path:
    write(tmp_path / "D", base="old base", core="old core")
    return tmp_path / "D"


def test_a_second_run_replaces_what_it_listed_and_removes_what_it_no_longer_makes(final):
    write(final, base="new base", cup="cup")
    assert {k: v for k, v in contents(final).items() if k != RECORD} == {"base.stl": "new base", "cup.stl": "cup"}
    assert set(listed_files(final, RECORD)) == {"base.stl", "cup.stl"}
    assert os.listdir(final.parent) == ["D"]


def test_what_the_user_keeps_in_the_folder_stays(final):
    mine = {"notes.txt": "tried PETG", "gcode/base.gcode": "G1", "slice/slice.json": "{}"}
    for name, text in mine.items():
        (final / name).parent.mkdir(exist_ok=True)
        (final / name).write_text(text)
    inode = (final / "notes.txt").stat().st_ino
    write(final, base="new base")
    assert {k: v for k, v in contents(final).items() if k != RECORD} == {"base.stl": "new base", **mine}
    assert (final / "notes.txt").stat().st_ino == inode  # not even moved


def test_a_listed_file_that_the_user_changed_is_refused_before_any_work(final):
    (final / "base.stl").write_text("repaired by hand")
    before = contents(final)
    with pytest.raises(FileError, match=r"base\.stl: changed since it was written") as caught:
        write(final, base="new base")
    assert contents(final) == before and len(str(caught.value).splitlines()) == 1
    assert os.listdir(final.parent) == ["D"]


def test_a_file_of_the_user_under_one_of_our_names_is_refused(final):
    (final / "cup.stl").write_text("my own cup")
    before = contents(final)
    with pytest.raises(FileError, match=r"cup\.stl: not listed in record\.json, so it is yours"):
        write(final, base="new base", cup="cup")
    assert contents(final) == before and os.listdir(final.parent) == ["D"]


@pytest.mark.parametrize("text", ["{", "[]", '{"files": 3}', '{"files": {"../x": "0"}}', '{"files": {"/etc/x": "0"}}'])
def test_a_record_that_cannot_be_trusted_is_refused(final, text):
    (final / RECORD).write_text(text)
    with pytest.raises(FileError, match=str(final / RECORD)):
        write(final, base="new base")
    assert (final / "base.stl").read_text() == "old base"


def test_a_file_where_the_folder_belongs_is_refused(tmp_path):
    (tmp_path / "D").write_text("mine")
    with pytest.raises(FileError, match="is a file where a folder belongs"):
        write(tmp_path / "D", base="b")
    assert (tmp_path / "D").read_text() == "mine"


def test_an_error_leaves_what_stood_there(final):
    before = contents(final)
    with pytest.raises(FileError, match="No space left on device: free some space"), whole_folder(final, RECORD) as new:
        (new / "half.stl").write_text("half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert contents(final) == before and os.listdir(final.parent) == ["D"]


def test_a_file_elsewhere_that_cannot_be_read_is_named_and_not_the_folder(tmp_path):
    table = tmp_path / "installed" / "table.csv"
    with pytest.raises(FileError) as caught, whole_folder(tmp_path / "exports" / "D", RECORD):
        table.read_text()
    assert str(caught.value) == (f"{table}: No such file or directory: make it readable, or install the toolkit again")


def test_a_run_killed_while_its_files_move_in_is_finished_by_the_next_start(final, monkeypatch):
    moved = []

    def replace_once(self, target):
        if moved:
            raise SystemError("killed here")
        moved.append(target)
        os.replace(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", replace_once)
        patch.setattr(module.shutil, "rmtree", lambda *_, **__: None)
        with pytest.raises(SystemError):
            write(final, base="new base", cup="new cup")
    half = contents(final)
    assert half["base.stl"] == "new base" and "cup.stl" not in half and len(os.listdir(final.parent)) == 2
    module.sweep(final, RECORD)
    assert {k: v for k, v in contents(final).items() if k != RECORD} == {"base.stl": "new base", "cup.stl": "new cup"}
    assert set(listed_files(final, RECORD)) == {"base.stl", "cup.stl"} and os.listdir(final.parent) == ["D"]


def test_the_folder_of_a_living_run_is_not_swept(tmp_path):
    with whole_folder(tmp_path / "A", RECORD) as first:
        write(tmp_path / "B", base="b")
        assert first.exists()
        write_record(first, RECORD, {})
    (tmp_path / ".C.partial-123").mkdir()
    (tmp_path / ".C.partial-123" / "x").write_text("of a dead run")
    module.remove_partial(tmp_path)
    assert sorted(os.listdir(tmp_path)) == ["A", "B"]


def test_a_signal_that_comes_while_files_move_in_does_not_split_the_folder(final, monkeypatch):
    handled = []
    monkeypatch.setattr(module, "_move_in", lambda *_: (signal.raise_signal(signal.SIGTERM), handled.append(True)))
    before = signal.getsignal(signal.SIGTERM)
    write(final, base="new base")
    assert handled == [True] and signal.getsignal(signal.SIGTERM) == before
