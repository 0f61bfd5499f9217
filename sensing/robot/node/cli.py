"""Command line: ``python -m sensing.robot --help``."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cad.errors import EndcapError, ParameterError, printable
from cad.extras import program
from cad.messages import LOG, transient
from sensing.arguments import number, port, whole
from sensing.live.ending import LOST, Stop
from sensing.live.outputs.lines import Lines
from sensing.live.outputs.mcap.new_file import require_new
from sensing.robot.node.record import Report, report_text
from sensing.robot.node.run import SILENT_S, Output, RobotSource
from sensing.robot.node.terminal import RobotTerminal
from sensing.tensegrity.description import TensegrityRobot
from sensing.tensegrity.robot_file import SHIPPED, load_robot
from sensing.tensegrity.samples import Sample

if TYPE_CHECKING:
    from sensing.robot.node.page import RobotPage
    from sensing.robot.node.recorder import RobotRecorder
    from sensing.robot.node.ros_topics import RobotTopics

DESCRIPTION = """\
Pose and shape of a tensegrity robot, and which of its endcaps hold, roll, slip or are free: from the wrenches of the
endcaps, inertial sensors and cable lengths. Without arguments: a simulated robot, the truth beside the estimate.

  python -m sensing.robot                                  three bars that tip over flat ground
  python -m sensing.robot --terrain rough --seed 3         flat, rough, slope, stairs, low_friction, drop or push
  python -m sensing.robot --config robot.toml              another robot (form: docs/robot.md, Your robot)
  python -m sensing.robot --record run.mcap                every sample and every estimate
  python -m sensing.robot --replay run.mcap                computes them again and compares the bits
  python -m sensing.robot --live --config robot.toml --endcaps endcaps.toml
                                                           the real one: cameras here, other sensors from ROS 2 topics
  python -m sensing.robot --json --speed 0 | jq .drift_m
