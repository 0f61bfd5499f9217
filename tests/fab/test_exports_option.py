"""``exports=`` as people type it: a home folder that no shell put there, names and links that none can have."""

from __future__ import annotations

import argparse
from importlib import import_module
from pathlib import Path

import pytest

from cad.errors import ParameterError
from cad.typed_folder import EXPORTS, typed_folder
from endcap.whole import parsed
from fab.command import exports_words
from sensing import study
from sensing.simulator.dataset import cli

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


def test_a_name_that_the_kernel_would_write_elsewhere_is_refused(tmp_path, monkeypatch):
    assert typed_folder(str(tmp_path / "M\u00e4rz")) == tmp_path / "M\u00e4rz"
    with pytest.raises(ParameterError, match=r"no UTF-8 where names are utf-8.* with exports=DIR"):
        typed_folder(str(tmp_path / "M\udce4rz"))  # as Python reads a name of an older system's, in Latin-1
    monkeypatch.setattr("os.fsencode", lambda path: str(path).encode("latin-1"))  # a terminal in Latin-1
    with pytest.raises(ParameterError, match="LC_ALL"):
        typed_folder(str(tmp_path / "M\u00e4rz"))


def test_commands_name_the_same_folder_wherever_they_are_typed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert exports_words(Path("my files")) == f" exports='{tmp_path.resolve() / 'my files'}'"
    assert exports_words(Path(EXPORTS)) == "" == exports_words(parsed([]).exports)  # that of molds, of endcap whole


def test_a_study_and_data_go_to_the_folder_of_the_molds_wherever_they_are_typed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exports, written = parsed([]).exports.resolve(), []

    def note(request, folder, *_):
        written.append(folder)
        raise ParameterError("enough")

    monkeypatch.setattr(cli, "write_dataset", note)
    parser = argparse.ArgumentParser()
    cli.add_options(parser)
    for words in [], ["--silicone", "Dragon Skin 30", "--diameter", "107"]:  # a set of another silicone is another set
        with pytest.raises(ParameterError, match="enough"):
            cli.run(parser.parse_args(words))
    assert written == [exports / "data_D130_T8_static_0", exports / "data_D107_T8_Dragon-Skin-30_static_0"]
    assert Path(study.OPTIONS["exports"]).resolve() == exports
