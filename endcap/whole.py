"""Commands ``endcap whole 180 10`` and ``make endcap D=180 T=10``: all files of one endcap (standard library only).

Each step is a command in a process of its own, which keeps CAD and sensing separate; a refusal is printed by that
command. At the end ``start.html`` lists each file with its purpose.
"""

from __future__ import annotations

import csv
import json
import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from cad.design_arguments import design_words
from cad.errors import EndcapError
from cad.materials import DEFAULT_SILICONE
from cad.messages import LOG, show
from cad.options import FROM_MAKE, MAKES_OWN, make_variables, named_as_typed, parse_options
from cad.typed_folder import typed_folder
from cad.whole_file import replace_file
from fab.command import VARIANT_DEFAULTS, Interrupts, ending_words, exports_words, parse_variant
from fab.variant import Variant, coupons_command, printer_option
from sensing.interpreter import typed_command

OPTIONS = {**VARIANT_DEFAULTS, "printer": ""}
PAGE = "start.html"
LEFT_OUT = 2  # status of a refusal by an optional command: no slicer, a shell that snaps through
END_S = 30.0  # for a command to remove its partial files
HELP = f"""\
usage: make endcap [options of make molds but cache=] [exports=DIR]      (or: endcap whole 180 10)

Makes molds, slicer projects, build sheet, LED ring, weights, robot-simulator model and study of one endcap in
exports/D180_T10/, and {PAGE} there, with what every file is for. Slicer projects are left out where PrusaSlicer is not
installed, and the robot-simulator model where the shell snaps; everything else that fails stops it, and what was made
before stays. Ten minutes of processor time (D=162.5 T=10.75), most of it molds, slicing and weights.

exit status: 0 made; 1 a check failed; 2 bad input; 130 interrupted; 143 ended by SIGTERM
"""


@dataclass(frozen=True)
class Step:
    """One command.

    Attributes:
        title: of the step.
        module, words: module that is run, and its arguments.
        optional: whether the step is skipped if it refuses.
    """

    title: str
    module: str
    words: tuple[str, ...]
    optional: bool = False


