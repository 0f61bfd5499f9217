"""What the data writer writes: frames with their labels, as asked for on the command line."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from small_data import short_path, small_request

from cad.dots import dot_pattern
from cad.errors import EndcapError, FileError, ParameterError
from cad.materials import silicone, silicones
from sensing.camera.mount import MountedCamera
from sensing.records_labelled import COLUMNS, LabelledSet
from sensing.simulator.__main__ import main
from sensing.simulator.dataset.frames import STEPS_A_PATH, labels_of, noise_number, shard_arrays, world_pose
from sensing.simulator.dataset.request import DataRequest
from sensing.simulator.dataset.states import PathState
from sensing.simulator.dataset.writer import write_dataset
from sensing.simulator.press.press import Target
from sensing.simulator.protocols.loading import Waypoint
from sensing.simulator.protocols.robot import robot_path
from sensing.simulator.scene import SceneState
from sensing.simulator.solid.mesh import DENSITIES
from sensing.simulator.solid.surface import turn_wrench

pytestmark = pytest.mark.usefixtures("short_paths")


def test_frames_are_their_states_turned_and_seen(small_set: Path) -> None:
    data = LabelledSet(small_set)
    frames = list(data.frames())
    assert len(frames) == 12 and [f.path for f in frames] == [0] * 6 + [1] * 6
    assert set(frames[0].labels) == {*COLUMNS, "outline_mm"}
    camera = MountedCamera.load(small_set / "camera.json")
    rest = np.load(small_set / "dots.npz")["dots_mm"]
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
    reported = camera.project(rest + loaded.dots_mm) - camera.project(rest)
    drawn = loaded.dots_px - free.dots_px  # the ink rides on the surface: the scatter cancels
    assert (
        np.linalg.norm(reported - drawn, axis=1)[seen].max() < 0.2 < 1.5 < np.linalg.norm(reported, axis=1)[seen].max()
    )
    picture = cv2.imdecode(np.frombuffer(loaded.frame.jpeg or b"", np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (480, 640, 3)
    ink = np.array([picture[round(y), round(x)].mean() for x, y in loaded.dots_px[seen][:30]])
    assert np.median(ink) < 0.6 * np.median(picture)


def test_pose_puts_plane_and_force_where_they_belong(small_set: Path) -> None:
    """World z is the plane's normal: the force on the endcap along it is the normal force, and the dome touches z=0."""
    for frame in LabelledSet(small_set).frames():
        pose = frame.labels["T_world_endcap"]
        assert (pose[:3, :3] @ frame.wrench.force_n)[2] == pytest.approx(frame.labels["normal_n"], abs=1e-9)
        params = small_request().params
        centre = pose @ [0, 0, params.centre_height_mm, 1]
        assert centre[2] == pytest.approx(params.outer_radius_mm - frame.labels["depth_mm"])
        assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)


def test_pose_of_a_robots_endcap_has_the_depth_of_its_frame() -> None:
    """While the ropes lower it and while it stands: the plane is z = 0, as in the sets of one endcap."""
    request = DataRequest(frames=1, protocol="robot", render="off")
    centre = np.array([0, 0, request.params.centre_height_mm, 1])
    paths = [robot_path(4, 3 * 6 + endcap, 1) for endcap in range(6)]
    at_rest = SceneState(2, 0.0, (0.0, 0.0), 0.0, (0.0, 0.0), np.zeros(6), np.zeros(0), 0.0, 0.0, 0.0, None, None)
    for depth_mm in (-25.0, 3.0):
        state = replace(at_rest, depth_mm=depth_mm)
        found = [world_pose(request, path, PathState(0, state, state), 0.0) for path in paths]
        places = np.array([pose @ centre for pose in found])
        assert np.allclose(places[:, 2], request.params.outer_radius_mm - depth_mm)
        assert np.ptp(places[:, 0]) > 100  # where the robot has them


def test_refused_states_are_listed_and_the_rest_stands() -> None:
    points = (*short_path(0, 0, 1).waypoints[:2], Waypoint("load", Target(normal_n=-1.0)), Waypoint("clear", None, 1.0))
    path = replace(short_path(0, 0, 1), waypoints=points)
    arrays = shard_arrays(replace(small_request(), render="off"), [path])
    assert arrays["step"].tolist() == [0, 1, 3]
    assert "path 0 states 2..2: range: normal_n=-1" in str(arrays["refusals"][0])
    assert arrays["surface_mm"].shape[0] == 3 and "jpeg" not in arrays


