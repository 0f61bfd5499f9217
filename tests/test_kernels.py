"""Compiled kernels have one signature each.

numba numbers the cache files of a kernel's signatures in the order in which they come. Two processes that compile two
signatures of one kernel at the same time can swap their files: the next process then runs the code of one array layout
on another, and the numbers are wrong without a word (shown by delaying one of the writes). With one signature there is
nothing to swap.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

WORK = """
import sys
from numba.core.dispatcher import Dispatcher
{code}
for name, module in list(sys.modules.items()):
    for kernel in vars(module).values() if name.startswith("sensing") else ():
        if isinstance(kernel, Dispatcher) and len(kernel.signatures) > 1:
            print(name, kernel.py_func.__name__, kernel.signatures)
"""
MECHANICS = """
from cad.materials import silicone
from sensing.simulator.geometry import shell_geometry
from sensing.simulator.indenter import Indenter
from sensing.simulator.levels import Scene, Simulator
from sensing.simulator.press import Target
for level, law in ((1, silicone().neo_hooke()), (2, silicone().yeoh())):
    simulator = Simulator(shell_geometry(130, 8), law, "draft", level=level)
    for kind in ("plane", "sphere"):
        scene = Scene(Indenter(tilt_deg=20, kind=kind), friction=0.5)
        for state in simulator.follow(scene, [Target(normal_n=3), Target(normal_n=4, shift_mm=(0.2, 0.1))]):
            simulator.markers(state, azimuth_deg=45)
"""
PICTURES = """
import numpy as np
from cad.params import EndcapParams
from sensing.methods import METHODS, field_method
from sensing.records import Frame
from sensing.simulator.render import DomeRenderer
renderer = DomeRenderer(EndcapParams(130, 8))
first, second = renderer.render(), renderer.render(frame=1)
for image in (first.image_bgr, np.ascontiguousarray(first.image_bgr[:, :, 1])):
    for name in METHODS:
        method = field_method(name, Frame(0.0, 0, "test", image=image))
        for number in (1, 2):
            method.update(Frame(number / 30, number, "test", image=np.roll(image, 2 * number, axis=1)))
"""


@pytest.mark.parametrize("code", [MECHANICS, PICTURES], ids=["mechanics", "pictures"])
def test_every_kernel_has_one_signature(code: str) -> None:
    root = Path(__file__).resolve().parent.parent
    run = subprocess.run([sys.executable, "-c", WORK.format(code=code)], capture_output=True, text=True, cwd=root)
    assert run.returncode == 0, run.stderr
    assert run.stdout == ""
