"""Predicts how a design measures before anything is printed: ``python -m sensing.study --help``.

python -m sensing.study 130 8
python -m sensing.study D=180 T=10 material='Dragon Skin 20'
python -m sensing.study                                    # map of all designs in all silicones
python -m sensing.study load=120 error=0.5                 # three designs that do, and why
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path

from cad.data_table import file_name
from cad.errors import EndcapError, ParameterError
from cad.lens import other_module
from cad.materials import DEFAULT_SILICONE, silicones
from cad.messages import LOG, show, transient
from cad.options import PATTERN_DEFAULTS, chosen, parse_design, parse_options
from cad.plain_numbers import plain_number
from cad.typed_folder import EXPORTS, typed_folder
from cad.whole_file import make_folder, replace_file, require_place

OPTIONS = {
    "D": "", "T": "", **PATTERN_DEFAULTS, "material": DEFAULT_SILICONE, "load": "", "error": "",
    "exports": EXPORTS, "folder": "",
}  # fmt: skip
DESIGN_S = 0.08  # M: processor time of one design of the map (two cores, November 2026)
HELP = """\
options, as NAME=VALUE; two numbers at the start are D and T:
  D=130 T=8             the design: writes exports/D130_T8/study/: study.html, study.csv, study.json
  dots=1-6-10-12-16-18-20 dot_mm=4 gyroid=0.1   its dots and its gyroid, as in make molds
  material='Smooth-Sil 950'   row of cad/materials.csv
  (neither D nor T)     the map of all designs in all silicones: exports/study/: map.html, map.csv
  load=120 error=0.6    with the map: three designs that bear so many newtons with so small an error an axis
  exports=DIR           another folder; folder=DIR: the very folder to write into

Every figure says whether it is computed, measured, estimated or unknown (docs/design.md).
exit status: 0 written; 2 bad input, or a question that no design answers
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m sensing.study", description="What a design will feel, before anything is printed.",
        epilog=HELP, formatter_class=argparse.RawDescriptionHelpFormatter, usage="%(prog)s [D T | NAME=VALUE ...]",
    )  # fmt: skip
    parser.add_argument("words", nargs="*", help=argparse.SUPPRESS)
    words = parser.parse_args(arguments).words
    try:
        options = _options(words)
        return _design(options) if options["D"] else _map(options)
    except EndcapError as error:
        LOG.error(f"sensing.study: {error}")
        return 2
    except KeyboardInterrupt:
        LOG.error("\nsensing.study: interrupted; nothing was written")
        return 130


def _options(words: Sequence[str]) -> dict[str, str]:
    """NAME=VALUE words over their defaults.

    Raises:
        ParameterError: a word that is no option, or options that do not go together.
    """
    numbers = list(takewhile(lambda word: "=" not in word, words))
    design = [f"{name}={number}" for name, number in zip(("D", "T"), numbers, strict=False)]
    found = parse_options([*design, *numbers[2:], *words[len(numbers) :]], OPTIONS)
    if found["D"] and (found["load"] or found["error"]):
        raise ParameterError("load and error ask for a design: leave D and T out", name="load")
    if not found["D"] and (other := [name for name, usual in PATTERN_DEFAULTS.items() if found[name] != usual]):
        raise ParameterError(f"{other[0]} is of a design: give D and T, too", name=other[0])
    if bool(found["load"]) != bool(found["error"]):
        raise ParameterError("load and error belong together, as in load=120 error=0.6", name="load")
    return found | {name: str(typed_folder(found[name], name)) for name in ("exports", "folder") if found[name]}


def _number(name: str, text: str) -> float:
    try:
        return float(plain_number(text))
    except (ValueError, argparse.ArgumentTypeError):
        raise ParameterError(f"{name}={text}: give a plain number, such as 8 or 6.5", name=name, value=text) from None


def _design(options: dict[str, str]) -> int:
    from sensing.design.pressed import Study
    from sensing.design.prints import prints_of
    from sensing.design.report import Report

    params = parse_design(options)
    report = Report(Study(params, chosen("material", options["material"], silicones(), "cad/materials.csv")))
    folder = Path(options["folder"] or Path(options["exports"]) / report.label / "study")
    report = Report(report.study, prints_of(params, folder.parent))
    page = report.write(folder)
    width = max(len(line.name) for line in report.figures)
    for line in report.figures:
        show(f"{line.name:<{width}}  {line.text:>12}  {line.source.value}")
    show(f"blind: {report.blind}")
    show(f"{page}: {len(report.figures)} figures of {params.label} in {report.study.silicone}")
    return 0


def _map(options: dict[str, str]) -> int:
    from sensing.design.page import map_page
    from sensing.design.region import as_csv, choose, grid, require_possible, survey

    asked = bool(options["load"])
    load, error = (_number(name, options[name]) if asked else math.nan for name in ("load", "error"))
    designs = grid()
    if asked:
        require_possible(designs, load, error)
    folder = Path(options["exports"]) / _map_name()
    make_folder(folder)  # before the work, which would be lost
    for name in ("map.html", "map.csv"):
        require_place(folder / name)
    LOG.info(f"the map: {len(designs)} designs are computed, {DESIGN_S * len(designs):.0f} s of processor time")
    places = survey(designs, _progress)
    choices = choose(places, load, error) if asked else []
    question = f"load {load:g} N with {error:g} N of error an axis" if asked else ""
    replace_file(folder / "map.csv", as_csv(places).encode())
    replace_file(folder / "map.html", map_page(places, choices, question).encode())
    for choice in choices:
        show(f"{choice.place.label}: {choice.why}")
    show(f"{folder / 'map.html'}: {len(places)} designs and silicones, {sum(p.pareto for p in places)} on the front")
    return 0


def _map_name() -> str:
    """Name of the map's folder: ``study``, and the camera module where it is another one than the released."""
    module = other_module()
    return f"study_{file_name(module)}" if module else "study"


def _progress(done: int, total: int) -> None:
    transient(f"{done}/{total} designs", done=done == total)


if __name__ == "__main__":
    sys.exit(main())
