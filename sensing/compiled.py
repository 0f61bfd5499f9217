"""How the field's inner loops are compiled (numba, on first use, cached on disk).

Sums may be reordered (fastmath), so the bits of a result depend on how a loop was compiled. A helper that is not
inlined has a compiled form of its own besides those in its callers' cache files, and which one runs would depend on
whether this process compiled it or loaded it: a run on a fresh checkout and its replay would differ in the last bits.
So helpers are always inlined; tests/test_kernels.py compares a process that compiles with one that loads.
"""

from __future__ import annotations

from typing import Any

KERNEL: dict[str, Any] = {"cache": True, "nogil": True, "fastmath": True, "error_model": "numpy"}
SHORT: dict[str, Any] = KERNEL | {"nogil": False}  # microseconds: to hand the lock over and wait for it costs more
HELPER: dict[str, Any] = KERNEL | {"forceinline": True, "cache": False}  # lies in its callers' files
KEEPS_NAN = {"reassoc", "contract", "arcp", "nsz"}  # fastmath flags under which NaN keeps its meaning
