"""Top-level package: the command ``endcap`` and its Python interface. Importing it loads the standard library only.

from endcap import DataSet, Endcap, Simulator

endcap = Endcap(130, 8)
endcap.shell, endcap.shell.cadquery                    # a solid for build123d, and the same for CadQuery
endcap.export("out")                                   # what `endcap molds 130 8 exports=out` writes
endcap.study()["silicone_g"].value                           # g; all figures of `endcap study 130 8`
state = Simulator(endcap).press(20, tilt_deg=30)       # state.force_n, state.torque_nm, state.depth_mm
frames = DataSet("exports/data")                       # len(frames), frames[0].wrench, frames.torch()
with endcap.live("0") as running:                      # camera 0
    for wrench in running.stream(): ...
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from endcap.data import DataSet as DataSet
    from endcap.endcap import Endcap as Endcap
    from endcap.simulator import Simulator as Simulator

_HOME = {"DataSet": "endcap.data", "Endcap": "endcap.endcap", "Simulator": "endcap.simulator"}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}: it has {', '.join(_HOME)}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
