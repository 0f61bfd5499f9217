"""Cases of one test of which the first stand for all in ``make test``; the others are run by ``make test-long``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def others_long(cases: Iterable[Any], count: int = 1, unpack: bool = False) -> list[Any]:
    """Cases for ``parametrize``.

    Args:
        cases: values of one argument; with ``unpack`` tuples, values of several.
        count: how many of the first are no long tests.
    """
    values = [case if unpack else (case,) for case in cases]
    return [pytest.param(*each, marks=[pytest.mark.long] * (number >= count)) for number, each in enumerate(values)]
