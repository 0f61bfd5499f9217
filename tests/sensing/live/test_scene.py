import itertools
import time
from dataclasses import replace

import numpy as np
import pytest
from live_stand_in import pipeline, stand_in

from cad.errors import FileError, ParameterError
from cad.params import EndcapParams
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.mixed_watch import FEWEST, FLAG, FRAMES
from sensing.live.core.model import LiveModel, load_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.robot import robot_state
from sensing.live.demo import scene
from sensing.records import Frame
from sensing.simulator.press import tangential
from sensing.simulator.robot import frames as robot_frames
from sensing.simulator.robot import scene as robot_scene
from sensing.tracking.zero import take_zero

RATE_HZ = 30.0


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """A film with shorter ramps and stands, rendered once; the live node's own cache is left alone."""
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        for name, ticks in {"REST": 24, "RAMP": 10, "HOLD": 16, "GAP": 8}.items():
            patch.setattr(robot_frames, name, ticks)
        made = robot_frames.load_film(folder)
        patch.setattr(scene, "scene_film", lambda *_: made)
        made.__dict__["folder"] = folder
        yield made


def frame(film, endcap: int, tick: int) -> Frame:
    return Frame(1 + tick / RATE_HZ, tick, f"scene:{endcap}", jpeg=film.jpeg(endcap, tick), size=scene.SIZE)


def hold(film, stand: int) -> int:
    """A tick at which the robot stands."""
    return next(t for t, m in enumerate(film.moments) if m == robot_frames.Moment(stand, robot_frames.RAMP)) + 8


# --- truth -----------------------------------------------------------------------------------------------------
def test_one_two_and_three_endcaps_carry_load_and_three_carry_the_weight(film):
    for stand in range(3):
        tick = hold(film, stand)
        touching = film.touching(tick)
        assert sum(touching) == stand + 1 and not any(touching[1::2])
        forces = np.array([film.truth(endcap, tick)[:3] for endcap in range(6)])
        assert [bool(np.linalg.norm(f) > 1) for f in forces] == list(touching)
        rotation = film.scene.R_world_robot[stand] @ film.scene.T_robot_endcap[:, :3, :3]
        world = np.einsum("kij,kj->ki", rotation, forces)
        sideways = np.linalg.norm(world[:, :2], axis=1)  # cables are slack: the ground pushes straight up
        assert (sideways <= tangential.TOLERANCE * world[:, 2]).all()
        if stand == 2:
            assert np.linalg.norm(world.sum(axis=0)) == pytest.approx(film.weight_n, abs=0.02)
    assert not any(film.touching(0)) and not film.truth(0, 0).any()


def test_a_ramp_begins_and_ends_where_it_should(film):
    stand, endcap = 2, 0
    rest, _ = film.scene.state(stand, endcap, 0.0)
    field, wrench = film.scene.state(stand, endcap, 1.0)
    half, half_wrench = film.scene.state(stand, endcap, 0.5)
    assert not rest.any() and np.linalg.norm(field, axis=1).max() > 5
    assert np.linalg.norm(half_wrench[:3]) == pytest.approx(0.5 * np.linalg.norm(wrench[:3]), rel=1e-3)
    assert 0.4 < np.abs(half).max() / np.abs(field).max() < 0.8  # a dome is stiffer at first


def test_the_solved_file_is_one_of_the_simulators_own_states():
    plan, shipped = robot_scene.plan_scene(), robot_scene.load_scene()
    assert [list(stand.touching) for stand in plan.stands] == shipped.touching.tolist()
    for place in plan.places():
        path, azimuth = plan.path(*place)
        target = path.waypoints[-1].target.normal_n
        assert np.linalg.norm(shipped.wrench[place][-1][:3]) == pytest.approx(target, rel=2e-3)
        assert shipped.azimuth_deg[place] == pytest.approx(azimuth)


def test_a_scene_that_is_missing_or_damaged_is_reported(tmp_path):
    with pytest.raises(FileError, match=r"robot_scene"):
        robot_scene.load_scene(tmp_path / "robot_scene.npz")
    (tmp_path / "x.npz").write_bytes(b"PK\x03\x04 not much")
    with pytest.raises(FileError, match=r"x\.npz"):
        robot_scene.load_scene(tmp_path / "x.npz")