"""
EPILOG = """\
exit status: 0 ended or stopped; 1 a recording or --json is not whole, or a replay differs (one line on stderr); 2 bad
input (one line on stderr); 130 or 143 stopped before it began
"""
MOST_SD_N = 100.0  # N, more is a typing error
SIMULATED_ONLY = ("terrain", "seed", "seconds", "speed")  # options that only a simulated robot has


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        if options.no_page and options.port is not None:
            raise ParameterError("--port has no effect with --no-page: leave one of them out", name="port")
        return _replay(options) if options.replay is not None else _run(options)
    except EndcapError as error:
        LOG.error(f"sensing.robot: {error}")
        return 2
    except KeyboardInterrupt:  # before the run starts
        return 130


class JsonOutput:
    """Writes each report as one line of JSON to standard output.

    Args:
        lines: standard output.
        robot: robot of the reports.
        stopped: whether the end of the run was requested.
        lost: takes a line when the first estimate is left out for a slow reader; without it the run waits.
    """

    def __init__(
        self, lines: Lines, robot: TensegrityRobot, stopped: Callable[[], bool] = lambda: False,
        lost: Callable[[str], object] | None = None,
    ) -> None:  # fmt: skip
        self._lines, self._robot, self._stopped, self._lost = lines, robot, stopped, lost
        self._said = False

    def sample(self, sample: Sample) -> None:
        """Do nothing: samples are not written."""

    def report(self, report: Report) -> None:
        """Write a line; without ``lost``, wait for a slow reader, but not beyond the end of the run."""
        text = report_text(report, self._robot) + "\n"
        while not self._lines.write(text) and not self._lines.failed and not self._stopped():
            if self._lost is not None:
                return self._leave_out(self._lost)
            time.sleep(0.01)

    def _leave_out(self, lost: Callable[[str], object]) -> None:
        if not self._said:
            self._said = True
            lost("--json: the reader is too slow, estimates are left out")


def _run(options: argparse.Namespace) -> int:
    from sensing.robot.estimator import RobotEstimator
    from sensing.robot.node.run import run_robot

    file, live = options.config or SHIPPED, options.live or options.endcaps is not None
    robot, description = load_robot(file), file.read_bytes()
    if options.record is not None:  # before the simulation runs for minutes
        require_new(options.record)
    estimator = RobotEstimator(robot)  # refuses a robot that cannot be estimated, before that, too
    source = _source(options, robot)
    wall_ns, silent_s = (None, SILENT_S) if live else (time.time_ns(), math.inf)  # a simulated clock begins at 0
    out = Lines(sys.stdout)
    lines = Lines(sys.stderr) if options.json else out
    terminal, stop = RobotTerminal(lines, robot, quiet=options.json), Stop()
    outputs: list[Output] = [terminal]
    recorder: RobotRecorder | None = None
    losses = _Losses()
    shown: list[RobotPage | RobotTopics] = []
    try:
        if options.json:  # neither a robot nor its recording waits
            outputs.append(JsonOutput(out, robot, stop.asked.is_set, losses.add if live else None))
        shown = _shown(options, robot, wall_ns)
        if options.record is not None:  # last, so that no file is left if another output cannot begin
            from sensing.robot.node.recorder import RobotRecorder

            recorder = RobotRecorder(options.record, robot, description, wall_ns, losses.add)
            outputs.append(recorder)
        _start_page(shown, lines)
        outputs += shown
        with stop:
            run_robot(source, estimator, outputs, lambda: stop.asked.is_set() or out.gone, losses.add, silent_s)
    finally:
        _close(shown, recorder, lines, out)
    if terminal.last is None and not out.gone and not stop.asked.is_set():
        raise ParameterError("no estimate: the robot must stand still for a second first, and cables report lengths")
    losses.of(out)
    return LOST if losses.lines or (recorder is not None and recorder.failed) else 0


def _close(shown: Sequence[RobotPage | RobotTopics], recorder: RobotRecorder | None, lines: Lines, out: Lines) -> None:
    for each in shown:
        each.close()
    if recorder is not None:
        recorder.close()
        lines.write(printable(recorder.note) + "\n")
    for stream in {id(each): each for each in (lines, out)}.values():
        stream.close(5.0)


class _Losses:
    """Lines of outputs that stopped; each is printed at once."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def add(self, line: str) -> None:
        """Add a line and print it."""
        self.lines.append(line)
        LOG.error(printable(f"sensing.robot: {line}"))

    def of(self, out: Lines) -> None:
        """Add a line if standard output could not be written, unless its reader has left."""
        if out.failed and not out.gone:
            self.add(f"standard output: {out.failed}")


def _source(options: argparse.Namespace, robot: TensegrityRobot) -> RobotSource:
    """The source of samples; the estimator's code is loaded before the source starts."""
    from sensing.robot.node.warm_up import warm_up

    source = _live(options, robot) if options.live or options.endcaps is not None else _simulated(options, robot)
    warm_up(robot, LOG.info)
    return source


def _live(options: argparse.Namespace, robot: TensegrityRobot) -> RobotSource:
    for name in SIMULATED_ONLY:
        if getattr(options, name) is not None:
            raise ParameterError(f"--{name} has no effect with --live: it is of the simulated robot")
    from sensing.robot.node.live import LiveRobot

    return LiveRobot(robot, options.endcaps, wrench_sd=_wrench_sd(options))


def _simulated(options: argparse.Namespace, robot: TensegrityRobot) -> RobotSource:
    if options.wrench_sd is not None:
        raise ParameterError("--wrench-sd has no effect without --live: it is of wrenches without covariance")
    from sensing.robot.demo.simulated import SimulatedRobot

    asked = {name: value for name in SIMULATED_ONLY if (value := getattr(options, name)) is not None}
    return SimulatedRobot(robot, **asked, say=lambda at_s: transient(f"simulating: {at_s:.0f} s"))


def _wrench_sd(options: argparse.Namespace) -> tuple[float, float] | None:
    """Standard deviations of wrenches without covariance, N and N m."""
    if options.wrench_sd is None:
        return None
    if options.endcaps is not None:
        raise ParameterError("--wrench-sd has no effect with --endcaps: their wrenches have a covariance")
    force, torque = options.wrench_sd
    if not (0 < force <= MOST_SD_N and 0 < torque <= MOST_SD_N):
        raise ParameterError(
            f"--wrench-sd {force:g} {torque:g} outside 0..{MOST_SD_N:g}: standard deviations in N and N m, "
            "for example 0.2 0.01",
            name="wrench_sd",
        )
    return force, torque


