"""What counts as standing still grows with the load; without its gain an endcap touches at another force."""

import contextlib
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.gate import DISTURBED
from sensing.live.core.mixed_watch import FLAG as MIXED
from sensing.live.core.state import Condition, State
from sensing.records import DotTracks, Wrench
from sensing.weighing import robot, session
from sensing.weighing.at_rest import Rest, RestWatch, _rest, _Row, _still
from sensing.weighing.film import as_trained
from sensing.weighing.gain import WeighingError, fit_gain
from sensing.weighing.store import gain_entries
from sensing.weighing.words import GRAVITY_M_S2, PoseRequest


@pytest.mark.parametrize(
    ("load_n", "creeps_n", "is_still"), [(1, 0.04, True), (1, 0.06, False), (20, 0.15, True), (20, 0.25, False)]
)
def test_a_load_may_creep_by_a_hundredth(load_n, creeps_n, is_still):
    forces = -load_n + np.repeat([0.0, creeps_n], 10)
    rows = [_Row(0.1 * k, np.array([0, 0, f, 0, 0, 0]), np.eye(6), True, frozenset(), "") for k, f in enumerate(forces)]
    rest = _rest(rows)
    assert rest.moved_n == pytest.approx(creeps_n) and _still(rows, rest) is is_still


@pytest.mark.parametrize(
    ("load_n", "scatter_n", "is_still"), [(1, 0.1, True), (1, 0.2, False), (20, 0.3, True), (20, 0.5, False)]
)
def test_a_load_may_scatter_by_a_fiftieth(load_n, scatter_n, is_still):
    rows = [
        _Row(0.1 * k, np.array([0, 0, -load_n + scatter_n * (-1) ** k, 0, 0, 0]), np.eye(6), True, frozenset(), "")
        for k in range(20)
    ]
    assert _still(rows, _rest(rows)) is is_still


def test_a_soft_dome_stands_still_by_its_own_forces():
    forces = -1.0 + np.repeat([0.0, 0.04], 10)
    rows = [_Row(0.1 * k, np.array([0, 0, f, 0, 0, 0]), np.eye(6), True, frozenset(), "") for k, f in enumerate(forces)]
    assert _still(rows, _rest(rows)) and not _still(rows, _rest(rows), load_scale=0.04)


def test_without_its_gain_an_endcap_touches_at_what_the_weights_would_say():
    soft = EndcapConfig("a", "0", gain=0.5, gain_sd=0.01, contact_on_n=0.4, contact_off_n=0.2)
    plain = as_trained(soft)
    assert (plain.gain, plain.gain_sd) == (1.0, 0.0)
    assert (plain.contact_on_n, plain.contact_off_n) == (0.8, 0.4)  # half as stiff: weights read twice its force


def test_a_second_weighing_moves_the_threshold_from_the_gain_before():
    """It was measured in newtons of the old gain, which need not be one."""
    soft = EndcapConfig("a", "0", gain=0.5, gain_sd=0.01, contact_on_n=0.4, contact_off_n=0.2)
    entries = gain_entries(soft, 0.6, 0.01, "0")
    assert (entries["contact_on_n"], entries["contact_off_n"]) == (0.48, 0.24) and entries["gain"] == 0.6
    assert "contact_on_n" not in gain_entries(EndcapConfig("a", "0"), 0.6, 0.01, "0")


def test_what_the_untouched_endcap_reads_is_no_load(monkeypatch):
    """Lamp, mounting or a small turn since the reference leave up to 0.6 N that nothing flags."""
    loads = [PoseRequest(grams).load_n() for grams in (600.0, 1800.0)]
    forces = iter([np.zeros(3), *(load / 0.73 for load in loads)])
    answers = iter(["", "600", "", "1800", "", ""])

    def at_rest(*_):
        return Rest(np.concatenate([np.add(next(forces), (0.1, 0.0, -0.6)), np.zeros(3)]), 0.1**2 * np.eye(6), 0.0, 30)

    monkeypatch.setattr(session, "Engine", lambda *_: contextlib.nullcontext())
    monkeypatch.setattr(session, "_await", at_rest)
    monkeypatch.setattr(session, "_await_reference", lambda _: None)
    pipeline = SimpleNamespace(model=SimpleNamespace(load_scale=1.0), endcap=EndcapConfig("a", "0"))
    endcap = SimpleNamespace(name="a", pipeline=pipeline)
    terms = session.Terms(0.0, 0.0, 0.0, GRAVITY_M_S2)
    poses = session.weigh_live(endcap, terms, lambda _: next(answers), lambda _: "")
    assert fit_gain(poses).gain == pytest.approx(0.73, abs=1e-12)


