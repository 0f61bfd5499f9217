"""What is compiled is loaded before the first frame: in a process that has done nothing else."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

WORK = """
from sensing.live.core.warm_up import warm_up
warm_up(lambda text: None)
from sensing.tracking import motion_kernels as fits, patch_kernels, search_kernels
for kernel in (fits.similarity, fits.fitted_change, patch_kernels.align_windows, search_kernels.best_rigid_motion):
    print(kernel.py_func.__name__, len(kernel.signatures))
"""


def test_the_tracker_and_the_fits_of_every_picture_are_loaded():
    root = Path(__file__).resolve().parents[3]
    run = subprocess.run([sys.executable, "-c", WORK], cwd=root, capture_output=True, text=True, check=True)
    said = dict(line.split() for line in run.stdout.splitlines())
    assert said == dict.fromkeys(("similarity", "fitted_change", "align_windows", "best_rigid_motion"), "1")
