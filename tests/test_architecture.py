"""The arrows between layers, as an allow-list over the source, and in a fresh interpreter.

cad's bottom layer imports the standard library only; fab imports cad; sensing imports the bottom layer only and never
the CAD kernel; fab and sensing never meet. Inside sensing the packages follow the data, from camera to contact, each
with a list of those it may import; the simulator shares nothing with the estimator but camera and records.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
BOTTOM_NAMES = (
    "errors data_table extras plain_numbers scaling feasible params dots lens materials material_units silicone_kits "
    "identity typed_folder user_folders whole_file plugins messages threads pools options design_arguments pattern"
)
BOTTOM = {f"cad.{name}" for name in BOTTOM_NAMES.split()}
PLAIN = BOTTOM | {
    f"cad.{name}"
    for name in ("bought", "leak", "led_ring.parts", "led_ring.placement", "mold.layout", "part", "robot_sides")
}  # standard library only, too
SHARED = {
    f"sensing.{name}"
    for name in (
        "arguments",
        "code_digest",
        "compiled",
        "decode",
        "frames",
        "interpreter",
        "npz",
        "records",
        "records_labelled",
        "set_manifest",
    )
}
ARROWS: dict[str, set[str]] = {  # package of sensing -> packages of sensing that it may import; "" are the commands
    "camera": set(),
    "tensegrity": set(),  # description and samples of the robot, which simulator and estimator share
    "robot": {"tensegrity"},  # state of the robot from six wrenches, cables and inertial sensors
    "sources": set(),
    "simulator": {"camera", "tensegrity"},
    "robot.demo": {"simulator", "tensegrity"},  # the simulated robot; nothing else of robot knows the simulator
    "calibration": {"camera"},
    "tracking": {"camera"},
    "wrench": {"camera", "tracking"},
    "recording": {"tracking"},
    "doctor": {"calibration", "camera", "sources"},
    "learning": {"calibration", "camera", "tracking", "wrench"},
    "design": {"camera", "learning", "simulator", "tracking", "wrench"},  # weights and study of a design, by similarity
    "live.core": {"calibration", "camera", "sources", "tracking", "wrench"},
    "live.outputs": {"live.core"},
    "live.web": {"design", "live.core", "live.outputs"},  # design: the shape of a pressed dome that the page draws
    "live.demo": {"live.core", "sources", "simulator"},  # the simulated robot; nothing else of live knows the simulator
    "live": {"live.core", "live.outputs", "live.web", "live.demo", "camera", "sources", "tracking", "wrench"},
    "robot.node": {"live", "live.core", "live.outputs", "live.web", "robot", "robot.demo", "tensegrity"},  # it runs
    "weighing": {"calibration", "live", "live.core", "sources", "tensegrity", "wrench"},  # known loads, live pipeline
    "evaluation": {
        "calibration",
        "camera",
        "learning",
        "live.core",
        "tracking",
        "wrench",
    },  # models through the live pipeline
    "": {
        "calibration",
        "camera",
        "design",
        "doctor",
        "evaluation",
        "learning",
        "live",
        "live.core",
        "recording",
        "robot.node",
        "sources",
        "tensegrity",
        "tracking",
        "weighing",
        "wrench",
    },
}
SHARED_WITH_SIMULATOR = {
    "sensing.arguments",  # forms of options: nothing that an estimate is made with
    "sensing.code_digest",  # which version of the code this is
    "sensing.records",
    "sensing.records_labelled",
    "sensing.set_manifest",
}  # besides the packages camera and tensegrity
PACKAGES = ("cad", "endcap", "fab", "sensing")
HEAVY = ("OCP", "build123d", "cadquery", "numpy", "scipy", "trimesh", "torch", "cv2", "vtkmodules", "matplotlib")
KERNEL = ("OCP", "build123d", "cadquery")


def module_name(path: Path, root: Path = ROOT) -> str:
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def sources(package: str) -> list[Path]:
    """Without those of packages that are installed elsewhere, beside the program that they extend."""
    found = (ROOT / package).rglob("*.py")
    return sorted(path for path in found if "packages" not in path.relative_to(ROOT).parts)


MODULES = {module_name(path): path for package in PACKAGES for path in sources(package)}


def imports(module: str, source: str, is_package: bool = False, known: frozenset[str] = frozenset(MODULES)) -> set[str]:
    """Every module that a source names in an import, at any depth, but for those under ``if TYPE_CHECKING``."""
    tree = ast.parse(source)
    typing_only = {
        id(node)
        for block in ast.walk(tree)
        if isinstance(block, ast.If) and "TYPE_CHECKING" in ast.dump(block.test)
        for statement in block.body
        for node in ast.walk(statement)
    }
    found: set[str] = set()
    for node in ast.walk(tree):
        if id(node) in typing_only:
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parents = module.split(".")[: None if is_package else -1]
                parents = parents[: len(parents) - node.level + 1]
                base = ".".join([*parents, *([node.module] if node.module else [])])
            names = {f"{base}.{alias.name}" for alias in node.names}
            found |= (names & known) or {base}
            if names - known and names & known:
                found.add(base)
    return found


@cache
def imports_of(module: str) -> set[str]:
    path = MODULES[module]
    return imports(module, path.read_text(), path.name == "__init__.py")


def own(names: set[str]) -> set[str]:
    return {name for name in names if name.split(".")[0] in PACKAGES}


def part(module: str) -> str:
    """Package of sensing that a module lies in, "" for commands: modules beside the packages, and that of sources."""
    names = module.split(".")
    if module in ("sensing.sources.__main__", "sensing.robot.__main__"):
        return ""
    inner = ".".join(names[1:3])
    return next((name for name in (inner, *names[1:2]) if name in ARROWS), "")


def sensing_violations(module: str, names: set[str]) -> set[str]:
    allowed = BOTTOM | {"cad"}
    bad = {n for n in own(names) if not n.startswith("sensing") and n not in allowed}
    bad |= {n for n in names if n.split(".")[0] in KERNEL}
    here = part(module)
    shared = SHARED_WITH_SIMULATOR if here == "simulator" else SHARED
    packages = set() if module in SHARED else ARROWS[here] | ({here} - {""})
    for name in names:
        if name.startswith("sensing.") and name not in shared and part(name) not in packages:
            bad.add(name)
    return bad


def violations(modules: Iterable[str], bad: Callable[[str, set[str]], set[str]]) -> dict[str, set[str]]:
    """What each module imports and must not, without the modules that import nothing such."""
    found = {module: bad(module, imports_of(module)) for module in sorted(modules)}
    return {module: names for module, names in found.items() if names}


def modules_of(*packages: str) -> list[str]:
    """All modules of some packages."""
    found = [module for module in MODULES if module.split(".")[0] in packages]
    assert len(found) > 10 * len(packages)
    return found


def test_the_bottom_layer_imports_only_the_standard_library_and_itself():
    def bad(module: str, names: set[str]) -> set[str]:
        allowed = (BOTTOM if module in BOTTOM else PLAIN) | {"cad"}
        strange = {n for n in names - own(names) if n.split(".")[0] not in sys.stdlib_module_names}
        return strange | (own(names) - allowed)

    assert violations(PLAIN, bad) == {}


def test_cad_imports_neither_fab_nor_sensing():
    assert violations(modules_of("cad"), lambda _, names: {n for n in own(names) if not n.startswith("cad")}) == {}


def test_fab_does_not_import_sensing():
    assert violations(modules_of("fab"), lambda _, names: {n for n in own(names) if n.startswith("sensing")}) == {}


def test_sensing_imports_the_bottom_layer_only_and_the_simulator_stands_apart():
    assert violations(modules_of("sensing"), sensing_violations) == {}


def test_nothing_imports_the_facade():
    others = modules_of("cad", "fab", "sensing")
    assert violations(others, lambda _, names: {n for n in names if n.split(".")[0] == "endcap"}) == {}


def test_the_runtime_does_not_import_the_verification():
    runtime = [module for module in modules_of("sensing") if "verification" not in module]
    assert violations(runtime, lambda _, names: {n for n in names if "simulator.verification" in n}) == {}


def test_every_package_of_sensing_has_its_arrows_and_they_have_no_cycle():
    assert {path.parent.name for path in (ROOT / "sensing").glob("*/*.py")} == {n for n in ARROWS if n and "." not in n}
    order = list(ARROWS)
    assert all(order.index(other) < order.index(package) for package in ARROWS for other in ARROWS[package])


@pytest.mark.parametrize(
    ("module", "source", "bad"),
    [
        ("sensing.flow", "from fab.meshing.mesh import weld", {"fab.meshing.mesh"}),
        ("sensing.flow", "def f():\n    import build123d.topology", {"build123d.topology"}),
        ("sensing.flow", "from cad import base, params", {"cad.base"}),
        ("sensing.flow", "from cad.mold.layout import MoldLayout", {"cad.mold.layout"}),
        ("sensing.flow", "from sensing.simulator.render.dome import ray", {"sensing.simulator.render.dome"}),
        ("sensing.flow", "from sensing.train import main", {"sensing.train"}),
        ("sensing.simulator.render.dome", "from sensing.flow import track", {"sensing.flow"}),
        ("sensing.simulator.render.dome", "from ...flow import track", {"sensing.flow"}),
        ("sensing.simulator.render.dome", "from sensing.frames import rigid", {"sensing.frames"}),
        ("sensing.simulator.render.dome", "from sensing.tracking import dots", {"sensing.tracking.dots"}),
        ("sensing.simulator.render.dome", "from sensing.calibration.dots import f", {"sensing.calibration.dots"}),
        ("sensing.simulator.render.dome", "from sensing.camera.model import project\nfrom .mesh import m", set()),
        ("sensing.tracking.dots", "from ..wrench.model import m", {"sensing.wrench.model"}),
        ("sensing.tracking.dots", "import sensing.field", {"sensing.field"}),
        ("sensing.camera.model", "from sensing.tracking.dots import find", {"sensing.tracking.dots"}),
        ("sensing.records", "from sensing.camera.model import project", {"sensing.camera.model"}),
        ("sensing.live.core.model", "def f():\n    import sensing.learning.net", {"sensing.learning.net"}),
        ("sensing.learning.net", "from sensing import records, compiled\nfrom . import ridge", set()),
        ("sensing.flow", "from cad.params import EndcapParams\nfrom cad import dots\nimport numpy", set()),
    ],
)
def test_the_scan_sees_planted_arrows(module, source, bad):
    known = frozenset({*MODULES, "sensing.flow"})
    assert sensing_violations(module, imports(module, source, known=known)) == bad


def loaded_after(statement: str) -> set[str]:
    """Top-level names in ``sys.modules`` of a fresh interpreter after a statement."""
    code = f"{statement}\nimport sys\nprint(*sorted({{m.split('.')[0] for m in sys.modules}}))"
    run = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    return set(run.stdout.splitlines()[-1].split())


def test_importing_parameters_loads_nothing_heavy():
    assert loaded_after("import cad.params, cad.dots, cad.mold.layout, cad.bought, cad.part") & set(HEAVY) == set()


def test_the_command_line_loads_nothing_heavy_before_it_has_read_its_options():
    assert loaded_after("import fab.molds") & {*HEAVY, "pymeshlab"} == set()


@pytest.mark.long  # the arrows above hold every import by its text
def test_importing_all_of_sensing_does_not_load_the_cad_kernel():
    names = ", ".join(sorted(m for m in MODULES if m.startswith("sensing") and not m.endswith("__main__")))
    loaded = loaded_after(f"import {names}")
    assert "sensing" in loaded
    assert loaded & {*KERNEL, "fab"} == set()


@pytest.mark.long  # the arrows above hold every import by its text
def test_importing_all_of_fab_loads_neither_pymeshlab_nor_torch_nor_sensing():
    names = ", ".join(sorted(m for m in MODULES if m.startswith("fab")))
    loaded = loaded_after(f"import {names}")
    assert "build123d" in loaded  # the kernel is really there, so the absence of the others says something
    assert loaded & {"pymeshlab", "torch", "sensing"} == set()
