"""The camera module that the environment names, in file names and in messages."""

from __future__ import annotations

from cad.data_table import file_name
from cad.identity import RELEASED, Identity, differing
from cad.lens import VARIABLE, other_module
from cad.materials import DEFAULT_SILICONE
from cad.params import EndcapParams

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


def endcap_label(params: EndcapParams, silicone: str = DEFAULT_SILICONE) -> str:
    """Name of an endcap, for files and folders of sensing: ``D180_T10``, ``D180_T10_Dragon-Skin-30``.

    Another camera module than the released one is part of the name, too.

    Args:
        params: the design.
        silicone: row of cad/materials.csv.
    """
    names = ("" if silicone == DEFAULT_SILICONE else silicone, other_module())
    return params.label + "".join(f"_{file_name(name)}" for name in names if name)
