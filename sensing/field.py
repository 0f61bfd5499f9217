"""Two pictures, or a video, to the shear field: the command line and the function behind it.

    python -m sensing.field --method dots --reference a.jpg --frame b.jpg --out field.npy --picture field.png
    python -m sensing.field --method gelslim --reference a.jpg --video press.avi --out fields.npz

``.npy`` holds the channels, (C, H, W) for a frame and (T, C, H, W) for a video, float32, u (right) and v (down) first,
in pixels of the 200 x 200 centre crop. ``.npz`` adds names, valid, time_s and, for the dots, their tracks.
"""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from cad.design_arguments import add_design_arguments, agreed_design
from cad.errors import EndcapError, ParameterError
from cad.extras import program
from cad.messages import LOG, show, transient
from cad.params import EndcapParams
from cad.whole_file import replace_file, require_place
from sensing.arguments import pair
from sensing.decode import FrameError, decode_bgr
from sensing.records import DotTracks, Frame, ShearField
from sensing.sources.coding import coding_doubt
from sensing.sources.files import FolderSource, VideoSource, read_picture
from sensing.tracking.field.picture import draw_field
from sensing.tracking.gelslim import CHANGE_CHANNELS, CHANNELS, GelslimConfig, GelslimField, derived_channels
from sensing.tracking.methods import DotField, FieldMethod, field_method, known_methods
from sensing.tracking.zero import MOST_UNSEEN, load_zero


@dataclass(frozen=True)
class FieldResult:
    """Field and tracks of one frame.

    Attributes:
        frame: the frame.
        field: its field.
        tracks: dot tracks, None for methods without dots.
    """

    frame: Frame
    field: ShearField
    tracks: DotTracks | None


def compute_fields(
    method: str,
    reference: Frame,
    frames: Iterable[Frame],
    shape: tuple[int, int] = (30, 30),
    channels: tuple[str, ...] = ("u", "v"),
    params: EndcapParams | None = None,
) -> Iterator[FieldResult]:
    """Fields of frames against one undeformed reference, one by one.

    Args:
        method: one of :func:`sensing.tracking.methods.known_methods`.
        reference: the undeformed picture.
        frames: pictures of the same size.
        shape: (H, W) of the field.
        channels: any of :data:`sensing.tracking.gelslim.CHANNELS`; changes (du ...) only with ``gelslim``.
        params: the design, whose dots ``dots`` looks for; None for dots that look like the released ones.

    Raises:
        EndcapError: unknown method or channel, no dots in the reference, a frame of another size or unreadable.
    """
    worker = _worker(method, reference, shape, channels, params)
    full = decode_bgr(reference).shape
    for frame in frames:
        if frame.size is not None and frame.size != (full[1], full[0]):
            raise FrameError(
                f"{frame.source}: {frame.size[0]}x{frame.size[1]} px, but the reference {reference.source} has "
                f"{full[1]}x{full[0]}: take both with the same camera mode"
            )
        field = worker.update(frame)
        if field.names != channels:
            field = _with_channels(field, channels)
        yield FieldResult(frame, field, worker.tracks if isinstance(worker, DotField) else None)


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    parser = _parser()
    options = parser.parse_args(arguments)
    try:
        _run(options)
    except EndcapError as error:
        LOG.error(f"sensing.field: {error}")
        return 2
    except KeyboardInterrupt:
        LOG.error("sensing.field: stopped, nothing written")
        return 130
    return 0


def _run(options: argparse.Namespace) -> None:
    if options.out is None and options.picture is None:
        raise ParameterError("nothing to write: give --out FILE.npy, --picture FILE.png or both", name="out")
    if options.out is not None and options.out.suffix not in (".npy", ".npz"):
        raise ParameterError(f"--out {options.out}: the name must end in .npy or .npz", name="out", value=options.out)
    if options.picture is not None and options.picture.suffix.lower() not in (".png", ".jpg"):
        raise ParameterError(
            f"--picture {options.picture}: the name must end in .png or .jpg", name="picture", value=options.picture
        )
    for path in filter(None, (options.out, options.picture)):
        require_place(path)
    zero = load_zero(options.reference) if options.reference.suffix == ".npz" else None
    reference = zero.frame() if zero else read_picture(options.reference)
    params = agreed_design(options, zero.params if zero else None, options.reference)
    frames: Iterable[Frame]
    if options.video is None:
        frames = [read_picture(options.frame)]
    else:
        frames = FolderSource(options.video) if os.path.isdir(options.video) else VideoSource(options.video)
    channels = tuple(name.strip() for name in options.channels.split(","))
    results = []
    for result in compute_fields(options.method, reference, frames, options.shape, channels, params):
        results.append(result)
        if options.video is not None:
            transient(f"{len(results)} frames")
    if options.video is not None:
        transient(f"{len(results)} frames", done=True)
    if isinstance(frames, VideoSource):
        coded = frames.coding and f"{options.video}: {coding_doubt(frames.coding)}"
        for doubt in filter(None, (frames.note, coded)):
            LOG.warning(f"sensing.field: {doubt}")
    _require_seen(options.video or options.frame, results)
    if options.out is not None:
        _save(options.out, results, single=options.video is None)
    if options.picture is not None:
        _save_picture(options.picture, results)
    show(_summary(options.method, results))


