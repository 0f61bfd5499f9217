import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cad.errors import ParameterError
from sensing.sources.drawn import Drawing, draw_dots
from sensing.sources.warp import Bump, Displacement, cell_truth
from sensing.tracking.field.operator import AFFINE_VARIANCE, displacement_to_cells, field_operator
from sensing.tracking.parallax import _bilinear

SIZE = (640, 480)
DOTS = draw_dots(Drawing())[1]


def moved(displacement: Displacement, place: np.ndarray) -> np.ndarray:
    return np.stack(displacement.at(place[:, 0], place[:, 1]), axis=1)


def test_affine_motion_is_reproduced():
    motion = Displacement((7.0, -4.0), 0.03)
    field = field_operator(DOTS, SIZE).field(moved(motion, DOTS))
    assert np.abs(field - cell_truth(motion, SIZE, unit_px=480)).max() < 0.02


def test_smooth_bump_is_reproduced_better_with_more_dots():
    motion = Displacement(bumps=(Bump((380.0, 260.0), (15.0, 5.0), 60.0),))
    truth = cell_truth(motion, SIZE, unit_px=480)
    errors = [
        np.abs(field_operator(DOTS[::step], SIZE).field(moved(motion, DOTS[::step])) - truth).mean()
        for step in (4, 2, 1)
    ]
    assert errors[0] > errors[1] > errors[2] and errors[2] < 0.06


def test_gradient_agrees_with_finite_differences():
    operator = field_operator(DOTS, SIZE)
    push = moved(Displacement(bumps=(Bump((380.0, 260.0), (15.0, 5.0), 90.0),)), DOTS)
    inside = (np.abs(DOTS - [320, 240]) < 150).all(axis=1)
    step = 0.5
    for axis in (0, 1):
        shift = np.eye(2)[axis] * step
        bump = Displacement(bumps=(Bump((380.0, 260.0), (15.0, 5.0), 90.0),))
        truth = (moved(bump, DOTS + shift) - moved(bump, DOTS - shift)) / (2 * step)
        assert np.abs(operator.gradient[axis * len(DOTS) :][: len(DOTS)] @ push - truth)[inside].max() < 0.03


def test_filling_lost_dots_equals_leaving_them_out():
    live = np.random.default_rng(1).random(len(DOTS)) > 0.3
    push = moved(Displacement((3.0, 1.0), 0.02, bumps=(Bump((300.0, 200.0), (9.0, 9.0), 70.0),)), DOTS)
    full = field_operator(DOTS, SIZE)
    origin = DOTS.mean(axis=0)

    def kernel(a: np.ndarray, b: np.ndarray) -> np.ndarray:  # written again, from the definition
        a, b = (a - origin) / 80, (b - origin) / 80
        r = np.sqrt(5) * np.linalg.norm(a[:, None] - b[None], axis=2)
        return AFFINE_VARIANCE * (1 + a @ b.T) + (1 + r + r**2 / 3) * np.exp(-r)

    gram = kernel(DOTS[live], DOTS[live]) + 0.005 * np.eye(live.sum())
    expected = kernel(DOTS[~live], DOTS[live]) @ np.linalg.solve(gram, push[live])
    spoiled = np.where(live[:, None], push, 1e3)
    assert np.allclose(full.filled(spoiled, live)[~live], expected, atol=1e-6)
    assert (full.filled(spoiled, live)[live] == push[live]).all()


def test_left_out_residual_equals_refitting_without_the_dot():
    push = moved(Displacement(bumps=(Bump((300.0, 200.0), (9.0, 9.0), 70.0),)), DOTS)
    operator = field_operator(DOTS, SIZE)
    live = np.ones(len(DOTS), bool)
    live[17] = False
    predicted = operator.filled(push, live)[17]
    assert np.allclose(operator.left_out(push)[17], push[17] - predicted, atol=1e-8)


@settings(max_examples=40, deadline=None)
@given(st.integers(10, len(DOTS)), st.integers(0, 10_000))
def test_condition_is_bounded_for_any_painted_subset(count, seed):
    chosen = DOTS[np.random.default_rng(seed).choice(len(DOTS), count, replace=False)]
    operator = field_operator(chosen, SIZE)
    radius = (np.linalg.norm(chosen - chosen.mean(axis=0), axis=1) / 80).max()
    assert operator.condition <= (count * (1 + AFFINE_VARIANCE * (1 + radius**2)) + 0.005) / 0.005
    assert np.abs(operator.to_cells.sum(axis=0) - 1).max() < 0.05  # a constant stays a constant


@pytest.mark.parametrize(
    "place",
    [DOTS[:1], np.repeat(DOTS[:1], 5, axis=0), DOTS[:2], np.stack([np.linspace(100, 500, 12), np.full(12, 200.0)], 1)],
    ids=["one", "coincident", "two", "collinear"],
)
def test_degenerate_dots_still_give_a_constant(place):
    field = field_operator(place, SIZE).field(np.tile([2.0, -1.0], (len(place), 1)))
    assert np.abs(field[0] - 2).max() < 0.6 and np.abs(field[1] + 1).max() < 0.3 and np.isfinite(field).all()


