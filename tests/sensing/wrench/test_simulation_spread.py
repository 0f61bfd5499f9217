"""What simulated frames do not show of a real shell widens live's intervals, in proportion to the load."""

from dataclasses import replace

import numpy as np
import pytest

from cad.params import EndcapParams
from sensing.learning.samples import are_simulated
from sensing.wrench.model import load_wrench_model
from sensing.wrench.simulation_spread import (
    FORCE_SHARE,
    LEVER_M,
    learned_from_simulation,
    simulation_spread,
)
from sensing.wrench.weight_files import BY_SIMILARITY, MADE_BY, SIMULATED


def test_it_grows_with_the_load_and_is_nothing_without():
    force = np.array([3.0, -4.0, 12.0])
    once, twice = simulation_spread(force, 65.0), simulation_spread(2 * force, 65.0)
    deviation = np.sqrt(np.diag(once))
    assert deviation == pytest.approx([13 * FORCE_SHARE] * 3 + [13 * LEVER_M] * 3)
    assert twice == pytest.approx(4 * once)
    assert not simulation_spread(np.zeros(3), 65.0).any()


def test_the_lever_is_a_part_of_the_radius_as_the_mesh_is():
    force = np.array([3.0, -4.0, 12.0])
    small, large = (np.sqrt(np.diag(simulation_spread(force, radius_mm))) for radius_mm in (49.45, 125.0))
    assert large[:3] == pytest.approx(small[:3])
    assert large[3:] / small[3:] == pytest.approx([125.0 / 49.45] * 3)


def test_only_weights_without_a_real_frame_are_widened():
    shipped = load_wrench_model(EndcapParams(130, 8))
    assert learned_from_simulation(shipped)
    assert not learned_from_simulation(replace(shipped, about={**shipped.about, SIMULATED: False}))
    assert not learned_from_simulation(object())


def test_paths_of_recordings_are_real_and_all_others_simulated():
    assert are_simulated(["wide-841-0", "library-0-1"])
    assert not are_simulated(["wide-841-0", "recorded-841-0"])


def test_weights_by_similarity_from_before_count_as_simulated(tmp_path):
    """Files that users made for their sizes state that a real frame was among the training."""
    shipped = load_wrench_model(EndcapParams(130, 8))
    for made_by, found in ((BY_SIMILARITY, True), ("my script", False)):
        path = tmp_path / f"{made_by}.safetensors"
        replace(shipped, about={**shipped.about, SIMULATED: False, MADE_BY: made_by}).save(path)
        assert learned_from_simulation(load_wrench_model(EndcapParams(130, 8), path)) is found
