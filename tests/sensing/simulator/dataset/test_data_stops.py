"""Writing a data set on one process, several, or a cluster; killed, interrupted, without space, grown and damaged."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from long_cases import others_long
from small_data import command, environment, group_lives, same, small_request

from cad.errors import FileError
from sensing.records_labelled import LabelledSet
from sensing.set_manifest import shard_path
from sensing.simulator.__main__ import main
from sensing.simulator.dataset import cluster, local_workers
from sensing.simulator.dataset import writer as dataset
from sensing.simulator.dataset.writer import write_dataset

pytestmark = pytest.mark.usefixtures("short_paths")


def test_a_killed_run_goes_on_and_ends_the_same(small_set: Path, tmp_path: Path) -> None:
    run = subprocess.run(command("kill", tmp_path), env=environment())
    assert run.returncode == -signal.SIGKILL
    assert shard_path(tmp_path, 0).exists() and not shard_path(tmp_path, 1).exists()
    assert list(tmp_path.rglob("*.part"))  # killed while it wrote
    assert len(list(LabelledSet(tmp_path).frames())) == 6
    assert write_dataset(small_request(), tmp_path) == 1
    assert same(tmp_path, small_set) and not list(tmp_path.rglob("*.part"))
    assert write_dataset(small_request(), tmp_path) == 0


@pytest.mark.long
def test_a_full_disk_is_one_line_and_what_was_written_stays(small_set: Path, tmp_path: Path) -> None:
    run = subprocess.run(command("full", tmp_path), env=environment(), capture_output=True, text=True)
    assert run.returncode == 2, run.stderr
    assert run.stderr.count("\n") == 1 and "cannot be written (File too large)" in run.stderr
    assert len(list(LabelledSet(tmp_path).frames())) == 6 and not list(tmp_path.rglob("*.part"))


@contextmanager
def running(folder: Path) -> Iterator[subprocess.Popen]:
    """A long run on two workers that has written its first shard; what is left of it in the end is killed."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "start_new_session": True}
    # a shell's background job ignores SIGINT, and its children inherit that: this one is in the foreground
    hears = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}
    run = subprocess.Popen(command("long", folder), env=environment(), **pipes, **hears)
    deadline = time.monotonic() + 120
    try:
        while not list(folder.glob("shards/[0-9]*.npz")) and run.poll() is None and time.monotonic() < deadline:
            time.sleep(0.05)
        yield run
    finally:
        if group_lives(run.pid):
            os.killpg(run.pid, signal.SIGKILL)
        run.communicate()


