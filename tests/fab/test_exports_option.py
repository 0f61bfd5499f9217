"""``exports=`` as people type it: a home folder that no shell put there, names and links that no folder can have."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest

from cad.errors import ParameterError
from cad.typed_folder import typed_folder
from endcap.whole import parsed

COMMANDS = [
    "fab.molds", "fab.slice.__main__", "fab.build_sheet.__main__", "fab.led_ring.__main__", "fab.coupons.__main__",
    "fab.design_page.__main__", "endcap.robot_model.__main__", "endcap.whole", "sensing.study",
]  # fmt: skip


@pytest.mark.parametrize("module", COMMANDS)
@pytest.mark.parametrize("name", ["loop", "x" * 300])
def test_a_place_that_cannot_be_is_one_line_in_every_command(module, name, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("fab.slice.run.find_slicer", lambda: "none")
    (tmp_path / "loop").symlink_to("loop")
    assert import_module(module).main([f"exports={tmp_path / name}"]) == 2
    out, err = capsys.readouterr()
    assert out == "" and len(err.splitlines()) == 1 and "exports=" in err and "with exports=DIR" in err


def test_a_tilde_is_the_home_folder_not_a_folder_of_that_name(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert typed_folder("~/endcaps") == tmp_path / "endcaps"
    assert parsed(["exports=~/endcaps"]).exports == tmp_path / "endcaps"
    assert typed_folder("a~b") == Path("a~b")
    with pytest.raises(ParameterError, match="no such user"):
        typed_folder("~nobody-of-this-name/x")
