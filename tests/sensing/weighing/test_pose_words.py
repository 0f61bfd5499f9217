"""Weights and poses as people type them: what they mean, and what is refused."""

import pytest

from cad.errors import ParameterError
from sensing.weighing.session import Terms
from sensing.weighing.words import GRAVITY_M_S2, PoseRequest, parse_pose, parse_weight_g


@pytest.mark.parametrize(
    ("text", "grams"),
    [("500", 500), ("0.5 kg", 500), ("0,5kg", 500), (" 5 N ", 509.858), ("1.1 lb", 498.952), ("2 lbf", 907.185)],
)
def test_weights_as_people_type_them(text, grams):
    assert parse_weight_g(text) == pytest.approx(grams, abs=1e-3)


@pytest.mark.parametrize(("text", "force_n"), [("5 N", 5.0), ("2 lbf", 8.896443)])
def test_a_force_is_what_presses_whatever_gravity_is(text, force_n):
    for gravity_m_s2 in (9.76, GRAVITY_M_S2, 9.84):
        for request in (Terms(0, 0, 0, gravity_m_s2).request(text), parse_pose(f"grams={text}", gravity_m_s2)):
            assert request.load_n(gravity_m_s2) == pytest.approx([0.0, 0.0, -force_n], abs=1e-6)
    assert Terms(0, 0, 0, 9.76).request("500").load_n(9.76)[2] == pytest.approx(-4.88)  # a mass is heavier elsewhere


@pytest.mark.parametrize("text", ["", "heavy", "1e3", "5 stone", "--5", "1.2.3", "nan"])
def test_what_is_no_weight_is_refused(text):
    with pytest.raises(ParameterError, match=r"no weight|no unit"):
        parse_weight_g(text)


def test_a_pose_in_words():
    found = parse_pose("tilt=20,grams=0.6 kg,azimuth=-90,sd=3,source=films/a,b.mcap")
    assert found == PoseRequest(600.0, 20.0, -90.0, 3.0, "films/a,b.mcap")


def test_what_a_pose_leaves_out_is_as_the_options_say():
    """--tilt and --scale-sd had no effect on poses from files."""
    found = parse_pose("grams=500,azimuth=30,source=a", tilt_deg=20.0, azimuth_deg=-90.0, sd_g=8.0)
    assert found == PoseRequest(500.0, 20.0, 30.0, 8.0, "a")
    assert parse_pose("grams=500,tilt=0,sd=0", tilt_deg=20.0, sd_g=8.0) == PoseRequest(500.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("tilt=0", "grams"), ("grams=500,grams=600", "grams=600"), ("grams=500,colour=red", "colour"),
        ("grams=500,tilt=steep", "tilt='steep'"), ("grams=0.5", "was it 0.5 kg or 0.5 lb"),
        ("grams=9 kg", "outside 20..6000"),
        ("grams=500,tilt=80", "outside 0..60"), ("grams=500,source=", "source"),
    ],
)  # fmt: skip
def test_a_pose_that_is_none_is_refused(text, said):
    with pytest.raises(ParameterError, match=said):
        parse_pose(text)


def test_a_weight_is_as_sure_as_a_kitchen_scale_unless_its_own_is_given():
    """2 g and half a percent, independent: at 400 g as much each."""
    assert PoseRequest(400.0).load_sd_n() == pytest.approx(8**0.5 / 1000 * GRAVITY_M_S2)
    assert PoseRequest(400.0, sd_g=0.5).load_sd_n(9.8) == pytest.approx(0.0049)
