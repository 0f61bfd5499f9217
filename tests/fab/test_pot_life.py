"""Time to cast: what is said before anything is printed, and what the sheet refuses."""

from __future__ import annotations

import subprocess
import sys
from types import SimpleNamespace

import pytest

from cad.errors import ParameterError
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab import molds
from fab.design_page.answer import answer
from fab.pot_life import require_pot_life, short_pot_life_words
from fab.recipe import closed_cast_mm3, overflow_of, recipe

QUICK = "Dragon Skin 10 Medium"


def test_the_words_give_the_minutes_and_silicones_that_have_time():
    layout = MoldLayout(EndcapParams(250.0, 25.0), silicone=QUICK)
    words = short_pot_life_words(layout) or ""
    assert "3.2 l take 24 min to mix, pour and close, and the pot life is 20" in words
    named = words.split("take ")[-1].split(", a thinner wall")[0].split(", ")
    assert named and QUICK not in named and "Ecoflex 00-30" not in named  # that one creeps through joints of 0.15
    for name in named:
        assert short_pot_life_words(MoldLayout(EndcapParams(250.0, 25.0), silicone=name)) is None
    assert short_pot_life_words(MoldLayout(EndcapParams(180.0, 10.0), silicone=QUICK)) is None


def test_the_sheet_refuses_by_the_recipe_of_the_mesh():
    layout = MoldLayout(EndcapParams(250.0, 25.0), silicone=QUICK)
    with pytest.raises(ParameterError, match="pot life is 20: take Smooth-Sil 950"):
        require_pot_life(layout, closed_cast_mm3(layout.params))
    require_pot_life(layout, 1e6)
    mix = recipe(2.3e6, overflow_of(layout), QUICK)  # the sheet's own clock
    with pytest.raises(ParameterError, match=f"take {mix.timeline[-1].end_min:g} min"):
        require_pot_life(layout, mix.cast_volume_mm3)


def test_nothing_of_it_loads_the_cad_kernel(tmp_path):
    """An unchanged design comes out of the cache in a second: the kernel alone takes four."""
    made = "from types import SimpleNamespace as N; molds.export = lambda *_: N(folder='', summary='', seconds=0.0)"
    asked = f"molds.main(['D=250', 'T=25', 'material={QUICK}', 'dots=1-3-4', 'exports={tmp_path}'])"
    check = "import sys; assert not {'build123d', 'OCP'} & set(sys.modules), 'loaded'"
    run = subprocess.run(
        [sys.executable, "-c", f"from fab import molds; {made}; assert {asked} == 0; {check}"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert "the pot life is 20" in run.stderr


def test_molds_and_the_page_say_it_at_the_start(monkeypatch, capsys, tmp_path):
    made = SimpleNamespace(folder=tmp_path, summary="made", seconds=0.0)
    monkeypatch.setattr(molds, "export", lambda *_: made)
    size = ["D=250", "T=25", f"exports={tmp_path}"]
    assert molds.main([*size, f"material={QUICK}"]) == 0
    assert capsys.readouterr().err.startswith(f"make molds: material='{QUICK}': 3.2 l take 24 min")
    assert molds.main(size) == 0 and capsys.readouterr().err == ""
    knobs = {"D": "250", "T": "25", "joint_clearance": "0.15"}
    assert "the pot life is 20" in dict(answer({**knobs, "material": QUICK})["facts"])["no time to cast"]
    assert "no time to cast" not in dict(answer(knobs)["facts"])
