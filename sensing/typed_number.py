"""A plain decimal number as the value of a command's option: one line says what was typed and what is accepted."""

from __future__ import annotations

import argparse

from cad.errors import ParameterError
from cad.plain_numbers import plain_number


def typed_number(text: str) -> float:
    """The number; for ``type=`` of argparse, which would hide the reason of any other error.

    Raises:
        argparse.ArgumentTypeError: another form.
    """
    try:
        return plain_number(text)
    except ParameterError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
