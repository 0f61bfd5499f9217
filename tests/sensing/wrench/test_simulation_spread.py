"""What simulated frames do not show of a real shell widens live's intervals, in proportion to the load."""

from dataclasses import replace

import numpy as np
import pytest

from cad.params import EndcapParams
from sensing.wrench.model import load_wrench_model
from sensing.wrench.simulation_spread import (
    FORCE_SHARE,
    LEVER_M,
    SIMULATED,
    learned_from_simulation,
    simulation_spread,
)


def test_it_grows_with_the_load_and_is_nothing_without():
    force = np.array([3.0, -4.0, 12.0])
    once, twice = simulation_spread(force), simulation_spread(2 * force)
    deviation = np.sqrt(np.diag(once))
    assert deviation == pytest.approx([13 * FORCE_SHARE] * 3 + [13 * LEVER_M] * 3)
    assert twice == pytest.approx(4 * once)
    assert not simulation_spread(np.zeros(3)).any()


def test_only_weights_without_a_real_frame_are_widened():
    shipped = load_wrench_model(EndcapParams(130, 8))
    assert learned_from_simulation(shipped)
    assert not learned_from_simulation(replace(shipped, about={**shipped.about, SIMULATED: False}))
    assert not learned_from_simulation(object())