@dataclass(frozen=True)
class Wanted:
    """Files that are to be made.

    Attributes:
        variant: the design, its joint clearance and its silicone.
        exports: folder that receives that of the endcap.
        printer: on which it is printed, a row of fab/slice/printers.csv; empty for the default of the commands.
    """

    variant: Variant
    exports: Path
    printer: str = ""

    @property
    def printer_option(self) -> tuple[str, ...]:
        """The option of the printer; empty where none was given."""
        return (f"printer={self.printer}",) if self.printer else ()

    @property
    def folder(self) -> Path:
        """Folder of the molds and of all other files."""
        return self.exports / self.variant.label

    def steps(self) -> list[Step]:
        """The commands in order."""
        params, material, folder = self.variant.params, self.variant.silicone, self.folder
        _, diameter, _, wall, *dots = design_words(params)
        design = (f"D={diameter}", f"T={wall}")
        pattern = (f"{name}={value}" for name, value in params.option_words.items())
        whole = (*shlex.split(self.variant.words), f"exports={self.exports}")
        printed = (*whole, *self.printer_option)
        train = ("--design", diameter, wall, *dots, "--silicone", material, "--unless-there", "--copy-to", str(folder))
        of_study = (*design, *pattern, f"material={material}")
        return [
            Step("molds", "fab.molds", printed),
            Step("slicer projects", "fab.slice", printed, optional=True),
            Step("build sheet", "fab.build_sheet", printed),
            Step("LED ring", "fab.led_ring", (*design, f"exports={folder}")),
            Step("weights", "sensing.train", train),
            Step("robot-simulator model", "endcap.robot_model", whole, optional=True),
            Step("study", "sensing.study", (*of_study, f"folder={folder / 'study'}")),
        ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if {"-h", "--help"} & set(words):
        show(HELP)
        return 0
    interrupts = Interrupts()
    try:
        with interrupts.handling():
            return make(parsed(words), lambda step: _run(step, interrupts))
    except EndcapError as error:
        LOG.error(f"make endcap: {error}")
        return 2
    except KeyboardInterrupt:
        number = interrupts.signal or signal.SIGINT
        LOG.error(f"make endcap: {ending_words(number)}; what was made before stays")
        return 128 + number


def parsed(words: Sequence[str]) -> Wanted:
    """NAME=VALUE words, or make's variables.

    Raises:
        ParameterError: an unknown option, only one of D and T, or a design that cannot be made.
    """
    typed = list(words)
    if FROM_MAKE in typed:
        typed.remove(FROM_MAKE)
        typed += make_variables(os.environ.get("MAKEFLAGS", ""))
    with named_as_typed():
        options = parse_options([word for word in typed if word.partition("=")[0] not in MAKES_OWN], OPTIONS)
    return Wanted(parse_variant(options), typed_folder(options["exports"]), options["printer"])


def make(wanted: Wanted, run: Callable[[Step], int]) -> int:
    """Run all commands, then write the page.

    Args:
        wanted: files that are to be made.
        run: runs a step and returns its exit status.

    Returns:
        Exit status: 0, or that of the first step that failed.

    Raises:
        FileError: the page cannot be written.
    """
    skipped: list[str] = []
    for step in wanted.steps():
        status = run(step)
        if status and not (step.optional and status == LEFT_OUT):
            if wanted.folder.is_dir():
                LOG.error(f"make endcap: {step.title} failed; {wanted.folder} holds what was made before")
            return status
        if status:
            skipped.append(step.title)
    write_page(wanted, wanted.folder, skipped)
    left_out = f" (left out: {', '.join(skipped)})" if skipped else ""
    show(f"{wanted.folder / PAGE}: everything of {wanted.folder.name}{left_out}")
    return 0


def _run(step: Step, interrupts: Interrupts) -> int:
    """Run a command; if this process is ended, the running command has time to remove its partial files."""
    LOG.info(f"== {step.title}")
    env = {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))}
    process = subprocess.Popen([sys.executable, "-m", step.module, *step.words], env=env)
    try:
        return process.wait()
    except KeyboardInterrupt:
        if interrupts.signal == signal.SIGTERM:  # Ctrl-C and a hangup reach both; a second signal ends the wait
            process.terminate()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
        raise


MEANINGS = {  # of folders and files beside those that index.html explains
    "index.html": "parts, their files, 3-D view and checks",
    "sheet/build_sheet.html": "what to buy, print, mix, cast, demold, paint, assemble and test",
    "sheet/build_sheet.pdf": "the same, to print",
    "study/study.html": "what this endcap will feel",
    "study/study.csv": "the same as a table",
    "study/study.json": "the same for programs",
    "robot_model/endcap.xml": "the endcap for MuJoCo (MJCF), springs fitted to the pressed shell",
    "robot_model/endcap.urdf": "the same as a rigid body (URDF)",
    "robot_model/robot_model.json": "mass, inertia, springs and how wrong they are, for programs",
    "slice/slice.json": "time, material and gates of every print",
    "manifest.json": "every part, file digest and check, for programs",
}
BY_FOLDER = {
    "slice": "slicer project", "sheet": "of the build sheet", "study": "of the study",
    "robot_model": "of the robot-simulator model",
}  # fmt: skip
BY_ENDING = {
    ".stl": "part as a mesh, to slice", ".3mf": "part as a mesh with name and unit", ".glb": "3-D view",
    ".step": "part or assembly as solid", ".png": "picture", ".safetensors": "weights: field to wrench",
    ".csv": "table", ".zip": "archive",
}  # fmt: skip
STYLE = (
    "body{font:15px/1.45 system-ui,sans-serif;max-width:64rem;margin:1.5rem auto;padding:0 1rem}td{padding:.1rem .8rem "
    ".1rem 0;vertical-align:top}img{max-width:48%}pre{background:#f3f3f3;padding:.6rem;overflow-x:auto}"
)


