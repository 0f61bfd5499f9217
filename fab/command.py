"""What the `make` commands of fab share: NAME=VALUE words, one line for an error, exit statuses, Ctrl-C and SIGTERM."""

from __future__ import annotations

import argparse
import difflib
import os
import re
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from cad import feasible
from cad.errors import EndcapError, ParameterError
from cad.extras import program
from cad.materials import DEFAULT_SILICONE, silicone
from cad.messages import LOG
from cad.mold_layout import JOINT_CLEARANCE_MM, MoldLayout
from cad.params import EndcapParams
from cad.plain_numbers import is_plain, plain
from fab.checks.check import ChecksFailedError
from fab.exports.whole_folder import ENDING_SIGNALS
from fab.variant import Variant

_ROOT = Path(__file__).resolve().parent.parent
# In a checkout its own folder; where the wheel is installed, one in the current folder.
EXPORTS = str(_ROOT / "exports") if (_ROOT / "pyproject.toml").exists() else "exports"
FROM_MAKE = "--make-variables"  # the Makefile's way to hand over its variables as they were typed
MAKES_OWN = ("PYTHON", "VENV")  # variables of the Makefile itself
DESIGN_DEFAULTS = {"D": "130", "T": "8"}
VARIANT_DEFAULTS = {
    **DESIGN_DEFAULTS,
    "joint_clearance": f"{JOINT_CLEARANCE_MM:g}",
    "material": DEFAULT_SILICONE,
    "exports": EXPORTS,
}


class Interrupts:
    """Ctrl-C and SIGTERM, remembered: out of a library's import or a worker's end they may come as another error."""

    def __init__(self) -> None:
        self.signal: int | None = None

    @property
    def came(self) -> bool:
        """Whether one came."""
        return self.signal is not None

    @contextmanager
    def heard(self) -> Iterator[None]:
        """Listen inside this context."""
        before = {number: signal.signal(number, self._hear) for number in ENDING_SIGNALS}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def raise_swallowed(self) -> None:
        """Raise KeyboardInterrupt where one came and was swallowed by a guard round some optional import."""
        if self.came:
            raise KeyboardInterrupt

    def _hear(self, number: int, _: object) -> None:
        self.signal = number
        raise KeyboardInterrupt


@dataclass(frozen=True)
class Command:
    """One command.

    Attributes:
        name: as typed, for example ``make molds``.
        usage: names of the options.
        description: one sentence.
        help: the options, what is written, exit statuses.
        defaults: every option with its default.
    """

    name: str
    usage: str
    description: str
    help: str
    defaults: Mapping[str, str]

    def run(self, argv: Sequence[str] | None, act: Callable[[dict[str, str], Interrupts], int]) -> int:
        """Read the words, act, and turn errors into lines; returns the exit status.

        Args:
            argv: words, by default those of the process.
            act: takes the options and what has been heard of signals; returns the exit status.
        """
        parser = argparse.ArgumentParser(
            prog=program(self.name),
            usage=f"{program(self.name)} {self.usage}",
            description=self.description,
            epilog=self.help,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        parser.add_argument("options", nargs="*", metavar="NAME=VALUE", help=argparse.SUPPRESS)
        parser.add_argument(FROM_MAKE, action="store_true", dest="from_make", help=argparse.SUPPRESS)
        arguments, unknown = parser.parse_known_args(argv)
        words = [*arguments.options, *unknown]
        if arguments.from_make:
            words += make_variables(os.environ.get("MAKEFLAGS", ""))
        interrupts = Interrupts()
        with interrupts.heard():
            try:
                return self._status(words, act, interrupts)
            except (Exception, KeyboardInterrupt):
                if interrupts.signal is None:
                    raise
                LOG.error(f"{self.name}: {_ending(interrupts.signal)}; nothing was left behind")
                return 128 + interrupts.signal

    def _status(
        self, words: Sequence[str], act: Callable[[dict[str, str], Interrupts], int], interrupts: Interrupts
    ) -> int:
        """Act, and turn errors of the user's into lines."""
        try:
            return act(parse_options(words, self.defaults), interrupts)
        except ChecksFailedError as error:
            for line in error.lines:
                LOG.error(f"{self.name}: check failed: {line}")
            LOG.error(f"{self.name}: {error}")
            return 1
        except EndcapError as error:
            interrupts.raise_swallowed()  # a worker that ended, a file that closed: what came of the signal
            LOG.error(f"{self.name}: {error}")
            return 2


def _ending(number: int) -> str:
    return "interrupted" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}"


