"""The folder of a training by similarity that was stopped, beside its weights: the same command goes on from it.

    with unfinished(Path("w.safetensors"), request.key) as folder:       # .w.safetensors.unfinished
        design_weights(request, config, folder=folder).save(Path("w.safetensors"))

It belongs to one request and one version of the code and tables that make states, pictures and fields (its key): what
another one left there is removed.
"""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cad.errors import FileError
from cad.whole_file import hold_lock, put_file
from sensing.code_digest import code_digest
from sensing.simulator.similarity.library import FILE

SOURCES = ("cad", *(f"sensing/{name}" for name in ("camera", "design", "learning", "simulator", "tracking")))
KEY = "key"  # name of the file of the key


@contextmanager
def unfinished(out: Path, key: str) -> Iterator[Path]:
    """Yield the folder of a training; it is removed at the end, and stays for the next run after an error.

    While another run trains the same weights, a temporary folder takes its place, which never stays.

    Args:
        out: file of the weights.
        key: text that identifies what is trained.

    Raises:
        FileError: the folder cannot be written.
    """
    folder = out.with_name(f".{out.name}.unfinished")
    try:
        folder.mkdir(exist_ok=True)
        lock = hold_lock(folder / ".lock")
    except BlockingIOError:
        with tempfile.TemporaryDirectory(prefix="endcap_weights_") as place:
            yield Path(place)
        return
    except OSError as error:
        raise FileError(f"{folder}: {error.strerror or error}: remove it, or give another --out") from error
    with lock:
        _emptied(folder, _digest(key))
        yield folder
        shutil.rmtree(folder, ignore_errors=True)


def _digest(key: str) -> str:
    """Digest of what is trained, and of code, tables and library from which states, pictures and fields are made."""
    found = hashlib.sha256(FILE.read_bytes())
    found.update(f"{key} {code_digest(SOURCES)}".encode())
    return found.hexdigest()


def _emptied(folder: Path, key: str) -> None:
    """Remove what another request, or another version, left in the folder."""
    try:
        if (folder / KEY).is_file() and (folder / KEY).read_text(encoding="utf-8") == key:
            return
        for name in ("states", "pictures"):
            shutil.rmtree(folder / name, ignore_errors=True)
        put_file(folder / KEY, key.encode())
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{folder}: cannot be read or written ({error}): remove it, or give another --out") from error
