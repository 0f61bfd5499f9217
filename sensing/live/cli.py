"""Command line: ``python -m sensing.live --help``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from cad.design_arguments import add_design_arguments, design_of
from cad.errors import EndcapError, FileError, ParameterError, printable
from cad.extras import program
from cad.materials import DEFAULT_SILICONE
from cad.messages import LOG, show
from sensing.arguments import number, port, silicone_name, whole
from sensing.live.core.config import LiveConfig, known_models
from sensing.live.core.endcap_config import EndcapConfig, dots_of
from sensing.live.core.endcaps_file import load_config
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import CameraFeed
from sensing.live.core.model import known_weights, weights_in_use
from sensing.live.ending import LOST, Stop
from sensing.live.open_outputs import add_outputs
from sensing.live.options import complete
from sensing.live.outputs.lines import Lines
from sensing.live.run import LiveRun, reduce_pauses, run_until_stopped
from sensing.sources.choose import is_camera_number
from sensing.tracking.methods import known_methods
from sensing.wrench.weight_files import command_for

if TYPE_CHECKING:
    from sensing.live.playback import Playback

DESCRIPTION = """\
Wrench and contact of endcaps, live. Without arguments: a simulated robot on six endcaps.

  python -m sensing.live                                simulated robot, numbers here, page in the browser
  python -m sensing.live --diameter 180 --wall 10       that of another size; its weights: python -m sensing.train
  python -m sensing.live --camera 0,2,4                 three USB cameras
  python -m sensing.live --config endcaps.toml          what python -m sensing.setup wrote
  python -m sensing.live --video press.avi              a recording, first picture untouched
  python -m sensing.live --url http://127.0.0.1:8081/   a camera on the network
  python -m sensing.live --record run.mcap              with a recording; --replay run.mcap gives the same numbers
  python -m sensing.live --json --no-page | jq .force_n

Cameras are zeroed at the start: leave the endcaps untouched for a second. Forces in N and torques in N m act on the
endcap, at the origin of its frame.
"""
EPILOG = """\
exit status: 0 ended or stopped by Ctrl-C, SIGTERM or SIGHUP; 1 a file, a recording, an output or --check is not
whole, or a camera gave no number in all of --seconds (one line on stderr); 2 bad input (one line on stderr); 130 or
143 stopped before it began
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        return _run(complete(options))
    except EndcapError as error:
        LOG.error(f"sensing.live: {error}")
        return 2
    except KeyboardInterrupt:  # before the loop runs
        return 130


def _run(options: argparse.Namespace) -> int:
    from sensing.live.open_endcaps import open_endcaps

    config = _config(options)
    if options.check:
        return _check(options.replay, config, options.from_s)
    playback: Playback | None = None
    if options.replay is None:
        endcaps = open_endcaps(config, options.speed)
    else:
        from sensing.live.playback import AtEnd, Playback
        from sensing.live.recorded_feed import replay_endcaps

        playback = Playback(options.replay, options.speed, AtEnd(options.at_end), options.from_s, options.paused)
        endcaps = replay_endcaps(options.replay, config, playback)
    if any(endcap.pipeline.model.method == "dots" for endcap in endcaps):
        from sensing.live.core.warm_up import warm_up

        warm_up(LOG.info)
    run = LiveRun(config, endcaps, min(options.workers, len(endcaps)), playback)
    lines = Lines(sys.stderr if options.json else sys.stdout)
    with Stop() as stop, ExitStack() as outputs:
        add_outputs(run, options, outputs, lines)
        if options.replay is None and not options.json:
            lines.write(_weights_in_use(config))
        for endcap in config.endcaps:
            if endcap.weighed:
                lines.write(f"{endcap.name}: {endcap.weighed}\n")
            if endcap.rate_effects:
                lines.write(f"{endcap.name}: rate effects {endcap.rate_effects}\n")
        reduce_pauses()
        run_until_stopped(run, lines, options.seconds, outputs, stop)
    losses = [said for loss in run.losses if (said := loss())]
    losses += [said for endcap in endcaps if (said := getattr(endcap.feed, "damage", ""))]
    if options.seconds is not None and not stop.asked.is_set():
        losses += [said for endcap in endcaps if (said := _never_came(endcap))]
    for line in dict.fromkeys(losses):
        LOG.warning(f"sensing.live: {printable(line)}")
    return LOST if losses else 0


