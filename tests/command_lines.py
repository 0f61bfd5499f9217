"""Commands as text against the parsers of their modules: nothing of a module runs beyond its parsing."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from unittest.mock import patch

from endcap.command import SUBCOMMANDS

ENDCAP_PROGRAMS = ("endcap", ".venv/bin/endcap")
PYTHON_PROGRAMS = ("python", "python3")  # under any path
WITHOUT_PARSER = ("sensing.live.web.process",)  # started by live alone, with numbers of sockets


class Parsed(BaseException):
    """A parser took all words; no ``except Exception`` of a module catches it."""


class Refused(BaseException):
    """A parser refuses the words."""


def refusal(command: str) -> str:
    """What the parser of a command's module says against it; empty for a good one, or one of another program.

    Args:
        command: as a shell takes it: ``python -m sensing.live --camera 0`` or ``endcap live --camera 0``.
    """
    words = shlex.split(command)
    module, arguments = "", []
    if words[0] in ENDCAP_PROGRAMS and words[1:] and words[1] in SUBCOMMANDS:
        module, arguments = SUBCOMMANDS[words[1]].module, [*SUBCOMMANDS[words[1]].arguments, *words[2:]]
    elif Path(words[0]).name in PYTHON_PROGRAMS and words[1:2] == ["-m"]:
        module, arguments = words[2], words[3:]
    return _refusal(module, arguments) if module.split(".")[0] == "sensing" and module not in WITHOUT_PARSER else ""


def parser_of(module: str) -> argparse.ArgumentParser | None:
    """The parser of a module's command line; none where it has one of its own making.

    Args:
        module: of ``python -m``.
    """
    made: list[argparse.ArgumentParser] = []

    def stop(parser: argparse.ArgumentParser, *given: object, **named: object) -> None:
        made.append(parser)
        raise Parsed

    with patch.object(argparse.ArgumentParser, "parse_args", stop):
        try:
            _main_of(module)([])
        except Parsed:
            return made[0]
        except SystemExit:
            return None
    return None


def _refusal(module: str, arguments: Sequence[str]) -> str:
    parse = argparse.ArgumentParser.parse_args

    def stop(parser: argparse.ArgumentParser, *given: object, **named: object) -> None:
        parse(parser, *given, **named)
        raise Parsed

    def refuse(parser: argparse.ArgumentParser, message: str) -> None:
        raise Refused(f"{parser.prog}: {message}")

    with (
        patch.object(argparse.ArgumentParser, "parse_args", stop),
        patch.object(argparse.ArgumentParser, "error", refuse),
    ):
        try:
            _main_of(module)(arguments)
        except Parsed:
            return ""
        except SystemExit as end:  # --help
            return "" if end.code in (0, None) else f"{module}: exit status {end.code}"
        except Refused as error:
            return str(error)
    return f"{module}: ended without parsing {' '.join(arguments)}"


def _main_of(module: str):
    """Of a package its command line, where that is a file of its own: importing ``__main__`` may start it."""
    places = [f"{module}.cli", f"{module}.__main__"] if find_spec(module).submodule_search_locations else [module]
    return import_module(next(place for place in places if find_spec(place))).main