def _shown(options: argparse.Namespace, robot: TensegrityRobot, wall_ns: int | None) -> list[RobotPage | RobotTopics]:
    """Page and topics of the options; the page is not started yet."""
    from sensing.robot.node.page import RobotPage
    from sensing.robot.node.ros_topics import RobotTopics

    shown: list[RobotPage | RobotTopics] = [RobotTopics(robot, wall_ns=wall_ns)] if options.ros else []
    return shown if options.no_page else [*shown, RobotPage(robot, options.port)]


def _start_page(shown: Sequence[RobotPage | RobotTopics], lines: Lines) -> None:
    from sensing.robot.node.page import RobotPage

    for page in shown:
        if isinstance(page, RobotPage):
            page.start()
            lines.write(f"page: {page.url}\n")


def _replay(options: argparse.Namespace) -> int:
    from sensing.robot.node.replay import Recording
    from sensing.robot.node.warm_up import warm_up

    others = ("config", "live", "record", "endcaps", "wrench_sd", "ros", "port")
    asked = {name: getattr(options, name) for name in (*SIMULATED_ONLY, *others)}
    given = [name.replace("_", "-") for name, value in asked.items() if value is not None and value is not False]
    if given:
        raise ParameterError(f"--{given[0]} has no effect with --replay: the recording has its own", name=given[0])
    recording = Recording(options.replay)
    warm_up(recording.robot, LOG.info)
    out, losses = Lines(sys.stdout), _Losses()
    lines = Lines(sys.stderr) if options.json else out
    outputs: list[Output] = [RobotTerminal(lines, recording.robot, quiet=options.json)]
    if options.json:
        outputs.append(JsonOutput(out, recording.robot))
    try:
        found = recording.replay(outputs)
        for note in found.notes:
            lines.write(printable(note) + "\n")
        lines.write(
            printable(f"{options.replay}: {found.compared} estimates computed again from {found.samples} samples, ")
            + f"{found.different} differ\n"
        )
    finally:
        for stream in {id(each): each for each in (lines, out)}.values():
            stream.close(5.0)
    if found.end is not None:
        LOG.error(f"sensing.robot: {found.end}")
    losses.of(out)
    return LOST if found.different or found.end is not None or losses.lines else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.robot"),
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--config", type=Path, metavar="FILE", help="robot.toml; without it the three-bar robot")
    parser.add_argument("--live", action="store_true", help="samples of ROS 2 topics (docs/robot.md)")
    parser.add_argument("--endcaps", type=Path, metavar="FILE", help="live, with the cameras here: endcaps.toml")
    parser.add_argument(
        "--wrench-sd", type=number, nargs=2, metavar=("N", "NM"),
        help="live: standard deviations of wrenches without covariance (geometry_msgs/WrenchStamped)",
    )  # fmt: skip
    parser.add_argument("--replay", type=Path, metavar="FILE", help="a recording made with --record")
    parser.add_argument("--record", type=Path, metavar="FILE", help="MCAP of all samples and estimates")
    parser.add_argument("--json", action="store_true", help="a line of JSON an estimate on stdout; the rest on stderr")
    parser.add_argument("--no-page", action="store_true", help="numbers here only")
    parser.add_argument("--port", type=port, metavar="N", help="port of the page (8008, or any free one)")
    parser.add_argument("--ros", action="store_true", help="ROS 2 topics over DDS, domain ROS_DOMAIN_ID")
    simulated = parser.add_argument_group("the simulated robot")
    simulated.add_argument("--terrain", metavar="NAME", help="what it walks on (flat)")
    simulated.add_argument("--seed", type=whole, metavar="N", help="of the ground and all noise (1)")
    simulated.add_argument("--seconds", type=number, metavar="S", help="length of the run (40)")
    simulated.add_argument("--speed", type=number, metavar="X", help="0: as fast as possible (1)")
    return parser
