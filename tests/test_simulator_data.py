"""The data writer: reproducible, resumable, readable; protocol and command line."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cad.errors import FileError, ParameterError
from sensing.simulator import dataset
from sensing.simulator.__main__ import main
from sensing.simulator.dataset import DataRequest, read_shard, shard_path, write_dataset
from sensing.simulator.press import Target
from sensing.simulator.protocols import PHASES, LoadPath, Waypoint, load_path
from sensing.simulator.turn import turn_wrench


def short_path(_: int, number: int, azimuths: int) -> LoadPath:
    """Three states, so that the tests stay quick."""
    targets = (Target(normal_n=0.0), Target(normal_n=3.0 + number), Target(normal_n=4.0, shift_mm=(0.3, 0.2)))
    phases = ("approach", "load", "circle")
    points = tuple(Waypoint(phase, target) for phase, target in zip(phases, targets, strict=True))
    return LoadPath(number, 20.0, 0.5, tuple(30.0 * (k + 1) for k in range(azimuths)), points)


@pytest.fixture()
def request_(monkeypatch: pytest.MonkeyPatch) -> DataRequest:
    monkeypatch.setitem(dataset.load_path.__globals__["PROTOCOLS"], "short", short_path)
    monkeypatch.setattr(dataset, "PATHS_PER_SHARD", 1)
    return DataRequest(frames=12, density="draft", protocol="short", azimuths=2)


def test_a_killed_run_goes_on_and_ends_the_same(request_: DataRequest, tmp_path: Path, capsys: Any) -> None:
    assert write_dataset(request_, tmp_path) == 2
    shard = read_shard(shard_path(tmp_path, 1))
    shard_path(tmp_path, 1).write_bytes(shard_path(tmp_path, 1).read_bytes()[:-200])  # a torn file
    with pytest.raises(FileError, match="not a whole shard"):
        read_shard(shard_path(tmp_path, 1))
    assert write_dataset(request_, tmp_path) == 1
    assert "corrupt shard" in capsys.readouterr().err
    again = read_shard(shard_path(tmp_path, 1))
    assert again.keys() == shard.keys()
    assert all(np.array_equal(again[name], shard[name]) for name in shard)
    assert write_dataset(request_, tmp_path) == 0
    assert not list(tmp_path.rglob("*.part"))


def test_frames_are_their_states_turned(request_: DataRequest, tmp_path: Path) -> None:
    write_dataset(request_, tmp_path)
    shard = read_shard(shard_path(tmp_path, 0))
    assert shard["frame_marker_mm"].shape[0] == 6 and not len(shard["refusals"])
    for frame in range(6):
        state = int(shard["frame_state"][frame])
        wrench = turn_wrench(shard["state_wrench"][state], float(shard["frame_azimuth_deg"][frame]))
        assert np.allclose(shard["frame_force_n"][frame], wrench[:3])
        assert np.allclose(shard["frame_torque_nm"][frame] * 1000, wrench[3:])
    assert np.allclose(shard["state_normal_n"], [0, 3, 4], atol=1e-3)
    assert shard["state_wrench_gap"].max() < request_.tolerance
    rest = np.load(tmp_path / "surface.npz")["position"]
    assert shard["state_surface"].shape[1:] == rest.shape


def test_another_request_may_not_share_a_folder(request_: DataRequest, tmp_path: Path) -> None:
    write_dataset(request_, tmp_path)
    with pytest.raises(FileError, match="holds another request"):
        write_dataset(DataRequest(frames=12, density="draft", protocol="short", azimuths=2, seed=1), tmp_path)
    assert json.loads((tmp_path / "manifest.json").read_text())["phases"] == list(PHASES)


def test_a_full_disk_is_one_line_and_leaves_no_litter(
    request_: DataRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(dataset.np, "savez_compressed", full)
    with pytest.raises(FileError, match="No space left on device"):
        write_dataset(request_, tmp_path)
    assert not list(tmp_path.rglob("*.part"))


def test_refused_states_are_listed_not_lost(request_: DataRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    bad = short_path(0, 0, 1)
    pulling = LoadPath(0, 20.0, 0.5, (0.0,), (*bad.waypoints[:2], Waypoint("load", Target(normal_n=-1.0))))
    arrays = dataset.solve_paths(request_, [pulling], request_.model())
    assert len(arrays["state_path"]) == 2
    assert "path 0 state 2: range: normal_n=-1" in str(arrays["refusals"][0])


def test_static_protocol_covers_the_papers_grid() -> None:
    paths = [load_path("static", 3, number, 2) for number in range(35)]
    assert {path.tilt_deg for path in paths} == {10, 20, 30, 40, 50}
    forces = {max(p.target.normal_n or 0 for p in path.waypoints) for path in paths}
    assert forces == {5, 10, 15, 20, 25, 30, 35}
    assert {point.phase for path in paths for point in path.waypoints} == set(PHASES)
    assert load_path("static", 3, 7, 2) == paths[7]
    assert load_path("static", 4, 7, 2) != paths[7]


def test_bad_requests_are_refused(tmp_path: Path, capsys: Any) -> None:
    with pytest.raises(ParameterError, match="protocol='dance' is unknown: choose one of static"):
        DataRequest(frames=10, protocol="dance")
    with pytest.raises(ParameterError, match="frames=0 outside"):
        DataRequest(frames=0)
    with pytest.raises(ParameterError, match=r"tolerance=0\.5 outside"):
        DataRequest(frames=1, tolerance=0.5)
    assert main(["data", "--out", str(tmp_path), "--density", "lush"]) == 2
    assert "density='lush' is unknown" in capsys.readouterr().err
    assert main(["press", "--density", "draft", "--normal", "5", "--tilt", "20"]) == 0
    assert "certificate residual" in capsys.readouterr().out