def ends(run: subprocess.Popen) -> bool:
    """Whether the command and its workers are all gone soon."""
    deadline = time.monotonic() + 30
    while group_lives(run.pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    return not group_lives(run.pid)


def test_ctrl_c_is_one_line_and_leaves_no_mess(tmp_path: Path) -> None:
    """As a terminal sends it: to the command and to its workers alike."""
    with running(tmp_path) as run:
        os.killpg(run.pid, signal.SIGINT)
        errors = run.communicate(timeout=60)[1]
        assert run.returncode == 130, errors
        assert errors == "sensing.simulator: stopped; run the same command again to go on\n"
        assert list(LabelledSet(tmp_path).frames()) and not list(tmp_path.rglob("*.part"))
        assert ends(run)


def test_ctrl_c_is_no_exception_while_futures_are_locked(monkeypatch: pytest.MonkeyPatch) -> None:
    """One in the middle of `wait` leaves them locked, and the pool's end then waits for ever."""
    plain, whole, before = local_workers.wait, [], signal.getsignal(signal.SIGINT)

    def interrupted(*arguments: Any, **options: Any) -> Any:
        signal.raise_signal(signal.SIGINT)
        whole.append(True)
        return plain(*arguments, **options)

    monkeypatch.setattr(local_workers, "wait", interrupted)
    with pytest.raises(KeyboardInterrupt):
        list(local_workers.results(abs, [(-1,)], 1))
    assert whole and signal.getsignal(signal.SIGINT) is before


@pytest.mark.long
def test_ctrl_c_while_a_worker_writes_its_result_ends(tmp_path: Path) -> None:
    assert subprocess.run(command("cut", tmp_path / "begun"), env=environment(), timeout=60).returncode == 0


@pytest.mark.parametrize("how", others_long([signal.SIGTERM, signal.SIGKILL]))
def test_workers_go_with_a_command_that_is_ended(tmp_path: Path, how: signal.Signals) -> None:
    """It cannot end them itself then, and nobody stops them."""
    with running(tmp_path) as run:
        os.kill(run.pid, how)
        assert run.wait(timeout=30) == -how
        assert ends(run)
        assert list(LabelledSet(tmp_path).frames())


def test_progress_is_for_terminals(capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch) -> None:
    dataset._progress(1, 4, 0.0)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr(time, "monotonic", lambda: 100.0)
    dataset._progress(1, 4, 90.0)
    assert capsys.readouterr().err == "\r\033[K1/4 shards, 30 s left"


def test_a_corrupt_shard_is_named_and_made_again(
    small_set: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert write_dataset(small_request(), tmp_path) == 2
    path = shard_path(tmp_path, 1)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF  # one byte of a picture
    path.write_bytes(data)
    with pytest.raises(FileError, match=r"00001\.npz: not a whole shard"):
        list(LabelledSet(tmp_path).frames())
    assert write_dataset(small_request(), tmp_path) == 1
    assert "00001.npz: corrupt shard" in capsys.readouterr().err
    assert same(tmp_path, small_set)


@pytest.mark.parametrize("workers", [1, 2])
def test_a_set_that_is_whole_stays_as_it_is(small_set: Path, tmp_path: Path, workers: int) -> None:
    shutil.copytree(small_set, tmp_path, dirs_exist_ok=True)
    assert write_dataset(small_request(), tmp_path, workers) == 0
    assert same(tmp_path, small_set)


def test_a_smaller_request_leaves_a_larger_set_the_larger_one(
    small_set: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    """Its manifest had said 6 frames in one shard: what an interrupted set holds then counted as all of it."""
    shutil.copytree(small_set, tmp_path, dirs_exist_ok=True)
    command = ["data", "--frames", "6", "--density", "draft", "--protocol", "short", "--render", "draft"]
    command += ["--azimuths", "2", "--out", str(tmp_path)]
    asked = (small_set / "manifest.json").read_bytes()
    assert main(command) == 0 and (tmp_path / "manifest.json").read_bytes() == asked
    assert "12 frames in 2 shards (0 written now), 2 paths at tilt" in capsys.readouterr().out
    assert (tmp_path / "croissant.json").exists()
    shard_path(tmp_path, 1).unlink()  # as if the larger one had been interrupted
    assert main(command) == 0 and (tmp_path / "manifest.json").read_bytes() == asked
    assert "6 frames in 1 of 2 shards of a larger set (0 written now)" in capsys.readouterr().out
    assert not (tmp_path / "croissant.json").exists()
    with pytest.raises(FileError, match="not whole \\(1 of 2 shards\\)"):
        LabelledSet(tmp_path).require_whole()
    (tmp_path / "manifest.json").write_bytes(asked.replace(b'"frames": 12', b'"frames": "12"'))
    assert main(command) == 2 and "frames='12' is no count" in capsys.readouterr().err


def test_files_of_the_user_stay(small_set: Path, tmp_path: Path) -> None:
    """A browser's unfinished download in the folder, and what another run writes below it, were deleted."""
    download, below = tmp_path / "film.mp4.part", tmp_path / "other" / "shards" / ".00000.npz.0a1b2c3d.part"
    left = tmp_path / "shards" / ".00001.npz.0a1b2c3d.part"
    shutil.copytree(small_set, tmp_path, dirs_exist_ok=True)
    (tmp_path / "camera.json").unlink()  # as if the first run had been killed behind the manifest
    below.parent.mkdir(parents=True)
    for path in (download, below, left):
        path.write_bytes(b"half")
    assert write_dataset(small_request(), tmp_path) == 0 and (tmp_path / "camera.json").exists()
    assert download.exists() and below.exists() and not left.exists()


def test_a_camera_of_the_user_stays(tmp_path: Path) -> None:
    """``--out .`` where ``endcap calibrate`` had written its camera.json put the nominal camera in its place."""
    (tmp_path / "camera.json").write_text("calibrated")
    with pytest.raises(FileError, match=r"camera\.json: is there, and is of no set: choose an empty folder"):
        write_dataset(small_request(), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["camera.json"]
    assert (tmp_path / "camera.json").read_text() == "calibrated"
    (tmp_path / "manifest.json").write_text('{"parts": []}')  # as that of an export
    with pytest.raises(FileError, match="not the manifest of labelled frames"):
        write_dataset(small_request(), tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["camera.json", "manifest.json"]


def test_a_set_of_two_versions_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another version may solve or draw otherwise, and nothing said which shards were its own."""
    request, words = replace(small_request(), render="off"), "its 1 shards were made by another version"
    write_dataset(replace(request, frames=6), tmp_path)
    first = LabelledSet(tmp_path).manifest["code"]
    with monkeypatch.context() as later:
        later.setattr(cluster, "_code", lambda: "of tomorrow")
        write_dataset(replace(request, frames=6), tmp_path)  # nothing to add
        assert LabelledSet(tmp_path).manifest["code"] == first and "version" not in capsys.readouterr().err
        write_dataset(request, tmp_path)
        assert LabelledSet(tmp_path).manifest["code"] == [*first, "of tomorrow"] and words in capsys.readouterr().err
    shard_path(tmp_path, 1).unlink()
    write_dataset(request, tmp_path)  # this version made a shard of it, as the manifest says
    assert "version" not in capsys.readouterr().err
    write_dataset(request, tmp_path / "drawn", stored=tmp_path)
    assert "drawn" not in (error := capsys.readouterr().err) and "another version of the toolkit solved them" in error
    assert LabelledSet(tmp_path / "drawn").manifest["code"] == [*first, "of tomorrow"]


def test_a_corrupt_shard_beyond_the_frames_asked_for_is_one_line(
    small_set: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    """The frames asked for are there; the summary reads all shards, and ended in a traceback of zipfile."""
    shutil.copytree(small_set, tmp_path, dirs_exist_ok=True)
    shard_path(tmp_path, 1).write_bytes(shard_path(small_set, 1).read_bytes()[:-400])
    command = ["data", "--frames", "6", "--density", "draft", "--protocol", "short", "--render", "draft"]
    assert main([*command, "--azimuths", "2", "--out", str(tmp_path)]) == 2
    assert "00001.npz: not a whole shard" in capsys.readouterr().err


@pytest.mark.long
def test_two_processes_give_the_same_shards(small_set: Path, tmp_path: Path) -> None:
    assert write_dataset(small_request(), tmp_path, workers=2) == 2
    assert same(tmp_path, small_set)


@pytest.mark.long
def test_a_dask_cluster_gives_the_same_shards(small_set: Path, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as cluster:
        assert write_dataset(small_request(), tmp_path, scheduler=cluster.scheduler_address) == 2
    assert same(tmp_path, small_set)


@pytest.mark.long
def test_a_set_grows_but_is_never_mixed(small_set: Path, tmp_path: Path) -> None:
    request = small_request()
    assert write_dataset(replace(request, frames=6), tmp_path) == 1
    assert write_dataset(request, tmp_path) == 1
    assert same(tmp_path, small_set)
    with pytest.raises(FileError, match="holds a set made with seed=0"):
        write_dataset(replace(request, seed=1), tmp_path)
    with dataset._locked(tmp_path), pytest.raises(FileError, match="another run is writing"):
        write_dataset(request, tmp_path)
    (tmp_path / "manifest.json").write_text("{")
    with pytest.raises(FileError, match="not the manifest"):
        write_dataset(request, tmp_path)


def test_processes_here_and_a_cluster_are_not_both_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """``--workers 8`` beside ``--scheduler`` had no effect, in silence."""
    with pytest.raises(SystemExit) as ended:
        main(["data", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1", "--out", str(tmp_path / "set")])
    assert ended.value.code == 2 and "not allowed with argument --workers" in capsys.readouterr().err
    assert not (tmp_path / "set").exists()