def test_stored_states_give_what_solving_them_gives(small_set: Path, tmp_path: Path) -> None:
    states, seen = tmp_path / "states", tmp_path / "seen"
    write_dataset(replace(small_request(), render="off"), states)
    write_dataset(small_request(), seen, stored=states)
    for solved, stored in zip(LabelledSet(small_set).frames(), LabelledSet(seen).frames(), strict=True):
        assert np.allclose(solved.wrench.force_n, stored.wrench.force_n, atol=1e-9)
        assert np.allclose(solved.wrench.torque_nm, stored.wrench.torque_nm, atol=1e-9)
        assert np.allclose(solved.dots_mm, stored.dots_mm, atol=1e-5)  # the set keeps surfaces in single precision
        assert np.array_equal(solved.dots_visible, stored.dots_visible)
        assert np.allclose(solved.dots_px[solved.dots_visible], stored.dots_px[solved.dots_visible], atol=1e-3)
    other = next(iter(LabelledSet(seen).frames()))
    write_dataset(replace(small_request(), sensor=3, frames=6), tmp_path / "other", stored=states)
    moved = next(iter(LabelledSet(tmp_path / "other").frames()))
    both = other.dots_visible & moved.dots_visible
    assert np.abs(other.dots_px - moved.dots_px)[both].max() > 1.0  # another camera
    for request, words in (
        (replace(small_request(), seed=5), "was made with seed=0: give the same options"),
        (replace(small_request(), frames=18), "holds no path 2: write it with as many frames"),
    ):
        with pytest.raises(EndcapError, match=words):
            write_dataset(request, tmp_path / "no", stored=states)
        assert not (tmp_path / "no").exists()  # said before anything is drawn
    with pytest.raises(ParameterError, match="holds pictures and no states"):
        write_dataset(small_request(), tmp_path / "no", stored=seen)


def test_states_that_were_written_anew_are_read_anew(tmp_path: Path) -> None:
    """A worker of a cluster lives on, and gave the states that it had read before under the same name."""
    plain = replace(small_request(), frames=6, render="off")
    for request in (plain, replace(plain, interlock=3.0)):
        shutil.rmtree(tmp_path / "states", ignore_errors=True)
        write_dataset(request, tmp_path / "states")
        shutil.rmtree(tmp_path / "seen", ignore_errors=True)
        write_dataset(request, tmp_path / "seen", stored=tmp_path / "states")
        solved, seen = (LabelledSet(tmp_path / name).column("depth_mm") for name in ("states", "seen"))
        assert np.array_equal(solved, seen)