# --- pictures --------------------------------------------------------------------------------------------------
def test_pictures_are_kept_and_a_damaged_file_of_them_is_not_used(film, monkeypatch):
    kept = next(film.folder.iterdir())
    monkeypatch.setattr(robot_frames, "_render", lambda *_: pytest.fail("rendered again"))
    again = robot_frames.load_film(film.folder)
    assert again.pictures == film.pictures
    monkeypatch.setattr(robot_frames, "_render", lambda scene, params, keys, progress: dict.fromkeys(keys, b"new"))
    whole = kept.read_bytes()
    kept.write_bytes(whole[: len(whole) // 2])
    assert set(robot_frames.load_film(film.folder).pictures.values()) == {b"new"}
    kept.write_bytes(whole)


def test_no_two_pictures_that_follow_one_another_are_equal(film):
    for endcap in (0, 3):
        reported = [film.jpeg(endcap, tick) for tick in range(film.ticks + 1)]
        assert all(a != b for a, b in itertools.pairwise(reported))


def test_a_camera_of_the_scene_keeps_its_rate_and_its_own_phase(film):
    sources = [iter(scene.SceneSource(number, 60)) for number in (0, 3)]
    times = np.array([[next(source).time_s for source in sources] for _ in range(12)])
    assert np.diff(times[:, 0]) == pytest.approx(np.rint(np.diff(times[:, 0]) * 60) / 60)
    apart = (times[:, 1] - times[:, 0]) * 60 % 1
    assert apart == pytest.approx(0.5, abs=1e-6) and times[-1, 0] <= time.monotonic()


def test_the_scene_begins_with_the_first_picture_taken_however_long_the_start_took(film, monkeypatch):
    """References are of its first second, at rest; on a new computer half a minute passes before it is read."""
    now = [5000.0]
    monkeypatch.setattr(scene.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(scene.time, "sleep", lambda wait_s: now.__setitem__(0, now[0] + wait_s))
    scene.scene_start_s.cache_clear()
    try:
        opened = [scene.SceneSource(number) for number in (0, 3)]
        now[0] += 25.0
        assert [next(iter(source)).jpeg for source in opened] == [source.picture(1) for source in opened]
    finally:
        scene.scene_start_s.cache_clear()


@pytest.mark.parametrize(("number", "rate"), [(6, 30), (-1, 30), (0, 0.0), (0, 1e4)])
def test_a_camera_that_is_not_there_is_refused(film, number, rate):
    with pytest.raises(ParameterError, match=r"scene:|rate_hz"):
        scene.SceneSource(number, rate)


def test_an_untouched_endcap_of_the_scene_is_not_flagged_as_a_camera_that_mixes_its_pictures(film):
    """Three patterns of noise in turn, as at rest, are no part of the picture before."""
    endcap = pipeline()
    for count in range(FRAMES * FEWEST + 1):
        shown = frame(film, 3, count % 24)
        reading = endcap.update(replace(shown, time_s=1 + count / RATE_HZ, sequence=count))
    assert FLAG not in reading.wrench.flags


# --- from picture to contact set -------------------------------------------------------------------------------
def contact_sets(film, model: LiveModel, ticks: range) -> list[tuple[int, tuple, tuple, object]]:
    """(tick, true contact set, reported contact set, robot state) of the ticks, zeroed on the first ten frames."""
    config = scene.scene_config()
    pipes = [
        EndcapPipeline(
            EndcapConfig(endcap.name, endcap.source), model, take_zero([frame(film, k, t) for t in range(10)]), k
        )
        for k, endcap in enumerate(config.endcaps)
    ]
    found = []
    for tick in ticks:
        readings = {pipe.endcap.name: pipe.update(frame(film, k, tick)) for k, pipe in enumerate(pipes)}
        reported = tuple(reading.contact.touching for reading in readings.values())
        state = robot_state(config.endcaps, readings, film.weight_n, 1 + tick / RATE_HZ)
        found.append((tick, film.touching(tick), reported, state))
    return found


def clear(film, tick: int) -> bool:
    """Not at the foot of a ramp, where the load is below any threshold."""
    moment = film.moments[tick]
    return moment.stand < 0 or moment.step > 0.2 * robot_frames.RAMP


def test_the_contact_set_of_six_endcaps_follows_the_scene(film):
    sets = contact_sets(film, stand_in(), range(0, film.ticks, 2))
    judged = [(truth, reported) for tick, truth, reported, _ in sets if clear(film, tick)]
    assert {sum(truth) for truth, _ in judged} == {0, 1, 2, 3}
    assert [truth for truth, _ in judged] == [reported for _, reported in judged]


@pytest.mark.long
def test_the_default_model_reports_contacts_and_weight_of_the_scene(film):
    try:
        model = load_model("default", EndcapParams(130, 8))
    except FileError:
        pytest.skip("no weights ship yet")
    sets = contact_sets(film, model, range(0, film.ticks, 2))
    assert all(truth == reported for tick, truth, reported, _ in sets if clear(film, tick))
    standing = [s for tick, _, _, s in sets if film.moments[tick] == robot_frames.Moment(2, robot_frames.RAMP)]
    assert len(standing) > 6 and all(state.consistent for state in standing[3:])


def test_a_calibrated_camera_that_is_turned_gives_the_same_wrench(film, tmp_path):
    """The picture turned by 180 degrees, and a calibration that says so."""
    import cv2

    from sensing.camera.mount import mount, rotation_matrix
    from sensing.camera.nominal import nominal_lens

    params = EndcapParams(130, 8)
    model = load_model("default", params)
    path = tmp_path / "camera.json"
    turned = mount(nominal_lens(), (0.0, 0.0, params.camera_height_mm), rotation_matrix([0.0, 0.0, np.pi]))
    turned.save(path)
    forces = {}
    for name, camera in (("straight", None), ("turned", path)):
        pipe, tick = (
            EndcapPipeline(EndcapConfig("endcap_0", "scene:0", camera=camera), model, zero_frames=1),
            hold(film, 2),
        )
        for k, at in enumerate((0, tick - 12, tick)):
            image = cv2.imdecode(np.frombuffer(film.jpeg(0, at), np.uint8), cv2.IMREAD_COLOR)
            image = image if camera is None else np.ascontiguousarray(image[::-1, ::-1])
            reading = pipe.update(Frame(1.0 + k, k, "test", image=image))
        forces[name] = reading.estimate.force_n
    truth = film.truth(0, hold(film, 2))[:3]
    assert np.linalg.norm(forces["straight"] - truth) < 4
    assert np.linalg.norm(forces["turned"] - forces["straight"]) < 1.5
