"""The undeformed reference of a sensor: take it, compare with it, keep it up to date.

    python -m sensing.zero take --source 0 --sensor "endcap 3" --out endcap3.npz
    python -m sensing.zero check --zero endcap3.npz --source 0
    python -m sensing.zero watch --zero endcap3.npz --source 0 --still 30

What it is and when it is renewed: :mod:`sensing.tracking.zero`.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cad.design_arguments import add_design_arguments, design_of, design_words
from cad.errors import EndcapError, ParameterError
from cad.extras import program
from cad.identity import Identity, identity
from cad.messages import LOG, show
from cad.params import EndcapParams
from cad.plain_numbers import plain_number
from sensing.calibration.command_for import calibrate_command
from sensing.calibration.misfit import camera_misfit
from sensing.calibration.rest_picture import light_doubts, picture_doubts
from sensing.camera.light import light_of
from sensing.camera.nominal import nominal_mount
from sensing.decode import FrameError
from sensing.live.ending import leave
from sensing.sources.choose import open_frames
from sensing.tracking.auto_zero import AutoZero
from sensing.tracking.tracker import DotTracker
from sensing.tracking.zero import (
    LEAST_FRAMES,
    Drift,
    Zero,
    ZeroError,
    load_zero,
    measure_drift,
    save_zero,
    take_zero,
)

MEANING = {
    "none": "as when it was zeroed",
    "lamp": "the light has changed: zero again if it stays",
    "mounting": "camera, lens or dome have moved as a whole: zero again when untouched",
    "contact": "something touches the dome, or it was turned and its own weight moves the dots",
    "hidden": "is the lens covered, the lamp off, the picture white?",
}

DAMAGED = "damaged"
TAKE = "average frames of the untouched sensor and store them (zero, re-zero)"
CHECK = "say what has changed: nothing, lamp, mounting, hidden dots or contact"
WATCH = "print changes as they come; renew the file when surely untouched"


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        options.run(options)
    except EndcapError as error:
        LOG.error(f"sensing.zero: {error}")
        return 2
    except KeyboardInterrupt:
        LOG.error("sensing.zero: stopped")
        return 130
    return 0


def _take(options: argparse.Namespace) -> None:
    if options.out.suffix != ".npz":
        raise ParameterError(f"--out {options.out}: give a name that ends in .npz, by which it is read", name="out")
    with open_frames(options.source) as frames:
        interval = list(itertools.islice(frames, options.frames))
    made_of = _made_of(options)
    params = None if made_of is None else made_of.design
    zero = replace(take_zero(interval, options.sensor, params), made_of=made_of)
    save_zero(zero, options.out)
    if all(frame.shows_same(interval[0]) for frame in interval[1:]):
        _warn([f"all {len(interval)} pictures are one and the same: does the camera hang? Plug it in again"])
    if params is None:
        _warn(light_doubts(light_of(zero.image)).values())
    else:
        _compare_with_design(zero, params, options.out)
    exposure = "unknown" if np.isnan(zero.exposure) else f"{zero.exposure:g}"
    show(
        f"{options.out}: {zero.sensor}, {zero.date}, {zero.frames} frames, {len(zero.noise_px)} dots, "
        f"noise {np.median(zero.noise_px):.3f} px, exposure {exposure}, digest {zero.digest[:12]}"
    )


def _compare_with_design(zero: Zero, params: EndcapParams, path: Path) -> None:
    """Warn where dots lie elsewhere than the nominal camera sees the design's, are missing, or lack light."""
    tracker = DotTracker(zero.frame(), params=params)
    misfit = camera_misfit(tracker.reference_px, tracker.size, params)
    if not misfit.fits:
        words = " ".join(design_words(params))
        LOG.warning(
            f"sensing.zero: warning: the picture does not fit {words} ({misfit.reason.split('; ')[0]}): is it of "
            "another design? Then take it again with that one's options; "
            f"else run {calibrate_command(params, path.with_suffix('.json'), path)}"
        )
    camera = nominal_mount(params, *tracker.size) if misfit.found is None else misfit.found.mounted
    _warn(picture_doubts(zero.image, tracker.reference_px, params, camera).values())


def _warn(doubts: Iterable[str]) -> None:
    for doubt in doubts:
        LOG.warning(f"sensing.zero: warning: {doubt}")


