"""The authors' data set as they publish it: ``index.csv`` beside ``shear_fields/NNNNNN.npy``.

``index.csv`` has at least the columns ``wrench`` (six numbers as text, "[Fx, Fy, Fz, Tx, Ty, Tz]", N, N m)
and ``array_path``; each array is (2, 30, 30), u and v in pixels of the 200 x 200 crop (P, NET19). Signs and
frame of the labels: :data:`sensing.frames.AUTHORS_LABEL_SIGN`. Rows follow one another in time.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from cad.errors import FileError

REPOSITORY = "jonathantwz/gelfoot"  # P: repository on the hub
FIELD_SHAPE = (2, 30, 30)  # of one array: u and v on a 30 x 30 grid
_SEPARATORS = re.compile(r"[\s,;]+")  # between the numbers of a label


@dataclass(frozen=True)
class AuthorsDataset:
    """Fields and labels in the order of the index.

    Attributes:
        fields: (N, 2, 30, 30) float32.
        wrenches: (N, 6) float32, as labelled (the released nodes publish the opposite sign).
    """

    fields: NDArray[np.float32]
    wrenches: NDArray[np.float32]


def read_authors_dataset(folder: str | Path) -> AuthorsDataset:
    """Read a folder in the authors' format.

    Raises:
        FileError: no index, a missing column, a label that is not six finite numbers, a missing array or one of another
            shape (the row is named).
    """
    folder = Path(folder)
    rows = _index(folder / "index.csv")
    fields = np.empty((len(rows), *FIELD_SHAPE), np.float32)
    wrenches = np.empty((len(rows), 6), np.float32)
    for number, (wrench, array_path) in enumerate(rows):
        place = f"{folder / 'index.csv'} line {number + 2}"
        wrenches[number] = _six_numbers(wrench, place)
        fields[number] = _field(_array_file(folder, array_path), place)
    return AuthorsDataset(fields, wrenches)


def download_authors_dataset(folder: str | Path, repository: str = REPOSITORY, endpoint: str | None = None) -> Path:
    """Download the data set into ``folder``, without files that are there already; returns the index's folder.

    Args:
        folder: destination folder.
        repository: name of the repository on the hub.
        endpoint: address of another hub than the public one.

    Raises:
        FileError: the optional library is missing, the hub does not answer, or the download holds no index.
    """
    try:
        from huggingface_hub import snapshot_download
    except ImportError:
        raise FileError(
            f"{repository}: huggingface_hub is not installed; run pip install 'endcap-toolkit[download]'"
        ) from None
    try:
        snapshot_download(repository, repo_type="dataset", local_dir=folder, endpoint=endpoint)
    except (OSError, ValueError) as error:  # the library's errors derive from these
        reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise FileError(f"{repository}: cannot be fetched ({reason}): check the name and the network") from error
    found = sorted(Path(folder).rglob("index.csv"), key=lambda path: len(path.parts))
    if not found:
        raise FileError(f"{folder}: {repository} came without an index.csv: unpack its archives there, if it has any")
    return found[0].parent


def _index(path: Path) -> list[tuple[str, str]]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            reader = csv.DictReader(stream)
            missing = {"wrench", "array_path"} - set(reader.fieldnames or ())
            if missing:
                raise FileError(f"{path}: no column {', '.join(sorted(missing))}: needs wrench and array_path")
            rows = [(row["wrench"] or "", row["array_path"] or "") for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"{path}: cannot read the index ({error}): give the folder that holds index.csv") from error
    if not rows:
        raise FileError(f"{path}: an index without rows: record or fetch some data first")
    return rows


def _six_numbers(text: str, place: str) -> NDArray[np.float64]:
    words = [word for word in _SEPARATORS.split(text.strip().strip("[]()")) if word]
    try:
        values = np.array([float(word) for word in words])
    except ValueError:
        values = np.full(0, np.nan)
    if values.shape != (6,) or not np.isfinite(values).all():
        raise FileError(
            f"{place}: wrench={text!r} is not six finite numbers Fx Fy Fz Tx Ty Tz: correct or drop the row"
        )
    return values


def _array_file(folder: Path, text: str) -> Path:
    """The array inside the folder, whatever the folder of the index's path was when it was recorded."""
    name = PurePosixPath(text.replace("\\", "/"))
    inside = not name.is_absolute() and ".." not in name.parts
    direct = folder / name
    return direct if inside and direct.is_file() else folder / "shear_fields" / name.name


def _field(path: Path, place: str) -> NDArray[np.float32]:
    try:
        found = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise FileError(f"{place}: {path}: no readable array ({error}): fetch it again or drop the row") from error
    if found.shape != FIELD_SHAPE or not np.isfinite(found).all():
        raise FileError(f"{place}: {path}: shape {found.shape}, expected {FIELD_SHAPE}, all numbers finite")
    return found.astype(np.float32)
