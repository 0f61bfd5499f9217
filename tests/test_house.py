"""How long lines, files and functions are, and how docstrings name arguments; a failure lists what is over."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import pytest

from endcap.command import SUBCOMMANDS

ROOT = Path(__file__).resolve().parents[1]
FILE_LINES, FUNCTION_LINES, COLUMNS, SAME_PREFIX = 300, 40, 120, 2
PACKAGES = ("cad", "endcap", "fab", "sensing", "bench", "scripts", "tests")
PUBLIC = ("cad", "endcap", "fab", "sensing")
ONE_A_LINE = ("cad", "fab", "sensing", "endcap")


def sources(packages: tuple[str, ...]) -> dict[str, str]:
    paths = [path for package in packages for path in (ROOT / package).rglob("*.py")]
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in sorted(paths)}


def long_files(texts: dict[str, str]) -> set[str]:
    return {name for name, text in texts.items() if len(text.splitlines()) > FILE_LINES}


def repeated_prefixes(names: Iterable[str]) -> set[str]:
    """``folder/prefix_`` of more than two modules of a folder, which are a package; not the programs of bench."""
    paths = [Path(name) for name in names]
    words = Counter(f"{path.parent.as_posix()}/{path.stem.split('_')[0]}_" for path in paths if path.stem[0] != "_")
    return {prefix for prefix, count in words.items() if count > SAME_PREFIX} - {"bench/bench_"}


def pages(packages: tuple[str, ...], suffixes: tuple[str, ...]) -> dict[str, str]:
    """Scripts, styles and HTML of the pages, which the linter of Python does not read."""
    paths = [path for package in packages for path in (ROOT / package).rglob("*") if path.suffix in suffixes]
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in sorted(paths)}


def wide_lines(texts: dict[str, str]) -> set[str]:
    lines = [(name, k, line) for name, text in texts.items() for k, line in enumerate(text.splitlines(), 1)]
    return {f"{name}:{k}" for name, k, line in lines if len(line) > COLUMNS}


def long_functions(texts: dict[str, str]) -> set[str]:
    """``file::function`` of more than forty lines, its docstring not counted."""
    return {
        f"{name}::{node.name}"
        for name, text in texts.items()
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and _length(node) > FUNCTION_LINES
    }


def _length(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    first = node.body[0]
    text = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str)
    said = (first.end_lineno or 0) - first.lineno + 1 if text else 0
    return (node.end_lineno or 0) - node.lineno + 1 - said


def without_args(texts: dict[str, str]) -> set[str]:
    """``file::function`` of public functions with three or more parameters that have no ``Args:``.

    A method counts without its ``self``; ``__init__`` is described in its class.
    """
    found = set()
    for name, text in texts.items():
        for owner, node in _public(ast.parse(text)):
            given = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            given = [argument for argument in given if argument.arg not in ("self", "cls")]
            said = ast.get_docstring(node) or ""
            if node.name == "__init__":
                said += ast.get_docstring(owner) or "" if owner else ""
            if len(given) >= 3 and not re.search(r"\bArgs:|\bAttributes:", said):
                found.add(f"{name}::{owner.name + '.' if owner else ''}{node.name}")
    return found


def args_not_parsed(texts: dict[str, str]) -> set[str]:
    """``file::function: name`` of parameters, of functions and of dataclasses, without an entry that tools can parse.

    Editors and the documentation site take one entry from each line of ``Args:`` (``Attributes:``) that is indented by
    four; a second name on the same line becomes part of the first one's description. Descriptions without such a
    section are free text and do not count.
    """
    return {
        f"{name}::{node.name}: {missing}"
        for name, text in texts.items()
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef | ast.ClassDef)
        for missing in _parameters(node) - _entries(ast.get_docstring(node) or "", _parameters(node))
    }


def _parameters(node: ast.FunctionDef | ast.ClassDef) -> set[str]:
    if isinstance(node, ast.ClassDef):
        names = {n.target.id for n in node.body if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)}
        return {name for name in names if not name.startswith("_")}
    return {a.arg for a in [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]} - {"self", "cls"}


def _entries(said: str, all_names: set[str]) -> set[str]:
    """Names at the head of the entries; all where there is no section for them."""
    sections = re.findall(r"^(?:Args|Attributes):\n((?:    .*\n?|\n(?=    ))*)", said, re.MULTILINE)
    heads = [head for section in sections for head in re.findall(r"^    ([\w*, ]+):", section, re.MULTILINE)]
    return {name.strip(" *") for head in heads for name in head.split(",")} if sections else all_names


def _public(tree: ast.Module):
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            yield None, node
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            for inner in node.body:
                if isinstance(inner, ast.FunctionDef) and (inner.name == "__init__" or not inner.name.startswith("_")):
                    yield node, inner


@pytest.mark.parametrize(
    ("over", "packages"),
    [(long_files, PACKAGES), (long_functions, PACKAGES), (without_args, PUBLIC), (args_not_parsed, ONE_A_LINE)],
)
def test_nothing_is_over_the_limits(over, packages):
    found = over(sources(packages))
    assert not found, "\n".join(sorted(found))


def test_a_prefix_that_repeats_is_a_package():
    assert repeated_prefixes(["a/led_x.py", "a/led_y.py", "a/led.py", "a/lens.py", "b/led_z.py"]) == {"a/led_"}
    assert not repeated_prefixes(sources((*PUBLIC, "bench")))


def test_pages_are_as_readable_as_programs():
    assert wide_lines(pages(PUBLIC, (".js", ".css", ".html"))) == set()
    assert long_files(pages(PUBLIC, (".js", ".html"))) == set()


def test_the_counts_see_what_they_count():
    assert wide_lines({"a.js": "x".ljust(120) + "\n" + "x" * 121}) == {"a.js:2"}
    long = {"a.py": "x = 1\n" * 301, "b.py": "def f():\n" + "    x = 1\n" * 41}
    assert long_files(long) == {"a.py"} and long_functions(long) == {"b.py::f"}
    bare = (
        "def f(a, b, c):\n    '''Nothing.'''\nclass A:\n    def g(self, a, b): ...\n    def h(self, a, b, *, c): ...\n"
    )
    assert without_args({"c.py": bare}) == {"c.py::f", "c.py::A.h"}
    assert without_args({"c.py": "def f(a, b, c):\n    '''One.\n\n    Args:\n        a, b, c: mm.\n    '''\n"}) == set()


def test_a_second_name_on_a_line_is_found():
    function = "def f(a_mm, b_n):\n    '''One.\n\n    Args:\n        {}\n    '''\n"
    assert args_not_parsed({"a.py": function.format("a_mm: mm. b_n: N.")}) == {"a.py::f: b_n"}
    assert not args_not_parsed({"a.py": function.format("a_mm: mm.\n        b_n: N.")})
    assert not args_not_parsed({"a.py": function.format("a_mm, b_n: mm and N.")})
    assert not args_not_parsed({"a.py": "def f(a, b):\n    '''a by b.'''\n"})
    said = "    '''One.\n\n    Attributes:\n        a_mm: mm. b_n: N.\n    '''\n"
    record = f"class A:\n{said}    a_mm: float\n    b_n: float\n"
    assert args_not_parsed({"a.py": record}) == {"a.py::A: b_n"}


@pytest.mark.parametrize("name", ["train", "molds", "press", "data", "bond-tests"])
def test_help_calls_the_program_what_was_typed(name):
    assert name in SUBCOMMANDS
    run = subprocess.run(
        [sys.executable, "-m", "endcap", name, "--help"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert re.match(rf"usage: endcap {name}[ \n]", run.stdout)
