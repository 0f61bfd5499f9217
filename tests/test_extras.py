"""Extras: each library comes from one, each command's imports are in its own, and a missing one is one line."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tempfile
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from cad import extras, threads

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
OURS = ("cad", "fab", "sensing")
COMMANDS = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__main__")
    for package in OURS
    for path in (ROOT / package).rglob("*.py")
    if path.name == "__main__.py" or '__name__ == "__main__"' in path.read_text()
)
NOT_OURS = {"cad", "fab", "sensing", "__future__"} | sys.stdlib_module_names | {"numpy"}  # numpy is always there


def requirements(extra: str) -> set[str]:
    """Names of the distributions that an extra brings, through others of ours too."""
    found: set[str] = set()
    for line in PROJECT["optional-dependencies"][extra]:
        name = re.match(r"[A-Za-z0-9._-]+", line)[0].lower().replace("_", "-")
        inner = re.search(r"\[(.*)\]", line)
        if name == extras.DISTRIBUTION:
            for other in inner[1].split(","):
                found |= requirements(other.strip())
        else:
            found.add(name)
    return found


def imported_roots(path: Path, at_import: bool) -> set[str]:
    """Top-level modules that a file imports: all, or only those outside functions and type checking."""
    found: set[str] = set()

    def visit(node: ast.AST) -> None:
        for child in ast.iter_child_nodes(node):
            if at_import and isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)):
                continue
            if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.dump(child.test):
                continue
            if isinstance(child, ast.Import):
                found.update(alias.name for alias in child.names)
            elif isinstance(child, ast.ImportFrom) and child.module:
                found.update({child.module} | {f"{child.module}.{alias.name}" for alias in child.names})
            visit(child)

    visit(ast.parse(path.read_text()))
    return found


def file_of(module: str) -> Path | None:
    path = ROOT.joinpath(*module.split("."))
    return next((p for p in (path / "__init__.py", path.with_suffix(".py")) if p.exists()), None)


def libraries_at_import(command: str) -> set[str]:
    """Libraries that ``python -m command`` needs before it reads its arguments."""
    seen: set[str] = set()
    libraries: set[str] = set()
    waiting = [command, f"{command}.__main__"]
    while waiting:
        parts = waiting.pop().split(".")
        if parts[0] not in OURS:
            libraries |= {parts[0]} - NOT_OURS
            continue
        for name in (".".join(parts[:count]) for count in range(1, len(parts) + 1)):
            if name not in seen and (path := file_of(name)) is not None:
                seen.add(name)
                waiting += imported_roots(path, at_import=True)
    return libraries


def test_every_library_that_is_imported_has_its_extras():
    used = set()
    for package in OURS:
        for path in (ROOT / package).rglob("*.py"):
            if "packages" in path.relative_to(ROOT).parts:
                continue  # installed elsewhere, beside the program that it extends
            used |= {name.split(".")[0] for name in imported_roots(path, at_import=False)}
    assert used - NOT_OURS - set(extras.EXTRAS_OF_MODULE) == set()


@pytest.fixture(scope="module")
def distributions():
    """Names of the installed distributions by the modules that they bring; a second of reading."""
    return packages_distributions()


@pytest.mark.parametrize("module", sorted(extras.EXTRAS_OF_MODULE))
def test_the_extras_of_a_module_bring_its_distribution(module, distributions):
    known = {name.lower().replace("_", "-") for name in distributions.get(module, ())}
    if not known:
        pytest.skip(f"{module} is not installed here")
    brings = {extra for extra in PROJECT["optional-dependencies"] if requirements(extra) & known}
    assert brings - {"all", "dev"} == set(extras.EXTRAS_OF_MODULE[module])


@pytest.mark.parametrize("command", COMMANDS)
def test_the_extra_of_a_command_brings_what_it_imports(command):
    extra = extras.extra_of_command(command)
    assert extra in PROJECT["optional-dependencies"]
    lacking = {name for name in libraries_at_import(command) if extra not in extras.EXTRAS_OF_MODULE[name]}
    assert not lacking, f"{command} imports {lacking}, which the extra {extra!r} does not bring"


def test_all_brings_everything_but_the_tools_of_development_and_lerobot():
    apart = {"all", "dev", "docs", "lerobot"}  # lerobot: one format for 45 MB
    listed = PROJECT["optional-dependencies"]
    assert requirements("all") == set().union(*(requirements(extra) for extra in set(listed) - apart))
    assert requirements("dev") > requirements("all")


@pytest.mark.parametrize(
    ("argv", "module"),
    [
        (["python", "-m", "sensing.live", "--page", "-m"], "sensing.live"),
        (["python", "-X", "utf8", "-m", "fab.molds"], "fab.molds"),
        (["python", "-I", "-m", "fab.molds"], "fab.molds"),
        (["python", "script.py", "-m", "fab.molds"], ""),
        (["python", "-c", "pass", "-m", "fab.molds"], ""),
        (["python"], ""),
    ],
)
def test_the_started_module(argv, module):
    assert extras.started_module(argv) == module


def bare(code_or_module: list[str]) -> subprocess.CompletedProcess[str]:
    """Run as where only numpy is installed: whatever an extra brings is not found."""
    hidden = sorted(extras.EXTRAS_OF_MODULE)
    hide = (
        "import sys\n"
        "class Hide:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        f"        if name.split('.')[0] in {hidden!r}:\n"
        "            raise ModuleNotFoundError(f'No module named {name!r}', name=name)\n"
        "sys.meta_path.insert(0, Hide())\n"
    )
    code = hide + f"import runpy, sys\nsys.orig_argv = ['python', '-m', {code_or_module[0]!r}]\n"
    code += (
        f"sys.argv = {code_or_module!r}\nrunpy.run_module({code_or_module[0]!r}, run_name='__main__', alter_sys=True)\n"
    )
    with tempfile.TemporaryDirectory() as cache:  # an export in the user's cache would need no library
        environment = {**os.environ, "XDG_CACHE_HOME": cache}
        return subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, env=environment, timeout=60
        )


@pytest.mark.parametrize(
    ("command", "extra"),
    [
        ("fab.molds", "cad"),
        ("endcap.robot_model", "simulate"),  # its springs come first
        ("sensing.live", "live"),
        ("sensing.simulator", "simulate"),
        ("sensing.train", "train"),
    ],
)
def test_a_missing_library_is_one_line_with_the_command_that_installs_it(command, extra):
    result = bare([command])
    assert result.returncode == 2
    assert result.stdout == ""
    lines = result.stderr.strip().splitlines()
    assert "Traceback" not in result.stderr and len([line for line in lines if "endcap-toolkit" in line]) == 1
    assert lines[-1].startswith(f"{command}: ")  # lines before it are of progress
    assert lines[-1].endswith(f"run pip install 'endcap-toolkit[{extra}]'")


def test_the_extra_of_the_importing_module_is_named_where_the_command_has_not_got_it():
    """``live`` without cameras shows the simulator's robot: scipy is then the simulator's to ask for."""
    try:
        exec(compile("import scipy_of_nobody", "scene.py", "exec"), {"__name__": "sensing.simulator.render.scene"})
    except ModuleNotFoundError as error:
        error.name = "scipy"
        assert "endcap-toolkit[simulate]" in extras.explain(error, "sensing.live")
        assert "endcap-toolkit[cad]" in extras.explain(error, "fab.molds")


def test_other_errors_keep_their_traceback():
    assert extras.explain(ImportError("cannot import name 'x' from 'cad'", name="cad"), "fab.molds") is None
    assert extras.explain(ModuleNotFoundError("No module named 'fab.nothing'", name="fab.nothing"), "fab.molds") is None
    assert "libgl1" in extras.explain(ImportError("libGL.so.1: cannot open shared object file"), "fab.molds")


def test_ctrl_c_while_libraries_are_loaded_is_one_line(tmp_path):
    (tmp_path / "cv2.py").write_text("raise KeyboardInterrupt\n")
    run = subprocess.run(
        [sys.executable, "-m", "sensing.calibrate", "--photo", "a.jpg"],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert (run.returncode, run.stdout, run.stderr) == (130, "", "sensing.calibrate: interrupted\n")


@pytest.mark.parametrize("words", [["sensing.simulator", "press"], ["endcap", "press"]])
def test_nowhere_to_keep_compiled_code_is_one_line(words):
    """As where a service without a home runs a checkout that it may only read."""
    run = subprocess.run(
        [sys.executable, "-m", *words],
        cwd=ROOT,
        env=os.environ | {"NUMBA_CACHE_LOCATOR_CLASSES": "IPythonCacheLocator"},
        capture_output=True,
        text=True,
    )
    assert (run.returncode, run.stdout, run.stderr.count("\n")) == (2, "", 1)
    assert "NUMBA_CACHE_DIR" in run.stderr


def test_importing_from_a_program_changes_nothing():
    code = (
        "import os, sys; before = sys.excepthook, dict(os.environ); import fab, sensing; "
        "assert (sys.excepthook, dict(os.environ)) == before"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)


@pytest.mark.parametrize("command", ["sensing.train", "endcap.robot_model"])
def test_a_command_gives_linear_algebra_one_thread_unless_the_user_says_otherwise(monkeypatch, command):
    monkeypatch.setattr(sys, "orig_argv", ["python", "-m", command])
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)
    for name in threads.VARIABLES:
        monkeypatch.delenv(name, raising=False)
    extras.prepare_command()
    assert {os.environ[name] for name in threads.VARIABLES} == {"1"}
    for name in threads.VARIABLES:
        monkeypatch.delenv(name)
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    extras.prepare_command()
    assert [os.environ.get(name) for name in threads.VARIABLES] == [None, "3", None]