def reading(number: int, force_n: float, flags=frozenset(), disturbed: int = 0, torn: bool = False):
    """One reading of 60 dots, a thirtieth of a second after the last; it touches from 0.3 N on."""
    places = np.stack(np.meshgrid(np.linspace(60, 580, 10), np.linspace(40, 440, 6)), axis=-1).reshape(-1, 2)
    moved = places + (np.array([2.0, 0.0]) * (places[:, 1:] > 200) if torn else 0.0)
    quality = np.where(np.arange(60) < disturbed, 0.9, 1.0)
    tracks = DotTracks(number / 30, np.arange(60), places, moved, quality, np.zeros(60, bool), (640, 480))
    wrench = Wrench(number / 30, np.array([0.0, 0.0, -force_n]), np.zeros(3), "endcap", 0.01 * np.eye(6), flags)
    contact = SimpleNamespace(touching=force_n >= 0.3)
    return SimpleNamespace(valid=True, estimate=wrench, tracks=tracks, contact=contact, reason="as seen")


@pytest.mark.parametrize("state", [State.RUNNING, State.UNPLUGGED])
def test_a_camera_that_is_unplugged_under_the_load_is_named(monkeypatch, state):
    """It read "fewer than 5 readings within 1 s: does the camera run?"."""
    monkeypatch.setattr(session, "REST_S", 0.0)
    condition = Condition(state, "/dev/video9: no such camera")
    endcap = SimpleNamespace(
        health=SimpleNamespace(valid=condition.valid), machine=SimpleNamespace(condition=condition)
    )
    with pytest.raises(WeighingError) as refused:
        session._await(endcap, session.Listener(1.0), RestWatch.pressed, "under the load")
    said = "; now unplugged: /dev/video9: no such camera"
    assert str(refused.value).endswith(said) is (state is State.UNPLUGGED)


def watched(readings) -> RestWatch:
    watch = RestWatch()
    for each in readings:
        watch.add(each)
    return watch


def test_a_few_dots_that_look_otherwise_do_not_refuse_a_load():
    """Reflections at the tip flagged every rendered sensor of D=107 at half its range: none could be weighed."""
    flags = frozenset({DISTURBED})
    rest = watched(reading(k, 9.0, flags, disturbed=4) for k in range(40)).pressed()
    assert rest.wrench[2] == -9.0 and rest.disturbed == 4 and "4 dot(s) look otherwise than untouched" in rest.note
    assert watched(reading(k, 9.0) for k in range(40)).pressed().note == ""


@pytest.mark.parametrize(
    "options",
    [
        {"flags": frozenset({DISTURBED}), "disturbed": 7},
        {"flags": frozenset({DISTURBED, "moved"}), "disturbed": 4},
        {"flags": frozenset({"out_of_range"})},
        {"flags": frozenset({DISTURBED}), "torn": True},
    ],
)
def test_many_such_dots_a_torn_picture_or_another_flag_do(options):
    with pytest.raises(WeighingError, match=r"readings under the load, 9\.00 N, are flagged"):
        watched(reading(k, 9.0, **options) for k in range(40)).pressed()


@pytest.mark.parametrize("flags", [{MIXED}, {MIXED, DISTURBED}])
def test_a_camera_that_mixes_its_pictures_shows_a_standing_load_as_it_is(flags):
    rest = watched(reading(k, 9.0, frozenset(flags), disturbed=4) for k in range(40)).pressed()
    assert rest.wrench[2] == -9.0 and rest.readings >= 30


