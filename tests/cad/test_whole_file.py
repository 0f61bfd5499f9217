"""Files that appear whole or not at all, and that one module writes them."""

import ast
import errno
import fcntl
import importlib
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from cad.errors import FileError
from cad.whole_file import PRIVATE, drafted, hold_lock, new_folder, put_file, replace_file, require_place

ROOT = Path(__file__).resolve().parents[2]
WRITERS = {"cad/whole_file.py", "fab/exports/whole_folder.py"}  # single files and new folders; folders with the user's


def renames(source: str) -> list[int]:
    """Lines that give a file another name: os.replace, os.rename, shutil.move, and Path's rename and replace."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
            continue
        owner, name = ast.unparse(node.func.value), node.func.attr
        plain = name == "replace" and len(node.args) == 1 and not node.keywords  # of a Path: text takes two words
        if name == "rename" or plain or (owner, name) in {("os", "replace"), ("shutil", "move"), ("os", "link")}:
            found.append(node.lineno)
    return found


def test_nobody_else_renames():
    paths = [path for package in ("cad", "endcap", "fab", "sensing") for path in (ROOT / package).rglob("*.py")]
    found = {str(path.relative_to(ROOT)): lines for path in paths if (lines := renames(path.read_text()))}
    assert set(found) == WRITERS, found


@pytest.mark.parametrize(
    ("line", "seen"),
    [
        ("os.replace(a, b)", True),
        ("Path(a).rename(b)", True),
        ("draft.replace(path)", True),
        ("shutil.move(a, b)", True),
        ("text.replace('a', 'b')", False),
        ("replace(record, x=1)", False),
        ("moment.replace(tzinfo=None)", False),
    ],
)
def test_the_scan_sees_twins(line, seen):
    assert bool(renames(line)) == seen


def test_a_file_is_replaced_and_nothing_else_is_left(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("old")
    replace_file(path, b"new")
    put_file(tmp_path / "b", b"b", durable=True)
    with drafted(tmp_path / "c.png") as draft:
        assert draft.parent == tmp_path and draft.suffix == ".png" and not (tmp_path / "c.png").exists()
        draft.write_bytes(b"c")
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == {"a.json": b"new", "b": b"b", "c.png": b"c"}


def test_a_secret_is_private_from_its_first_byte(tmp_path, monkeypatch):
    seen = []
    fsync = os.fsync
    monkeypatch.setattr(os, "fsync", lambda number: (seen.append(os.fstat(number).st_mode), fsync(number)))
    put_file(tmp_path / "token", b"secret", PRIVATE, durable=True)
    assert [stat.S_IMODE(mode) for mode in seen] == [0o600]
    assert stat.S_IMODE((tmp_path / "token").stat().st_mode) == 0o600


@pytest.mark.parametrize("write", [lambda p: replace_file(p, b"new"), lambda p: put_file(p, b"new")])
def test_what_stood_there_stands_when_the_writer_fails(tmp_path, monkeypatch, write):
    path = tmp_path / "a"
    path.write_bytes(b"old")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises((FileError, OSError), match="No space left"):
        write(path)
    assert [p.name for p in tmp_path.iterdir()] == ["a"] and path.read_bytes() == b"old"


def test_the_message_names_file_reason_and_remedy(tmp_path):
    with pytest.raises(FileError, match="none/a: No such file or directory: choose another place"):
        replace_file(tmp_path / "none" / "a", b"", "choose another place")


def test_a_full_disk_asks_for_space(tmp_path):
    real = os.open
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "open", lambda path, flags, mode=0o777: real("/dev/full", os.O_WRONLY))
        with pytest.raises(FileError, match="No space left on device: free some space, or give a folder"):
            replace_file(tmp_path / "a", b"x")
    assert not list(tmp_path.iterdir())


def test_a_place_is_tried_before_long_work(tmp_path):
    (tmp_path / "there").write_text("mine")
    require_place(tmp_path / "there")
    require_place(tmp_path / "new")
    assert [path.name for path in tmp_path.iterdir()] == ["there"] and (tmp_path / "there").read_text() == "mine"
    for path, why in ((tmp_path, "Is a directory"), (tmp_path / "no" / "x", "No such file"), (Path("/proc/x"), "")):
        with pytest.raises(FileError, match=rf"^{path}: .*{why}.*: name a file in a folder that may be written$"):
            require_place(path)


@pytest.mark.parametrize(
    "words",
    [
        "train --design 130 8 --out /proc/w.safetensors",
        "train nowhere --out /proc/w.safetensors",
        "evaluate nowhere --csv /proc/x.csv",
        "evaluate nowhere --cells-csv /proc/x.csv",
        "calibrate --photo nowhere.jpg --out /proc/camera.json",
        "field --reference nowhere.jpg --frame nowhere.jpg --out /proc/field.npy",
    ],
)
def test_long_commands_try_their_place_first(words, capsys):
    name, *rest = words.split()
    assert importlib.import_module(f"sensing.{name}").main(rest) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"{rest[-1]}: " in line and "name a file in a folder that may be written" in line


def test_a_new_folder_appears_whole_or_not_at_all(tmp_path):
    with new_folder(tmp_path / "set") as folder:
        (folder / "a").write_text("a")
        assert not (tmp_path / "set").exists()
    with pytest.raises(FileError, match="not an empty folder"), new_folder(tmp_path / "set"):
        pass
    with pytest.raises(KeyboardInterrupt), new_folder(tmp_path / "other") as folder:
        raise KeyboardInterrupt
    assert [p.name for p in tmp_path.iterdir()] == ["set"]


def test_a_new_folder_takes_nothing_of_the_users_and_sweeps_what_a_killed_run_left(tmp_path):
    (tmp_path / "set.part").mkdir()
    (tmp_path / "set.part" / "mine").write_text("mine")
    (tmp_path / ".other.partial-1234").mkdir()
    with new_folder(tmp_path / "set") as folder, new_folder(tmp_path / "twin") as second:
        assert folder.exists() and second.exists()  # the second does not sweep the first, which lives
        with pytest.raises(KeyboardInterrupt), new_folder(tmp_path / "set"):
            assert folder.exists()
            raise KeyboardInterrupt
    assert (tmp_path / "set.part" / "mine").read_text() == "mine"
    assert sorted(path.name for path in tmp_path.iterdir()) == [".other.partial-1234", "set", "set.part", "twin"]


def test_a_killed_process_leaves_a_folder_that_the_next_start_sweeps(tmp_path):
    code = """
