"""The wheel works outside the repository: its data files come along, and commands run from an empty folder."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from fab.cache import library_versions

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("cad", "endcap", "fab", "sensing")
BUILD = "from setuptools import build_meta; import sys; print(build_meta.build_wheel(sys.argv[1]))"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with what the wheel holds, built from a copy of the sources so that the checkout stays clean."""
    source, wheels, site = (tmp_path_factory.mktemp(name) for name in ("source", "wheels", "site"))
    for package in PACKAGES:
        shutil.copytree(ROOT / package, source / package, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source / name)
    subprocess.run(
        [sys.executable, "-c", BUILD, str(wheels)], cwd=source, check=True, capture_output=True, text=True, timeout=120
    )
    (wheel,) = wheels.glob("endcap_toolkit-*.whl")
    zipfile.ZipFile(wheel).extractall(site)
    return site


def run(installed: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """A command with the wheel's modules and this environment's libraries, in a folder."""
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    return subprocess.run(
        [sys.executable, *words], cwd=folder, env=environment, capture_output=True, text=True, timeout=120
    )


def test_every_file_that_the_packages_read_is_in_the_wheel(installed):
    def files(root: Path) -> set[str]:
        found = (path for package in PACKAGES for path in (root / package).rglob("*") if path.is_file())
        return {path.relative_to(root).as_posix() for path in found if path.suffix not in (".pyc", ".nbi", ".nbc")}

    assert files(ROOT) - files(installed) == set()


def test_the_console_script_is_declared(installed):
    (entry,) = installed.glob("*.dist-info/entry_points.txt")
    assert "endcap = endcap.command:program" in entry.read_text()


def test_the_modules_are_those_of_the_wheel_and_their_data_is_read(installed, tmp_path):
    code = (
        "import cad, fab, sensing, endcap.command\n"
        "from cad.bought import bought_table\n"
        "from cad.led_ring.parts import led_part\n"
        "from cad.materials import silicones\n"
        "from cad.params import EndcapParams\n"
        "from cad.typed_folder import EXPORTS\n"
        "from sensing.wrench.model import load_wrench_model\n"
        "assert bought_table() and led_part('led') and silicones()\n"
        "load_wrench_model(EndcapParams(130, 8))\n"
        "print(cad.__file__, EXPORTS, sep='\\n')\n"
    )
    result = run(installed, tmp_path, "-c", code)
    assert result.returncode == 0, result.stderr
    place, exports = result.stdout.splitlines()
    assert Path(place).is_relative_to(installed)
    assert exports == "exports"
    assert list(tmp_path.iterdir()) == []


def test_the_key_of_the_cache_names_the_libraries_of_the_checkout(installed, tmp_path):
    code = (
        "import json\n"
        "from fab.cache import Cache, library_versions\n"
        "assert len(Cache().key('molds', {'diameter_mm': 130})) == 64\n"
        "print(json.dumps(library_versions()))\n"
    )
    result = run(installed, tmp_path, "-c", code)
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout) == library_versions(ROOT)


@pytest.mark.long
def test_commands_run_from_an_empty_folder(installed, tmp_path):
    result = run(installed, tmp_path, "-m", "endcap", "--help")
    assert result.returncode == 0 and "endcap COMMAND" in result.stdout, result.stderr
    refused = run(installed, tmp_path, "-m", "endcap", "molds", "20", "8")
    assert refused.returncode == 2 and "D=20 outside" in refused.stderr
    picture = run(installed, tmp_path, "-m", "endcap", "render", "--out", "frame.jpg", "--level", "draft")
    assert picture.returncode == 0, picture.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["frame.jpg"]
