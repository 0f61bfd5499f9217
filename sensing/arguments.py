"""Types of command-line options: what they refuse, argparse prints as they say it."""

from __future__ import annotations

import argparse

from cad.errors import ParameterError
from cad.plain_numbers import plain_number


def number(text: str) -> float:
    """A plain decimal number.

    Raises:
        argparse.ArgumentTypeError: another form; argparse would name the function where a ``ValueError`` is raised.
    """
    try:
        return plain_number(text)
    except ParameterError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
