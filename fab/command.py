"""Shared parts of the `make` commands of fab: NAME=VALUE options, errors of one line, exit statuses, signals."""

from __future__ import annotations

import argparse
import locale
import os
import shlex
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from cad.errors import EndcapError
from cad.extras import program
from cad.materials import DEFAULT_SILICONE, silicones
from cad.messages import LOG
from cad.mold.layout import JOINT_CLEARANCE_MM, MoldLayout
from cad.options import (
    DESIGN_DEFAULTS,
    FROM_MAKE,
    PATTERN_DEFAULTS,
    chosen,
    make_variables,
    named_as_typed,
    parse_design,
    parse_length,
    parse_options,
)
from cad.robot_sides import DEFAULT_ROBOT, robot_sides
from cad.typed_folder import EXPORTS, typed_folder
from fab.checks.check import ChecksFailedError
from fab.exports.whole_folder import ENDING_SIGNALS
from fab.variant import Variant

VARIANT_USAGE = (
    "[D=MM T=MM] [joint_clearance=MM] [material=NAME] [robot=NAME] [dots=COUNTS] [dot_mm=MM] [gyroid=FRACTION]"
)
VARIANT_DEFAULTS = {
    **DESIGN_DEFAULTS,
    **PATTERN_DEFAULTS,
    "joint_clearance": f"{JOINT_CLEARANCE_MM:g}",
    "material": DEFAULT_SILICONE,
    "robot": DEFAULT_ROBOT,
    "exports": EXPORTS,
}


def exports_words(exports: Path) -> str:
    """Option ``exports=DIR`` with a space before it, to follow a command; empty for the default.

    The path is absolute, as the printed command is run in the toolkit's folder, and not where this one ran.

    Args:
        exports: folder that holds those of the variants.
    """
    place = exports.resolve()
    return "" if place == Path(EXPORTS).resolve() else f" exports={shlex.quote(str(place))}"


class Interrupts:
    """Record of ending signals: in a library's import or a worker's end they may appear as another error."""

    def __init__(self) -> None:
        self.signal: int | None = None

    @contextmanager
    def handling(self) -> Iterator[None]:
        """Handle the ending signals inside this context, except those that nohup or a shell ignores."""
        handled = [number for number in ENDING_SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]
        before = {number: signal.signal(number, self._handle) for number in handled}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def raise_swallowed(self) -> None:
        """Raise KeyboardInterrupt if a signal was received; a library may have swallowed its exception in an import."""
        if self.signal is not None:
            raise KeyboardInterrupt

    def _handle(self, number: int, _: object) -> None:
        self.signal = number
        raise KeyboardInterrupt


@dataclass(frozen=True)
class Command:
    """One command.

    Attributes:
        name: as typed, for example ``make molds``.
        usage: names of the options.
        description: one sentence.
        help: the options, what is written, exit statuses; a function where tables name the choices.
        defaults: every option with its default.
    """

    name: str
    usage: str
    description: str
    help: str | Callable[[], str]
    defaults: Mapping[str, str]

    def run(self, argv: Sequence[str] | None, act: Callable[[dict[str, str], Interrupts], int]) -> int:
        """Parse the options, act, and report errors in one line; return the exit status.

        Args:
            argv: options, by default those of the process.
            act: takes the options and the interrupts; returns the exit status.
        """
        try:
            epilog = self.help if isinstance(self.help, str) else self.help()
        except EndcapError as error:  # a row of a table that cannot be read
            LOG.error(f"{self.name}: {error}")
            return 2
        parser = argparse.ArgumentParser(
            prog=program(self.name),
            usage=f"{program(self.name)} {self.usage}",
            description=self.description,
            epilog=epilog,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        parser.add_argument("options", nargs="*", metavar="NAME=VALUE", help=argparse.SUPPRESS)
        parser.add_argument(FROM_MAKE, action="store_true", dest="from_make", help=argparse.SUPPRESS)
        arguments, unknown = parser.parse_known_args(argv)
        words = [*arguments.options, *unknown]
        if arguments.from_make:
            words += make_variables(os.environ.get("MAKEFLAGS", ""))
        _utf8_names()
        interrupts = Interrupts()
        with interrupts.handling():
            try:
                return self._status(words, act, interrupts)
            except (Exception, KeyboardInterrupt):
                if interrupts.signal is None:
                    raise
                LOG.error(f"{self.name}: {ending_words(interrupts.signal)}; nothing was left behind")
                _end_with_status()
                return 128 + interrupts.signal

    def _status(
        self, words: Sequence[str], act: Callable[[dict[str, str], Interrupts], int], interrupts: Interrupts
    ) -> int:
        """Act, and report errors of the user in one line; return the exit status."""
        try:
            with named_as_typed():
                options = parse_options(words, self.defaults)
                if "exports" in options:
                    options["exports"] = str(typed_folder(options["exports"]))
                return act(options, interrupts)
        except ChecksFailedError as error:
            for line in error.lines:
                LOG.error(f"{self.name}: check failed: {line}")
            LOG.error(f"{self.name}: {error}")
            return 1
        except EndcapError as error:
            interrupts.raise_swallowed()  # the signal may have ended a worker or closed a file
            LOG.error(f"{self.name}: {error}")
            return 2


def _utf8_names() -> None:
    """Have libraries read names of files as UTF-8 wherever Python does.

    Under LC_ALL=C pymeshlab, in a folder with an umlaut, would find none of its filters.
    """
    if sys.flags.utf8_mode:
        with suppress(locale.Error):  # a system without this locale
            locale.setlocale(locale.LC_CTYPE, "C.UTF-8")


def _end_with_status() -> None:
    """Have ``python -m`` end with the status that is returned, not by SIGINT.

    Where the signal came in code given as text, as of a data class while its module is imported, CPython takes it for
    unhandled for good; the next such code resets that (run_eval_code_obj of its pythonrun.c).
    """
    exec("")


def ending_words(number: int) -> str:
    """Text on the signal that ended a command: ``interrupted``, ``ended by SIGTERM``.

    Args:
        number: of the signal.
    """
    return "interrupted" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}"


def parse_variant(options: Mapping[str, str]) -> Variant:
    """Variant of a command's options.

    Args:
        options: by name, as typed.

    Raises:
        ParameterError: a value that is no number or outside the feasible region, or an unknown silicone or robot.
    """
    clearance = parse_length("joint_clearance", options["joint_clearance"])
    material = chosen("material", options["material"], silicones(), "cad/materials.csv")
    robot = chosen("robot", options["robot"], robot_sides(), "cad/robot_sides.csv")
    with named_as_typed():
        return Variant(MoldLayout(parse_design(options), clearance, material), robot)
