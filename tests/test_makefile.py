"""The command line of make: every word is read or refused in one line, and reaches the program as it was typed."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from cad.design_arguments import design_of
from cad.lens import RELEASED_MODULE
from cad.params import EndcapParams
from cad.pattern import parse_rings
from fab.build_sheet.commands import train_command
from sensing import study, train

ROOT = Path(__file__).resolve().parents[1]
# Answers what is asked before; "-m venv" leaves a python and ends, as without ensurepip.
HALF = """#!/bin/sh
[ "$1" = -m ] || exit 0
mkdir -p "$3/bin"
touch "$3/bin/python"
echo "ensurepip is not available" >&2
exit 1
"""
pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")


def make(*words: str, folder: Path = ROOT) -> subprocess.CompletedProcess[str]:
    """Run make; inside of another make its variables would come along."""
    env = {k: v for k, v in os.environ.items() if not k.startswith(("MAKE", "MFLAGS"))}
    return subprocess.run(["make", *words], cwd=folder, env=env, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["molds", "150", "10"], "150 10: not a target"),
        (["molds", "D=150", "fast"], "fast: not a target"),
        (
            ["data", "d=150"],
            "d: not a variable of `make data`, which takes PYTHON VENV N D T dots dot_mm material WORKERS OPTIONS",
        ),
        (["check", "X=1"], "X: not a variable of `make check`"),
        (["data", "D=150"], "D without T"),
        (["data", "T=9"], "T without D"),
        (["clean", "SURE=yes"], "SURE: not a variable of `make clean`"),
    ],
)
def test_what_make_would_ignore_is_refused_in_one_line_before_anything_runs(words, expected):
    done = make("-n", *words)
    assert done.returncode == 2 and done.stdout == ""
    assert len(done.stderr.splitlines()) == 1 and expected in done.stderr


@pytest.mark.parametrize("words", [["PYTHON=", "clean"], ["clean"]])
def test_an_empty_python_is_none_and_the_usual_one_is_taken(words, monkeypatch):
    monkeypatch.setenv("PYTHON", "")
    line = make("-n", *words).stdout.splitlines()[0]
    assert line.endswith(" -m fab.clean") and Path(line.split()[0]).name.startswith("python3")
    assert make("-n", "PYTHON=/opt/own/python", "clean").stdout.startswith("/opt/own/python -m fab.clean")


@pytest.fixture
def workshop(tmp_path: Path) -> Path:
    """The Makefile with an environment whose python only prints its words and make's variables, one a line."""
    shutil.copy(ROOT / "Makefile", tmp_path)
    for name in ("pyproject.toml", "lock.txt"):
        shutil.copy(ROOT / name, tmp_path)
    (tmp_path / "scripts").mkdir()
    (tmp_path / "scripts" / "prove_kernel.py").write_text("")
    bin_folder = tmp_path / ".venv" / "bin"
    bin_folder.mkdir(parents=True)
    (bin_folder / "python").write_text('#!/bin/sh\nprintf "%s\\n" "$@" "$MAKEFLAGS"\n')
    (bin_folder / "python").chmod(0o755)
    for stamp in ("fab.stamp", "all.stamp"):
        (tmp_path / ".venv" / stamp).write_text("")
    return tmp_path


def test_no_shell_reads_the_values(workshop):
    done = make("molds", "D=130;touch stray", "T=$$(touch stray)", "material=`touch stray`", folder=workshop)
    assert done.returncode == 0 and not (workshop / "stray").exists()
    assert done.stdout.splitlines()[:3] == ["-m", "fab.molds", "--make-variables"]
    assert r"D=130;touch\ stray" in done.stdout


def test_targets_run_in_the_order_in_which_they_are_typed_also_under_j(workshop):
    """A build sheet reads what the molds wrote."""
    python = workshop / ".venv" / "bin" / "python"
    python.write_text('#!/bin/sh\necho "begin $2"\nsleep 0.3\necho "end $2"\n')
    done = make("-j4", "molds", "sheet", "D=142", "T=7.5", folder=workshop)
    assert done.stdout.split("\n")[:4] == [
        "begin fab.molds",
        "end fab.molds",
        "begin fab.build_sheet",
        "end fab.build_sheet",
    ]


@pytest.mark.parametrize("target", ["molds", "slice", "sheet", "endcap"])
def test_the_printer_is_taken_by_every_target_that_prints(workshop, target):
    (workshop / "scripts" / "slicer.sh").write_text("")
    done = make(target, "D=142", "T=7.5", "printer=a1_mini", folder=workshop)
    assert done.returncode == 0 and "printer=a1_mini" in done.stdout, done.stderr


