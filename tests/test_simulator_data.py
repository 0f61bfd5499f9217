"""The data writer: reproducible, resumable, readable, on one process, several, or a cluster; its command line."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from cad.dots import dot_pattern
from cad.errors import FileError, ParameterError
from sensing.camera_mount import MountedCamera
from sensing.records_labelled import COLUMNS, LabelledSet
from sensing.simulator import data_request, dataset, protocols
from sensing.simulator.__main__ import main
from sensing.simulator.data_frames import shard_arrays
from sensing.simulator.data_request import DataRequest
from sensing.simulator.dataset import shard_path, write_dataset
from sensing.simulator.loading import LoadPath, Waypoint, timed
from sensing.simulator.press import Target
from sensing.simulator.surface import turn_wrench

ROOT = Path(__file__).resolve().parent.parent


def short_path(_: int, number: int, azimuths: int) -> LoadPath:
    """Three states in the mirror plane, so that the tests stay quick."""
    points = [
        Waypoint("approach", None, 2.0),
        Waypoint("load", Target(normal_n=8.0 + number)),
        Waypoint("drag", Target(normal_n=8.0, shift_mm=(0.5, 0.0))),
    ]
    return LoadPath(number, 20.0, 0.5, tuple(30.0 * (k + 1) for k in range(azimuths)), timed(points))


def small_request() -> DataRequest:
    """Two shards of one path each; needs :func:`short_path` under its name."""
    protocols.PROTOCOLS["short"] = short_path
    data_request.PATHS_PER_SHARD = 1
    return DataRequest(frames=12, density="draft", protocol="short", azimuths=2, render="draft")


@pytest.fixture(autouse=True)
def _restore(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(protocols.PROTOCOLS, "short", short_path)
    monkeypatch.setattr(data_request, "PATHS_PER_SHARD", 1)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    kept = data_request.PATHS_PER_SHARD
    folder = tmp_path_factory.mktemp("set")
    assert write_dataset(small_request(), folder) == 2
    data_request.PATHS_PER_SHARD = kept
    return folder


def same(first: Path, second: Path) -> bool:
    a, b = ([shard_path(folder, k).read_bytes() for k in range(2)] for folder in (first, second))
    return [content(x) for x in a] == [content(x) for x in b]


def content(data: bytes) -> dict[str, bytes]:
    """Members of a zip by name (its time stamps may differ)."""
    import io
    import zipfile

    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def test_frames_are_their_states_turned_and_seen(made: Path) -> None:
    data = LabelledSet(made)
    frames = list(data.frames())
    assert len(frames) == 12 and [f.path for f in frames] == [0] * 6 + [1] * 6
    assert set(frames[0].labels) == set(COLUMNS)
    camera = MountedCamera.load(made / "camera.json")
    rest = np.load(made / "dots.npz")["dots_mm"]
    assert len(rest) == len(dot_pattern(small_request().params))
    for first, turned in zip(frames[0:3], frames[3:6], strict=True):
        wrench = np.concatenate([first.wrench.force_n, first.wrench.torque_nm])
        assert np.allclose(turn_wrench(wrench, 30.0)[:3], turned.wrench.force_n, atol=1e-9)
        assert np.allclose(turn_wrench(wrench, 30.0)[3:], turned.wrench.torque_nm, atol=1e-9)
        assert first.contact == (first.phase != "approach")
    free, loaded = frames[0], frames[1]
    seen = loaded.dots_visible & free.dots_visible
    gap = np.linalg.norm(camera.project(rest) - free.dots_px, axis=1)[seen]
    assert 0.3 < np.sqrt((gap**2).mean()) < 1.5  # the hand that painted scatters by 0.2 mm
    told = camera.project(rest + loaded.dots_mm) - camera.project(rest)
    drawn = loaded.dots_px - free.dots_px  # the ink rides on the surface: the scatter cancels
    assert np.linalg.norm(told - drawn, axis=1)[seen].max() < 0.2 < 1.5 < np.linalg.norm(told, axis=1)[seen].max()
    picture = cv2.imdecode(np.frombuffer(loaded.frame.jpeg or b"", np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (480, 640, 3)
    ink = np.array([picture[round(y), round(x)].mean() for x, y in loaded.dots_px[seen][:30]])
    assert np.median(ink) < 0.6 * np.median(picture)


def test_pose_puts_plane_and_force_where_they_belong(made: Path) -> None:
    """World z is the plane's normal: the force on the endcap along it is the normal force, and the dome touches z=0."""
    for frame in LabelledSet(made).frames():
        pose = frame.labels["T_world_endcap"]
        assert (pose[:3, :3] @ frame.wrench.force_n)[2] == pytest.approx(frame.labels["normal_n"], abs=1e-9)
        params = small_request().params
        centre = pose @ [0, 0, params.centre_height_mm, 1]
        assert centre[2] == pytest.approx(params.outer_radius_mm - frame.labels["depth_mm"])
        assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)


def test_a_killed_run_goes_on_and_ends_the_same(made: Path, tmp_path: Path) -> None:
    run = subprocess.run([sys.executable, __file__, "kill", str(tmp_path)], cwd=ROOT, env=environment())
    assert run.returncode == -signal.SIGKILL
    assert shard_path(tmp_path, 0).exists() and not shard_path(tmp_path, 1).exists()
    assert list(tmp_path.rglob("*.part"))  # killed while it wrote
    assert len(list(LabelledSet(tmp_path).frames())) == 6
    assert write_dataset(small_request(), tmp_path) == 1
    assert same(tmp_path, made) and not list(tmp_path.rglob("*.part"))
    assert write_dataset(small_request(), tmp_path) == 0


