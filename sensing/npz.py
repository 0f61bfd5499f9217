"""Arrays from ``.npz`` files that may be damaged or hostile: sizes are checked before anything is unpacked."""

from __future__ import annotations

import io
import math
import struct
import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

MOST_BYTES = 1 << 29  # of all arrays together


def read_npz(
    path: str | Path, names: Collection[str] | None = None, most_bytes: int = MOST_BYTES
) -> dict[str, NDArray[Any]]:
    """Arrays by name; nothing is unpickled.

    Args:
        path: of the file.
        names: arrays wanted; None for all.
        most_bytes: largest size when unpacked.

    Raises:
        OSError: missing.
        KeyError: no array of that name.
        ValueError: no such file, damaged, or too large.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = {entry.filename.removesuffix(".npy"): entry for entry in archive.infolist()}
            wanted = {name: members[name] for name in (members if names is None else names)}
            size = sum(entry.file_size for entry in wanted.values())
            if size > most_bytes:
                raise ValueError(f"{size} bytes when unpacked, at most {most_bytes} allowed")
            return {name: _array(archive.read(entry)) for name, entry in wanted.items()}
    except (zipfile.BadZipFile, zlib.error, struct.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise ValueError(f"no whole .npz file: {error}") from error
    except (MemoryError, OverflowError, SyntaxError) as error:
        raise ValueError(f"a damaged array: {error}") from error


def _array(data: bytes) -> NDArray[Any]:
    """One array, whose head may not claim more than there is."""
    stream = io.BytesIO(data)
    version = npy.read_magic(stream)
    shape, _, dtype = (npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0)(stream)
    if math.prod(shape) * dtype.itemsize > len(data):
        raise ValueError(f"an array that claims shape {shape} in {len(data)} bytes")
    stream.seek(0)
    return np.asarray(npy.read_array(stream, allow_pickle=False))
