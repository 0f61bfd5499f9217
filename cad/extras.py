"""Error line for a missing library, which gives the command that installs it (standard library only).

The libraries are grouped as the extras of ``pyproject.toml``. A command whose library is missing ends with

    endcap live: numba is not installed: run pip install 'endcap-toolkit[live]'

and status 2. The packages ``fab`` and ``sensing`` call :func:`prepare_command` when they are
imported; it acts only where Python was started as ``python -m`` with a command of :data:`EXTRA_OF_COMMAND`: an import
from a program, a notebook or a test raises ModuleNotFoundError as usual.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.util import find_spec
from traceback import walk_tb
from types import TracebackType

from cad.messages import LOG
from cad.threads import one_thread

DISTRIBUTION = "endcap-toolkit"  # name of the distribution
KERNEL_COMMAND = "pip install --force-reinstall --no-deps cadquery-ocp"  # build123d brings one without VTK
SYSTEM_LIBRARIES = {"libGL.so.1": "libgl1", "libEGL.so.1": "libegl1", "libOpenGL.so.0": "libopengl0"}  # -> package
NO_CACHE = "no locator available"  # in numba's message where it finds no folder for its cache

_CAD = ("cad",)  # extras that contain the CAD kernel,
_NUMERICS = ("sensing", "simulate", "train", "cluster", "onnx", "download", "lerobot")  # numerical libraries,
_PICTURES = ("live", "robot", *_NUMERICS)  # and libraries for pictures
EXTRAS_OF_MODULE: dict[str, tuple[str, ...]] = {  # top-level module -> extras that contain it
    **dict.fromkeys(("OCP", "build123d", "cadquery", "vtkmodules", "pymeshlab", "typst", "embreex"), _CAD),
    **dict.fromkeys(("PIL", "gerbonara", "lxml", "manifold3d", "networkx", "shapely", "skimage", "trimesh"), _CAD),
    **dict.fromkeys(("cv2", "simplejpeg", "numba", "safetensors"), _PICTURES),
    **dict.fromkeys(
        ("starlette", "uvicorn", "websockets", "mcap", "rosbags", "segno", "lz4", "zstandard"), ("live", "robot")
    ),
    "cyclonedds": ("live", "robot", "ros"),
    **dict.fromkeys(("scipy", "matplotlib"), (*_CAD, *_NUMERICS)),
    "torch": ("train", "onnx", "download"),
    **dict.fromkeys(("dask", "distributed"), ("cluster",)),
    **dict.fromkeys(("onnx", "onnxruntime"), ("onnx",)),
    "huggingface_hub": ("download",),
    "mujoco": ("robot",),
    "pyarrow": ("lerobot",),
}
EXTRA_OF_COMMAND: dict[str, str] = {  # longest matching prefix of the command's module -> its extra; "" matches all
    "fab": "cad",
    "endcap.robot_model": "cad",
    "endcap.whole": "cad",
    "sensing": "sensing",
    "sensing.live": "live",
    "sensing.live.demo": "simulate",
    "sensing.robot": "robot",
    "sensing.setup": "live",
    "sensing.weigh": "live",
    "sensing.dwell": "live",
    "sensing.simulator": "simulate",
    "sensing.train": "train",
    "sensing.evaluate": "train",
    "sensing.wrench_onnx": "onnx",
}


_started_as = ""  # "endcap train" where the command endcap runs a module


def start_as(name: str) -> None:
    """Set the name of the program in messages from now on; empty for the name of each module."""
    global _started_as
    _started_as = name


def program(module: str) -> str:
    """Name of the program for ``--help`` and messages: ``endcap train`` where that was typed, else ``module``'s."""
    return _started_as or module


def install_command(*extras: str) -> str:
    """Command that installs extras, for example ``pip install 'endcap-toolkit[live]'``."""
    return f"pip install '{DISTRIBUTION}[{','.join(extras)}]'"


def extra_of_command(module: str) -> str:
    """Extra that a command's module needs; empty for a module that is not a command of this project."""
    parts = module.split(".")
    prefixes = (".".join(parts[:count]) for count in range(len(parts), 0, -1))
    return next((EXTRA_OF_COMMAND[prefix] for prefix in prefixes if prefix in EXTRA_OF_COMMAND), "")


def explain(error: BaseException, command: str) -> str | None:
    """Line that names what an import lacks, a library or a folder for compiled code, and how to supply it.

    Args:
        error: exception of the import.
        command: module of the command that was started, for example ``sensing.live``.

    Returns:
        The line, or ``None`` where the cause is another one (a fault of this project, or a library that no extra
        contains).
    """
    if isinstance(error, RuntimeError) and NO_CACHE in str(error):
        return (
            "compiled code can be kept neither beside the toolkit nor in the user's cache folder, as neither can be "
            "written: set NUMBA_CACHE_DIR to a folder that can"
        )
    if not isinstance(error, ImportError):
        return None
    for library, package in SYSTEM_LIBRARIES.items():
        if library in str(error):
            return f"the system library {library} is missing: run apt-get install {package}, or your system's command"
    name = error.name or ""
    missing = name.split(".")[0]
    if missing == "OCP" and find_spec("OCP") is not None:
        return f"{name} is not in the CAD kernel that was installed last: run {KERNEL_COMMAND}"
    if not isinstance(error, ModuleNotFoundError) or missing not in EXTRAS_OF_MODULE:
        return None
    extras = EXTRAS_OF_MODULE[missing]
    wanted = (extra_of_command(command), *map(extra_of_command, _importers(error)))
    return f"{missing} is not installed: run {install_command(next((e for e in wanted if e in extras), extras[0]))}"


def prepare_command() -> None:
    """Install an exception hook: a command started with ``python -m`` ends with one line where a library is missing.

    The hook also covers the case that compiled code can be stored nowhere, and a Ctrl-C while libraries are loaded,
    which the command itself cannot handle yet. Linear algebra is limited to one thread (:mod:`cad.threads`).
    """
    command = started_module(sys.orig_argv)
    if not extra_of_command(command):
        return
    one_thread()
    before = sys.excepthook

    def hook(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        if isinstance(error, KeyboardInterrupt):
            LOG.error(f"{command}: interrupted")
            raise SystemExit(130)  # the exit status is that of the exception raised in the hook
        line = explain(error, command)
        if line is None:
            before(kind, error, trace)
            return
        LOG.error(f"{command}: {line}")
        raise SystemExit(2)

    sys.excepthook = hook


def started_module(argv: Sequence[str]) -> str:
    """Module of ``python [options] -m MODULE ...``; empty where Python was started otherwise."""
    words = iter(argv[1:])
    for word in words:
        if word == "-m":
            return next(words, "")
        if word in ("-c", "-") or not word.startswith("-"):
            return ""
        if word in ("-W", "-X"):  # options of Python that take an argument
            next(words, "")
    return ""


def _importers(error: BaseException) -> list[str]:
    """Modules that were being imported when the error occurred, innermost first."""
    frames = [frame for frame, _ in walk_tb(error.__traceback__)]
    return [str(frame.f_globals.get("__name__", "")) for frame in reversed(frames)]
