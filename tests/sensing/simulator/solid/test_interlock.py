"""The zone with the TPU gyroid: stiffer by its factor where it is, and nothing else changed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cad.errors import ParameterError
from cad.materials import hyperelastic_law, silicone
from cad.scaling import INTERLOCK_DEPTH_MM
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.dataset.request import DataRequest
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Press, Target
from sensing.simulator.similarity.labelled import shell_of
from sensing.simulator.similarity.ratios import ShellRatios
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.shell import shell_model

FACTOR = 1.5


def test_a_shell_that_is_all_interlock_is_one_of_a_silicone_as_much_stiffer():
    """R = 16 mm ends 24 mm over the clamp: both pressed to the load that is the same in units of their moduli."""
    geometry, law = ShellRatios.of(shell_geometry(130, 8)).shell(16.0), silicone().neo_hooke()
    assert geometry.centre_mm[2] + geometry.outer_radius_mm - geometry.clamp_height_mm < INTERLOCK_DEPTH_MM
    stiffer = replace(law, c10_mpa=FACTOR * law.c10_mpa, bulk_mpa=FACTOR * law.bulk_mpa)
    zone = Simulator(geometry, law, "draft", interlock=FACTOR).press(2.0, 20.0)
    all_of_it = Simulator(geometry, stiffer, "draft").press(2.0, 20.0)
    plain = Simulator(geometry, law, "draft").press(2.0, 20.0)
    assert zone.depth_mm == pytest.approx(all_of_it.depth_mm, rel=5e-3)
    assert np.abs(zone.surface_mm - all_of_it.surface_mm).max() < 5e-3 * np.abs(all_of_it.surface_mm).max()
    assert plain.depth_mm > 1.1 * zone.depth_mm


def test_only_elements_in_the_zone_are_stiffer():
    geometry, law = shell_geometry(130, 8), silicone().neo_hooke()
    plain, zone = (shell_model(geometry, law, "draft", True, interlock=factor).solid.data for factor in (1.0, FACTOR))
    ratio = zone.weight / plain.weight
    cells = shell_model(geometry, law, "draft", True).solid.mesh
    height = cells.points[cells.cells][:, :, 2] - geometry.clamp_height_mm
    assert ratio[height.max(axis=1) < INTERLOCK_DEPTH_MM] == pytest.approx(FACTOR)
    assert ratio[height.min(axis=1) > INTERLOCK_DEPTH_MM] == pytest.approx(1.0)
    assert set(np.unique(ratio.round(9))) == {1.0, FACTOR}


def test_the_stiffest_interlock_converges_in_nearly_incompressible_silicone():
    """Both at the end of their range: the round-off of the interlock's forces was taken for a lack of balance."""
    forces = []
    for poisson in (0.495, 0.4999):
        law = hyperelastic_law(0.34, poisson)
        press = Press(shell_model(shell_geometry(130, 8), law, "draft", True, interlock=100.0), Indenter(20.0), 0.0)
        state = press.advance(press.start(), Target(depth_mm=0.5))
        assert state.certificate.substeps == 1 and state.certificate.wrench_gap < 1e-6
        forces.append(state.normal_n)
    assert forces[1] == pytest.approx(forces[0], rel=0.01)


def test_a_set_says_its_interlock_and_takes_none_that_cannot_be():
    request = DataRequest(1, render="off", density="draft", azimuths=1, interlock=FACTOR)
    assert shell_of(request)[0]._shell.interlock == FACTOR and request.record()["interlock"] == FACTOR
    for factor in (0.9, 101.0, float("nan")):
        with pytest.raises(ParameterError, match=r"interlock=.* outside 1\.\.100: how many times as stiff"):
            replace(request, interlock=factor)
    with pytest.raises(ParameterError, match="level 4: its library was fitted to plain silicone"):
        Simulator(shell_geometry(130, 8), silicone().neo_hooke(), level=4, interlock=FACTOR)
