"""Commands ``endcap whole 180 10`` and ``make endcap D=180 T=10``: all files of one endcap (standard library only).

Each step is a command in a process of its own, which keeps CAD and sensing separate; a refusal is printed by that
command. At the end ``start.html`` lists each file with its purpose.
"""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from cad.design_arguments import design_words
from cad.errors import EndcapError
from cad.messages import LOG, show
from cad.options import FROM_MAKE, make_variables, named_as_typed, parse_options
from cad.typed_folder import typed_folder
from endcap.start_page import PAGE, write_page
from fab.command import VARIANT_DEFAULTS, Interrupts, ending_words, parse_variant
from fab.pot_life import require_pot_life
from fab.recipe import closed_cast_mm3
from fab.variant import Variant

OPTIONS = {**VARIANT_DEFAULTS, "printer": ""}
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
        ParameterError: an unknown option, only one of D and T, a design that cannot be made, or a silicone that
            thickens before its mold is closed.
    """
    typed = list(words)
    if FROM_MAKE in typed:
        typed.remove(FROM_MAKE)
        typed += make_variables(os.environ.get("MAKEFLAGS", ""))
    with named_as_typed():
        options = parse_options(typed, OPTIONS)
    variant = parse_variant(options)
    require_pot_life(variant.layout, closed_cast_mm3(variant.params))  # else the sheet refuses it after all the slices
    return Wanted(variant, typed_folder(options["exports"]), options["printer"])


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
    write_page(wanted.variant, wanted.exports, wanted.printer, skipped)
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


if __name__ == "__main__":
    sys.exit(main())
