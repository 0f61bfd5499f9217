"""Commands to be pasted name the Python that runs, by the shortest name under which the shell finds it."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from cad.lens import VARIABLE
from cad.params import EndcapParams
from sensing.calibration.command_for import calibrate_command
from sensing.interpreter import typed_command, typed_python
from sensing.live.core.endcaps_file import live_command
from sensing.wrench.weight_files import command_for


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A folder with a virtual environment whose Python runs, and with another Python on PATH."""
    for folder in (tmp_path / ".venv" / "bin", tmp_path / "other"):
        folder.mkdir(parents=True)
        (folder / "python").write_text(folder.name)
        (folder / "python").chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(tmp_path / ".venv" / "bin" / "python"))
    monkeypatch.setenv("PATH", str(tmp_path / "other"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_in_a_checkout_it_is_the_path_from_here(checkout):
    assert typed_python() == ".venv/bin/python"


def test_elsewhere_it_is_the_whole_path(checkout, monkeypatch):
    monkeypatch.chdir(checkout / "other")
    assert typed_python() == str(checkout / ".venv" / "bin" / "python")


def test_where_the_environment_is_active_it_is_python(checkout, monkeypatch):
    monkeypatch.setenv("PATH", os.pathsep.join((str(checkout / ".venv" / "bin"), str(checkout / "other"))))
    assert typed_python() == "python"


def test_a_python_beside_the_running_one_may_be_another(checkout, monkeypatch):
    (checkout / ".venv" / "bin" / "python3.11").write_text("runs")
    monkeypatch.setattr(sys, "executable", str(checkout / ".venv" / "bin" / "python3.11"))
    monkeypatch.setenv("PATH", str(checkout / ".venv" / "bin"))
    assert typed_python() == ".venv/bin/python3.11"


def test_all_commands_to_be_pasted_name_it(checkout):
    design = EndcapParams(142, 7.5)
    assert command_for(design) == ".venv/bin/python -m sensing.train --design 142 7.5"
    assert calibrate_command(design, "a.json").startswith(".venv/bin/python -m sensing.calibrate ")
    assert live_command(Path("endcaps.toml")) == ".venv/bin/python -m sensing.live --config endcaps.toml"


def test_another_camera_module_is_named_before_it(checkout, monkeypatch):
    monkeypatch.setenv(VARIABLE, "ELP-USBFHD01M-L170")
    assert typed_command("sensing.live", "--silicone", "Dragon Skin 30") == (
        f"{VARIABLE}=ELP-USBFHD01M-L170 .venv/bin/python -m sensing.live --silicone 'Dragon Skin 30'"
    )
    assert command_for(EndcapParams(142, 7.5)).startswith(f"{VARIABLE}=ELP-USBFHD01M-L170 .venv/bin/python -m ")
