"""A frame's bytes to pixels, once, in the colour and at the size that a method needs.

Half, quarter and eighth size come out of the JPEG decoder itself (scaled inverse transform), which saves both the
full-size transform and a resize. Geometry: pixel (x, y) of a picture reduced s times covers s x s full-size pixels,
so its centre lies at full-size (s x + (s - 1) / 2, likewise y): :func:`to_full_px`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
import simplejpeg
from numpy.typing import NDArray

from cad.errors import EndcapError, FileError
from sensing.records import Frame, Image

SHORT_SIDE_PX = 200  # a working picture keeps at least this: half size at 640 x 480, where the trials lost nothing
STORED = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION  # pixels as they lie in a file, never turned by its EXIF
TIFF: dict[bytes, Literal["little", "big"]] = {b"II*\0": "little", b"MM\0*": "big"}
MOST_PIXELS = 1 << 26  # of a picture: a few bytes of a damaged or hostile file may claim gigabytes


class FrameError(EndcapError):
    """A frame that cannot be decoded, or not to a picture of the expected kind."""


def decode_bgr(frame: Frame) -> Image:
    """(H, W, 3) uint8 BGR at full size.

    Raises:
        FrameError: damaged bytes (any complaint of the decoder counts), or an image that is no picture.
    """
    if frame.image is None:
        return _decoded(frame, "BGR", 1)
    image = as_uint8(frame.image, frame.source)
    return cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image


def decode_gray(frame: Frame, reduction: int = 1) -> Image:
    """(H / reduction, W / reduction) uint8 gray; an odd last row or column is rounded up, as the decoder does.

    Args:
        frame: compressed or raw.
        reduction: 1, 2, 4 or 8.

    Raises:
        FrameError: damaged bytes (any complaint of the decoder counts), or an image that is no picture.
    """
    if frame.image is None:
        return np.ascontiguousarray(_decoded(frame, "GRAY", reduction)[:, :, 0])
    image = as_uint8(frame.image, frame.source)
    gray = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image
    return reduce_gray(gray, reduction)


def reduce_gray(gray: Image, reduction: int) -> Image:
    """Area average over reduction x reduction blocks; the border is repeated where a side is no multiple."""
    if reduction == 1:
        return gray
    height, width = gray.shape
    pad_y, pad_x = -height % reduction, -width % reduction
    if pad_y or pad_x:
        gray = cv2.copyMakeBorder(gray, 0, pad_y, 0, pad_x, cv2.BORDER_REPLICATE)
    size = ((width + pad_x) // reduction, (height + pad_y) // reduction)
    return cv2.resize(gray, size, interpolation=cv2.INTER_AREA)


def working_reduction(size: tuple[int, int], short_side_px: int = SHORT_SIDE_PX) -> int:
    """Largest of 1, 2, 4, 8 that leaves the short side of (width, height) at ``short_side_px`` or more."""
    return max((r for r in (1, 2, 4, 8) if min(size) / r >= short_side_px), default=1)


def to_full_px(position: NDArray[np.floating], reduction: int) -> NDArray[np.float64]:
    """Positions in a reduced picture to full-size pixels."""
    return np.asarray(position, float) * reduction + (reduction - 1) / 2


def as_uint8(image: NDArray, source: str) -> Image:
    """An (H, W) or (H, W, 3) uint8 contiguous picture from uint8, uint16 (high byte) or float (0..1 or 0..255).

    Raises:
        FrameError: another type or shape, an empty picture, or values that are not finite.
    """
    image = np.asarray(image)
    if image.ndim == 3 and image.shape[2] == 1:
        image = image[:, :, 0]
    if image.size == 0 or image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] != 3):
        raise FrameError(f"{source}: shape {image.shape} is no picture: give (H, W) gray or (H, W, 3) BGR")
    if image.dtype == np.uint16:
        image = (image >> 8).astype(np.uint8)
    elif np.issubdtype(image.dtype, np.floating):
        if not np.isfinite(image).all():
            raise FrameError(f"{source}: picture holds NaN or infinity: give finite values in 0..1 or 0..255")
        scale = 255.0 if image.max() <= 1.0 else 1.0
        image = np.clip(np.rint(image * scale), 0, 255).astype(np.uint8)
    elif image.dtype != np.uint8:
        raise FrameError(f"{source}: pixel type {image.dtype}: give uint8, uint16 or float")
    return np.ascontiguousarray(image)


def decode_file(path: Path | str, data: bytes, types: str = "JPEG or PNG") -> Image:
    """(H, W, 3) uint8 BGR of a picture file, whatever its type.

    Args:
        path: of the file, for messages.
        data: what is in it.
        types: that it may have, for messages.

    Raises:
        FileError: no picture, several in one file, or one of more pixels than :data:`MOST_PIXELS`.
    """
    if _holds_several(data):
        raise FileError(
            f"{path}: holds several pictures, of which only the first would be read: save each as a file of its own in "
            "a folder, or all as a video"
        )
    size = jpeg_size(data) or png_size(data)  # of other types OpenCV itself refuses more than 2^30 pixels
    if size is not None and size[0] * size[1] > MOST_PIXELS:
        raise FileError(
            f"{path}: a picture of {size[0]}x{size[1]} px: at most {MOST_PIXELS} pixels; make it smaller, or give the "
            "camera's own picture"
        )
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), STORED) if data else None
    except cv2.error:
        image = None
    if image is None:
        known = data.startswith((b"\xff\xd8", b"\x89PNG"))
        remedy = "it is damaged or cut, copy it again" if known else f"give a file of type {types}"
        if data.startswith(tuple(TIFF)):
            remedy = "it is damaged, or its numbers are none of 8 or 16 bits: save it so"
        raise FileError(f"{path}: {'no' if data else 'an empty file, no'} picture that can be decoded: {remedy}")
    return np.asarray(image, dtype=np.uint8)


def _holds_several(data: bytes) -> bool:
    """Whether a TIFF has more than one page, or a PNG is animated; thumbnails count as pages, too."""
    if data[:4] in TIFF:
        order = TIFF[data[:4]]
        first = int.from_bytes(data[4:8], order)
        entries = int.from_bytes(data[first : first + 2], order)
        after = first + 2 + 12 * entries  # TIFF 6.0, section 2: the place of the next page follows the entries
        return any(data[after : after + 4])
    return png_size(data) is not None and b"acTL" in data[: data.find(b"IDAT")]


def png_size(data: bytes) -> tuple[int, int] | None:
    """(width, height) from the head of a PNG (ISO/IEC 15948, 11.2.2); None if it is none."""
    if data[:8] != b"\x89PNG\r\n\x1a\n" or len(data) < 24:
        return None
    return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")


def jpeg_size(data: bytes) -> tuple[int, int] | None:
    """(width, height) from the head of a JPEG; None if it is none, or damaged: the decoder then raises the error."""
    try:
        height, width = simplejpeg.decode_jpeg_header(data)[:2]
    except ValueError:
        return None
    return width, height


def sized(frame: Frame) -> Frame:
    """The frame with its size, read from the JPEG where the source gives none (plug-ins need not)."""
    if frame.size is not None or frame.jpeg is None or frame.fault:
        return frame
    return replace(frame, size=jpeg_size(frame.jpeg))


def _decoded(frame: Frame, colour: str, reduction: int) -> Image:
    """(H, W, 1) or (H, W, 3) of a JPEG; one that the decoder complains of is refused: its numbers would be wrong."""
    if frame.fault:
        raise FrameError(frame.fault)
    data = frame.jpeg or b""
    where = f"{frame.source}: frame {frame.sequence}"
    if data[:2] != b"\xff\xd8":
        kind = "a PNG" if png_size(data) is not None else "no picture"
        raise FrameError(f"{where} is {kind}, not a JPEG: set camera or streamer to MJPEG, check cable and file")
    try:
        height, width = simplejpeg.decode_jpeg_header(data)[:2]
        if width * height <= MOST_PIXELS:
            least = (-(-height // reduction), -(-width // reduction)) if reduction > 1 else (0, 0)
            return simplejpeg.decode_jpeg(data, colour, min_height=least[0], min_width=least[1])
    except ValueError as error:
        raise FrameError(f"{where} is damaged ({error}): check cable and file") from None
    raise FrameError(f"{where} of {width}x{height} px: at most {MOST_PIXELS} pixels")
