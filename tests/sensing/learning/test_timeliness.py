"""The filter's answers in motion: their lag, and the time that they are judged by."""

from types import SimpleNamespace

import numpy as np
import pytest

from cad.params import EndcapParams
from sensing.learning.timeliness import filtered_score, lag_s

DESIGN = EndcapParams(130.0, 8.0)


def test_lag_left_in_is_reported_and_prediction_takes_it_out():
    """The answers themselves are the truth here, so that all lag is the latency's. A run that stands still has none."""
    time = np.arange(90) / 30
    swing = np.outer(np.sin(4 * time), [5.0, 2.0, 8.0, 0.1, 0.2, 0.3])
    test = SimpleNamespace(
        wrenches=np.concatenate([swing, np.zeros((90, 6))]), time_s=np.tile(time, 2), design=DESIGN,
        path=np.repeat(["a", "b"], 90), azimuth_deg=np.zeros(180), contact=np.ones(180, bool),
    )  # fmt: skip
    answers = test.wrenches, np.tile(1e-4 * np.eye(6), (180, 1, 1)), test, 1.0
    assert filtered_score(*answers, 0.0).lag_s == pytest.approx(0.0, abs=0.003)
    assert filtered_score(*answers, 0.06, predict=False).lag_s == pytest.approx(0.06, abs=0.008)
    assert filtered_score(*answers, 0.06).lag_s == pytest.approx(0.0, abs=0.02)


def test_late_answers_are_judged_by_the_contact_of_their_own_time():
    """Frames a second apart, 1 s late with the lag left in: the force of the last touch comes while all is clear."""
    force = np.array([0.0, 0.0, 8.0, 8.0, 0.0, 0.0])
    truth = np.outer(force, [0.0, 0.0, -1.0, 0.0, 0.0, 0.0])
    test = SimpleNamespace(
        wrenches=truth, time_s=np.arange(6.0), path=np.full(6, "a"), design=DESIGN, azimuth_deg=np.zeros(6),
        contact=force > 0,
    )  # fmt: skip
    answers = truth, np.tile(1e-4 * np.eye(6), (6, 1, 1)), test, 1.0
    late = filtered_score(*answers, 1.0, predict=False)
    assert late.rest_n == pytest.approx(8.0, rel=0.01)
    assert filtered_score(*answers, 0.0, predict=False).rest_n < 0.1


def test_the_filter_that_is_scored_is_that_of_the_endcaps_forces():
    """As live runs it: a soft endcap's answers are those of a hard one in smaller newtons, and so are their errors."""
    time, rng = np.arange(90) / 30, np.random.default_rng(0)
    truth = np.outer(np.sin(4 * time), [5.0, 2.0, 8.0, 0.1, 0.2, 0.3])
    seen = truth + 0.1 * rng.standard_normal(truth.shape)

    def scored(scale):
        test = SimpleNamespace(
            wrenches=scale * truth, time_s=time, path=np.full(90, "a"), design=DESIGN,
            azimuth_deg=np.zeros(90), contact=np.ones(90, bool),
        )  # fmt: skip
        covariance = np.tile((0.1 * scale) ** 2 * np.eye(6), (90, 1, 1))
        return filtered_score(scale * seen, covariance, test, scale, 0.06)

    hard, soft = scored(1.0), scored(0.04)
    assert np.array(soft.rmse) == pytest.approx(0.04 * np.array(hard.rmse), rel=1e-6)
    for name in ("lag_s", "direction_deg", "precision", "recall", "coverage"):
        assert getattr(soft, name) == pytest.approx(getattr(hard, name), rel=1e-6, nan_ok=True), name


def test_lag_of_a_delayed_copy_is_its_delay():
    time = np.arange(0, 2, 1 / 30)
    assert lag_s(np.sin(5 * (time - 0.05)), np.sin(5 * time), time) == pytest.approx(0.05, abs=0.006)
    assert lag_s(np.sin(5 * time), np.sin(5 * time), time) == pytest.approx(0.0, abs=0.003)
