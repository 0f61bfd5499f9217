"""Pairs camera frames with a force/torque sensor into labelled frames that sensing.train reads.

    python -m sensing.record --source 0 --netft 192.168.1.1 --mount mount.json --out exports/endcap3
    python -m sensing.record --source run.avi --ft-csv run.csv --mount mount.json --out exports/endcap3
    python -m sensing.train exports/endcap3 --method dots --start default --out endcap3.safetensors

Begin untouched: the first frames (--rest) give the reference picture and the sensor's tare. Then press; every time
the force goes back to rest a new loading path begins, and paths are what training and test never share. mount.json
holds T_endcap_ft (4 x 4, mm) and reads (1: the sensor carries the endcap; -1: the endcap presses on the
sensor), see sensing/frames.py. Running again with the same folder goes on. Times are seconds of one clock.

A CSV file has a line of names and one sample a line: time_s (s, on the clock of the frames; that of a video or a folder
begins at 0), fx_n, fy_n, fz_n (N), tx_nm, ty_nm, tz_nm (N m), in the sensor's own axes. Forces over 2000 N and torques
over 200 N m are refused as wrong units. Of a NetFT, the rate of its counter and half its answer time, taken for the
delay on the network, are found out and printed; a label is off by what is wrong with it, and by the camera's own delay.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from cad.design_arguments import add_design_arguments, design_of
from cad.errors import EndcapError, FileError, ParameterError
from cad.extras import program
from cad.materials import DEFAULT_SILICONE
from cad.messages import LOG, show
from sensing.arguments import number, silicone_name, whole
from sensing.decode import FrameError, decode_gray
from sensing.frames import ACTION, REACTION, FtMount
from sensing.live.core.warm_up import warm_up
from sensing.live.ending import leave
from sensing.recording.folder import Recording
from sensing.recording.ft_streams import COUNTS, PORT, CsvFt, NetFt
from sensing.recording.progress import Progress
from sensing.recording.synchronise import SLOP_S, Synchroniser
from sensing.records import Frame
from sensing.sources.choose import open_frames
from sensing.tracking.zero import LEAST_FRAMES, take_zero

REST_FRAMES = 30
MOST_WAITING = 300  # frames that wait for their force; more means that the stream lags


@dataclass(frozen=True)
class RecordResult:
    """Result of a recording: frames written, frames without a force near enough, bad packets, damaged pictures."""

    written: int
    unpaired: int
    faulty: int
    damaged: int = 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        stream = CsvFt(options.ft_csv) if options.ft_csv else NetFt(
            options.netft, options.port, options.counts_n, options.counts_nm, options.ft_rate, options.ft_delay
        )  # fmt: skip
        params = design_of(options)
        mount = read_mount(options.mount)
        if options.netft:
            warm_up(LOG.info)  # or frames and samples would be lost meanwhile
        with (
            Recording(options.out, params, mount, options.silicone) as recording,
            open_frames(options.source) as frames,
        ):
            result = record(frames, stream, recording, options.slop, options.rest, options.frames)
    except EndcapError as error:
        LOG.error(f"sensing.record: {error}")
        return 2
    except KeyboardInterrupt:
        on = "a file is recorded whole, into an empty folder" if options.ft_csv else "the same command goes on"
        LOG.error(f"\nsensing.record: stopped; what is written stays, {on}")
        return 130
    show(
        f"{options.out}: {result.written} frames written now, {recording.paths} paths in all, {result.unpaired} frames "
        f"without a force within {options.slop:g} s, {result.faulty} faulty packets"
        + (f", {result.damaged} damaged pictures left out" if result.damaged else "")
    )
    if stream.note:
        show(stream.note)
    if not result.written:
        LOG.error(
            f"sensing.record: nothing was written: {options.rest} untouched frames with a force, then those to "
            "learn from, are needed; do frames and forces have the same clock?"
        )
    return 0 if result.written else 1


def record(
    frames: Iterable[Frame],
    stream: NetFt | CsvFt,
    recording: Recording,
    slop_s: float = SLOP_S,
    rest_frames: int = REST_FRAMES,
    most: int | None = None,
) -> RecordResult:
    """Pair frames with forces and write them until the frames end; after an error, paired frames are still written.

    Args:
        frames: of the endcap.
        stream: of the force/torque sensor.
        recording: the folder.
        slop_s: largest time between a frame and a sample of its pair.
        rest_frames: first frames, untouched, that make the reference.
        most: frames to take; None for all.

    Raises:
        ParameterError: too few untouched frames, or a slop out of range.
        ZeroError: the endcap moved during the first frames.
        ClockError: a clock jumped.
        StreamError: the stream broke.
        FileError: no space left.
    """
    _check_counts(rest_frames, most)
    synchroniser = Synchroniser(slop_s)
    waiting: deque[Frame] = deque()
    rest: list[Frame] = []
    readings: list[Any] = []
    with stream, Progress(rest_frames) as progress:
        read = _Reader(stream, synchroniser).read
        try:
            for frame in _whole(islice(frames, most), progress):
                progress.samples += read()
                waiting.append(frame)
                while waiting and (synchroniser.covers(waiting[0].time_s) or len(waiting) > MOST_WAITING):
                    frame = waiting.popleft()
                    reading = synchroniser.at(frame.time_s)
                    if reading is None:
                        progress.unpaired += 1
                    elif len(rest) < rest_frames:
                        rest.append(frame)
                        readings.append(reading)
                        progress.rest += 1
                        if len(rest) == rest_frames:
                            recording.begin(take_zero(rest, recording.name, recording.params), np.mean(readings, 0))
                    else:
                        progress.force_n = recording.add(frame, reading)
                        progress.written += 1
                progress.waiting = len(waiting)
        finally:
            recording.flush()
    return RecordResult(progress.written, progress.unpaired + len(waiting), stream.faulty, progress.damaged)


def _whole(frames: Iterable[Frame], progress: Progress) -> Iterator[Frame]:
    """Pictures that can be decoded, all counted; one that cannot would stop the training on all others."""
    for frame in frames:
        progress.frames += 1
        try:
            decode_gray(frame, 8)
        except FrameError:
            progress.damaged += 1
        else:
            yield frame


class _Reader:
    """Reads a stream between frames; samples lost meanwhile do not count as jumps of its clock."""

    def __init__(self, stream: NetFt | CsvFt, synchroniser: Synchroniser) -> None:
        self._stream, self._synchroniser = stream, synchroniser
        self._looks_s = deque([time.monotonic()] * 2, maxlen=2)  # a gap may show at the second look only

    def read(self) -> int:
        """Read all samples that have arrived; returns their number."""
        unread_s, count = time.monotonic() - self._looks_s[0], 0
        for sample in self._stream.arrived():
            self._synchroniser.add(sample, unread_s)
            count += 1
        self._looks_s.append(time.monotonic())
        return count


def _check_counts(rest_frames: int, most: int | None) -> None:
    """Refuse counts of frames that give no reference, or nothing beside it."""
    if rest_frames < LEAST_FRAMES:
        raise ParameterError(
            f"rest={rest_frames}: at least {LEAST_FRAMES} untouched frames make the reference and the tare",
            name="rest",
            value=rest_frames,
        )
    if most is not None and most <= rest_frames:
        raise ParameterError(
            f"frames={most}: give more than the {rest_frames} untouched ones (--rest), the others are to learn from",
            name="frames",
            value=most,
        )


def read_mount(path: Path) -> FtMount:
    """Mounting of the force/torque sensor from JSON.

    Raises:
        FileError: missing, no JSON, or no such numbers.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        reads = found["reads"]
        if isinstance(reads, bool) or reads not in (ACTION, REACTION):
            raise ValueError(f"reads={json.dumps(reads)[:40]}")
        return FtMount(np.array(found["T_endcap_ft"], float), int(reads))
    except OSError as error:
        raise FileError(f"{path}: cannot read ({error.strerror}): give the sensor's mounting") from error
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise FileError(
            f'{path}: no mounting ({error}): needs {{"T_endcap_ft": 4x4 rigid transform in mm, "reads": {ACTION} or '
            f"{REACTION}}}"
        ) from error


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.record"),
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--source", required=True, metavar="S", help="camera number, address, video or folder")
    force = parser.add_mutually_exclusive_group(required=True)
    force.add_argument("--netft", metavar="HOST", help="address of an ATI NetFT")
    force.add_argument("--ft-csv", type=Path, metavar="FILE", help="samples with time_s on the frames' clock")
    parser.add_argument("--mount", type=Path, required=True, metavar="FILE", help="how the sensor is mounted (JSON)")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder; of an earlier run: continued")
    add_design_arguments(parser)
    parser.add_argument(
        "--silicone",
        type=silicone_name,
        default=DEFAULT_SILICONE,
        metavar="NAME",
        help=f"of the endcap, cad/materials.csv ({DEFAULT_SILICONE})",
    )
    parser.add_argument("--slop", type=number, default=SLOP_S, metavar="S", help=f"longest from a frame ({SLOP_S:g})")
    parser.add_argument(
        "--rest", type=whole, default=REST_FRAMES, metavar="N", help=f"first, untouched frames ({REST_FRAMES})"
    )
    parser.add_argument("--frames", type=whole, metavar="N", help="stop after so many frames")
    parser.add_argument("--port", type=whole, default=PORT, metavar="N", help=f"of the NetFT ({PORT})")
    parser.add_argument("--ft-rate", type=number, metavar="HZ", help="counts a second of the NetFT (found out)")
    parser.add_argument("--ft-delay", type=number, metavar="S", help="network delay of a sample (half the answer time)")
    parser.add_argument("--counts-n", type=number, default=COUNTS, metavar="N", help="NetFT counts per N (1e6)")
    parser.add_argument("--counts-nm", type=number, default=COUNTS, metavar="N", help="NetFT counts per N m (1e6)")
    return parser


if __name__ == "__main__":
    leave(main())