def _made_of(options: argparse.Namespace) -> Identity | None:
    """The endcap, where it was given."""
    given = [value is not None for value in (options.diameter, options.wall)]
    dots = options.dot_rings is not None or options.dot_mm is not None
    if any(given) != all(given) or (dots and not any(given)):
        raise ParameterError(
            "--diameter and --wall belong together, and dots to both: give both or none of them", name="diameter"
        )
    if not any(given):
        return None
    return identity(design_of(options)).without("camera")


def _check(options: argparse.Namespace) -> None:
    zero = load_zero(options.zero)
    tracker = DotTracker(zero.frame(), params=zero.params)
    drift = None
    with open_frames(options.source) as frames:
        for frame in itertools.islice(frames, options.frames):
            drift = measure_drift(zero, frame, tracker.update(frame))
    if drift is None:
        raise ZeroError(f"{options.source}: no frame: is the source empty?")
    show(_said(drift))


def _watch(options: argparse.Namespace) -> None:
    """Prints every change of state, and renews the file when the sensor was surely untouched and has drifted."""
    auto = AutoZero(load_zero(options.zero), options.still)
    tracker = DotTracker(auto.zero.frame(), params=auto.zero.params)
    before = ""
    with open_frames(options.source) as frames:
        for frame in frames:
            try:
                renewed = auto.update(frame, tracker.update(frame))
            except FrameError as error:  # of hours of pictures one may be cut
                auto.begin_anew()
                if before != DAMAGED:
                    show(f"{frame.time_s:.2f} s  {error}: passed over")
                    before = DAMAGED
                continue
            if auto.drift is not None and auto.drift.cause != before:
                show(f"{frame.time_s:.2f} s  {_said(auto.drift)}")
                before = auto.drift.cause
            if renewed is not None:
                save_zero(renewed, options.zero)
                tracker = DotTracker(renewed.frame(), params=renewed.params)
                show(f"{frame.time_s:.2f} s  {options.zero}: zeroed again, digest {renewed.digest[:12]}")


def _said(drift: Drift) -> str:
    x, y = drift.shift_px
    if drift.cause == "hidden":
        return f"hidden: {drift.unseen:.0%} of the dots are not seen: {MEANING['hidden']}"
    return (
        f"{drift.cause}: {MEANING[drift.cause]} (shift {x:+.2f}, {y:+.2f} px, "
        f"turn {np.degrees(drift.turn_rad):+.3f} deg, scale {drift.scale:.4f}, "
        f"left {drift.residual_px:.2f} px, brightness x{drift.brightness:.2f})"
    )


def _count(text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 6) or int(text) < LEAST_FRAMES:
        raise argparse.ArgumentTypeError(f"{text!r}: give a whole number from {LEAST_FRAMES} to 99999")
    return int(text)


def _seconds(text: str) -> float:
    try:
        value = plain_number(text)
        if not 0 < value < 86400:
            raise ParameterError(text, name="still", value=value)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: give seconds, more than 0 and less than a day") from None
    return value


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.zero"),
        description="The undeformed reference of a sensor: take it, compare with it, keep it up to date.",
        epilog="A source is a camera number, an http address, a folder of pictures or a video. "
        "Bad input: one line on stderr, exit status 2.",
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    take = commands.add_parser("take", help=TAKE)
    take.add_argument("--sensor", default="endcap", help="name of the sensor")
    take.add_argument("--out", type=Path, required=True, metavar="FILE.npz", help="replaced when it is there")
    add_design_arguments(take.add_argument_group("of the endcap, which live compares"), with_defaults=False)
    take.set_defaults(run=_take)
    check = commands.add_parser("check", help=CHECK)
    check.set_defaults(run=_check)
    watch = commands.add_parser("watch", help=WATCH)
    watch.add_argument("--still", type=_seconds, default=30.0, help="untouched and still for so many seconds (30)")
    watch.set_defaults(run=_watch)
    for command, words in zip((take, check, watch), (TAKE, CHECK, WATCH), strict=True):
        command.description = f"{words[0].upper()}{words[1:]}."
        command.add_argument("--source", required=True, help="camera number, address, folder or video")
    for command in (take, check):
        command.add_argument("--frames", type=_count, default=30, help="frames to use (30)")
    for command in (check, watch):
        command.add_argument("--zero", type=Path, required=True, metavar="FILE.npz", help="written by take")
    return parser


if __name__ == "__main__":
    leave(main())
