"""Rate effects in data sets: what they change, what the manifest says, how such a set grows, what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from small_data import same

from cad.errors import FileError, ParameterError
from cad.materials import silicone
from sensing.records_labelled import LabelledSet
from sensing.simulator.__main__ import main
from sensing.simulator.dataset import request as data_request
from sensing.simulator.dataset.request import DataRequest
from sensing.simulator.dataset.states import path_states
from sensing.simulator.dataset.writer import refusals, write_dataset
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Target
from sensing.simulator.protocols import catalogue as protocols
from sensing.simulator.protocols.catalogue import load_path
from sensing.simulator.protocols.loading import LoadPath, Waypoint
from sensing.simulator.solid.geometry import shell_geometry

FRAMES = 5  # a path


def moving_path(_: int, number: int, azimuths: int) -> LoadPath:
    """Stands on the plane, is pressed on within 1/30 s, let go, and hit."""
    points = (
        Waypoint("approach", None, 2.0),
        Waypoint("load", Target(normal_n=8.0, time_s=0.0)),
        Waypoint(
            "drag", Target(normal_n=16.0 + number, time_s=0.03), time_s=0.03,
            begins=Target(normal_n=14.0, time_s=0.02), via=(Target(normal_n=11.0, time_s=0.01),),
        ),
        Waypoint("clear", None, 1.0, 0.06),
        Waypoint("impact", Target(depth_mm=2.0, time_s=0.09), time_s=0.09),
    )  # fmt: skip
    return LoadPath(number, 20.0, 0.5, (0.0,) * azimuths, points, 0.01, began_s=-3600.0)


@pytest.fixture(autouse=True)
def moving(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(protocols.PROTOCOLS, "moving", moving_path)
    monkeypatch.setattr(data_request, "PATHS_PER_SHARD", 1)


def request(frames: int = 2 * FRAMES, rate_effects: bool = True) -> DataRequest:
    return DataRequest(frames, density="draft", protocol="moving", azimuths=1, render="off", rate_effects=rate_effects)


def test_a_set_with_rate_effects_differs_as_it_should_and_says_so(tmp_path: Path) -> None:
    for name, on in (("elastic", False), ("relaxing", True)):
        write_dataset(request(FRAMES, on), tmp_path / name)
        assert not refusals(tmp_path / name)
    elastic, relaxing = (LabelledSet(tmp_path / name) for name in ("elastic", "relaxing"))
    asked = relaxing.manifest["request"]
    assert asked["rate_effects"] is True and asked["prony"] == [list(term) for term in silicone().prony]
    assert elastic.manifest["request"]["rate_effects"] is False and elastic.manifest["request"]["prony"] == []
    approach, stand, drag, clear, hit = range(FRAMES)
    here, there = (np.linalg.norm(data.column("dots_mm"), axis=2).max(axis=1) for data in (relaxing, elastic))
    assert here[approach] == there[approach] == 0
    assert here[stand] == pytest.approx(there[stand], rel=1e-3)  # stood for an hour: relaxed
    assert 0.94 < here[drag] / there[drag] < 0.985  # half of the load is new, and met by 1.08 of the modulus
    assert 0 == there[clear] < 0.02 * there[drag] < here[clear] < 0.08 * there[drag]  # it still comes back
    stiffer = relaxing.column("normal_n") / np.maximum(elastic.column("normal_n"), 1e-9)
    assert stiffer[[stand, drag]] == pytest.approx(1.0, abs=1e-3)
    assert 0.95 < stiffer[hit] < 0.995  # stiffer, but on the dent of the hour before; without memory it would be 1.05
    assert relaxing.column("contact").tolist() == elastic.column("contact").tolist()
    assert relaxing.column("depth_mm")[clear] == pytest.approx(elastic.column("depth_mm")[clear], abs=1e-9)


@pytest.mark.long
def test_a_set_with_rate_effects_grows_to_the_same_bytes_and_is_never_mixed(tmp_path: Path) -> None:
    whole, grown, still = (tmp_path / name for name in ("whole", "grown", "still"))
    assert write_dataset(request(), whole) == 2
    assert write_dataset(request(FRAMES), grown) == 1 and write_dataset(request(), grown) == 1
    assert same(whole, grown)
    with pytest.raises(FileError, match=r"holds a set made with rate_effects=True, prony=\[\[0\.05, 0\.1\]"):
        write_dataset(request(rate_effects=False), grown)
    write_dataset(request(FRAMES, False), still)
    manifest = json.loads((still / "manifest.json").read_text())
    del manifest["request"]["rate_effects"], manifest["request"]["prony"]  # written before there was such an option
    (still / "manifest.json").write_text(json.dumps(manifest))
    assert write_dataset(request(FRAMES, False), still) == 0
    with pytest.raises(FileError, match="holds a set made with rate_effects=False"):
        write_dataset(request(FRAMES), still)


def test_what_cannot_have_rate_effects_is_one_line_and_status_2(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    for arguments, words in (
        (["--protocol", "static"], "protocol='static' has no rate effects: its states are at rest"),
        (["--protocol", "robot"], "protocol='robot' has no rate effects: its states are at rest"),
        (["--protocol", "dynamic", "--silicone", "Dragon Skin 30"], "silicone='Dragon Skin 30' has no Prony series"),
        (["--protocol", "dynamic", "--level", "3"], "level=3 is unknown: choose one of 1, 2"),
        (["--protocol", "dynamic", "--level", "4"], "level=4 is unknown: choose one of 1, 2"),
    ):
        assert main(["data", "--rate-effects", "--out", str(tmp_path / "x"), *arguments]) == 2
        error = capsys.readouterr().err
        assert words in error and error.count("\n") == 1
    assert not (tmp_path / "x").exists()
    simulator = Simulator(shell_geometry(130, 8), silicone().neo_hooke(), "draft", prony=silicone().prony_series())
    with pytest.raises(ParameterError, match="path 0 carries no time"):
        path_states(simulator, load_path("static", 0, 0, 1))


def test_times_of_the_dynamic_protocol_go_forward() -> None:
    for number in range(24):
        path = load_path("dynamic", 5, number, 1)
        assert path.began_s is not None
        times, last = [path.began_s], path.began_s
        for point in path.waypoints:
            ends = [point.target] if point.target else []
            targets = [*point.via, *([point.begins] if point.begins else []), *ends]
            times += [t.time_s for t in targets if t.time_s is not None]
            assert len(times) >= 1 and all(t.time_s is not None for t in targets)
            if point.begins is not None and point.begins.time_s is not None and point.target is not None:
                assert point.target.time_s == point.time_s
                assert point.time_s - point.begins.time_s == pytest.approx(path.exposure_s)
            last = point.time_s
        assert np.diff(times).min() > 1e-4 and times[-1] <= last
