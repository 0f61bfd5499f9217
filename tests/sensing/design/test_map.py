"""The map of all designs: every silicone's own limits, the front, the inverse question, and its files."""

from dataclasses import replace

import pytest

from cad.errors import ParameterError
from cad.materials import silicone
from cad.params import EndcapParams
from sensing import study as command
from sensing.design.page import map_page
from sensing.design.pressed import Study
from sensing.design.region import Place, choose, grid, pareto, place_of, survey

RELEASED = Study(EndcapParams(130, 8))
OTHER_CAMERA = "ELP-USBFHD01M-L170"


def test_a_silicone_that_tears_early_is_limited_by_its_strain_on_the_map_too(monkeypatch):
    """The map scaled the safe load of the default silicone, which its strain does not limit."""

    def row(name):
        return replace(silicone(name), elongation_percent=10.0) if name == "Ecoflex 00-30" else silicone(name)

    monkeypatch.setattr("sensing.design.pressed.silicone", row)
    place = next(place for place in survey([(130, 8)]) if place.silicone == "Ecoflex 00-30")
    assert (place.safe_n, place.limit) == Study(EndcapParams(130, 8), "Ecoflex 00-30").safe
    assert place.limit.startswith("strain at")


def test_the_page_of_the_map_has_the_prices_that_it_counts(monkeypatch):
    """It said 40 dollars a kilogram of every silicone."""
    monkeypatch.setattr("sensing.design.page.map_panels", lambda *_: "")
    assert "silicones at 44 to 80 dollars a kg" in map_page([], [], "")


def test_the_front_holds_what_nothing_beats():
    def place(range_n: float, bound_n: float, mass_g: float) -> Place:
        return Place(130, 8, "Smooth-Sil 950", range_n, range_n, "", 1.0, bound_n, mass_g, 1.0, 0.1)

    places = [place(10, 0.1, 100), place(10, 0.1, 90), place(20, 0.1, 200), place(10, 0.04, 300)]
    assert pareto(places).tolist() == [False, True, True, True]


def test_the_question_is_answered_by_designs_that_do_it_or_refused_with_the_nearest():
    places = [place_of(Study(EndcapParams(d, t))) for d, t in ((130, 8), (150, 12), (200, 18), (180, 16))]
    choices = choose(places, 60.0, 0.8)
    assert 1 <= len(choices) <= 3 and len({choice.place for choice in choices}) == len(choices)
    assert all(choice.place.safe_n >= 60 and choice.place.error_n <= 0.8 for choice in choices)
    assert choices[0].place.mass_g == min(p.mass_g for p in places if p.safe_n >= 60 and p.error_n <= 0.8)
    for load, error, words in (
        (1e6, 1.0, "no design bears it; the most is"),
        (60.0, 1e-4, "the least is"),
        (-1, 1, "more than 0"),
    ):
        with pytest.raises(ParameterError, match=words):
            choose(places, load, error)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["load=100000", "error=0.01"], "load=100000 N: no design bears it; the most is"),
        (["load=60", "error=0.0001"], "error=0.0001 N at load=60 N: no design is expected to do so well"),
        (["load=0", "error=1"], "load=0: give newtons, more than 0"),
    ],
)
def test_a_question_without_an_answer_is_refused_before_the_map(words, said, monkeypatch, tmp_path, capsys):
    """Five minutes of map came first."""
    monkeypatch.setattr("sensing.design.region.survey", lambda *_: pytest.fail("the map was computed"))
    assert command.main([*words, f"exports={tmp_path}"]) == 2
    found = capsys.readouterr().err
    assert said in found and found.count("\n") == 1


def test_a_map_that_cannot_be_written_is_refused_before_it_is_computed(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr("sensing.design.region.survey", lambda *_: pytest.fail("the map was computed"))
    (tmp_path / "file").touch()
    (tmp_path / "study" / "map.html").mkdir(parents=True)
    for exports, said in ((tmp_path / "file", "that can be made"), (tmp_path, "map.html: Is a directory")):
        assert command.main([f"exports={exports}"]) == 2
        found = capsys.readouterr().err
        assert said in found and found.count("\n") == 1


def test_the_maps_of_two_cameras_do_not_replace_one_another_and_name_theirs(monkeypatch, tmp_path):
    """The second map lay in the place of the first, and neither said whose bounds it had."""
    monkeypatch.setattr("sensing.design.region.survey", lambda *_: [place_of(RELEASED)])
    monkeypatch.setattr("sensing.design.page.map_panels", lambda *_: "")
    assert command.main([f"exports={tmp_path}"]) == 0
    first = (tmp_path / "study" / "map.html").read_bytes()
    monkeypatch.setenv("ENDCAP_CAMERA", OTHER_CAMERA)
    assert command.main([f"exports={tmp_path}"]) == 0
    assert (tmp_path / "study" / "map.html").read_bytes() == first and b"module ELP-USBFHD01M-L180" in first
    assert f"module {OTHER_CAMERA}" in (tmp_path / f"study_{OTHER_CAMERA}" / "map.html").read_text()


def test_the_grid_lies_inside_the_region_and_reaches_its_ends():
    designs = grid(6, 4)
    assert all(EndcapParams(*design) for design in designs)
    assert min(d for d, _ in designs) < 99.5 and (250.0, 25.0) in designs and (250.0, 6.5) in designs
