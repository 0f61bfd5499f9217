"""Which directions of a field come first, and what a calibration leaves of a camera: planted signals and noises."""

from dataclasses import replace

import numpy as np
import pytest
from made_samples import SIDE, made_samples

from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.calibration.dots import pattern_points
from sensing.calibration.from_dots import calibrate_from_dots
from sensing.camera.nominal import nominal_mount
from sensing.camera.parameters import NAMES, camera_at, camera_vector
from sensing.learning.covered_range import _left
from sensing.learning.found_camera import FRAME_PX, PAINT_PX, left_by_calibration
from sensing.learning.principal import leading, pattern_tensor, principal_fields, same_states, second_moments
from sensing.learning.samples import Samples
from sensing.learning.symmetry import moved_inputs

VIEWS = 4


def seen_often(noise: np.ndarray, seed: int = 0) -> Samples:
    """Every state four times, each view with a field of its own beside the contact's; rows are shuffled.

    Args:
        noise: (2, SIDE, SIDE) field; a view has a random multiple of it.
    """
    once, rng = made_samples(noise=0.0), np.random.default_rng(seed)
    many = once.take(rng.permutation(np.repeat(np.arange(len(once)), VIEWS)))
    beside = rng.standard_normal(len(many))[:, None, None, None] * noise
    return replace(many, fields=(many.fields + beside).astype(np.float32))


@pytest.fixture(scope="module")
def swirl() -> np.ndarray:
    """A field that no contact makes, larger than what contacts make, the same under the square's symmetries."""
    y, x = np.mgrid[0:SIDE, 0:SIDE] * 2 / (SIDE - 1) - 1
    return 3.0 * np.stack([x * (x**2 - y**2) ** 2, y * (x**2 - y**2) ** 2])


def test_views_of_a_state_lie_in_one_block(swirl):
    samples = seen_often(swirl)
    rows = same_states(samples)
    assert np.array_equal(np.sort(np.concatenate([block.ravel() for block in rows])), np.arange(len(samples)))
    for block in rows:
        assert block.shape[1] == VIEWS
        assert (samples.wrenches[block] == samples.wrenches[block[:, :1]]).all()


def test_noise_is_what_views_of_a_state_differ_by(swirl):
    """Its moments are those of the planted field, whose mean square over the disc is known."""
    samples = seen_often(swirl)
    _, noise = second_moments(samples)
    planted = replace(samples, fields=np.broadcast_to(swirl, samples.fields.shape).astype(np.float32)).inputs[0]
    assert planted @ noise @ planted / (planted @ planted) ** 2 == pytest.approx(1.0, rel=0.1)
    assert np.trace(noise) == pytest.approx(planted @ planted, rel=0.1)


def test_a_large_field_that_only_sensors_make_comes_last(swirl):
    samples = seen_often(swirl)
    axis = replace(samples, fields=np.broadcast_to(swirl, samples.fields.shape).astype(np.float32)).inputs[0]
    axis /= np.linalg.norm(axis)
    known = principal_fields(samples, 6)
    once = np.unique(np.char.add(samples.path, samples.time_s.astype(str)), return_index=True)[1]
    blind = principal_fields(samples.take(once), 6)  # no state is seen twice: the noise is not known as such
    held = [np.linalg.norm(np.linalg.pinv(fields) @ fields @ axis) for fields in (known, blind)]
    assert held[0] < 0.05 and held[1] > 0.95
    parts = samples.inputs @ known.T
    every = np.mean([(moved_inputs(samples.inputs, k, SIDE) @ known.T) ** 2 for k in range(8)], axis=(0, 1))
    assert every == pytest.approx(np.ones(6), rel=1e-6) and parts.shape == (len(samples), 6)


def test_fields_of_nothing_are_refused():
    with pytest.raises(ParameterError, match="all zero"):
        leading(np.zeros((8, 8)), np.zeros((8, 8)), 3)


@pytest.mark.long
def test_calibrations_err_by_as_much_as_is_drawn_for_training():
    """Squared errors of found cameras over the covariance of :func:`left_by_calibration`."""
    design, rng = EndcapParams(130, 8), np.random.default_rng(5)
    nominal, left = nominal_mount(design, *FRAME_PX), left_by_calibration(design)
    free = [NAMES.index(name) for name in NAMES if name not in ("cx_px", "cy_px", "k1", "k2")]
    ratios = []
    for _ in range(24):
        moved = camera_vector(nominal)
        moved[5:8] += 0.026 * rng.standard_normal(3)
        moved[8:11] += 0.5 * rng.standard_normal(3)
        moved[0] *= 1 + 0.01 * rng.standard_normal()
        true = camera_at(moved, nominal)
        place = true.project(pattern_points(design)[0])
        place = place[((place > 0) & (place < np.array(FRAME_PX) - 1)).all(axis=1)]
        found = calibrate_from_dots(place + PAINT_PX * rng.standard_normal(place.shape), design, FRAME_PX).mounted
        off = (camera_vector(found) - camera_vector(true))[free]
        ratios.append(off @ np.linalg.solve(left[np.ix_(free, free)], off) / len(free))
    assert 0.3 < np.mean(ratios) < 3.0, ratios


def test_what_patterns_leave_of_the_samples_is_not_seen_by_their_parts(swirl):
    """Normal equations of the least squares; the smallest fields with these parts leave more."""
    samples = seen_often(swirl)
    directions = principal_fields(samples, 12).astype(np.float32)
    pattern = pattern_tensor(directions, samples, None)["pattern"].astype(float)
    copies = np.concatenate([moved_inputs(samples.inputs, k, SIDE) for k in range(8)])
    parts = copies @ directions.T.astype(float)
    left = copies - parts @ pattern.T
    assert np.abs(left.T @ parts).max() < 1e-4 * np.abs(copies.T @ parts).max()
    smallest = copies - parts @ np.linalg.pinv(directions.astype(float)).T
    assert (left**2).sum() < 0.98 * (smallest**2).sum()  # most of both is the swirl, which no part sees


def test_fine_tuned_weights_keep_the_pattern_of_their_start(swirl):
    samples = seen_often(swirl)
    directions = principal_fields(samples, 4).astype(np.float32)
    known = {"principal": directions, "pattern": np.ones((directions.shape[1], 4), np.float32)}
    assert pattern_tensor(directions, samples, known)["pattern"] is known["pattern"]
    assert pattern_tensor(directions, samples, {"principal": directions}) == {}
    more = principal_fields(samples, 5).astype(np.float32)
    assert pattern_tensor(more, samples, known)["pattern"].shape == (directions.shape[1], 5)


def test_what_is_left_of_a_field_may_grow_with_the_load_as_in_training():
    """Of fields that leave 0.2 px and 0.05 px more for each newton, and a margin of 1.3."""
    force_n = np.linspace(0.0, 40.0, 4001)
    least, slope = _left(np.where(force_n < 2.0, 0.2, 0.2 + 0.05 * force_n), force_n)
    assert least == pytest.approx(1.3 * 0.2) and slope == pytest.approx(1.3 * 0.05)