import os, signal, sys
from pathlib import Path
from cad.whole_file import new_folder
with new_folder(Path(sys.argv[1])) as folder:
    (folder / "half").write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "set")], cwd=ROOT, check=False)
    assert len(list(tmp_path.glob(".set.partial-*"))) == 1
    with new_folder(tmp_path / "set") as folder:
        (folder / "whole").write_text("whole")
    assert sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*")) == ["set", "set/whole"]


def test_a_lock_is_held_by_one_and_is_never_a_link_nor_a_pipe(tmp_path):
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "link").symlink_to(tmp_path / "mine")
    (tmp_path / "nowhere").symlink_to(tmp_path / "none")
    os.mkfifo(tmp_path / "pipe")
    for name in ("link", "nowhere", "pipe"):
        with pytest.raises(OSError):
            hold_lock(tmp_path / name)
    assert (tmp_path / "mine").read_text() == "mine" and not (tmp_path / "none").exists()
    with hold_lock(tmp_path / "mine"):
        assert (tmp_path / "mine").read_text() == "mine"
        with pytest.raises(BlockingIOError):
            hold_lock(tmp_path / "mine")
    hold_lock(tmp_path / "mine").close()


def test_a_file_system_without_locks_is_refused_and_nothing_is_left(tmp_path, monkeypatch):
    """As Lustre without the option flock: 26,000 hidden folders were made in three seconds, until two had one name."""

    def no_lock(*_: object) -> None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))

    def mkdir(path, *words, make=Path.mkdir, **more):
        made.append(path.name)
        assert len(made) < 9
        make(path, *words, **more)

    made: list[str] = []
    monkeypatch.setattr(fcntl, "flock", no_lock)
    monkeypatch.setattr(Path, "mkdir", mkdir)
    with pytest.raises(OSError, match="no locks"), new_folder(tmp_path / "data"):
        pass
    assert sum("partial" in name for name in made) == 1 and list(tmp_path.iterdir()) == []
