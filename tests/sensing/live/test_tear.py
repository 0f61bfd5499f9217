"""Where a picture is torn, from the displacements of the dots alone: steps sideways at one row, and nothing else."""

import numpy as np
import pytest

from sensing.live.core.gate import torn_row
from sensing.records import DotTracks

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
