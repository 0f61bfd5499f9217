"""Compiled kernels have one signature each, and give the same bits compiled or loaded.

numba numbers the cache files of a kernel's signatures in the order in which they come. Two processes that compile two
signatures of one kernel at the same time can swap their files: the next process then runs the code of one array layout
on another, and the numbers are wrong without a word (shown by delaying one of the writes). With one signature there is
nothing to swap.

And a run on a fresh checkout, which compiles, must be replayed to the bit by one that loads the compiled code.

numba keeps compiled code as long as the file of its function does not change. So what is compiled into it lies there.
"""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

WORK = """
import hashlib
import sys
import numpy as np
from numba.core.dispatcher import Dispatcher
def show(values):
    print(hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest())
{code}
for name, module in list(sys.modules.items()):
    for kernel in vars(module).values() if name.startswith("sensing") else ():
        if isinstance(kernel, Dispatcher) and kernel._cache.cache_path and len(kernel.signatures) > 1:
            print(name, kernel.py_func.__name__, kernel.signatures)
"""
MECHANICS = """
from cad.materials import silicone
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Target
from sensing.simulator.scene import Scene
for level, law in ((1, silicone().neo_hooke()), (2, silicone().yeoh())):
    simulator = Simulator(shell_geometry(130, 8), law, "draft", level=level)
    for kind in ("plane", "sphere", "rough"):
        scene = Scene(Indenter(tilt_deg=20, kind=kind), friction=0.5)
        for state in simulator.follow(scene, [Target(normal_n=3), Target(normal_n=4, shift_mm=(0.2, 0.1))]):
            show(simulator.markers(state, azimuth_deg=45))
"""
PICTURES = """
from cad.params import EndcapParams
from sensing.tracking.methods import METHODS, field_method
from sensing.records import Frame
from sensing.simulator.render.dome import DomeRenderer
renderer = DomeRenderer(EndcapParams(130, 8))
first, second = renderer.render(), renderer.render(frame=1)
for image in (first.image_bgr, np.ascontiguousarray(first.image_bgr[:, :, 1])):
    for name in METHODS:
        method = field_method(name, Frame(0.0, 0, "test", image=image))
        for number in (1, 2):
            frame = Frame(number / 30, number, "test", image=np.roll(image, 9 * number, axis=1))
            show(method.update(frame).channels)
from cad.materials import silicone
from sensing.tracking.model_input import model_input
from sensing.tracking.mounting import common_motion
from sensing.tracking.own_weight import OwnWeight
from sensing.wrench.filter import WrenchFilter
from sensing.wrench.model import load_wrench_model
model, smooth = load_wrench_model(EndcapParams(130, 8)), WrenchFilter()
seen = model_input(Frame(0.0, 0, "test", image=first.image_bgr), model.shape, model.design)
for number in (1, 2, 3):
    frame = Frame(number / 30, number, "test", image=np.roll(first.image_bgr, number, axis=1))
    tracks = seen.track(seen.decode(frame), frame.time_s)
    motion, weight = common_motion(tracks), OwnWeight(seen, EndcapParams(130, 8), silicone())
    weight.motion(tracks)
    show([*motion.shift_px, motion.turn_rad, motion.scale, motion.residual_px, weight.left_px, *weight.change_g])
    estimate = model.estimate(seen.field(tracks))
    for answer in (estimate, smooth.update(estimate), smooth.at(number / 30 + 0.01)):
        show(np.concatenate([answer.force_n, answer.torque_nm, answer.covariance.ravel()]))
"""
ROBOT = """
sys.path.insert(0, "tests")
from standing_robot import feed, standing_samples
from sensing.robot.estimator import RobotEstimator
from sensing.tensegrity.robot_file import load_robot
robot = load_robot()
estimator = RobotEstimator(robot)
feed(estimator, standing_samples(robot, 2.0)[1])
for at_s in (estimator.newest_s, estimator.newest_s + 0.02):
    for bar in estimator.state(at=at_s).bars:
        show(bar.T_world_bar)
        show(bar.covariance)
"""
# What kernels take from other files: whoever changes one of these changes the kernel's file, too.
TAKEN = {
    "sensing/robot/measurement_kernels.py": {"times_vector", "turned_by"},
    "sensing/simulator/contact/kernels.py": {"BodyKind"},
    "sensing/tracking/search_kernels.py": {"MARGIN"},
}


def test_what_is_compiled_into_a_kernel_lies_in_its_file() -> None:
    root = Path(__file__).resolve().parent.parent
    sources = {path.relative_to(root).as_posix(): path.read_text("utf-8") for path in root.glob("sensing/**/*.py")}
    found = {name: taken_from_other_files(source) for name, source in sources.items() if "njit" in source}
    assert len(found) > 15 and {name: names for name, names in found.items() if names} == TAKEN


def taken_from_other_files(source: str) -> set[str]:
    """Names that compiled functions of a file use, and that it imports from this project."""
    body = ast.parse(source).body
    imports = [node for node in body if isinstance(node, ast.ImportFrom)]
    own = [node for node in imports if (node.module or "").split(".")[0] in ("cad", "fab", "sensing")]
    imported = {alias.asname or alias.name for node in own for alias in node.names}
    functions = [node for node in body if isinstance(node, ast.FunctionDef)]
    kernels = [node for node in functions if any("njit" in ast.unparse(each) for each in node.decorator_list)]
    lines = [line for kernel in kernels for line in kernel.body]
    return imported & {node.id for line in lines for node in ast.walk(line) if isinstance(node, ast.Name)}


@pytest.mark.long  # compiles nearly everything anew
@pytest.mark.parametrize("code", [PICTURES, MECHANICS, ROBOT], ids=["pictures", "mechanics", "robot"])
def test_kernels_have_one_signature_and_the_same_bits_compiled_or_loaded(code: str, tmp_path: Path) -> None:
    compiled, loaded = run(code, tmp_path), run(code, tmp_path)
    share_with_other_tests(tmp_path)
    assert any(tmp_path.rglob("*.nbc"))
    assert len(compiled) >= 8
    assert compiled == loaded
    assert [line for line in compiled if line.startswith("sensing")] == []


def share_with_other_tests(cache: Path) -> None:
    """Put compiled kernels where the other tests look for them, each file whole, an index after what it names."""
    shared = Path(os.environ.get("NUMBA_CACHE_DIR", cache))  # itself, where pytest keeps no cache
    for path in sorted(cache.rglob("*.nb[ic]"), key=lambda path: path.suffix):
        target = shared / path.relative_to(cache)
        target.parent.mkdir(parents=True, exist_ok=True)
        part = target.with_name(f"{target.name}.{os.getpid()}")
        shutil.copy(path, part)
        part.replace(target)


def run(code: str, cache: Path) -> list[str]:
    """Digests of what was computed, and kernels of several signatures."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    root = Path(__file__).resolve().parent.parent
    command = [sys.executable, "-c", WORK.format(code=code)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=root, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()
