"""The undeformed reference: average of an interval without contact, its file, and the drift since.

A touch deforms part of the skin; an ageing lamp or a camera that settles in its mount changes the whole picture. Drift
is classified accordingly: one motion of picture or camera that fits all dots is the mounting
(:mod:`sensing.tracking.mounting`); a change of brightness without motion is the lamp; dots that are lost while the
others do not move are hidden; anything else is contact.

Units: full-size pixels, seconds. File format: ``.npz``, read without pickle.
"""

from __future__ import annotations

import datetime
import hashlib
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from cad.errors import EndcapError, FileError
from cad.identity import Identity, recorded, require_same
from cad.params import EndcapParams
from cad.whole_file import replace_file
from sensing.camera.nominal import nominal_lens
from sensing.decode import MOST_PIXELS, decode_bgr, decode_gray, png_size, working_reduction
from sensing.npz import read_npz
from sensing.records import DotTracks, Frame, Image
from sensing.tracking.dots import find_dots
from sensing.tracking.mounting import CommonMotion, MotionKind, common_motion
from sensing.tracking.tracker import DotTracker

STILL_PX = 0.6  # at 480: dots that move more than this during the interval are being touched
CONTACT_PX = 0.8  # at 480: dot motion left by the common one, from which it is contact
LAMP = 0.1  # relative change of brightness from which the lamp has drifted
LEAST_FRAMES = 3  # needed to separate rest from motion
MOST_FILE_BYTES = 1 << 26  # of a reference file when unpacked
LOST_SHARE = 0.3  # of the dots that may be lost in a frame of the interval
MOST_UNSEEN = 0.12  # E: share of the reference's dots; an untouched dome that shows fewer is covered
Cause = Literal["none", "lamp", "mounting", "hidden", "contact"]


class ZeroError(EndcapError):
    """A reference that cannot be taken: too few frames, no dots, or something moved."""


@dataclass(frozen=True)
class Zero:
    """A reference and where it comes from.

    Attributes:
        image: (H, W, 3) BGR average of the interval.
        sensor: name of the sensor.
        date: ISO date and time (UTC) of the interval.
        frames: number of frames averaged.
        noise_px: (N,) rms motion of each dot within the interval.
        brightness: mean gray of the picture.
        exposure: exposure that the driver reported; NaN where it reported none.
        made_of: identity of the endcap; None where it is unknown.
        error_px: standard deviation of an axis of a dot at rest against the picture; 0 where it is unknown.
    """

    image: Image
    sensor: str
    date: str
    frames: int
    noise_px: NDArray[np.float64]
    brightness: float
    exposure: float = float("nan")
    made_of: Identity | None = None
    error_px: float = 0.0

    @property
    def params(self) -> EndcapParams | None:
        """The design; None where it is unknown."""
        return None if self.made_of is None else self.made_of.design

    @property
    def digest(self) -> str:
        """SHA-256 of the picture, by which fields and weights can name their reference."""
        return hashlib.sha256(np.ascontiguousarray(self.image).tobytes()).hexdigest()

    def frame(self) -> Frame:
        """The reference as a frame for :class:`sensing.tracking.tracker.DotTracker` and the other methods."""
        return Frame(0.0, 0, f"reference of {self.sensor}", image=self.image)


@dataclass(frozen=True)
class Drift:
    """Drift since the reference was taken.

    Attributes:
        cause: ``none``, ``lamp``, ``mounting``, ``hidden`` (dots of the reference are not seen) or ``contact``; a later
            one comes before an earlier.
        shift_px: (2,) x, y of the similarity motion at the picture's centre.
        turn_rad: its rotation.
        scale: its scale.
        residual_px: third largest dot motion that it leaves, or that the camera's own motion does.
        brightness: gray level now over that of the reference.
        unseen: share of the reference's dots that are not seen.
    """

    cause: Cause
    shift_px: NDArray[np.float64]
    turn_rad: float
    scale: float
    residual_px: float
    brightness: float
    unseen: float = 0.0