def _never_came(endcap: LiveEndcap) -> str:
    """Why a camera has given no number in a run of fixed length, which nobody may have watched; empty if it has."""
    if endcap.stats.frames or not isinstance(endcap.feed, CameraFeed):
        return ""
    condition = endcap.machine.condition
    return (
        f"{endcap.name}: no number came from {endcap.pipeline.endcap.source} ({condition.state}: {condition.message})"
    )


def _check(path: Path, config: LiveConfig, from_s: float) -> int:
    from sensing.live.replay import verify

    check = verify(path, config, from_s=from_s)
    if not check.frames and check.end is None:
        where = (
            f" from {from_s:g} s on: give an earlier moment" if from_s else ": record for longer than it takes to zero"
        )
        raise FileError(f"{path}: no frame in it{where}")
    if from_s:
        show(
            f"{path}: {check.frames} frames computed again from {from_s:g} s on, {check.different} differ in a bit, "
            f"none by more than {check.largest_n:.2g} N"
        )
    else:
        show(f"{path}: {check.frames} frames computed again, {check.different} differ")
    if check.end is not None:
        LOG.error(f"sensing.live: {check.end}")
    differs = check.different and not from_s  # from a moment on bits differ as they may
    return LOST if differs or check.end is not None or not check.frames else 0


def _config(options: argparse.Namespace) -> LiveConfig:
    """The configuration that the options describe."""
    if options.config is not None:
        config = load_config(options.config)
        changes = {"model": options.model, "weights": options.weights, "method": options.method}
        return replace(config, **{name: value for name, value in changes.items() if value is not None})
    if options.replay is not None:
        from sensing.live.replay import read_config

        return read_config(options.replay, options.model, options.weights, options.method)
    words = _sources(options)
    model = options.model or "default"
    if not words:
        from sensing.live.demo.scene import scene_config

        _require_weights(model, options)
        config = scene_config(model, options.weights, options.method, design_of(options), options.silicone)
        return replace(config, endcaps=tuple(replace(endcap, rate_hz=options.rate) for endcap in config.endcaps))
    endcaps = tuple(
        EndcapConfig(
            f"endcap_{number}", word, options.zero, options.diameter, options.wall, rate_hz=options.rate,
            exposure=options.exposure, silicone=options.silicone, **dots_of(design_of(options)),
        )
        for number, word in enumerate(words)
    )  # fmt: skip
    if options.zero is not None and len(endcaps) > 1:
        raise ParameterError(
            "--zero is for one endcap: write a configuration with python -m sensing.setup", name="zero"
        )
    return LiveConfig(endcaps, model, options.weights, options.method)


def _require_weights(model: str, options: argparse.Namespace) -> None:
    """Refuse a robot that has no weights before its pictures are rendered.

    Raises:
        FileError: no weights for its endcaps.
        ParameterError: a design that cannot be made.
    """
    params = design_of(options)
    if model == "default" and options.weights is None and known_weights(model, params, options.silicone) is None:
        raise FileError(
            f"no weights for the simulated robot of {params.label} in {options.silicone}: make them in minutes with "
            f"{command_for(params, options.silicone)}, then start this again"
        )


def _weights_in_use(config: LiveConfig) -> str:
    """One line for each kind of endcap: which file answers."""
    if config.model != "default":
        return ""
    said = ""
    for endcap in {f"{endcap.identity.digest} {endcap.weighed}": endcap for endcap in config.endcaps}.values():
        path = weights_in_use(config, endcap)
        said += "" if path is None else f"{endcap.params.label}: weights {path}\n"
    return said


