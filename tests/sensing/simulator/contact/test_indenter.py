"""What no indenter can be is refused, with a message that fits the number."""

import pytest

from cad.errors import ParameterError
from sensing.simulator.contact.indenter import Indenter


@pytest.mark.parametrize(
    ("tilt_deg", "words"),
    [
        (120.0, "tilt_deg=120 outside 0..100: beyond it the body meets the base first"),
        (-5.0, "tilt_deg=-5 outside 0..100: turn the azimuth instead of a negative tilt"),
        (float("nan"), "tilt_deg=nan outside 0..100: give a number"),
    ],
)
def test_a_tilt_outside_its_range_is_refused_for_the_side_that_it_is_on(tilt_deg: float, words: str) -> None:
    with pytest.raises(ParameterError) as refused:
        Indenter(tilt_deg)
    assert str(refused.value) == words and refused.value.name == "tilt_deg"


@pytest.mark.parametrize("kind", ["plane", "edge", "rough"])
@pytest.mark.parametrize("axis_deg", [float("nan"), float("inf")])
def test_an_axis_that_is_no_angle_is_refused(kind: str, axis_deg: float) -> None:
    with pytest.raises(ParameterError, match=rf"^axis_deg={axis_deg:g} is no angle: give its degrees") as refused:
        Indenter(kind=kind, axis_deg=axis_deg)
    assert refused.value.name == "axis_deg" and refused.value.value is axis_deg
