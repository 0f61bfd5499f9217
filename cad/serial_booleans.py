"""Limit the CAD kernel's booleans to one thread, in every process that imports this module.

build123d requests that OCCT run every boolean on all cores. OCCT 7.9 then occasionally returns an invalid solid: the
interface of D=100 T=8 cut to its flange was invalid in 3 of 370 runs on two busy cores, and ``make molds`` failed; on
one thread it was invalid in none of 900, and no slower. build123d has no setting for it, so that this module replaces
the method.
"""

from __future__ import annotations

from OCP.BRepAlgoAPI import BRepAlgoAPI_Algo


def _on_one_thread(operation: BRepAlgoAPI_Algo, wanted: bool) -> None:
    """Replacement of ``SetRunParallel`` that does nothing: one thread is the kernel's default."""


BRepAlgoAPI_Algo.SetRunParallel = _on_one_thread
