"""Dots in the picture: fab's own count against the camera model of the sensing side, which it must not import."""

from __future__ import annotations

import random
from types import SimpleNamespace

import pytest

from bench.sizes import option_sizes
from cad.lens import VARIABLE, camera_modules
from cad.params import EndcapParams
from fab import molds
from fab.camera_view import FEWEST, few_dots_words, seen_dots
from fab.design_page.answer import answer
from sensing.calibration.dots import FEWEST_TO_FIT, pattern_points
from sensing.camera.nominal import nominal_mount

FEW = EndcapParams(99.46, 9.94, dot_rings=(1, 3, 4))


@pytest.mark.parametrize("module", sorted(camera_modules()))
def test_the_count_is_that_of_the_camera_that_calibration_starts_from(module, monkeypatch):
    monkeypatch.setenv(VARIABLE, module)
    seed = random.Random(f"seen {module}").randrange(2**32)
    for size in option_sizes(seed, 30):
        params = EndcapParams(size.diameter_mm, size.wall_mm, dot_rings=size.dot_rings, dot_mm=size.dot_mm)
        assert seen_dots(params) == nominal_mount(params).sees(pattern_points(params)[0]).sum(), size.key


def test_a_design_whose_camera_cannot_be_calibrated_is_named():
    assert FEWEST == FEWEST_TO_FIT
    assert seen_dots(FEW) == 4 and "dots=1-3-4: the picture shows 4 dots" in (few_dots_words(FEW) or "")
    assert few_dots_words(EndcapParams(130.0, 8.0)) is None


def test_molds_warns_before_it_makes_such_a_design_and_the_page_says_so(monkeypatch, capsys, tmp_path):
    made = SimpleNamespace(folder=tmp_path, summary="made", seconds=0.0)
    monkeypatch.setattr(molds, "export", lambda *_: made)
    size = ["D=99.46", "T=9.94", f"exports={tmp_path}"]
    assert molds.main([*size, "dots=1-3-4"]) == 0
    assert "make molds: dots=1-3-4: the picture shows 4 dots" in capsys.readouterr().err
    assert molds.main(size) == 0 and capsys.readouterr().err == ""
    few = answer({"D": "99.46", "T": "9.94", "joint_clearance": "0.15", "dots": "1-3-4"})
    assert "shows 4 of them: too few" in dict(few["facts"])["dots"]