def make_variables(flags: str) -> list[str]:
    """NAME=VALUE words that were given to `make`, out of its MAKEFLAGS, less the Makefile's own.

    No shell reads them on this way, so a value may hold any character. Make puts a backslash before spaces and
    backslashes, and doubles dollar signs.
    """
    words = [match[0] for match in re.finditer(r"(?:\\.|\S)+", flags, re.DOTALL)]
    if "--" not in words:
        return []
    typed = []
    for word in reversed(words[words.index("--") + 1 :]):  # make lists the last first
        name, equals, value = word.partition("=")
        plain_name = name.rstrip(":")
        if plain_name not in MAKES_OWN:
            typed.append(plain_name + equals + re.sub(r"\\(.)", r"\1", value).replace("$$", "$"))
    return typed


def parse_options(words: Sequence[str], defaults: Mapping[str, str]) -> dict[str, str]:
    """Read NAME=VALUE words over the defaults.

    Raises:
        ParameterError: an unknown name, a word of another form or given twice, or only one of D and T.
    """
    given: dict[str, str] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals or name not in defaults or not value:
            raise ParameterError(f"{word!r} is not an option: {_hint(word, defaults)}", name=name)
        if name in given:
            raise ParameterError(f"{name} is given twice ({given[name]} and {value}): give it once", name=name)
        given[name] = value
    if {"D", "T"} <= set(defaults) and len({"D", "T"} & set(given)) == 1:
        _refuse_half_a_design(given)
    return {**defaults, **given}


def _hint(word: str, defaults: Mapping[str, str]) -> str:
    """What may have been meant."""
    name, equals, value = word.partition("=")
    known = {known.lower(): known for known in defaults}
    near = difflib.get_close_matches(name.lower(), known, n=1)
    if equals and value and near:
        return f"did you mean {known[near[0]]}={value}? Options are {', '.join(defaults)}"
    if is_plain(word) and "D" in defaults:
        return "name each number, for example D=150 T=8"
    return f"give {', '.join(f'{n}=...' for n in defaults)}"


def _refuse_half_a_design(given: Mapping[str, str]) -> None:
    """Refuse one number without the other, with the nearest pair that can be made."""
    usual_wall = float(DESIGN_DEFAULTS["T"])
    if "D" in given:
        diameter = parse_length("D", given["D"])
        low, high = feasible.wall_range_mm(diameter) if diameter > 0 else (1.0, 0.0)
        if not low <= high:
            EndcapParams(diameter, usual_wall)  # refused by its own message: no wall fits
        example = f"D={given['D']} T={plain(feasible.nearest_wall_mm(diameter, usual_wall))}"
        missing, name = "D={D} without T", "T"
    else:
        wall = parse_length("T", given["T"])
        ranges = {diameter: feasible.wall_range_mm(diameter) for diameter in (130.0, 200.0, 250.0)}
        fitting = next((diameter for diameter, (low, high) in ranges.items() if low <= wall <= high), None)
        example = f"D={plain(fitting)} T={given['T']}" if fitting else "D=130 T=8"
        missing, name = "T={T} without D", "D"
    raise ParameterError(
        f"{missing.format(**given)}: a design is two numbers, diameter and wall (6.5 mm to a fifth of the radius): "
        f"give both, for example {example}",
        name=name,
    )


def parse_length(name: str, text: str) -> float:
    """Read a length in millimetres: a plain decimal number in the digits 0 to 9.

    Raises:
        ParameterError: anything else that Python would read as a number too (``1_30``, ``1e2``, other scripts' digits).
    """
    if not is_plain(text):
        raise ParameterError(
            f"{name}={text} is not a number: give plain millimetres without a unit, for example D=130 T=8",
            name=name,
            value=text,
        )
    return float(text)


def parse_design(options: Mapping[str, str]) -> EndcapParams:
    """The two numbers.

    Raises:
        ParameterError: not numbers, or outside the feasible region.
    """
    return EndcapParams(parse_length("D", options["D"]), parse_length("T", options["T"]))


def parse_variant(options: Mapping[str, str]) -> Variant:
    """The two numbers, the joint clearance and the silicone.

    Raises:
        ParameterError: not numbers, outside the feasible region, or a silicone that is not in the table.
    """
    params = parse_design(options)
    layout = MoldLayout(params, parse_length("joint_clearance", options["joint_clearance"]))
    return Variant(layout, silicone(options["material"]).name)