def test_a_value_with_a_quote_cannot_leave_its_word(workshop):
    done = make("data", "D=1'; touch stray; '", "T=8", folder=workshop)
    assert done.returncode == 0 and not (workshop / "stray").exists()
    assert "1'; touch stray; '" in done.stdout.splitlines()


def test_clean_removes_only_an_environment_that_make_has_set_up(workshop):
    (workshop / "fab").mkdir()
    (workshop / "fab" / "clean.py").write_text("")
    other = workshop / "other"
    other.mkdir()
    (other / "pyvenv.cfg").write_text("somebody's")
    assert make("clean", "VENV=other", folder=workshop).returncode == 0
    assert (other / "pyvenv.cfg").exists() and (workshop / ".venv").exists()
    assert make("clean", folder=workshop).returncode == 0
    assert not (workshop / ".venv").exists()


def test_the_test_data_of_each_design_have_a_folder_of_their_own(workshop):
    """``$dots_$dot_mm`` is the variable ``dots_`` to a shell, which is empty."""
    words = make("evaluate", "D=187.3", "T=12.6", "dots=1-5-11", "dot_mm=6.3", "material=Ecoflex", folder=workshop)
    assert words.stdout.splitlines().count("exports/wrench_test_D187.3_T12.6_1-5-11_6.3_Ecoflex") == 2


@pytest.mark.parametrize("module", ["ELP-USBFHD01M-L170", "Own 160° lens"])
def test_weights_and_test_data_of_another_camera_module_are_its_own(workshop, module, monkeypatch):
    """The weights of the module that ran first stayed, and the test data of a second one were refused for ever."""
    monkeypatch.setenv("ENDCAP_CAMERA", module)
    trained = make("train", folder=workshop).stdout.splitlines()
    assert trained[trained.index("sensing.train") + 1 :][:3] == ["--design", "130", "8"]
    tested = make("evaluate", folder=workshop).stdout.splitlines()
    assert tested.count(f"exports/wrench_test_D130_T8_{module}") == 2 and "--weights" not in tested
    sized = make("evaluate", "D=142", "T=7.5", folder=workshop).stdout.splitlines()
    assert sized.count(f"exports/wrench_test_D142_T7.5_{module}") == 2


@pytest.mark.parametrize("module", [None, "", RELEASED_MODULE])
def test_weights_of_the_released_camera_module_are_a_simulation_of_ones_own(workshop, module, monkeypatch):
    monkeypatch.delenv("ENDCAP_CAMERA", raising=False)
    if module is not None:
        monkeypatch.setenv("ENDCAP_CAMERA", module)
    tested = make("evaluate", folder=workshop).stdout.splitlines()
    assert "exports/wrench_test" in tested and "exports/wrench_train/small.safetensors" in tested


def test_the_training_command_of_the_build_sheet_reaches_the_program_as_that_design(workshop):
    params = EndcapParams(142.0, 7.5, parse_rings("1-6-10-12-16-18-20"), 3.5, 0.12)
    done = make(*shlex.split(train_command(params, "Dragon Skin 30"))[1:], folder=workshop)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    options = train._parser().parse_args(lines[lines.index("sensing.train") + 1 : lines.index("Dragon Skin 30") + 1])
    options.diameter, options.wall = options.design
    assert design_of(options) == EndcapParams(142.0, 7.5, params.dot_rings, 3.5)
    assert options.silicone == "Dragon Skin 30"


def test_every_option_of_the_study_reaches_it(workshop):
    values = {**study.OPTIONS, "D": "187.3", "T": "9"}
    words = [f"{name}={value}" for name, value in values.items() if value]
    done = make("study", *words, folder=workshop)
    assert done.returncode == 0, done.stderr
    assert set(words) <= set(done.stdout.splitlines())


def test_a_half_made_environment_does_not_stay(workshop):
    shutil.rmtree(workshop / ".venv")
    shutil.copytree(ROOT / "scripts", workshop / "scripts", dirs_exist_ok=True)
    python = workshop / "python"
    python.write_text(HALF)
    python.chmod(0o755)
    for _ in range(2):  # the second run must not take the first one's remains for an environment
        done = make(f"PYTHON={python}", "setup", folder=workshop)
        assert done.returncode == 2 and "ensurepip is not available" in done.stderr
        assert not (workshop / ".venv" / "bin" / "python").exists()
