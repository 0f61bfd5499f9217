"""What the gate makes of dots alone: pictures torn at one row, steps that are not confirmed, pictures that stay."""

import numpy as np
import pytest

from sensing.live.core.gate import Gate, disturbed_dots, torn_row
from sensing.live.core.state import Event
from sensing.records import DotTracks, Frame, Wrench

SIZE = (640, 480)


def test_a_tear_is_a_step_sideways_at_one_row():
    rng = np.random.default_rng(3)
    places = rng.uniform([60, 20], [580, 460], (80, 2))
    below = places[:, 1] > 240
    row = places[below, 1].min()

    def torn(moved: np.ndarray) -> float:
        noisy = places + moved + rng.normal(0, 0.05, places.shape)
        lost = np.zeros(80, bool)
        return torn_row(DotTracks(0.0, np.arange(80), places, noisy, np.ones(80), lost, SIZE))

    for step in (-40.0, -1.5, 2.0, 12.0):
        assert torn(np.outer(below, [step, 0.0])) == pytest.approx(row, abs=15), step
    for other in ([0.0, 3.0], [2.0, 2.0]):  # up and down, or slanted
        assert torn(np.outer(below, other)) == 0.0
    assert torn(np.full((80, 2), 3.0)) == 0.0 and torn(np.zeros((80, 2))) == 0.0  # the camera moved; nothing did
    away = np.linalg.norm(places - [330, 230], axis=1)
    bump = np.exp(-((away / 90) ** 2))
    assert torn(np.outer(bump, [9.0, 0.0])) == 0.0
    shear = np.clip((places[:, 1] - 100) / 280, 0, 1)  # as a push along the picture
    assert torn(np.outer(shear, [6.0, 0.0])) == 0.0


PLACES = np.random.default_rng(5).uniform([60, 20], [580, 460], (60, 2))


def judged(gate: Gate, force_n: float, likeness: float = 1.0, quality: float = 0.95):
    """Verdict on a picture with that force along -z, where the filter expects none."""
    tracks = DotTracks(0.0, np.arange(60), PLACES, PLACES, np.full(60, quality), np.zeros(60, bool), SIZE)
    estimate = Wrench(0.0, np.array([0.0, 0.0, -force_n]), np.zeros(3), "sphere", np.eye(6))
    return gate.judge(likeness, tracks, estimate, lambda: np.zeros(3))


def test_a_step_is_confirmed_by_a_frame_that_shows_the_same_and_by_no_other():
    gate = Gate()
    assert judged(gate, 10.0).held and not judged(gate, 9.0).held  # it lasts
    assert judged(gate, 10.0).held and judged(gate, 4.0).held  # another false step
    assert judged(Gate(), 0.2).held is False  # no step
    assert judged(Gate(), 10.0, quality=0.99).held is False  # all windows are sure: a press


def test_a_picture_without_a_number_between_confirms_nothing():
    gate = Gate()
    assert judged(gate, 10.0).held
    assert judged(gate, 10.0, likeness=0.1).event is Event.UNSEEN
    assert judged(gate, 10.0).held


def test_few_pictures_of_a_slow_camera_are_no_camera_that_hangs():
    gate, picture = Gate(), np.zeros((4, 4), np.uint8)
    same_s = [gate.frozen(Frame(0.5 * k, k, "slow", image=picture)) for k in range(7)]
    assert same_s == [0, 0, 0, 0, 0, 2.5, 3.0]
    assert gate.frozen(Frame(3.5, 7, "slow", image=picture + np.uint8(1))) == 0


@pytest.mark.parametrize(("rows", "is_torn"), [(480, True), (960, False)])
def test_a_step_of_a_tear_counts_by_the_size_of_the_picture(rows, is_torn):
    size, scale = (rows * 4 // 3, rows), rows / 480
    places = PLACES * scale
    moved = places + np.outer(places[:, 1] > 240 * scale, [1.5, 0.0])  # px
    found = torn_row(DotTracks(0.0, np.arange(60), places, moved, np.ones(60), np.zeros(60, bool), size))
    assert bool(found) is is_torn


@pytest.mark.parametrize(
    ("force_n", "load_scale", "clear"),
    [(0.0, 1.0, 0.985), (20.0, 1.0, 0.965), (1.0, 0.05, 0.965), (200.0, 10.0, 0.965), (500.0, 1.0, 0.94)],
)
def test_what_a_dot_may_lose_by_a_press_is_counted_in_the_newtons_of_the_dome(force_n, load_scale, clear):
    quality, lost = np.array([clear - 5e-4, clear + 5e-4, 1.0]), np.array([False, False, True])
    tracks = DotTracks(0.0, np.arange(3), PLACES[:3], PLACES[:3], quality, lost, SIZE)
    found = disturbed_dots(tracks, np.array([0.0, 0.6, -0.8]) * force_n, load_scale)
    assert found.tolist() == [True, False, True]


@pytest.mark.parametrize(("force_n", "is_step"), [(0.03, True), (0.02, False)])
def test_a_step_is_counted_in_the_newtons_of_the_dome(force_n, is_step):
    assert judged(Gate(0.07), force_n).held is is_step  # 0.35 N at D=130 T=8