def test_measured_stretch_sharpens_narrow_bumps_between_dots():
    operator, step = field_operator(DOTS, SIZE), 0.5
    plain, sharp = [], []
    for place in [(395, 262), (410, 250), (380, 300), (300, 180), (250, 330), (440, 300)]:
        motion = Displacement(bumps=(Bump(place, (20.0, 12.0), 26.0),))
        push, truth = moved(motion, DOTS), cell_truth(motion, SIZE, unit_px=480)
        slopes = [(moved(motion, DOTS + s) - moved(motion, DOTS - s)) / (2 * step) for s in np.eye(2) * step]
        plain.append(np.linalg.norm(operator.field(push) - truth, axis=0))
        sharp.append(np.linalg.norm(operator.field(push, np.stack(slopes, axis=2)) - truth, axis=0))
    assert np.max(sharp, axis=(1, 2)).mean() < 0.7 * np.max(plain, axis=(1, 2)).mean()
    assert np.mean(sharp) < 0.8 * np.mean(plain)


def test_stretch_within_its_scatter_changes_nothing():
    operator = field_operator(DOTS, SIZE)
    push = moved(Displacement((2.0, 1.0), 0.01), DOTS)
    noise = np.random.default_rng(0).normal(0, 0.05, (len(DOTS), 2, 2))
    noise[::7] = np.nan
    assert np.abs(operator.field(push, operator.predicted_stretch(push) + noise) - operator.field(push)).max() < 0.05


@pytest.mark.parametrize("share", [0.45, 0.6])
def test_dots_without_a_measured_stretch_do_not_lower_its_usual_scatter(share):
    """A lost dot has no stretch: it is no dot whose stretch agrees with the prediction."""
    operator = field_operator(DOTS, SIZE)
    push = np.zeros((len(DOTS), 2))
    stretch = np.random.default_rng(5).normal(0.0, 0.05, (len(DOTS), 2, 2))
    lost = np.arange(len(DOTS)) < share * len(DOTS)
    assert not operator.field(push, stretch).any()
    assert not operator.field(push, np.where(lost[:, None, None], np.nan, stretch)).any()
    assert not operator.field(push, np.full_like(stretch, np.nan)).any()


def test_a_picture_of_twice_the_size_shows_the_same_field_in_twice_the_pixels():
    motion = Displacement((2.0, 1.0), 0.01, bumps=(Bump((395.0, 262.0), (20.0, 12.0), 26.0),))
    push, live = moved(motion, DOTS), DOTS[:, 0] < 320
    small, large = field_operator(DOTS, SIZE), field_operator(2 * DOTS + 0.5, (1280, 960))
    stretch = small.predicted_stretch(push)  # it has no unit
    stretch[20:23] += [[0.3, -0.2], [0.1, 0.4]]
    assert np.allclose(large.field(2 * push), 2 * small.field(push), atol=1e-3)
    assert np.allclose(displacement_to_cells(2 * DOTS + 0.5, (1280, 960)), small.to_cells, atol=1e-4)
    assert np.allclose(large.predicted_stretch(2 * push), small.predicted_stretch(push), atol=1e-9)
    assert np.allclose(large.field(2 * push, stretch), 2 * small.field(push, stretch), atol=1e-2)
    assert np.abs(small.field(push, stretch) - small.field(push)).max() > 0.5  # it did count
    assert (large.valid(live) == small.valid(live)).all() and not small.valid(live).all()


def test_mask_says_where_no_dot_reaches():
    operator = field_operator(DOTS, SIZE)
    live = DOTS[:, 0] < 320
    assert operator.valid(live)[:, :12].mean() > 0.9 and not operator.valid(live)[:, 22:].any()
    assert not operator.valid(np.zeros(len(DOTS), bool)).any()


def test_all_lost_gives_zero():
    operator = field_operator(DOTS, SIZE)
    assert (operator.filled(np.full((len(DOTS), 2), np.nan), np.zeros(len(DOTS), bool)) == 0).all()


@pytest.mark.parametrize("place", [np.zeros((0, 2)), np.array([[1.0, np.nan]])])
def test_no_dots_or_nan_is_refused(place):
    with pytest.raises(ParameterError, match="at least one finite position"):
        field_operator(place, SIZE)


def test_what_moves_as_far_as_it_lies_shows_where_the_cells_are():
    """The field of the dots' own coordinates is those of the cells' middles: no half pixel, no axis exchanged."""
    field = field_operator(DOTS, SIZE, (20, 30)).field(DOTS)
    columns, rows = 80 + (np.arange(30) + 0.5) * 16 - 0.5, (np.arange(20) + 0.5) * 24 - 0.5
    near = field_operator(DOTS, SIZE, (20, 30)).valid(np.ones(len(DOTS), bool))
    assert np.abs(field[0] - columns[None])[near].max() < 0.1
    assert np.abs(field[1] - rows[:, None])[near].max() < 0.1


def test_cells_are_read_at_dots_along_the_right_axes():
    columns, rows = 80 + (np.arange(30) + 0.5) * 16 - 0.5, (np.arange(20) + 0.5) * 24 - 0.5
    place = np.random.default_rng(0).uniform([100, 20], [540, 460], (40, 2))
    plane = 3 * columns[None] - 2 * rows[:, None]
    assert _bilinear(place, SIZE, (20, 30)) @ plane.ravel() == pytest.approx(3 * place[:, 0] - 2 * place[:, 1])
