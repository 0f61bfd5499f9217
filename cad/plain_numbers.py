"""Numbers as people type them: plain decimals in the digits 0 to 9 (standard library only: the bottom layer).

Python reads more as a number: ``1_30``, ``1e2``, ``nan``, the digits of other scripts. Where someone typed one of these
for a size, a typing error would become a part.
"""

from __future__ import annotations

import re

from cad.errors import ParameterError

_FORM = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)")


def is_plain(text: str) -> bool:
    """Whether a text is a plain decimal number."""
    return _FORM.fullmatch(text) is not None


def plain_number(text: str) -> float:
    """Read a plain decimal number.

    Raises:
        ParameterError: another form.
    """
    if not is_plain(text):
        raise ParameterError(f"{text} is not a plain decimal number: write it like 130 or 8.5, without a unit")
    return float(text)


def plain(number: float) -> str:
    """A number in the fewest digits that read back as the same number."""
    short = f"{number:g}"
    return short if float(short) == number else repr(number)
