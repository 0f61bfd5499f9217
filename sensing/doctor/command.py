"""Command line of the camera doctor: ``python -m sensing.sources check --help``."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from cad.design_arguments import add_design_arguments, agreed_design, design_of
from cad.errors import EndcapError, ParameterError, printable
from cad.extras import program
from cad.messages import LOG, show
from cad.params import EndcapParams
from sensing.arguments import number, whole
from sensing.doctor.examine import Report, examine, take_live
from sensing.doctor.finding import Finding, Verdict, finding
from sensing.records import Frame
from sensing.sources.camera import CameraConfig, list_devices
from sensing.sources.choose import is_camera_number, source_opener

DESCRIPTION = """\
Look at cameras of untouched endcaps: rate, jitter, dropped frames, USB, noise reduction over time, size of the
pictures, exposure, light, focus, size of the dots, and which dots are missing; each with a verdict (good, look, bad)
and a fix.

  python -m sensing.sources check                       all cameras of this computer
  python -m sensing.sources check 0 2 http://127.0.0.1:8081/
  python -m sensing.sources check photos/ rest.avi run.mcap
"""
EPILOG = "exit status: 0 nothing is bad, 1 something is, 2 bad input (one line on stderr)"
FEWEST, MOST = 1, 3000  # frames
COLOURS = {Verdict.GOOD: "32", Verdict.LOOK: "33", Verdict.BAD: "31"}
Recorded = Callable[[Path], Iterator[tuple[str, EndcapParams, Iterator[Frame]]]]  # (endcap, its design, its frames)


def main(arguments: Sequence[str], recorded: Recorded) -> int:
    """Check all sources; returns the exit status.

    Args:
        arguments: behind ``check``.
        recorded: opens a recording.
    """
    options = _parser().parse_args(arguments)
    try:
        if not FEWEST <= options.frames <= MOST:
            raise ParameterError(f"--frames {options.frames} outside {FEWEST}..{MOST}", name="frames")
        params = design_of(options)
        words = options.source or [str(number) for number, _ in list_devices()]
        if not words:
            raise ParameterError("no camera found: plug one in, or name a source (see --help)", name="source")
        reports = []
        for word in words:
            for report in _reports(word, options, params, recorded):
                reports.append(report)
                if not options.json:
                    show(_text(report, sys.stdout.isatty()))
    except EndcapError as error:
        LOG.error(f"sensing.sources: {error}")
        return 2
    except KeyboardInterrupt:
        return 130
    if options.json:
        sys.stdout.write(json.dumps([_plain(report) for report in reports], allow_nan=False, indent=1) + "\n")
    return int(any(report.verdict is Verdict.BAD for report in reports))


def _reports(word: str, options: argparse.Namespace, params: EndcapParams, recorded: Recorded) -> Iterator[Report]:
    if word.lower().endswith(".mcap"):
        for endcap, held, pictures in recorded(Path(word)):
            design = agreed_design(options, held, word)
            yield examine(f"{word}: {endcap}", list(islice(pictures, options.frames)), design, timed=True)
        return
    camera = CameraConfig(rate_hz=options.rate, exposure=options.exposure)
    opener, live = source_opener(word, camera)
    name = f"/dev/video{word}" if is_camera_number(word) else word
    if not live:
        source = opener()
        report = examine(name, list(islice(source, options.frames)), params, timed=False)
        if note := getattr(source, "note", ""):  # of a video that ended too early
            cut = finding("file", Verdict.BAD, note, "copy or record it again")
            report = dataclasses.replace(report, findings=(cut, *report.findings))
        yield report
        return
    frames, message = take_live(opener, options.frames)
    usb = is_camera_number(word) or word.startswith("/dev/")
    report = examine(name, frames, params, timed=True, asked_hz=options.rate if usb else None)
    if not frames and message:
        said = dataclasses.replace(report.findings[0], text=f"no frame came: {message}")
        report = dataclasses.replace(report, findings=(said,))
    yield report


def _text(report: Report, colour: bool) -> str:
    size = "" if report.size is None else f", {report.size[0]} x {report.size[1]} px"
    lines = [f"{printable(report.source)}: {report.verdict}; {report.frames} frames{size}"]
    for each in report.findings:
        word = f"{each.verdict:<4}"
        if colour:
            word = f"\x1b[{COLOURS[each.verdict]}m{word}\x1b[0m"
        lines.append(f"  {word}  {each.name:<9} {printable(each.text)}")
        if each.fix:
            lines.append(f"  {'':<4}  {'':<9} -> {each.fix}")
    return "\n".join(lines)


def _plain(report: Report) -> dict[str, Any]:
    return {
        "source": printable(report.source),
        "verdict": report.verdict.value,
        "frames": report.frames,
        "size": None if report.size is None else list(report.size),
        "findings": [_plain_finding(each) for each in report.findings],
    }


def _plain_finding(each: Finding) -> dict[str, Any]:
    values = {
        name: value if isinstance(value, list) else round(value, 4) if math.isfinite(value) else None
        for name, value in each.values.items()
    }
    return {"name": each.name, "verdict": each.verdict.value, "text": each.text, "fix": each.fix, "values": values}


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.sources check"), description=DESCRIPTION, epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("source", nargs="*", help="camera number, address, folder, video, picture or recording")
    parser.add_argument("--frames", type=whole, default=90, metavar="N", help="to look at (90: three seconds)")
    parser.add_argument("--rate", type=number, default=30.0, metavar="HZ", help="to ask of a camera (30)")
    parser.add_argument("--exposure", type=number, metavar="V", help="fixed exposure, the driver's unit")
    add_design_arguments(parser, with_defaults=False)
    parser.add_argument("--json", action="store_true", help="as JSON, for programs")
    return parser
