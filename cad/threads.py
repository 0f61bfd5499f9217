"""Number of threads of linear algebra: one in the project's commands (standard library only).

The matrices are small. On a busy computer the threads of one product wait for one another: a press that needs 2 s of
processor time took 28 s of it, and 278 s instead of 24 s of wall clock (two cores, twenty-five active processes).
"""

from __future__ import annotations

import os

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # environment


def one_thread() -> None:
    """Set one thread for this process and those that it starts, unless the user's environment sets another number.

    It affects only libraries that are loaded later; call it before NumPy is imported.
    """
    if not any(name in os.environ for name in VARIABLES):
        os.environ.update(dict.fromkeys(VARIABLES, "1"))