def _require_seen(source: Path, results: list[FieldResult]) -> None:
    """Refuse pictures that show no dot; warn of those that show too few."""
    if not any(result.field.valid.any() for result in results):
        raise FrameError(
            f"{source}: none of the reference's dots are seen: is it the same sensor, the lamp on, the lens free?"
        )
    covered = sum(map(_covered, results))
    if covered:
        LOG.warning(
            f"sensing.field: in {covered} of {len(results)} frame(s) over {MOST_UNSEEN:.0%} of the dots are not seen: "
            "cells far from those that are seen are NaN in a .npy, marked as not valid in a .npz"
        )


def _covered(result: FieldResult) -> bool:
    """Whether too few dots are followed for a field of an untouched or pressed dome."""
    return result.tracks is not None and float(result.tracks.lost.mean()) > MOST_UNSEEN


def _worker(
    method: str, reference: Frame, shape: tuple[int, int], channels: tuple[str, ...], params: EndcapParams | None
) -> FieldMethod:
    if method == "gelslim":
        return GelslimField(reference, GelslimConfig(shape, channels))
    GelslimConfig(shape, channels)  # the same bounds for all methods
    changes = [name for name in channels if name in CHANGE_CHANNELS]
    if changes:
        raise ParameterError(
            f"channels={','.join(changes)}: only --method gelslim gives them", name="channels", value=channels
        )
    return field_method(method, reference, shape, params)


def _with_channels(field: ShearField, channels: tuple[str, ...]) -> ShearField:
    u, v = field.channel("u"), field.channel("v")
    known = {"u": u, "v": v} | derived_channels(u, v, channels)
    stack = np.stack([known[name] for name in channels]).astype(np.float32)
    return ShearField(field.time_s, stack, channels, field.unit, field.valid)


def _save(path: Path, results: list[FieldResult], single: bool) -> None:
    fields = [r.field for r in results]
    channels = fields[0].channels if single else np.stack([f.channels for f in fields])
    if path.suffix == ".npy":
        known = np.stack([r.field.valid | (not _covered(r)) for r in results])[:, None]
        channels = np.where(known[0] if single else known, channels, np.float32(np.nan))
        np.save(buffer := io.BytesIO(), channels)
        replace_file(path, buffer.getvalue())
        return
    content: dict[str, NDArray] = {
        "channels": channels,
        "names": np.array(fields[0].names),
        "valid": np.stack([f.valid for f in fields]),
        "time_s": np.array([f.time_s for f in fields]),
    }
    tracks = [r.tracks for r in results if r.tracks is not None]
    if tracks:
        content |= {name: np.stack([getattr(t, name) for t in tracks]) for name in ("position_px", "quality", "lost")}
        content["reference_px"] = np.asarray(tracks[0].reference_px)
    np.savez_compressed(buffer := io.BytesIO(), **content)  # type: ignore[arg-type]
    replace_file(path, buffer.getvalue())


def _save_picture(path: Path, results: list[FieldResult]) -> None:
    """One picture, or for a video one per frame with the frame number before the suffix."""
    for index, result in enumerate(results):
        name = path if len(results) == 1 else path.with_name(f"{path.stem}_{index:05d}{path.suffix}")
        image = draw_field(decode_bgr(result.frame), result.field, result.tracks)
        replace_file(name, cv2.imencode(name.suffix, image)[1].tobytes())


def _summary(method: str, results: list[FieldResult]) -> str:
    last = results[-1]
    u, v = last.field.channels[0], last.field.channels[1] if len(last.field.names) > 1 else 0
    size = np.hypot(u, v)[last.field.valid] if last.field.names[:2] == ("u", "v") else np.abs(u[last.field.valid])
    text = f"{method}: {len(results)} frame(s), field {'x'.join(map(str, last.field.channels.shape))}"
    text += ", of the last one" if len(results) > 1 else ""
    if size.size:
        text += f", mean {size.mean():.3f}, largest {size.max():.3f} px of 200, valid {last.field.valid.mean():.0%}"
    if last.tracks is not None:
        text += f", {int((~last.tracks.lost).sum())} of {len(last.tracks.ids)} dots followed"
    return text


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.field"),
        description="Shear field of a picture, or of a video, against the undeformed picture of the same sensor.",
        epilog="Unit of u, v: pixels of the 200x200 centre crop. Bad input: one line on stderr, exit status 2.",
    )
    parser.add_argument("--method", choices=known_methods(), default="dots", help="gelslim: the released pipeline")
    parser.add_argument(
        "--reference", type=Path, required=True, help="picture of the untouched sensor, or its zero (.npz)"
    )
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--frame", type=Path, help="one picture")
    what.add_argument("--video", type=Path, help="a video file, or a folder of pictures")
    add_design_arguments(parser, with_defaults=False)
    parser.add_argument("--shape", type=pair, default=(30, 30), metavar="HxW", help="cells (default 30x30)")
    parser.add_argument("--channels", default="u,v", help=f"comma-separated, of {', '.join(CHANNELS)} (default u,v)")
    parser.add_argument("--out", type=Path, metavar="FILE", help=".npy (channels) or .npz (with mask, times, tracks)")
    parser.add_argument("--picture", type=Path, metavar="FILE", help=".png or .jpg: image, dots, arrows, quality")
    return parser


if __name__ == "__main__":
    sys.exit(main())
