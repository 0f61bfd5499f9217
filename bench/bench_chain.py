"""Does every command of the workshop take every design? Random designs go through molds, slice, sheet and ring.

    python bench/bench_chain.py                  eight designs more, five minutes each; needs PrusaSlicer
    python bench/bench_chain.py --count 2 --seed 7
    python bench/bench_chain.py --look DIR       keeps the folders there, to be looked at

A design is a size from the whole region, a silicone, a robot's side and a printer that can make it; every other one
has dots and gyroid of its own, and half of them a joint clearance. Each command is the user's, with a cache of its own.
Appends a row a design to chain.csv beside this file as it ends: what was typed, seconds of each command, numbers of
files, plates and pages of the sheet, and what was wrong: a command that did not end with status 0, an STL that trimesh
reads as open, a page or an assembly of next to no bytes, a command in the sheet that does not name the size. Ends with
status 1 where something was.
"""

from __future__ import annotations

import argparse
import csv
import os
import random
import re
import shlex
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import trimesh

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.sizes import Size, option_sizes, random_sizes
from cad.errors import EndcapError
from cad.materials import silicones
from cad.mold.layout import JOINT_CLEARANCE_MM, MoldLayout, joint_clearance_range_mm
from cad.robot_sides import robot_sides
from fab.slice.footprints import require_printer
from fab.slice.printers import printer, printers
from fab.variant import Variant, printer_option

ROOT = Path(__file__).resolve().parent.parent
TABLE = Path(__file__).with_name("chain.csv")
COMMANDS = {"molds": "fab.molds", "slice": "fab.slice", "sheet": "fab.build_sheet", "ring": "fab.led_ring"}
PAGE = re.compile(rb"/Type\s*/Page\b")  # an object of the PDF
SIZED = re.compile(r">(make (?:molds|slice|sheet|ring|train|live|study|endcap|data)\b[^<\n]*)")  # a line of its own


@dataclass(frozen=True)
class Drawn:
    """One design, and the printer that makes it."""

    variant: Variant
    printer: str

    @property
    def typed(self) -> str:
        """What a user types after ``make molds``."""
        return f"{self.variant.words} {printer_option(self.printer)}"


@dataclass
class Done:
    """What came out of one design."""

    drawn: Drawn
    seconds: dict[str, float] = field(default_factory=dict)
    files: int = 0
    plates: int = 0
    pages: int = 0
    wrong: list[str] = field(default_factory=list)


def main() -> int:
    """Draw, make, write; returns 1 where something was wrong."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, prog="bench_chain.py"
    )
    parser.add_argument("--count", type=int, default=8, help="designs (default: 8)")
    parser.add_argument("--seed", type=int, help="of the draw (default: one that the table does not hold)")
    parser.add_argument("--look", type=Path, metavar="DIR", help="keep the folders here")
    options = parser.parse_args()
    seed = _free_seed() if options.seed is None else options.seed
    wrong = False
    for drawn in designs(seed, options.count):
        with tempfile.TemporaryDirectory(prefix="chain-") as name:
            done = made(drawn, options.look or Path(name), Path(name) / "cache")
        _append(seed, done)
        print(f"make molds {drawn.typed}: {'; '.join(done.wrong) or 'all passed'}", flush=True)
        wrong |= bool(done.wrong)
    return int(wrong)


def designs(seed: int, count: int) -> list[Drawn]:
    """Designs that can be made, by a seed: those that are refused at the start are drawn anew."""
    draw, found = random.Random(seed), list[Drawn]()
    plain, own = iter(random_sizes(seed, 100 * count)), iter(option_sizes(1000 + seed, 100 * count))
    while len(found) < count:
        size = next(own if len(found) % 2 else plain)
        try:
            found.append(_with_choices(size, draw, own_clearance=len(found) // 2 % 2 == 1))
        except EndcapError:
            continue
    return found


def _with_choices(size: Size, draw: random.Random, own_clearance: bool) -> Drawn:
    """A size with silicone, clearance, robot and printer.

    Raises:
        EndcapError: they do not go together.
    """
    silicone = draw.choice(list(silicones()))
    low, high = joint_clearance_range_mm(size.params, silicone)
    clearance = round(draw.uniform(low, high), 3) if own_clearance else JOINT_CLEARANCE_MM
    variant = Variant(MoldLayout(size.params, clearance, silicone), draw.choice(list(robot_sides())))
    name = draw.choice(list(printers()))
    require_printer(variant.layout, printer(name))
    return Drawn(variant, name)


def made(drawn: Drawn, exports: Path, cache: Path) -> Done:
    """Run every command and read what it wrote.

    Args:
        drawn: the design. exports: folder that receives its folder. cache: folder of the caches.
    """
    done = Done(drawn)
    environment = os.environ | {"XDG_CACHE_HOME": str(cache), "PYTHONPATH": str(ROOT)}
    size = [word for word in drawn.variant.words.split() if word.startswith(("D=", "T="))]
    for name, module in COMMANDS.items():
        words = size if name == "ring" else shlex.split(drawn.typed)
        start = time.monotonic()
        ended = subprocess.run(
            [sys.executable, "-m", module, *words, f"exports={exports}"],
            cwd=ROOT,
            env=environment,
            capture_output=True,
            text=True,
        )
        done.seconds[name] = time.monotonic() - start
        if ended.returncode or "Traceback" in ended.stderr:
            last = (ended.stderr.strip() or "nothing said").splitlines()[-1]
            done.wrong.append(f"{name}: status {ended.returncode}: {last}")
            if name == "molds":
                return done
    _read(done, exports / drawn.variant.label)
    return done


def _read(done: Done, folder: Path) -> None:
    """Count what is there, and find what is wrong with it."""
    done.files = sum(path.is_file() for path in folder.rglob("*"))
    done.plates = len(list((folder / "slice").glob("*.prusa.3mf")))
    for path in sorted(folder.glob("*.stl")):
        if not trimesh.load_mesh(path).is_watertight:
            done.wrong.append(f"{path.name} is open")
    for path in (folder / "index.html", *folder.glob("*.glb")):
        if path.stat().st_size < 100_000:
            done.wrong.append(f"{path.name} has {path.stat().st_size} bytes")
    sheet = folder / "sheet" / "build_sheet.pdf"
    if sheet.exists():
        done.pages = len(PAGE.findall(sheet.read_bytes()))
        text = sheet.with_suffix(".html").read_text(encoding="utf-8")
        done.wrong += [f"sheet: {words.strip()}" for words in SIZED.findall(text) if not _names(words, done.drawn)]


def _names(words: str, drawn: Drawn) -> bool:
    """Whether a command names the size of a design."""
    return all(f" {word}" in words for word in drawn.variant.words.split()[:2])


def _free_seed() -> int:
    """A seed that no row of the table has."""
    with TABLE.open(newline="", encoding="utf-8") as stream:
        return 1 + max((int(row["seed"]) for row in csv.DictReader(stream)), default=0)


def _append(seed: int, done: Done) -> None:
    """A row more."""
    with TABLE.open("a", newline="", encoding="utf-8") as stream:
        seconds = [f"{done.seconds[name]:.0f}" if name in done.seconds else "" for name in COMMANDS]
        row = [seed, done.drawn.typed, *seconds, done.files, done.plates, done.pages, "; ".join(done.wrong)]
        csv.writer(stream, lineterminator="\n").writerow(row)


if __name__ == "__main__":
    sys.exit(in_one_line(main))
