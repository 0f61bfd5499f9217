"""Numbers as people type them: plain decimals in the digits 0 to 9 (standard library only: the bottom layer).

Python reads more as a number: ``1_30``, ``1e2``, ``nan``, the digits of other scripts. Where someone typed one of these
for a size, a typing error would become a part.
"""

from __future__ import annotations

import math
import re

from cad.errors import ParameterError, printable

_FORM = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)")
_STORED = re.compile(_FORM.pattern + r"([eE][+-]?[0-9]+)?")
_WHOLE = re.compile(r"[+-]?[0-9]{1,18}")  # more digits count nothing, and Python refuses thousands of them
_LONGEST = 40  # characters of a text that a message repeats


def is_plain(text: str) -> bool:
    """Whether a text is a plain decimal number."""
    return _FORM.fullmatch(text) is not None


def plain_number(text: str) -> float:
    """Read a plain decimal number.

    Raises:
        ParameterError: another form.
    """
    if not is_plain(text) or not math.isfinite(float(text)):
        raise ParameterError(f"{brief(text)} is not a plain decimal number: write it like 130 or 8.5, without a unit")
    return float(text)


def whole_number(text: str) -> int:
    """Read a whole number.

    Raises:
        ParameterError: another form.
    """
    if _WHOLE.fullmatch(text) is None:
        raise ParameterError(f"{brief(text)} is not a whole number: write it in the digits 0 to 9, like 30")
    return int(text)


def stored_number(text: str | None) -> float:
    """Read a number as programs write it to tables: also with an exponent, and with blanks around it.

    Raises:
        ParameterError: another form, infinity, or nothing at all.
    """
    word = (text or "").strip(" ")
    if _STORED.fullmatch(word) is None or not math.isfinite(float(word)):
        raise ParameterError(f"{brief(word) or 'nothing'} is not a finite decimal number, such as 8.5 or -1.2e-05")
    return float(word)


def brief(text: str) -> str:
    """A text as a message repeats it: in one line, and of a long one the beginning and how long it is."""
    return printable(text if len(text) <= _LONGEST else f"{text[:_LONGEST]}... ({len(text)} characters)")


def plain(number: float) -> str:
    """A number in the fewest digits that read back as the same number."""
    short = f"{number:g}"
    return short if float(short) == number else repr(number)