def take_zero(frames: Sequence[Frame], sensor: str = "endcap", params: EndcapParams | None = None) -> Zero:
    """Average an interval without contact.

    Args:
        frames: of the untouched sensor.
        sensor: its name.
        params: its design, whose dots are looked for; None for dots that look like the released ones.

    Raises:
        ZeroError: fewer than three frames, sizes that differ, or dots that moved (then the offender is named).
        NoDotsError: a frame without dots.
        ParameterError: pictures that stand upright.
    """
    if len(frames) < LEAST_FRAMES:
        raise ZeroError(f"{len(frames)} frames: at least {LEAST_FRAMES} needed to separate rest from motion")
    image = _averaged(frames)
    nominal_lens(image.shape[1], image.shape[0])  # refuses upright ones
    tracker = DotTracker(frames[0], params=params)
    limit = STILL_PX * min(tracker.size) / 480.0
    moved = []
    for frame in frames:
        tracks = tracker.update(frame)
        if tracks.lost.mean() > LOST_SHARE:  # a dark or empty picture is named as what it is
            reduction = working_reduction(tracker.size)
            find_dots(decode_gray(frame, reduction), max(1, len(tracker.dots) // 2), frame.source, params)
        live = ~tracks.lost
        largest = np.percentile(np.linalg.norm(tracks.displacement_px[live], axis=1), 95) if live.any() else np.inf
        if tracks.lost.mean() > LOST_SHARE or largest > limit:
            raise ZeroError(
                f"{frame.source}: frame {frame.sequence} moved by {largest:.2f} px, at most {limit:.2f} allowed: "
                "keep the sensor untouched and still, and zero again"
            )
        moved.append(tracks.displacement_px)
    noise = np.sqrt(np.mean((np.stack(moved) - np.mean(moved, axis=0)) ** 2, axis=(0, 2)))
    known = [f.exposure for f in frames if f.exposure is not None]
    date = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    exposure = float(np.mean(known)) if known else float("nan")
    brightness = _brightness(Frame(0.0, 0, sensor, image=image))
    error_px = _error_px(noise, len(frames))
    return Zero(image, sensor, date, len(frames), noise, brightness, exposure, error_px=error_px)


def _error_px(noise_px: NDArray[np.float64], frames: int) -> float:
    """Of :class:`Zero`: the mean of n pictures takes 1/n of a dot's variance out of the interval, and has it itself."""
    if frames < LEAST_FRAMES or not noise_px.size:
        return 0.0
    return float(np.sqrt(np.mean(noise_px**2) * (frames + 1) / (frames - 1)))


def _averaged(frames: Sequence[Frame]) -> Image:
    """(H, W, 3) mean of pictures; only one is decoded at a time.

    Raises:
        ZeroError: sizes that differ.
    """
    total, shapes = np.zeros(0), set()
    for frame in frames:
        picture = decode_bgr(frame)
        shapes.add(picture.shape)
        if len(shapes) == 1:
            total = total + picture if total.size else picture.astype(np.int64)
    if len(shapes) > 1:
        raise ZeroError(f"frames of different sizes {sorted(shape[:2] for shape in shapes)}: fix the camera mode")
    return np.rint(total.astype(np.float32) / np.float32(len(frames))).astype(np.uint8)


def single_zero(frame: Frame, sensor: str = "endcap") -> Zero:
    """One picture as a reference, where no interval is to be had (a folder of photos); its noise is unknown.

    Raises:
        FrameError: the picture cannot be decoded.
    """
    image = decode_bgr(frame)
    date = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    brightness = _brightness(Frame(0.0, 0, sensor, image=image))
    exposure = float("nan") if frame.exposure is None else frame.exposure
    return Zero(image, sensor, date, 1, np.zeros(0), brightness, exposure)


def save_zero(zero: Zero, path: Path | str) -> None:
    """Write ``.npz`` under a temporary name, then rename.

    Raises:
        FileError: the place cannot be written.
    """
    path = Path(path)
    about = {name: getattr(zero, name) for name in ("sensor", "date", "frames", "brightness", "exposure")}
    about |= {"digest": zero.digest, "identity": None if zero.made_of is None else zero.made_of.record()}
    png = cv2.imencode(".png", zero.image)[1]
    buffer = io.BytesIO()
    np.savez(buffer, png=png, noise_px=zero.noise_px, about=np.array(json.dumps(about)))
    replace_file(path, buffer.getvalue())


def load_zero(path: Path | str, wanted: Identity | None = None) -> Zero:
    """Read what :func:`save_zero` wrote.

    Args:
        path: the file.
        wanted: the endcap at hand; None takes a reference of any.

    Raises:
        FileError: missing, no such file format, the picture does not match its digest, or it is a reference of another
            endcap or dot pattern.
    """
    try:
        data = read_npz(path, ("about", "png", "noise_px"), MOST_FILE_BYTES)
        about, noise = json.loads(str(data["about"])), np.array(data["noise_px"], float)
        size = png_size(data["png"].tobytes()[:24])
        if size is None or size[0] * size[1] > MOST_PIXELS:
            raise ValueError(f"a picture of {size} px")
        image = cv2.imdecode(data["png"], cv2.IMREAD_COLOR)
        if image is None:
            raise ValueError("no picture")
        digest, stated = about.pop("digest"), about.pop("identity", {})
        design = wanted.design if wanted is not None else None
        made_of: Identity | None = None  # null: unknown
        if stated:
            made_of = recorded(stated, EndcapParams(**stated["design"]))
        elif stated is not None and design is not None:
            made_of = recorded(None, design)  # of before: the released pattern
        for name, kind in (("sensor", str), ("date", str), ("frames", int), ("brightness", float), ("exposure", float)):
            about[name] = kind(about[name])
        if not ((noise >= 0) & (noise < min(size))).all():
            raise ValueError("dots that scatter by no number of pixels")
        zero = Zero(image=image, noise_px=noise, made_of=made_of, error_px=_error_px(noise, about["frames"]), **about)
    except OSError as error:
        raise FileError(f"{path}: {error.strerror or error}: give a file written by zeroing") from None
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError, cv2.error) as error:
        said = " ".join(str(error).split())[:100]
        raise FileError(f"{path}: no reference file ({said}): zero the sensor again") from None
    if zero.digest != digest:
        raise FileError(f"{path}: the picture does not match its digest: the file is damaged, zero the sensor again")
    require_same(path, "a reference", zero.made_of, wanted, "zero the sensor again", ("dots",))
    return zero


def measure_drift(
    zero: Zero, frame: Frame, tracks: DotTracks, gray: Image | None = None, motion: CommonMotion | None = None
) -> Drift:
    """Drift between the reference and a frame with its tracks.

    Args:
        zero: the reference.
        frame: the later picture.
        tracks: its dots.
        gray: the frame, if it is decoded already.
        motion: what the dots have in common, if it is known already.

    Raises:
        FrameError: the frame cannot be decoded.
    """
    ratio = (_brightness(frame) if gray is None else cv2.mean(gray)[0]) / max(zero.brightness, 1e-6)
    unseen, unit = float(tracks.lost.mean()), min(tracks.size) / 480.0
    motion = motion or common_motion(tracks, zero.params)
    if motion is None:
        return Drift("hidden", np.zeros(2), 0.0, 1.0, float("inf"), ratio, unseen)
    if motion.residual_px > CONTACT_PX * unit or (motion.moved and motion.kind is MotionKind.CONTACT):
        cause: Cause = "contact"
    elif unseen > MOST_UNSEEN:
        cause = "hidden"
    elif motion.kind is MotionKind.MOUNTING:
        cause = "mounting"
    elif abs(ratio - 1) > LAMP:
        cause = "lamp"
    else:
        cause = "none"
    return Drift(cause, motion.shift_px, motion.turn_rad, motion.scale, motion.residual_px, ratio, unseen)


def _brightness(frame: Frame) -> float:
    """Mean gray level; a quarter of the size is enough for a mean."""
    return float(decode_gray(frame, 4).mean())
