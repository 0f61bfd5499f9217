"""Documents against the code: the map of CONTRIBUTING, and every command that a code block names."""

from __future__ import annotations

import re
import shlex
from importlib.util import find_spec
from pathlib import Path

import pytest
from command_lines import refusal
from test_architecture import ARROWS, ROOT

from endcap.command import SUBCOMMANDS

PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")])
BLOCK = re.compile(r"^(`{3,})[ \t]*(\w*)[ \t]*\n(.*?)^\1[ \t]*$", re.M | re.S)
OF_A_PLUGIN = re.compile("invalid choice: '(nothing|ball|constant)'")  # added by the plug-in that the page writes
SHELLS = {"", "sh", "bash", "console"}
GOALS = {
    word
    for line in (ROOT / "Makefile").read_text(encoding="utf-8").splitlines()
    if re.match(r"[a-z-]+:( |$)", line)
    for word in [line.split(":")[0]]
}


def shell_lines(text: str) -> list[str]:
    """Commands of all shell blocks, one for each part of a pipe or a list."""
    lines = [line for _, kind, body in BLOCK.findall(text) if kind in SHELLS for line in body.splitlines()]
    return [part.strip() for line in lines for part in re.split(r"&&|\||;", line.split(" #")[0]) if part.strip()]


def missing(command: str) -> str:
    """What a command names that does not exist; empty for a good one, or one of somebody else's program."""
    try:
        words = [word for word in shlex.split(command) if not re.fullmatch(r"[A-Z_]+=.*", word)]
    except ValueError:
        return ""  # a drawing, or prose
    if not words:
        return ""
    program, rest = Path(words[0]).name, words[1:]
    if program == "make":
        return " ".join(word for word in rest if re.fullmatch(r"[a-z-]+", word) and word not in GOALS)
    if program == "endcap" and words[0] in ("endcap", ".venv/bin/endcap"):
        return "" if rest and (rest[0] in SUBCOMMANDS or rest[0].startswith("-")) else " ".join(rest[:1])
    if program == "python" and rest[:1] == ["-m"]:
        return "" if find_spec(rest[1]) else rest[1]
    if program in ("python", "sh") and rest and rest[0].endswith((".py", ".sh")):
        return "" if (ROOT / rest[0]).exists() else rest[0]
    return ""


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_command_of_a_page_exists(page):
    text = page.read_text(encoding="utf-8")
    assert {command: missing(command) for command in shell_lines(text) if missing(command)} == {}


def options_refused(text: str) -> dict[str, str]:
    """Commands of a page, those within a line only where they give options, whose words their parsers refuse."""
    prose = re.sub(BLOCK, "", text)
    inline = [words for words in re.findall(r"`((?:python -m|endcap) [^`]+)`", prose) if " --" in words]
    commands = [
        re.split(r"\s[>&]", line)[0] for line in [*shell_lines(text), *inline] if "$" not in line and " ..." not in line
    ]
    commands = [command for command in commands if re.match(r"(\.venv/bin/)?(python3?|endcap) ", command)]
    return {command: said for command in commands if (said := refusal(command)) and not OF_A_PLUGIN.search(said)}


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_command_of_a_page_parses(page):
    assert options_refused(page.read_text(encoding="utf-8")) == {}


@pytest.mark.parametrize(
    "text",
    ["```sh\npython -m sensing.calibrate --photo a.jpg\n```\n", "so `endcap live --cameras 0 1` shows", "`python -m "
     "sensing.zero take --out`"],
)  # fmt: skip
def test_options_that_a_parser_refuses_are_seen(text):
    assert options_refused(text)


@pytest.mark.parametrize(
    "command",
    ["make mold D=130", "endcap mold 130 8", "python -m sensing.lives", "A=1 python bench/bench_nothing.py"],
)
def test_a_command_that_does_not_exist_is_seen(command):
    text = f"text\n```sh\ncd x && {command}  # comment\n```\n"
    assert any(missing(part) for part in shell_lines(text))


def test_the_readme_has_commands():
    assert len(shell_lines((ROOT / "README.md").read_text(encoding="utf-8"))) > 10


def test_what_a_page_says_you_see_is_in_the_code():
    """Words that the first column of "What can go wrong" has in quotes."""
    code = "\n".join(
        path.read_text("utf-8") for name in ("cad", "fab", "sensing") for path in (ROOT / name).rglob("*.py")
    )
    pages = [path.read_text("utf-8") for path in (ROOT / "docs" / "users").glob("*.md")]
    quoted = [words for page in pages for words in re.findall(r'^\|[^|]*"([^"|]+)"[^|]*\|', page, re.M)]
    assert len(quoted) >= 2 and [words for words in quoted if words not in code] == []


def test_every_page_of_the_four_users_and_the_tutorials_is_linked():
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    assert re.findall(r"\(users/(\w+)\.md\)", index) == ["technician", "roboticist", "researcher", "maintainer"]
    tutorials = (ROOT / "docs" / "tutorials" / "index.md").read_text(encoding="utf-8")
    notebooks = {path.stem for path in (ROOT / "docs" / "tutorials").glob("*.ipynb")}
    assert set(re.findall(r"\((\w+)\.ipynb\)", tutorials)) == notebooks


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_link_of_a_page_leads_to_a_file_of_the_checkout(page):
    targets = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    assert [name for name in targets if "://" not in name and not (page.parent / name).exists()] == []


def test_the_map_says_what_the_architecture_test_holds():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").split("| package of `sensing` |")[1]
    rows = re.findall(r"^\| `([\w.]+)` \| [^|]+ \| ([^|]+) \|$", text.split("\n\n")[0], re.M)
    written = {name: set(re.findall(r"`([\w.]+)`", imports)) for name, imports in rows}
    assert written == {name: imports for name, imports in ARROWS.items() if name}


def test_every_place_of_the_map_exists():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    paths = set(re.findall(r"`((?:cad|fab|sensing|docs|bench|tests)/[\w./]*)`", text))
    assert len(paths) > 10 and {path for path in paths if not (ROOT / path).exists()} == set()


def test_every_file_of_make_quick_exists():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8").replace("\\\n", " ")
    names = re.findall(r"[\w/]+\.py", re.search(r"^QUICK := (.*)$", makefile, re.M)[1])
    assert len(names) > 10 and [name for name in names if not list((ROOT / "tests").rglob(Path(name).name))] == []


def test_the_technician_trains_and_sets_up_the_size_that_was_made():
    lines = shell_lines((ROOT / "docs" / "users" / "technician.md").read_text(encoding="utf-8"))
    train = next(line for line in lines if line.startswith("make train "))
    setup = next(line for line in lines if line.startswith(".venv/bin/endcap setup"))
    assert lines.index(train) < lines.index(setup)
    size = re.search(r"--diameter (\S+) --wall (\S+)", setup)
    assert size is not None and train == f"make train D={size[1]} T={size[2]}"
