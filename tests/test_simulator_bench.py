"""What the simulator's page says of elements with one pressure each, by its bench's own functions."""

import numpy as np
import pytest

from bench import bench_simulator as bench
from sensing.simulator.solid.mesh import DENSITIES, MeshDensity


@pytest.mark.long
def test_constant_pressure_is_too_soft_in_bending_until_there_are_layers(monkeypatch):
    monkeypatch.setattr(bench, "FORCES_N", (5.0, 20.0))
    size = {}
    for layers in (1, 2):
        core, rings = DENSITIES["draft"].core, DENSITIES["draft"].rings
        model = bench.model_of(MeshDensity(core, rings, layers))
        linear, constant = (bench.run(each)["markers"][-1] for each in (model, bench.constant_pressure(model)))
        size[layers] = np.sqrt((constant**2).mean() / (linear**2).mean())
    assert size[1] > 1.3 and 1.0 < size[2] < 1.15
