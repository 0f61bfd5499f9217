"""Booleans of the CAD kernel on one thread, for whoever imports this.

build123d asks OCCT to run every boolean on all cores. OCCT 7.9 then returns an invalid solid now and then: the
interface of D=100 T=8 cut to its flange came out invalid in 3 of 370 runs on two busy cores, and ``make molds`` was
refused; on one thread in none of 900, and no slower. build123d has no setting for it, so its request is not passed on.
"""

from __future__ import annotations

from OCP.BRepAlgoAPI import BRepAlgoAPI_Algo


def _on_one_thread(operation: BRepAlgoAPI_Algo, wanted: bool) -> None:
    """In place of ``SetRunParallel``: one thread is the kernel's default."""


BRepAlgoAPI_Algo.SetRunParallel = _on_one_thread