def test_a_load_beyond_the_weights_says_what_to_do():
    """It said only "flagged (out_of_range): the model flags out_of_range"."""
    made = [reading(k, 16.5, frozenset({"out_of_range"})) for k in range(40)]
    said = [SimpleNamespace(**{**vars(each), "reason": "the model flags out_of_range"}) for each in made]
    with pytest.raises(WeighingError, match=r"16\.5 N, are flagged .*: weights have not learned .* 15 to 70 % of"):
        watched(said).pressed()


def test_of_a_recording_what_the_untouched_endcap_read_before_the_load_is_taken_out():
    """The guide did so, but the same weights from recordings kept it: 0.2 N of 5.9 N are 3 % of the gain."""
    forces = [*[0.2] * 40, *np.linspace(0.2, 6.1, 20), *[6.1] * 40, *[0.1] * 40]
    rest = watched(reading(k, force) for k, force in enumerate(forces)).loaded()
    assert rest.wrench[2] == pytest.approx(-5.9) and "0.20 N of the untouched endcap taken out" in rest.note


@pytest.mark.parametrize("before", [[0.2] * 20, list(np.linspace(0.0, 0.29, 40))])
def test_without_a_second_of_rest_before_the_load_nothing_is_taken_out(before):
    rest = watched(reading(k, force) for k, force in enumerate([*before, *[6.1] * 40])).loaded()
    assert rest.wrench[2] == pytest.approx(-6.1) and math.isnan(rest.untouched_n) and rest.note == ""


def test_of_a_posture_what_has_left_the_ground_carries_nothing(monkeypatch):
    """An endcap may touch while the robot comes to rest; only what carries at the end stands."""
    forces = [*[6.1] * 40, *[0.1] * 10]
    for last_n, carries in ((6.0, True), (0.1, False)):
        shown = [reading(k, force) for k, force in enumerate([*forces, *[last_n] * 40])]
        monkeypatch.setattr(robot, "film_readings", lambda *_, made=shown: made)
        found = robot._at_rest(EndcapConfig("a", "0"), Path("stand.mcap"), SimpleNamespace(load_scale=1.0))
        assert (found is not None) == carries and (not carries or found[0] == pytest.approx([0.0, 0.0, -6.0]))


def test_forces_and_covariances_of_a_posture_are_in_the_robots_frame(monkeypatch):
    """This endcap looks along the robot's x: what is uncertain along its axis is uncertain along x."""
    T = np.array([[0.0, 0.0, 1.0, 50.0], [0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    rest = np.array([1.0, 2.0, -9.0]), np.array([[1.0, 0.5, 0.0], [0.5, 2.0, 0.0], [0.0, 0.0, 9.0]])
    monkeypatch.setattr(robot, "_at_rest", lambda *_: rest)
    config = LiveConfig((EndcapConfig("a", "0", T_robot_endcap=T),))
    force, covariance = robot._forces(config, Path("stand.mcap"), lambda _: None, lambda _: "")
    assert force["a"] == pytest.approx([-9.0, 2.0, -1.0])
    assert covariance["a"] == pytest.approx(np.array([[9.0, 0.0, 0.0], [0.0, 2.0, -0.5], [0.0, -0.5, 1.0]]))


@pytest.mark.parametrize(("count", "long_enough"), [(31, True), (29, False)])
def test_a_load_has_to_stand_for_a_second(count, long_enough):
    """Thirty intervals of a thirtieth; the median of the forces counts, not the last one."""
    watch = watched(reading(k, 6.1 if k == count - 1 else 6.0) for k in range(count))
    if long_enough:
        assert watch.pressed().wrench[2] == -6.0 and watch.pressed().readings == count
    else:
        with pytest.raises(WeighingError, match="lasts for less than 1 s"):
            watch.pressed()


@pytest.mark.parametrize(("flagged", "counts"), [(1, True), (2, False)])
def test_one_flagged_reading_of_thirty_does_not_refuse_a_load(flagged, counts):
    watch = watched(reading(k, 6.0, frozenset({"moved"} if k < flagged else ())) for k in range(31))
    if counts:
        assert watch.pressed().readings == 31
    else:
        with pytest.raises(WeighingError, match=r"are flagged \(moved\)"):
            watch.pressed()
