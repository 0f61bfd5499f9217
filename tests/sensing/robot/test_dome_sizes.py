"""Domes of another size or silicone than D=130 T=8, beside the pressed shell's stiffness, and in the estimate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from standing_robot import standing_samples

from cad.params import EndcapParams
from sensing.robot.contact import contact_of
from sensing.robot.dome import dome_centre
from sensing.robot.layout import layout_of
from sensing.robot.settings import DEFAULTS
from sensing.robot.state import empty_state
from sensing.simulator.robot_model.pressed import pressed_states
from sensing.simulator.solid.geometry import shell_geometry
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import FootSample

ROBOT = load_robot()


def pressed_n_mm(diameter_mm: float, wall_mm: float) -> float:
    """Force over depth of a shell pressed on its tip by 5 mm, N/mm."""
    states = pressed_states(shell_geometry(diameter_mm, wall_mm), 0.68)
    used = states.where(states.is_pressed_only & (states.tilt_deg == 0))
    order = np.argsort(used.depth_mm)
    return abs(float(np.interp(5.0, used.depth_mm[order], used.force_n[order, 0]))) / 5.0


def of_size(diameter_mm: float, wall_mm: float, **stated):
    """The robot with endcaps of a size."""
    return replace(
        ROBOT,
        endcaps=tuple(replace(e, diameter_mm=diameter_mm, wall_mm=wall_mm, **stated) for e in ROBOT.endcaps),
    )


@pytest.mark.parametrize(("diameter_mm", "wall_mm"), [(100, 7), (130, 6.5), (180, 7), (180, 16), (213, 11.5)])
def test_a_dome_yields_by_its_size_as_the_pressed_shell_does(diameter_mm, wall_mm):
    EndcapParams(diameter_mm, wall_mm)  # one that can be made
    yields = layout_of(of_size(diameter_mm, wall_mm)).compliance_m_n(0, DEFAULTS) / DEFAULTS.compliance_m_n
    assert yields == pytest.approx(pressed_n_mm(130, 8) / pressed_n_mm(diameter_mm, wall_mm), rel=0.2)


def test_the_dome_that_the_settings_describe_is_that_of_the_released_size_to_the_bit():
    layout = layout_of(ROBOT)
    assert all(layout.compliance_m_n(k, DEFAULTS) == DEFAULTS.compliance_m_n for k in range(layout.endcaps))


def test_a_dome_that_the_description_states_stands_before_size_and_settings():
    robot = of_size(180, 16, compliance_m_n=4e-4, yield_delay_s=3e-4)
    layout, other = layout_of(robot), replace(DEFAULTS, compliance_m_n=1e-3, yield_delay_s=0.05)
    assert layout.compliance_m_n(2, other) == 4e-4 and layout.yield_delay_s(2, other) == 3e-4
    sample = next(s for s in standing_samples(robot, 0.1)[1] if isinstance(s, FootSample) and s.touching)
    state, contact = empty_state(layout, 0.0), contact_of(sample, 0, layout, other)
    state.velocity[0] = [0.0, 0.0, 1.0]
    centre = dome_centre(state, 0, contact, layout, other)
    expected = layout.endcap_lever[0] + 4e-4 * contact.force_n + 3e-4 * state.normal[0]
    np.testing.assert_allclose(centre.lever_m, expected, atol=1e-12)
