"""What the `make` commands of fab share: NAME=VALUE words, one line for an error, exit statuses, Ctrl-C."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from cad.errors import EndcapError, ParameterError
from cad.params import EndcapParams
from fab.checks.check import ChecksFailedError

EXPORTS = str(Path(__file__).resolve().parent.parent / "exports")


class Interrupts:
    """Ctrl-C, remembered: out of a library's import or a worker's end it may come as another error, or not at all."""

    def __init__(self) -> None:
        self.came = False

    @contextmanager
    def heard(self) -> Iterator[None]:
        """Listen inside this context."""
        before = signal.signal(signal.SIGINT, self._hear)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)

    def raise_swallowed(self) -> None:
        """Raise KeyboardInterrupt where one came and was swallowed by a guard round some optional import."""
        if self.came:
            raise KeyboardInterrupt

    def _hear(self, *_: object) -> None:
        self.came = True
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
            act: takes the options and what has been heard of Ctrl-C; returns the exit status.
        """
        parser = argparse.ArgumentParser(
            prog=self.name,
            usage=f"{self.name} {self.usage}",
            description=self.description,
            epilog=self.help,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        parser.add_argument("options", nargs="*", metavar="NAME=VALUE", help=argparse.SUPPRESS)
        arguments, unknown = parser.parse_known_args(argv)
        interrupts = Interrupts()
        with interrupts.heard():
            try:
                return act(parse_options([*arguments.options, *unknown], self.defaults), interrupts)
            except ChecksFailedError as error:
                for line in error.lines:
                    print(f"{self.name}: check failed: {line}", file=sys.stderr)
                print(f"{self.name}: {error}", file=sys.stderr)
                return 1
            except EndcapError as error:
                print(f"{self.name}: {error}", file=sys.stderr)
                return 2
            except (Exception, KeyboardInterrupt):
                if not interrupts.came:
                    raise
                print(f"{self.name}: interrupted; nothing was left behind", file=sys.stderr)
                return 130


def parse_options(words: Sequence[str], defaults: Mapping[str, str]) -> dict[str, str]:
    """Read NAME=VALUE words over the defaults.

    Raises:
        ParameterError: an unknown name, or a word of another form.
    """
    options = dict(defaults)
    for word in words:
        name, equals, value = word.partition("=")
        if not equals or name not in defaults or not value:
            raise ParameterError(
                f"{word!r} is not an option: give {', '.join(f'{n}=...' for n in defaults)}", name=name
            )
        options[name] = value
    return options


def parse_length(name: str, text: str) -> float:
    """Read a length in millimetres.

    Raises:
        ParameterError: not a number.
    """
    try:
        return float(text)
    except ValueError:
        raise ParameterError(
            f"{name}={text} is not a number: give millimetres without a unit, for example D=130 T=8",
            name=name,
            value=text,
        ) from None


def parse_design(options: Mapping[str, str]) -> EndcapParams:
    """The two numbers.

    Raises:
        ParameterError: not numbers, or outside the feasible region.
    """
    return EndcapParams(parse_length("D", options["D"]), parse_length("T", options["T"]))