def test_states_of_other_constants_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a row of the table was corrected, a set drew the states of the old constants and stated the new ones."""
    states, request = tmp_path / "states", replace(small_request(), frames=6)
    write_dataset(replace(request, render="off"), states)
    row = silicone()
    stiffer = replace(row, neo_hooke_c10_mpa=1.2 * row.neo_hooke_c10_mpa)
    with monkeypatch.context() as changed:
        changed.setitem(silicones(), row.name, stiffer)
        with pytest.raises(ParameterError, match=r"c10_mpa=0.34, bulk_mpa=.*write it again, Smooth-Sil 950 has others"):
            write_dataset(request, tmp_path / "no", stored=states)
    with monkeypatch.context() as changed:
        changed.setitem(DENSITIES, "draft", replace(DENSITIES["draft"], layers=2))
        with pytest.raises(FileError, match=r"states for the mesh .*: write them again"):
            write_dataset(request, tmp_path / "no", stored=states)
    (states / "manifest.json").write_text('{"format": 2, "phases": []}')  # a traceback before
    with pytest.raises(ParameterError, match="was made with diameter_mm=None"):
        write_dataset(request, tmp_path / "no", stored=states)
    assert not (tmp_path / "no").exists()


def pictures(arrays: dict[str, np.ndarray]) -> set[bytes]:
    """Those of a shard, with the references."""
    found: set[bytes] = set()
    for name in ("jpeg", "reference_jpeg"):
        found |= {part.tobytes() for part in np.split(arrays[name], arrays[f"{name}_end"][:-1])}
    return found


def test_sets_of_two_seeds_share_no_noise() -> None:
    """Training and test sets may be of one sensor; states, lamp and paint are the same here, so only noise differs."""
    request, path = replace(small_request(), lamp="steady", azimuths=1), short_path(0, 0, 1)
    first, again, other = (pictures(shard_arrays(replace(request, seed=seed), [path])) for seed in (1, 1, 101))
    assert first == again and len(first) == len(other) == 4
    assert not first & other


def test_pictures_are_not_continued_with_other_noise(tmp_path: Path) -> None:
    request = replace(small_request(), frames=6)
    for seed in (0, 1):
        folder = tmp_path / str(seed)
        write_dataset(replace(request, seed=seed), folder)
        text = (folder / "manifest.json").read_text()
        assert '"noise_key": 2' in text
        (folder / "manifest.json").write_text(re.sub(r',\s*"noise_key": 2', "", text))  # as it was written before
        if seed == 0:  # the key with seed 0 is the earlier one
            assert write_dataset(replace(request, seed=seed), folder) == 0
            assert noise_number(0, 7, 3) == 7 * STEPS_A_PATH + 3
            continue
        with pytest.raises(FileError, match="noise_key=1 where this one has 2"):
            write_dataset(replace(request, seed=seed), folder)


def test_another_indenter_presses_otherwise_and_is_never_mixed(tmp_path: Path) -> None:
    plane = replace(small_request(), render="off", frames=6)
    sphere = replace(plane, indenter="sphere", radius_mm=15.0)
    for name, request in (("plane", plane), ("sphere", sphere)):
        write_dataset(request, tmp_path / name)
    flat, round_ = (LabelledSet(tmp_path / name) for name in ("plane", "sphere"))
    loaded = flat.column("normal_n") > 5
    assert np.allclose(flat.column("normal_n"), round_.column("normal_n"), rtol=1e-2)
    assert (round_.column("depth_mm")[loaded] > 1.2 * flat.column("depth_mm")[loaded]).all()
    with pytest.raises(FileError, match="holds a set made with indenter=plane"):
        write_dataset(sphere, tmp_path / "plane")


def test_an_edge_presses_along_its_axis(tmp_path: Path) -> None:
    """What an edge across the meridian moves reaches further across it than what one along it moves."""
    request = replace(small_request(), render="off", frames=6, indenter="edge", radius_mm=15.0)
    width = {}
    for axis in (0.0, 90.0):
        write_dataset(replace(request, axis_deg=axis), tmp_path / f"{axis:g}")
        data = LabelledSet(tmp_path / f"{axis:g}")
        loaded = np.flatnonzero(data.column("normal_n") > 5)[0]
        turn = np.radians(data.column("azimuth_deg")[loaded] + 90.0)
        lateral = np.array([np.cos(turn), np.sin(turn), 0.0])  # across the meridian, in the tangent plane
        weight = np.linalg.norm(data.column("dots_mm")[loaded], axis=1) ** 2
        place = np.load(tmp_path / f"{axis:g}" / "dots.npz")["dots_mm"] @ lateral
        width[axis] = np.sqrt((weight * place**2).sum() / weight.sum())
    assert width[90.0] > 1.02 * width[0.0]
    with pytest.raises(FileError, match="axis_deg"):
        write_dataset(request, tmp_path / "0")


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
        (["--azimuths", "65"], "azimuths=65 outside 1..64"),
        (["--tolerance", "0.5"], "tolerance=0.5 outside"),
        (["--level", "4"], "level=4 is unknown: choose one of 1, 2"),
        (["--silicone", "butter"], "silicone='butter' is not in cad/materials.csv"),
        (["--wall", "1"], "wall_mm=1"),
        (["--unpainted", "2"], "Paint.unpainted=2.0 outside"),
        (["--indenter", "cone"], "indenter='cone' is unknown: choose one of plane, sphere, edge"),
        (["--indenter", "sphere", "--radius", "0"], "radius_mm=0 is not positive"),
        (["--radius", "15"], "--radius 15: a plane has none"),
        (["--indenter", "sphere", "--axis", "0"], "--axis 0: a sphere has none"),
        (["--states", str(tmp_path)], "give a folder of labelled frames"),
        (["--workers", "0"], "workers=0 outside"),
    ):
        assert main(["data", "--out", str(tmp_path / "x"), *arguments]) == 2
        error = capsys.readouterr().err
        assert words in error and error.count("\n") == 1
    assert not (tmp_path / "x").exists()
    (tmp_path / "file").write_text("")
    assert main(["data", "--out", str(tmp_path / "file"), "--frames", "1"]) == 2
    assert "cannot be written" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], ""),
        (
            ["--diameter", "172", "--wall", "12.5", "--silicone", "Ecoflex 00-50"],
            "D172_T12.5 in Ecoflex 00-50 range to 5.96 N",
        ),
        (["--diameter", "250", "--wall", "25"], "D250_T25 in Smooth-Sil 950 range to 342 N"),
        (["--diameter", "250", "--wall", "25", "--loads", "design"], ""),
        (["--diameter", "250", "--wall", "25", "--protocol", "robot"], ""),
    ],
)
def test_loads_that_are_not_the_designs_are_named(words, said, tmp_path, monkeypatch, capsys) -> None:
    """An endcap for 6 N was pressed to 35 N and 39 mm without a word."""

    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("sensing.simulator.dataset.cli.write_dataset", stopped)
    assert main(["data", "--out", str(tmp_path / "x"), *words]) == 130
    first, *rest = capsys.readouterr().err.splitlines()
    assert (said in first and "--loads design" in first and len(rest) == 1) if said else not rest


def test_the_press_command_prints_a_certificate(capsys: pytest.CaptureFixture) -> None:
    assert main(["press", "--density", "draft", "--normal", "5", "--tilt", "20"]) == 0
    assert "certificate residual" in capsys.readouterr().out


def test_a_frame_is_stamped_with_the_middle_of_its_exposure() -> None:
    path = replace(short_path(0, 0, 1), exposure_s=0.01)
    solved = SimpleNamespace(
        wrench=np.zeros(6), level=1, depth_mm=1.0, shift_mm=(0.0, 0.0), normal_n=5.0, patch_mm2=3.0, slip_share=0.0,
        certificate=None, error_estimate=0.0,
    )  # fmt: skip
    row = labels_of(small_request(), path, SimpleNamespace(step=1, begin=solved, end=solved), 30.0)
    assert row["time_s"] == pytest.approx(path.waypoints[1].time_s - 0.005) and row["exposure_s"] == 0.01
