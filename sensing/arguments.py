"""Types of command-line options; argparse prints the reason of a refusal unchanged."""

from __future__ import annotations

import argparse

from cad.design_arguments import number
from cad.errors import FileError, ParameterError
from cad.materials import silicones
from cad.options import chosen
from cad.plain_numbers import brief, stored_number, whole_number

# number, too: an option of a design is of that type
__all__ = ["number", "pair", "port", "refuse_unused", "scientific", "silicone_name", "whole"]
MOST_PORT = 65535


def whole(text: str) -> int:
    """A whole number in the digits 0 to 9.

    Raises:
        argparse.ArgumentTypeError: another form.
    """
    try:
        return whole_number(text)
    except ParameterError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def port(text: str) -> int:
    """A TCP or UDP port, 0 to 65535; 0 lets the system choose.

    Raises:
        argparse.ArgumentTypeError: another form, or outside.
    """
    value = whole(text)
    if not 0 <= value <= MOST_PORT:
        raise argparse.ArgumentTypeError(f"port {value} outside 0..{MOST_PORT}: give 0 for any that is free")
    return value


def scientific(text: str) -> float:
    """A decimal number that may have an exponent, for an option as small as a tolerance.

    Raises:
        argparse.ArgumentTypeError: another form.
    """
    try:
        return stored_number(text)
    except ParameterError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def silicone_name(text: str) -> str:
    """A silicone as cad/materials.csv writes its name; upper and lower case count as one.

    A name that is not there stays as it is: whoever looks it up refuses it.

    Raises:
        argparse.ArgumentTypeError: the table cannot be read.
    """
    try:
        return chosen("silicone", text, silicones(), "cad/materials.csv")
    except ParameterError:
        return text
    except FileError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def pair(text: str) -> tuple[int, int]:
    """Two whole numbers over zero with an x between them.

    Raises:
        argparse.ArgumentTypeError: another form.
    """
    words = text.lower().split("x")
    try:
        first, second = (whole_number(word) for word in words)
    except ValueError:
        first = second = 0
    if min(first, second) < 1:
        raise argparse.ArgumentTypeError(f"{brief(text)} is not two whole numbers over zero: write it like 30x30")
    return first, second


def refuse_unused(
    parser: argparse.ArgumentParser, options: argparse.Namespace, flags: str, what: str, reason: str
) -> None:
    """Refuse the first of some options that was given and would do nothing.

    Args:
        parser: that read the options; what differs from its defaults was given.
        options: all of them.
        flags: those that would do nothing, as a user types them, with spaces between.
        what: beside what they do nothing.
        reason: why, and what to do.

    Raises:
        ParameterError: one was given.
    """
    for flag in flags.split():
        name = flag.strip("-").replace("-", "_").lower()
        if getattr(options, name) != parser.get_default(name):
            raise ParameterError(f"{what} with {flag}: {reason}", name=flag)