def test_a_full_disk_is_one_line_and_what_was_written_stays(made: Path, tmp_path: Path) -> None:
    run = subprocess.run(
        [sys.executable, __file__, "full", str(tmp_path)], cwd=ROOT, env=environment(), capture_output=True, text=True
    )
    assert run.returncode == 2, run.stderr
    assert run.stderr.count("\n") == 1 and "cannot be written (File too large)" in run.stderr
    assert len(list(LabelledSet(tmp_path).frames())) == 6 and not list(tmp_path.rglob("*.part"))


def test_a_corrupt_shard_is_named_and_made_again(made: Path, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert write_dataset(small_request(), tmp_path) == 2
    path = shard_path(tmp_path, 1)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF  # one byte of a picture
    path.write_bytes(data)
    with pytest.raises(FileError, match=r"00001\.npz: not a whole shard"):
        list(LabelledSet(tmp_path).frames())
    assert write_dataset(small_request(), tmp_path) == 1
    assert "00001.npz: corrupt shard" in capsys.readouterr().err
    assert same(tmp_path, made)


def test_two_processes_give_the_same_shards(made: Path, tmp_path: Path) -> None:
    assert write_dataset(small_request(), tmp_path, workers=2) == 2
    assert same(tmp_path, made)


def test_a_dask_cluster_gives_the_same_shards(made: Path, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
    ) as cluster:
        assert write_dataset(small_request(), tmp_path, scheduler=cluster.scheduler_address) == 2
    assert same(tmp_path, made)


def test_no_scheduler_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(dataset, "CONNECT_S", 1)
    with pytest.raises(ParameterError, match=r"no Dask scheduler answers there"):
        write_dataset(small_request(), tmp_path, scheduler="tcp://127.0.0.1:9")


def test_a_set_grows_but_is_never_mixed(made: Path, tmp_path: Path) -> None:
    request = small_request()
    assert write_dataset(replace(request, frames=6), tmp_path) == 1
    assert write_dataset(request, tmp_path) == 1
    assert same(tmp_path, made)
    with pytest.raises(FileError, match="holds a set made with seed=0"):
        write_dataset(replace(request, seed=1), tmp_path)
    with dataset._locked(tmp_path), pytest.raises(FileError, match="another run is writing"):
        write_dataset(request, tmp_path)
    (tmp_path / "manifest.json").write_text("{")
    with pytest.raises(FileError, match="not the manifest"):
        write_dataset(request, tmp_path)


def test_refused_states_are_listed_and_the_rest_stands() -> None:
    points = (*short_path(0, 0, 1).waypoints[:2], Waypoint("load", Target(normal_n=-1.0)), Waypoint("clear", None, 1.0))
    path = replace(short_path(0, 0, 1), waypoints=points)
    arrays = shard_arrays(replace(small_request(), render="off"), [path])
    assert arrays["step"].tolist() == [0, 1, 3]
    assert "path 0 states 2..2: range: normal_n=-1" in str(arrays["refusals"][0])
    assert arrays["surface_mm"].shape[0] == 3 and "jpeg" not in arrays


def test_sensors_and_lamps_differ_as_asked() -> None:
    request = small_request()
    other = replace(request, sensor=3)
    assert np.array_equal(request.mounted.T_camera_endcap[:3, :3], np.eye(3))
    assert 0.1 < np.linalg.norm(other.mounted.pupil_endcap_mm - request.mounted.pupil_endcap_mm) < 3
    assert request.light(0) == request.light(0) != request.light(1)
    steady = replace(request, lamp="steady")
    assert steady.light(0) == steady.light(1)


def test_bad_requests_are_one_line_and_status_2(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    for arguments, words in (
        (["--density", "lush"], "density='lush' is unknown"),
        (["--protocol", "dance"], "protocol='dance' is unknown: choose one of static"),
        (["--frames", "0"], "frames=0 outside"),
        (["--tolerance", "0.5"], "tolerance=0.5 outside"),
        (["--level", "9"], "level=9 is unknown"),
        (["--silicone", "butter"], "silicone='butter' is not in cad/materials.csv"),
        (["--wall", "1"], "wall_mm=1"),
        (["--unpainted", "2"], "Paint.unpainted=2.0 outside"),
        (["--workers", "0"], "workers=0 outside"),
    ):
        assert main(["data", "--out", str(tmp_path / "x"), *arguments]) == 2
        error = capsys.readouterr().err
        assert words in error and error.count("\n") == 1
    assert not (tmp_path / "x").exists()
    (tmp_path / "file").write_text("")
    assert main(["data", "--out", str(tmp_path / "file"), "--frames", "1"]) == 2
    assert "cannot be written" in capsys.readouterr().err


def test_the_press_command_prints_a_certificate(capsys: pytest.CaptureFixture) -> None:
    assert main(["press", "--density", "draft", "--normal", "5", "--tilt", "20"]) == 0
    assert "certificate residual" in capsys.readouterr().out


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT)}


def kill_in_second_shard(folder: str) -> None:
    """SIGKILL after the second shard's bytes are in its temporary file."""
    plain, calls = os.fsync, []

    def fsync(number: int) -> None:
        calls.append(number)
        if len(calls) == 4:  # dots, manifest, first shard, second
            os.kill(os.getpid(), signal.SIGKILL)
        plain(number)

    os.fsync = fsync
    write_dataset(small_request(), Path(folder))


def fill_disk_in_second_shard(folder: str) -> int:
    """A file size limit that the second shard exceeds, through the command line's handling of errors."""
    request = small_request()
    write_dataset(replace(request, frames=6), Path(folder))
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
    try:
        write_dataset(request, Path(folder))
    except FileError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    mode, where = sys.argv[1:]
    sys.exit(kill_in_second_shard(where) if mode == "kill" else fill_disk_in_second_shard(where))