def write_page(wanted: Wanted, folder: Path, skipped: Sequence[str]) -> None:
    """Write the page that lists everything.

    Args:
        wanted: files that were made.
        folder: that holds them.
        skipped: titles of the steps left out.
    """
    shown = {"exploded.png": "the parts, pulled apart", "section.png": "section of the endcap"}
    pictures = "".join(f'<img src="{file}" alt="{alt}">' for file, alt in shown.items() if (folder / file).is_file())
    missing = f"<p>Left out: {escape(', '.join(skipped))} (its own message is in the terminal).</p>" if skipped else ""
    title = f"Endcap {folder.name}"
    body = (
        f"<h1>{escape(title)}</h1><p>{escape(_checks(folder))}</p>{missing}{pictures}<h2>What it will feel</h2>"
        f"<table>{_figures(folder)}</table><h2>Next</h2><pre tabindex='0'>{escape(_next(wanted, folder))}</pre>"
        f"<h2>Every file</h2><table>{_files(folder)}</table>"
    )
    page = (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f"<style>{STYLE}</style></head><body><main>{body}</main></body></html>\n"
    )
    replace_file(folder / PAGE, page.encode())


def _checks(folder: Path) -> str:
    try:
        checks = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["checks"]
    except (OSError, ValueError, KeyError):
        return "Its manifest cannot be read: make the molds again."
    return f"{len(checks)} checks of the parts passed, on files that were read back."


def _figures(folder: Path) -> str:
    try:
        with (folder / "study" / "study.csv").open(encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
    except OSError:
        return ""
    return "".join(
        f"<tr><td>{escape(row['name'])}</td><td>{escape(_short(row['value'], row['unit']))}</td>"
        f"<td>{escape(row['source'])}</td></tr>"
        for row in rows
    )


def _short(value: str, unit: str) -> str:
    """A value in the format of the study's page: three digits, larger numbers whole."""
    if not value:
        return "–"
    digits = f"{float(value):.0f}" if abs(float(value)) >= 999.5 else f"{float(value):.3g}"
    return f"{digits} {unit}".strip()


def _next(wanted: Wanted, folder: Path) -> str:
    design, material = design_words(wanted.variant.params), wanted.variant.silicone
    other = ("--silicone", material) if material != DEFAULT_SILICONE else ()
    printer = f" {printer_option(wanted.printer)}" if wanted.printer else ""
    sheet = wanted.variant.command("sheet") + printer + exports_words(wanted.exports)
    calibrate = ("--photo", "a.jpg", *design, "--out", "camera.json", "--picture", "fit.png")
    coupons = coupons_command(material) + printer + exports_words(wanted.exports)
    return "\n".join([
        f"{coupons:<64} # print the fit coupon first; give what fits as joint_clearance=",
        f"{sheet:<64} # {folder.name}/sheet/build_sheet.pdf: print, cast, assemble",
        f"{typed_command('sensing.live', *design, *other)}    # the simulated robot of this size, with its weights",
        typed_command("sensing.calibrate", *calibrate),
        typed_command("sensing.live", "--camera", "0", *design, *other),
    ])  # fmt: skip


def _files(folder: Path) -> str:
    rows = []
    for path in sorted(folder.rglob("*"), key=lambda path: (len(path.relative_to(folder).parts), str(path))):
        name = path.relative_to(folder).as_posix()
        if path.is_file() and name != PAGE and not path.name.startswith("."):
            top = name.split("/")[0] if "/" in name else ""
            ring = "of the LED ring" if top.startswith("led_ring") else ""
            meaning = MEANINGS.get(name) or ring or BY_FOLDER.get(top) or BY_ENDING.get(path.suffix, "")
            size = f"{max(1, round(path.stat().st_size / 1000))} kB"
            link = f'<a href="{escape(name)}">{escape(name)}</a>'
            rows.append(f"<tr><td>{link}</td><td>{escape(meaning)}</td><td>{size}</td></tr>")
    return "".join(rows)


if __name__ == "__main__":
    sys.exit(main())
