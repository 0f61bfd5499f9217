"""What is compiled is loaded before the first frame: in a process that has done nothing else.

Else a first run on a computer compiles for seconds while its cameras run, and loses those pictures.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

WORK = """
import sys
from numba.core.dispatcher import Dispatcher
from cad.params import EndcapParams
from sensing.live.core.model import load_model
from sensing.live.core.warm_up import warm_up
warm_up(lambda text: None)
load_model("default", EndcapParams(130, 8))
for name, module in list(sys.modules.items()):
    for kernel in vars(module).values() if name.startswith("sensing") else ():
        if isinstance(kernel, Dispatcher) and kernel._cache.cache_path:
            print(kernel.py_func.__module__, kernel.py_func.__name__, len(kernel.signatures))
"""
OTHERS = {  # no part of a run of the default model
    "sensing.tracking.field.kernels add_stretch_residual",  # of the field of the picture plane
    "sensing.wrench.kernels estimate_many",  # of many fields at once, as evaluations have them
    "sensing.wrench.kernels contact_angles",
}


def test_all_that_a_run_needs_is_loaded():
    root = Path(__file__).resolve().parents[3]
    run = subprocess.run([sys.executable, "-c", WORK], cwd=root, capture_output=True, text=True, check=True)
    loaded = {kernel: int(count) for kernel, count in (line.rsplit(" ", 1) for line in run.stdout.splitlines())}
    assert len(loaded) > 15 and "sensing.wrench.plane_kernels plane_solution" in loaded
    assert {kernel for kernel, count in loaded.items() if not count} == OTHERS
