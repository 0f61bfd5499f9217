"""The error of one weight that a weighing would not show is found, and stated."""

from dataclasses import replace

import numpy as np
import pytest

from sensing import weigh
from sensing.weighing.gain import Pose, WeighingError, fit_gain
from sensing.weighing.unnoticed import unnoticed
from sensing.weighing.words import PoseRequest

COVARIANCE = np.diag([0.05, 0.05, 0.1]) ** 2


def poses(*weights_g: float) -> list[Pose]:
    asked = [PoseRequest(grams) for grams in weights_g]
    return [Pose(a.name, a.load_n(), a.load_sd_n(), a.load_n() / 0.73, COVARIANCE) for a in asked]


@pytest.mark.parametrize("weights_g", [(350.0, 1000.0), (350.0, 700.0, 1000.0), (500.0, 2500.0)])
def test_no_weight_that_is_wrong_by_more_makes_a_gain(weights_g):
    given = poses(*weights_g)
    found, worst = unnoticed(given), 0.0
    for number in range(len(given)):
        for part in np.linspace(-0.4, 0.4, 161):
            changed = [replace(p, load_n=(1 + part * (k == number)) * p.load_n) for k, p in enumerate(given)]
            try:
                gain = fit_gain(changed).gain
            except WeighingError:
                continue
            assert abs(part) < found.weight_part + 0.001 and abs(gain / 0.73 - 1) < found.gain_part + 0.001
            worst = max(worst, abs(part))
    assert found.weight_part == pytest.approx(worst, abs=0.006) and 0.01 < found.gain_part < found.weight_part


def test_what_would_not_have_been_noticed_is_said_beside_the_gain(capsys):
    """A weight wrong by a tenth moved the gain by three of its stated deviations, and nothing said that it could."""
    given = poses(350.0, 1000.0)
    weigh._report(given, fit_gain(given))
    missed = unnoticed(given)
    said = capsys.readouterr().out
    assert f"wrong by up to {100 * missed.weight_part:.0f} % would not have been noticed" in said
    assert f"would change the gain by up to {100 * missed.gain_part:.0f} %" in said
