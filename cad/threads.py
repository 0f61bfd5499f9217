"""Threads of linear algebra: one for a command of ours (standard library only).

Its matrices are small. On a busy computer the threads of one product wait for one another: a press of 2 s of processor
time took 28 s of it, and 278 s instead of 24 s on the clock (two cores, twenty-five processes at work).
"""

from __future__ import annotations

import os

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def one_thread() -> None:
    """One thread in this process and those it starts, unless the user's environment says otherwise.

    Acts on libraries that are loaded later: call it before NumPy is imported.
    """
    if not any(name in os.environ for name in VARIABLES):
        os.environ.update(dict.fromkeys(VARIABLES, "1"))
