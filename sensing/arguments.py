"""Types of command-line options: what they refuse, argparse prints as they say it."""

from __future__ import annotations

import argparse

from cad.design_arguments import number
from cad.errors import ParameterError
from cad.plain_numbers import brief, stored_number, whole_number

__all__ = ["number", "pair", "scientific", "whole"]  # number: an option of a design is of that type, too


def whole(text: str) -> int:
    """A whole number in the digits 0 to 9.

    Raises:
        argparse.ArgumentTypeError: another form.
    """
    try:
        return whole_number(text)
    except ParameterError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def scientific(text: str) -> float:
    """A decimal number that may have an exponent, for an option as small as a tolerance.

    Raises:
        argparse.ArgumentTypeError: another form.
    """
    try:
        return stored_number(text)
    except ParameterError as error:
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
