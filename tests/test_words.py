"""The glossary's old words are gone from code, documents, messages and page.

``old_words_allowed.txt`` lists what is still to be cleaned: files, or folders that end with a slash. The list only
shrinks: a path that is already clean, or no longer there, fails until its line is taken out.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
GLOSSARY = ROOT / "docs" / "glossary.md"
ALLOWED = Path(__file__).with_name("old_words_allowed.txt")
FOLDERS = ("cad", "endcap", "fab", "sensing", "tests", "bench", "scripts", "docs")
FILES = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff", "Makefile", "pyproject.toml")
SUFFIXES = {".py", ".md", ".js", ".html", ".css", ".sh", ".csv", ".toml", ".ipynb"}
EXCEPT = {GLOSSARY, Path(__file__).resolve()}  # the two that must name the old words

# An underscore, a digit and a change of case end a word, so that `open_caps`, `CapConfig` and `told_n` are found too.
START, END = r"(?:(?<![A-Za-z])|(?<=[a-z])(?=[A-Z]))", r"(?![a-z])"
OLD: dict[str, str] = {  # pattern -> what to write instead
    r"[Tt]old|[Tt]ell(?:s|ing)?": "predicted, estimated, reports, states, shows",
    r"[Ff]oret(?:old|ells?)": "predicted, predict step",
    r"ahead(?=\()|(?<=import )ahead": "predict step",
    r"[Bb]elie(?:ve[sd]?|f|fs)|BELIEF": "mode probability; inlier (of a dot)",
    r"[Cc]aps?(?![ _]?(?:screw|head)s?)|CAPS": "endcap, sensor",
    r"[Ff]eet": "endcaps on the ground",
    r"[Ww]ides|core_wide|WIDES?": "wedge segments, core_wedge",
    r"rests": "contribution blocks (solver); lies, stands",
    r"contact[ _-]shares?|shares? of contact": "contact-time fraction",
    r"[Ss]way(?:s|ed|ing)?": "global bias",
    r"[Ss]haken": "disturbed",
    r"[Mm]ade-up": "domain-randomised",
    r"[Ff]elt": "measured",
    r"[Dd]oors?": "facade",
    r"favour_the_loop": "reduce_pauses",
    r"[Mm]end(?:s|ed|ing)?": "fix; say how",
    r"of everything drawn": "of the random numbers",
}
PATTERNS = {re.compile(f"{START}(?:{pattern}){END}"): instead for pattern, instead in OLD.items()}
ROUGH = re.compile("|".join(OLD))  # ten times as fast: most lines hold none, as a word or inside one
LEGITIMATE = re.compile(r"[Ss]pherical cap|cap angle|cap\.(?:read|set|get|release|isOpened)\(|(?:stream|self)\.tell\(")


def old_words(text: str) -> list[tuple[int, str, str]]:
    """Line number, old word, replacement."""
    found = []
    for number, line in enumerate(text.splitlines(), 1):
        plain = LEGITIMATE.sub("", line)
        if not ROUGH.search(plain):
            continue
        for pattern, instead in PATTERNS.items():
            found += [(number, match.group(), instead) for match in pattern.finditer(plain)]
    return found


@cache
def findings() -> dict[str, list[tuple[int, str, str]]]:
    """Path in the repository -> its old words, of every file that has some."""
    paths = [p for folder in FOLDERS for p in (ROOT / folder).rglob("*") if p.suffix in SUFFIXES]
    paths += [ROOT / name for name in FILES if (ROOT / name).exists()]
    found = {}
    for path in sorted(set(paths) - EXCEPT):
        words = old_words(path.read_text(encoding="utf-8"))
        if words:
            found[path.relative_to(ROOT).as_posix()] = words
    return found


def allowed() -> list[str]:
    lines = (line.split("#")[0].strip() for line in ALLOWED.read_text(encoding="utf-8").splitlines())
    return [line for line in lines if line]


def covers(entry: str, path: str) -> bool:
    return path.startswith(entry) if entry.endswith("/") else path == entry


def test_old_words_stand_only_where_they_are_still_allowed():
    entries = allowed()
    wrong = [
        f"{path}:{number}: {word!r}; write: {instead}"
        for path, words in findings().items()
        if not any(covers(entry, path) for entry in entries)
        for number, word, instead in words
    ]
    assert not wrong, "old words (docs/glossary.md):\n" + "\n".join(wrong)


def test_the_list_only_shrinks():
    clean = [entry for entry in allowed() if not any(covers(entry, path) for path in findings())]
    assert not clean, f"already clean, take out of {ALLOWED.name}: {', '.join(clean)}"


@pytest.mark.parametrize(
    "text",
    [
        "the model told",
        "what_it_tells",
        "open_caps",
        "CapConfig",
        "six caps,",
        "cap_index",
        "core_wide_1",
        "made-up sensors",
        "seed: of everything drawn",
    ],
)
def test_old_words_are_found(text):
    assert old_words(text)


@pytest.mark.parametrize(
    "text",
    [
        "ISO 4762 cap screw",
        "cv2.CAP_PROP_FPS",
        "capture",
        "a spherical cap",
        "amend",
        "recommended",
        "4 mm wide",
        "capable",
    ],
)
def test_other_words_are_not(text):
    assert not old_words(text)


def test_every_old_word_is_in_the_glossary():
    table = GLOSSARY.read_text(encoding="utf-8").split("## Old words")[1]
    for word in (
        "told",
        "foretold",
        "ahead",
        "believe",
        "cap",
        "feet",
        "wides",
        "rests",
        "share",
        "sway",
        "mend",
        "door",
    ):
        assert re.search(rf"\b{word}\b", table), word
