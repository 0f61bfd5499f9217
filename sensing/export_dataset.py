"""Labelled frames in the authors' format (``index.csv`` and ``shear_fields/NNNNNN.npy``), or in LeRobot's.

    python -m sensing.export_dataset --data exports/data_D130_T8_static_0 --out exports/gelfoot
    python -m sensing.export_dataset --data exports/data_D130_T8_static_0 --out exports/lerobot --format lerobot

LeRobot's: :mod:`sensing.learning.lerobot_dataset`. The authors': rows of ``index.csv`` are ``wrench``, six numbers as
text (N, N m), and ``array_path``, a (2, 30, 30) float32 shear field in px of the 200 x 200 crop against the untouched
picture in the same light (:mod:`sensing.tracking.gelslim`; P, NET19). Sign and origin are those of their labels as
:mod:`sensing.frames` reads them: what the endcap does to the plane, about the sphere's centre. Further columns say
path, phase and level, so that splits can keep a path together. :mod:`sensing.learning.authors_dataset` reads it.
"""

from __future__ import annotations

import argparse
import csv
import signal
import sys
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

import numpy as np

from cad.errors import EndcapError, FileError
from cad.extras import program
from cad.messages import LOG, show, transient
from cad.whole_file import new_folder
from sensing.frames import AUTHORS_LABEL_SIGN, T_sphere_endcap, wrench_in
from sensing.learning.lerobot_dataset import write_lerobot
from sensing.records import Wrench
from sensing.records_labelled import LabelledFrame, LabelledSet
from sensing.tracking.gelslim import GelslimField

COLUMNS = ("wrench", "array_path", "path", "phase", "level")


def export_dataset(data: LabelledSet, folder: Path, paths: Collection[int] | None = None) -> int:
    """Write the fields of all frames, or of some paths; the folder appears when all of it is there, or not at all.

    Args:
        data: labelled frames.
        folder: a new or empty one.
        paths: numbers of the paths to write; None for all.

    Returns:
        Number of rows.

    Raises:
        FileError: a corrupt shard, a set without pictures, or a folder that cannot be written or is not empty.
    """
    to_sphere = T_sphere_endcap(data.params)
    try:
        with new_folder(folder) as place, (place / "index.csv").open("w", newline="", encoding="utf-8") as stream:
            (place / "shear_fields").mkdir()
            writer = csv.writer(stream)
            writer.writerow(COLUMNS)
            count = 0
            for item, channels in _fields(data, paths):
                name = f"shear_fields/{count:06d}.npy"
                np.save(place / name, channels)
                wrench = _label(wrench_in(item.wrench, to_sphere, "sphere"))
                writer.writerow((wrench, name, item.path, item.phase, int(item.labels["level"])))
                count += 1
                _progress(count)
            if not count:
                raise FileError(f"{data.folder}: no frame to write: let the command that writes the set run first")
    except OSError as error:
        raise FileError(f"{folder}: cannot be written ({error.strerror}): free some space or choose another") from error
    return count


def main(arguments: list[str] | None = None) -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.export_dataset"),
        description="Write labelled frames in the authors' format (index.csv, shear_fields) or in LeRobot's (v3.0).",
        epilog="exit status: 0 written, 2 bad input or no place to write, 130 interrupted (nothing is left behind)",
    )
    parser.add_argument("--data", type=Path, required=True, help="folder written by python -m sensing.simulator data")
    parser.add_argument("--out", type=Path, required=True, help="folder to write; must be new or empty")
    parser.add_argument("--format", choices=FORMATS, default="authors", help="(authors); lerobot needs pyarrow")
    options = parser.parse_args(arguments)
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C: nothing is left behind
    try:
        data = LabelledSet(options.data)
        data.require_whole()
        count = FORMATS[options.format](data, options.out)
    except EndcapError as error:
        LOG.error(f"sensing.export_dataset: {error}")
        return 2
    except KeyboardInterrupt:
        LOG.error("sensing.export_dataset: stopped; nothing was written")
        return 130
    finally:
        signal.signal(signal.SIGTERM, before)
    show(f"{options.out}: {count} frames")
    return 0


FORMATS: dict[str, Callable[[LabelledSet, Path], int]] = {"authors": export_dataset, "lerobot": write_lerobot}


def _fields(data: LabelledSet, paths: Collection[int] | None) -> Iterator[tuple[LabelledFrame, np.ndarray]]:
    reference, field = b"", None
    for item in data.frames(paths):
        if field is None or item.reference.jpeg != reference:
            reference, field = item.reference.jpeg or b"", GelslimField(item.reference)
        yield item, field.update(item.frame).channels


def _label(wrench: Wrench) -> str:
    return str([float(AUTHORS_LABEL_SIGN * value) for value in (*wrench.force_n, *wrench.torque_nm)])


def _progress(done: int) -> None:
    if done % 100 == 0:
        transient(f"{done} frames")


if __name__ == "__main__":
    sys.exit(main())
