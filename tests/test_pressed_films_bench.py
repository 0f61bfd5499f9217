"""Films that benches keep: one is shown again only of the recipe, path and simulator that it was made of."""

from dataclasses import replace
from pathlib import Path

import pytest

from bench import pressed_films
from bench.pressed_films import Recipe, pressed_film
from sensing.simulator.dataset.cluster import Origin
from sensing.simulator.press.press import Target


def test_a_film_of_another_recipe_or_path_is_made_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = []

    def make(folder: Path, *what: object) -> None:
        made.append(what)
        folder.mkdir()
        (folder / "frame_00000.jpg").write_bytes(b"a picture")
        (folder / "truth.csv").write_text(f"time_s,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm\n0,0,0,{len(made)},0,0,0\n")

    monkeypatch.setattr(pressed_films, "_make", make)
    recipe, path = Recipe(tilt_deg=10.0), [None, Target(normal_n=5.0)]
    shown = [
        pressed_film(tmp_path / "film", *what).wrench[0, 2]
        for what in ((recipe, path), (replace(recipe, friction=0.3), path), (recipe, path[:1]), (recipe, list(path)))
    ]
    assert shown == [1, 2, 3, 1]
    another = Origin("another simulator", "")
    monkeypatch.setattr(Origin, "here", staticmethod(lambda: another))
    assert pressed_film(tmp_path / "film", recipe, path).wrench[0, 2] == 4, "a film of an older simulator was shown"
