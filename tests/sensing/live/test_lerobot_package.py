"""LeRobot's camera plug-in as it is written: against lerobot where it is installed, else a stand-in of its base."""

import abc
import contextlib
import importlib.util
import sys
import time
import tomllib
from dataclasses import dataclass, replace
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from live_stand_in import Shown, a_reading, endless, film, frames, pipeline, wait_for

from cad.errors import FileError
from sensing.learning.lerobot_dataset import WRENCH
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import CameraFeed, FileFeed, Pace
from sensing.live.endcap import Endcap
from sensing.live.lerobot_package import main
from sensing.records import Frame

NAME = "lerobot_camera_endcap"
ERRORS = ("DeviceAlreadyConnectedError", "DeviceNotConnectedError")


def lerobot_stand_in() -> dict[str, ModuleType]:
    """Base classes with the names of LeRobot's."""

    @dataclass(kw_only=True)
    class CameraConfig:
        fps: int | None = None
        width: int | None = None
        height: int | None = None

        @classmethod
        def register_subclass(cls, name):
            return lambda config: config

    class Base:
        def __init__(self, config):
            self.fps, self.width, self.height = config.fps, config.width, config.height

        def __enter__(self):
            self.connect()
            return self

        def __exit__(self, *_):
            self.disconnect()

    names = ("is_connected", "find_cameras", "connect", "read", "async_read", "read_latest", "disconnect")
    Camera = abc.ABCMeta("Camera", (Base,), {name: abc.abstractmethod(lambda self: None) for name in names})
    errors = {name: type(name, (ConnectionError,), {}) for name in ERRORS}
    inside = {"lerobot": {}, "lerobot.cameras": {}, "lerobot.utils": {}, "lerobot.utils.errors": errors}
    inside |= {"lerobot.cameras.camera": {"Camera": Camera}, "lerobot.cameras.configs": {"CameraConfig": CameraConfig}}
    modules = {name: ModuleType(name) for name in inside}
    for name, values in inside.items():
        vars(modules[name]).update(values)
    return modules


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plugin") / "out"
    assert main(["--out", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def plugin(package):
    with pytest.MonkeyPatch.context() as patch:
        if importlib.util.find_spec("lerobot") is None:
            for name, module in lerobot_stand_in().items():
                patch.setitem(sys.modules, name, module)
        spec = importlib.util.spec_from_file_location(NAME, package / NAME / f"{NAME}.py")
        module = importlib.util.module_from_spec(spec)
        patch.setitem(sys.modules, NAME, module)
        spec.loader.exec_module(module)
        yield module


@pytest.fixture
def camera(plugin, monkeypatch):
    """A connected camera that sees what ``shown.now`` says."""
    shown = Shown()

    def opened(*_, **__):
        return Endcap(LiveEndcap(CameraFeed(shown.camera()), pipeline()))

    monkeypatch.setattr(plugin, "open_endcap", opened)
    monkeypatch.setattr(plugin, "STALE_S", 20.0)  # on a busy computer a frame may be late
    monkeypatch.setattr(plugin, "READ_S", 60.0)
    with plugin.EndcapCamera(plugin.EndcapCameraConfig(source="0", start_s=60.0)) as found:
        found.shown = shown
        yield found


def test_what_is_written_has_the_name_that_lerobot_looks_for(package):
    project = tomllib.loads((package / NAME / "pyproject.toml").read_text())
    assert project["project"]["name"] == NAME == project["tool"]["setuptools"]["py-modules"][0]
    assert sorted(path.name for path in package.rglob("*")) == [
        "README.md", NAME, f"{NAME}.py", "pyproject.toml"
    ]  # fmt: skip


def test_a_folder_with_something_in_it_is_left_alone(tmp_path, caplog):
    (tmp_path / "mine").write_text("mine")
    assert main(["--out", str(tmp_path)]) == 2 and "not an empty folder" in caplog.text
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_lerobot_makes_the_camera_of_its_type(plugin):
    utils = pytest.importorskip("lerobot.cameras.utils")
    import draccus
    from lerobot.cameras.configs import CameraConfig

    config = draccus.decode(CameraConfig, {"type": "endcap", "source": "scene:0", "fps": 30})
    assert config.type == "endcap" and (config.source, config.fps, config.wall_mm) == ("scene:0", 30, 8.0)
    (camera,) = utils.make_cameras_from_configs({"endcap_0": config}).values()
    assert isinstance(camera, plugin.EndcapCamera) and not camera.is_connected


def test_the_picture_is_rgb(plugin):
    _, reading = a_reading()
    blue = np.zeros((480, 640, 3), np.uint8)
    blue[:, :, 0] = 255
    camera = plugin.EndcapCamera(plugin.EndcapCameraConfig(source="0"))
    picture = camera._picture(replace(reading, frame=Frame(1.0, 1, "test", image=blue)))
    assert picture.shape == (480, 640, 3) and picture[0, 0].tolist() == [0, 0, 255]
    assert (camera.width, camera.height) == (640, 480)


def test_the_features_are_those_of_the_newest_wrench(plugin):
    _, reading = a_reading()
    camera = plugin.EndcapCamera(plugin.EndcapCameraConfig(source="0"))
    camera._endcap = SimpleNamespace(valid=True, close=lambda: None)
    camera._reading = replace(reading, captured_s=time.monotonic() + 60)
    found = plugin.wrench_features(camera, "endcap_0")
    wrench, deviation = reading.wrench, np.sqrt(reading.wrench.covariance.diagonal())
    expected = [*wrench.force_n, *wrench.torque_nm, *deviation, float(reading.contact.touching), bool(wrench.flags), 1]
    assert list(found.values()) == expected and np.isfinite(expected).all()
    assert list(found) == list(plugin.wrench_feature_types("endcap_0"))
    assert list(found)[:6] == [f"endcap_0.{name}" for name in WRENCH]  # as in exported data sets
    assert all(type(value) is float for value in found.values())
    camera._endcap.valid = False  # unplugged, say
    assert plugin.wrench_features(camera, "e")["e.valid"] == 0


def test_a_press_is_read(camera):
    camera.shown.now = "pressed"
    wait_for(lambda: camera.async_read(60e3) is not None and camera.touching and abs(camera.wrench.force_n[0]) > 5)


@pytest.mark.parametrize("now", ["black", "broken"])
def test_a_picture_without_numbers_gives_nan_and_says_so(camera, plugin, now):
    camera.shown.now = now
    wait_for(lambda: not camera.reading.valid)
    found = plugin.wrench_features(camera, "e")
    assert (found.pop("e.valid"), found.pop("e.flagged")) == (0, 1) and np.isnan(list(found.values())).all()
    assert camera.touching is None and camera.wrench.flags


def test_a_damaged_picture_is_not_handed_out(camera):
    camera.shown.now = "broken"
    wait_for(lambda: not camera.reading.valid)
    camera.read_latest(60_000)  # the last good one, while it is young enough
    with contextlib.suppress(TimeoutError):
        camera.async_read(0)  # unless it was handed out already
    with pytest.raises(TimeoutError, match=r"gave no picture in 0.2 s .*is damaged"):
        camera.async_read(200)


def test_a_camera_that_is_silent_gives_no_old_numbers(camera, plugin, monkeypatch):
    assert plugin.wrench_features(camera, "e")["e.valid"] == 1
    monkeypatch.setattr(plugin, "STALE_S", -1.0)
    found = plugin.wrench_features(camera, "e")
    assert found["e.valid"] == 0 and np.isnan(found["e.force_z_n"]) and "stale" in camera.wrench.flags
    with pytest.raises(TimeoutError, match="ms old"):
        camera.read_latest(-1)


def test_each_picture_is_handed_out_once(camera):
    first, again = camera.async_read(60e3), camera.async_read(60e3)
    assert (first != again).any() and camera.read().dtype == np.uint8


def test_a_source_that_ends_is_a_timeout(plugin, monkeypatch):
    given = frames(film([0] * 4), time.monotonic())
    opened = Endcap(LiveEndcap(FileFeed(lambda: given, Pace(0)), pipeline()))
    monkeypatch.setattr(plugin, "open_endcap", lambda *_, **__: opened)
    camera = plugin.EndcapCamera(plugin.EndcapCameraConfig(source="0", start_s=60.0))
    with camera, pytest.raises(TimeoutError, match="has ended"):
        while True:
            camera.async_read(60e3)


def test_what_cannot_be_connected_is_one_line(plugin, monkeypatch):
    camera = plugin.EndcapCamera(plugin.EndcapCameraConfig(source="nowhere"))
    with pytest.raises(ConnectionError, match="not connected"):
        camera.read()
    with pytest.raises(ConnectionError, match="not connected"):
        camera.disconnect()

    def refused(*_, **__):
        raise FileError("nowhere: no camera number, address, folder or file: check the spelling")

    monkeypatch.setattr(plugin, "open_endcap", refused)
    with pytest.raises(ConnectionError, match=r"EndcapCamera\(nowhere\): nowhere: no camera") as caught:
        camera.connect()
    assert "\n" not in str(caught.value) and not camera.is_connected


@pytest.mark.parametrize(
    ("asked", "zero_frames", "error", "says"),
    [({"width": 320}, 1, RuntimeError, "640x480 px, configured 320x480"), ({}, 10**6, ConnectionError, "zeroing")],
)
def test_a_start_that_fails_lets_the_camera_go(plugin, monkeypatch, asked, zero_frames, error, says):
    opened = Endcap(LiveEndcap(CameraFeed(endless(film([0] * 6))), pipeline(zero_frames=zero_frames)))
    monkeypatch.setattr(plugin, "open_endcap", lambda *_, **__: opened)
    start_s = 60.0 if asked else 1.0
    camera = plugin.EndcapCamera(plugin.EndcapCameraConfig(source="0", start_s=start_s, **asked))
    with pytest.raises(error, match=says):
        camera.connect()
    assert not camera.is_connected and not camera._thread.is_alive()
