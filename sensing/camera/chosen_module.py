"""Words on the camera module that the environment names, where a file was made with another one."""

from __future__ import annotations

from cad.identity import RELEASED, Identity, differing
from cad.lens import VARIABLE

OTHER_MODULE = (
    f"start with the module that it was made with ({VARIABLE}=NAME of cad/cameras.csv; for {RELEASED!r} without "
    f"{VARIABLE}), or "
)


def other_module_words(found: Identity | None, wanted: Identity | None) -> str:
    """Begin of a remedy where two endcaps differ in the camera: one shell may lack the variable; else empty.

    Args:
        found: identity of a file; None: nothing is compared.
        wanted: identity of the endcap in use; None: nothing is compared.
    """
    if found is None or wanted is None or "camera" not in differing(found, wanted, ("camera",)):
        return ""
    return OTHER_MODULE