def _sources(options: argparse.Namespace) -> list[str]:
    if options.camera is not None:
        numbers = [word.strip() for word in options.camera.split(",")]
        if not all(is_camera_number(word) for word in numbers):
            raise ParameterError(
                f"--camera {options.camera}: give numbers, such as 0 or 0,2,4 (listed by python -m sensing.sources)",
                name="camera",
                value=options.camera,
            )
        return numbers
    return [str(word) for word in (options.video, options.photos) if word is not None] + (
        options.url or options.source or []
    )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.live"),
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    _add_sources(parser)
    _add_model(parser)
    _add_outputs(parser)
    return parser


def _add_sources(parser: argparse.ArgumentParser) -> None:
    what = parser.add_argument_group("where frames come from").add_mutually_exclusive_group()
    what.add_argument("--camera", metavar="N[,N]", help="numbers of USB cameras, one an endcap")
    what.add_argument("--video", type=Path, metavar="FILE", help="a video; its first picture is the untouched endcap")
    what.add_argument(
        "--photos", type=Path, metavar="DIR", help="a folder of pictures; the first is the untouched endcap"
    )
    what.add_argument("--url", action="append", metavar="URL", help="MJPEG over HTTP; again for another endcap")
    what.add_argument("--source", action="append", metavar="NAME:ADDRESS", help="a plug-in's camera; again for another")
    what.add_argument("--replay", type=Path, metavar="FILE", help="a recording made with --record")
    what.add_argument("--config", type=Path, metavar="FILE", help="endcaps.toml")
    play = parser.add_argument_group("how a recording is played")
    play.add_argument(
        "--from", dest="from_s", type=number, metavar="S", help="begin so many seconds after its start (0)"
    )
    play.add_argument("--at-end", choices=["stop", "loop", "stay"], help="end the run, begin again, or wait (stop)")
    play.add_argument("--paused", action="store_true", help="show the first pictures and wait for the page's button")
    play.add_argument("--speed", type=number, metavar="X", help="also of other files; 0: as fast as possible (1)")


def _add_model(parser: argparse.ArgumentParser) -> None:
    model = parser.add_argument_group("what is computed")
    model.add_argument("--model", choices=known_models(), help="default: ours; paper: the released field and network")
    model.add_argument(
        "--weights", type=Path, metavar="FILE", help="weights of the model, else those of the design (printed)"
    )
    model.add_argument("--method", choices=known_methods(), help="another field method than the model's own")
    model.add_argument("--zero", type=Path, metavar="FILE.npz", help="reference written by python -m sensing.zero")
    add_design_arguments(model, with_defaults=False)
    model.add_argument(
        "--silicone", type=silicone_name, metavar="NAME", help=f"that it is cast of ({DEFAULT_SILICONE})"
    )
    model.add_argument("--rate", type=number, metavar="HZ", help="frames a second of a camera (30)")
    model.add_argument("--exposure", type=number, metavar="V", help="fixed exposure, the driver's unit")
    model.add_argument("--workers", type=whole, metavar="N", help="threads that share the endcaps (1)")


def _add_outputs(parser: argparse.ArgumentParser) -> None:
    out = parser.add_argument_group("outputs")
    out.add_argument("--no-page", action="store_true", help="numbers here only")
    out.add_argument("--host", help="address of the page (127.0.0.1); others need a token")
    out.add_argument("--port", type=port, metavar="N", help="port of the page (8008, or any free one)")
    out.add_argument(
        "--record", type=Path, nargs="?", const=Path(), metavar="FILE", help="MCAP; without a name: endcap_TIME.mcap"
    )
    out.add_argument(
        "--record-pictures",
        choices=["full", "half", "none"],
        help="as they came (full), or half as wide, or none: dots instead, for the same numbers",
    )
    out.add_argument("--check", action="store_true", help="with --replay: compare every wrench with the recorded one")
    out.add_argument("--ros", action="store_true", help="ROS 2 topics over DDS, domain ROS_DOMAIN_ID")
    out.add_argument("--rerun", action="store_true", help="also show in the Rerun viewer, if it is installed")
    out.add_argument("--output", action="append", metavar="NAME[=WORDS]", help="a plug-in's output; again for another")
    out.add_argument("--json", action="store_true", help="one line of JSON a frame on stdout; the rest on stderr")
    out.add_argument("--seconds", type=number, metavar="S", help="stop after so long")
