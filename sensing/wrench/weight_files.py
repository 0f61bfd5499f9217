"""Where the weights of a design lie: those that ship, and those that `sensing.train --design` wrote for this user."""

from __future__ import annotations

import os
import re
from pathlib import Path

from cad.lens import RELEASED_MODULE, camera_module
from cad.materials import DEFAULT_SILICONE
from cad.params import EndcapParams
from cad.plain_numbers import plain

SHIPPED = Path(__file__).parents[1] / "weights"


def weights_folder() -> Path:
    """The user's folder of weights: ``endcap-toolkit/weights`` in XDG_DATA_HOME or ~/.local/share."""
    data = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(data) / "endcap-toolkit" / "weights"


def weights_name(params: EndcapParams, silicone: str = DEFAULT_SILICONE) -> str:
    """File name of a design's weights: ``D180_T10.safetensors``, ``D180_T10_Dragon-Skin-30.safetensors``.

    Another camera module than the released one is part of the name, too.

    Args:
        params: the design. silicone: row of cad/materials.csv.
    """
    pairs = ((silicone, DEFAULT_SILICONE), (camera_module().name, RELEASED_MODULE))
    other = "".join("_" + re.sub(r"[^A-Za-z0-9.-]+", "-", name) for name, usual in pairs if name != usual)
    return f"{params.label}{other}.safetensors"


def find_weights(params: EndcapParams, silicone: str = DEFAULT_SILICONE) -> Path | None:
    """The file that ships for a design, else the user's own; None where there is neither.

    Args:
        params: the design. silicone: row of cad/materials.csv.
    """
    name = weights_name(params, silicone)
    places = (SHIPPED / f"default_{name}", weights_folder() / name)
    return next((path for path in places if path.is_file()), None)


def command_for(params: EndcapParams, silicone: str = DEFAULT_SILICONE) -> str:
    """The command that makes the weights of a design.

    Args:
        params: the design. silicone: row of cad/materials.csv.
    """
    other = "" if silicone == DEFAULT_SILICONE else f" --silicone '{silicone}'"
    return f"python -m sensing.train --design {plain(params.diameter_mm)} {plain(params.wall_mm)}{other}"
