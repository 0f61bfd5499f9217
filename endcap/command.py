"""The command ``endcap``: one table of subcommands, each a module with a ``main`` (standard library only).

    endcap molds 130 8
    endcap live --camera 0,2,4

The rest of the line goes to that module's ``main`` unchanged, so ``endcap live ...`` and ``python -m sensing.live ...``
are the same. A module is imported only when it is called: ``endcap --help`` loads neither CAD kernel nor NumPy.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import takewhile
from typing import NoReturn

from cad.messages import LOG, set_level, show


@dataclass(frozen=True)
class Subcommand:
    """One subcommand.

    Attributes:
        name: as typed.
        module: where its ``main(arguments) -> exit status`` is.
        summary: one line of ``endcap --help``.
        arguments: placed before those of the user.
        takes_design: numbers at the start are D and T.
    """

    name: str
    module: str
    summary: str
    arguments: tuple[str, ...] = ()
    takes_design: bool = False


GROUPS: tuple[tuple[str, tuple[Subcommand, ...]], ...] = (
    (
        "make an endcap",
        (
            Subcommand(
                "molds", "fab.molds", "print and cast files of one endcap: endcap molds 130 8", takes_design=True
            ),
            Subcommand("slice", "fab.slice.__main__", "slicer projects, sliced and measured", takes_design=True),
            Subcommand(
                "sheet", "fab.build_sheet.__main__", "build sheet, bill of materials, recipe", takes_design=True
            ),
            Subcommand(
                "ring", "fab.led_ring.__main__", "LED ring: board files, budget, light on the dome", takes_design=True
            ),
            Subcommand(
                "whole",
                "endcap.whole",
                "all of these, weights and study in one folder: endcap whole 180 10",
                takes_design=True,
            ),
            Subcommand(
                "robot-model",
                "endcap.robot_model.__main__",
                "endcap for robot simulators, MJCF and URDF: endcap robot-model 130 8",
                takes_design=True,
            ),
            Subcommand(
                "study",
                "sensing.study",
                "what a design will feel: endcap study 130 8; the map: endcap study",
                takes_design=True,
            ),
            Subcommand(
                "design", "fab.design_page.__main__", "a page with sliders for D and T, and a button that makes it"
            ),
            Subcommand("coupons", "fab.coupons.__main__", "fit coupon of the joints, bond specimens"),
            Subcommand("bond-tests", "fab.bond_tests.__main__", "statistics of a testing machine's files"),
        ),
    ),
    (
        "run it",
        (
            Subcommand("cameras", "sensing.sources.__main__", "cameras of this computer and their modes"),
            Subcommand(
                "doctor",
                "sensing.sources.__main__",
                "what is wrong with a camera, and the fix",
                ("check",),
            ),
            Subcommand("setup", "sensing.setup", "find the cameras, take the zero, write endcaps.toml"),
            Subcommand("calibrate", "sensing.calibrate", "camera from one photo of the dots, or a chessboard"),
            Subcommand("zero", "sensing.zero", "take, check or watch the untouched reference"),
            Subcommand("weigh", "sensing.weigh", "known weights, or a robot's own, to the gain of each endcap"),
            Subcommand("dwell", "sensing.dwell", "rate effects of the silicone from one dwell test"),
            Subcommand("live", "sensing.live.cli", "wrench and contact: terminal, page, recording, ROS 2"),
            Subcommand("robot", "sensing.robot.__main__", "a tensegrity robot: pose, shape, and which endcaps hold"),
            Subcommand(
                "ros-package", "sensing.live.ros_package", "ROS 2 packages: message with covariance, launch file"
            ),
            Subcommand("lerobot-package", "sensing.live.lerobot_package", "camera plug-in for LeRobot, with wrench"),
            Subcommand("field", "sensing.field", "shear field of pictures or a video"),
            Subcommand("record", "sensing.record", "frames paired with a force/torque sensor"),
        ),
    ),
    (
        "simulate and train",
        (
            Subcommand("press", "sensing.simulator.__main__", "press a simulated endcap once", ("press",)),
            Subcommand("data", "sensing.simulator.__main__", "labelled, rendered frames", ("data",)),
            Subcommand("render", "sensing.simulator.render.cli", "one frame of the endcap's camera"),
            Subcommand("verify", "sensing.simulator.verification.report", "the simulator's verification report"),
            Subcommand("scene-server", "sensing.live.demo.scene_server", "simulated cameras of six endcaps over HTTP"),
            Subcommand("export-data", "sensing.export_dataset", "a data set in the authors' format, or LeRobot's"),
            Subcommand("train", "sensing.train", "wrench model of any size (--design 180 10), or from labelled frames"),
            Subcommand("evaluate", "sensing.evaluate", "errors of a wrench model and of the comparisons"),
            Subcommand("onnx", "sensing.wrench_onnx", "wrench model as ONNX"),
        ),
    ),
)
READ_CAMERAS = {"cameras", "doctor", "setup", "zero", "weigh", "dwell", "live", "robot", "record"}
SUBCOMMANDS = {command.name: command for _, commands in GROUPS for command in commands}


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line.

    Args:
        arguments: of the command line, by default those of the process.

    Returns:
        Exit status: that of the subcommand; 2 for an unknown one, or a library that is missing; 130 after Ctrl-C.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    quiet = words[:1] in (["--quiet"], ["-q"])
    set_level(logging.WARNING if quiet else logging.INFO)
    words = words[1:] if quiet else words
    if words[:1] == ["help"]:
        words = [*words[1:2], "--help"]
    if not words or words[0] in ("-h", "--help"):
        say = show if words else LOG.error
        say(help_text())
        return 0 if words else 2
    if words[0] == "--version":
        import cad

        show(f"endcap {cad.__version__}")
        return 0
    if words[0] not in SUBCOMMANDS:
        LOG.error(f"endcap: {words[0]!r} is not a command{_nearest(words[0])} endcap --help lists them")
        return 2
    return run(SUBCOMMANDS[words[0]], words[1:])


def program() -> NoReturn:
    """Entry point of the command ``endcap``: ends the process with the status of :func:`main`.

    Commands that read cameras skip the interpreter's finalization: a driver thread that wakes up during it aborts the
    process (status 134).
    """
    status = main()
    words = [word for word in sys.argv[1:] if word not in ("--quiet", "-q")]
    if not set(words[:1]) & READ_CAMERAS:
        sys.exit(status)
    from sensing.live.ending import leave

    leave(status)


def run(command: Subcommand, words: Sequence[str]) -> int:
    """Import a subcommand's module and call its ``main``."""
    from cad.extras import explain, start_as
    from cad.threads import one_thread

    one_thread()
    start_as(" ".join(("endcap", command.name)))
    try:
        return int(import_module(command.module).main([*command.arguments, *_named(command, words)]) or 0)
    except (ImportError, RuntimeError) as error:
        line = explain(error, command.module)
        if line is None:
            raise
        LOG.error(f"endcap {command.name}: {line}")
        return 2
    except KeyboardInterrupt:
        LOG.error(f"endcap {command.name}: interrupted")
        return 130
    finally:
        start_as("")


