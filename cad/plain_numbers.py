"""Parser of typed numbers: plain decimals in the digits 0 to 9 (standard library only: the bottom layer).

Python also accepts ``1_30``, ``1e2``, ``nan`` and the digits of other scripts. As a size, each of these is probably a
typing error, which would become a wrong part.
"""

from __future__ import annotations

import math
import re

from cad.errors import ParameterError, printable

_FORM = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)")  # as typed
_STORED = re.compile(_FORM.pattern + r"([eE][+-]?[0-9]+)?")  # as in tables that programs write
_WHOLE = re.compile(r"[+-]?[0-9]{1,18}")  # more are never needed, and Python refuses thousands of digits
_LONGEST = 40  # most characters of a text that a message repeats in full


def is_plain(text: str) -> bool:
    """Whether a text is a plain decimal number."""
    return _FORM.fullmatch(text) is not None


def plain_number(text: str) -> float:
    """Read a plain decimal number.

    Raises:
        ParameterError: the text has another form.
    """
    if not is_plain(text) or not math.isfinite(float(text)):
        raise ParameterError(f"{brief(text)} is not a plain decimal number: write it like 130 or 8.5, without a unit")
    return float(text)


def whole_number(text: str) -> int:
    """Read a whole number of at most 18 digits.

    Raises:
        ParameterError: the text has another form.
    """
    if _WHOLE.fullmatch(text) is None:
        raise ParameterError(f"{brief(text)} is not a whole number: write it in the digits 0 to 9, like 30")
    return int(text)


def stored_number(text: str | None) -> float:
    """Read a number from a table that a program wrote: an exponent and surrounding blanks are accepted.

    Raises:
        ParameterError: the text has another form, is empty, or holds infinity.
    """
    word = (text or "").strip(" ")
    if _STORED.fullmatch(word) is None or not math.isfinite(float(word)):
        raise ParameterError(f"{brief(word) or 'nothing'} is not a finite decimal number, such as 8.5 or -1.2e-05")
    return float(word)


def brief(text: str) -> str:
    """A text for a message: on one line, and shortened to its beginning and its length where it is long."""
    return printable(text if len(text) <= _LONGEST else f"{text[:_LONGEST]}... ({len(text)} characters)")


def plain(number: float) -> str:
    """A number as text, with the fewest digits that read back as the same number."""
    short = f"{number:g}"
    return short if float(short) == number else repr(number)