def _named(command: Subcommand, words: Sequence[str]) -> list[str]:
    """Arguments with the leading numbers named: ``130 8`` becomes ``D=130 T=8`` where a design is expected."""
    if not command.takes_design:
        return list(words)
    numbers = list(takewhile(lambda word: word[:1].isdigit() and "=" not in word, words))
    return [*(f"{name}={number}" for name, number in zip("DT", numbers, strict=False)), *words[len(numbers[:2]) :]]


def help_text() -> str:
    """Text of ``endcap --help``."""
    width = max(map(len, SUBCOMMANDS))
    lines = ["usage: endcap COMMAND [options]", "", "Make, understand and run large visuotactile endcaps."]
    for title, commands in GROUPS:
        lines += ["", f"{title}:", *(f"  {command.name:<{width}}  {command.summary}" for command in commands)]
    lines += ["", "endcap COMMAND --help lists the options of one; endcap --version prints the version;"]
    lines += ["endcap --quiet COMMAND leaves progress out."]
    return "\n".join(lines)


def _nearest(word: str) -> str:
    from difflib import get_close_matches

    near = get_close_matches(word.lower().lstrip("-"), SUBCOMMANDS, n=1, cutoff=0.5)
    return f": did you mean endcap {near[0]}?" if near else ":"
