"""Labelled frames in the authors' format: ``index.csv`` and ``shear_fields/NNNNNN.npy``.

    python -m sensing.export_dataset --data exports/data_D130_T8_static_0 --out exports/gelfoot

Rows of ``index.csv``: ``wrench``, a list of six (N, N m), and ``array_path``, a (2, 30, 30) float32 shear field in
pixels of the 200 x 200 crop against the untouched picture in the same light (:mod:`sensing.gelslim`; facts.md, "data").
Their sensor measured what the endcap exerts on the plane and their nodes publish the negated prediction (facts.md,
"output sign"), so wrenches are written NEGATED against ours, which act on the endcap (our reading of both facts, E).
Our origin is the centre of the mating plane; theirs, the "sensor center", is not published as a number. Further
columns say path, phase and level, so that splits can keep a path together.
"""

from __future__ import annotations

import argparse
import csv
import io
import os
import sys
from collections.abc import Collection
from pathlib import Path

import numpy as np

from cad.errors import EndcapError, FileError
from sensing.gelslim import GelslimField
from sensing.records_labelled import LabelledSet

COLUMNS = ("wrench", "array_path", "path", "phase", "level")


def export_dataset(data: LabelledSet, folder: Path, paths: Collection[int] | None = None) -> int:
    """Write the fields of all frames, or of the named paths; the index appears last, when all of them are there.

    Returns:
        Number of rows.

    Raises:
        FileError: a corrupt shard, a set without pictures, or a folder that cannot be written or is not empty.
    """
    fields = folder / "shear_fields"
    try:
        if folder.exists() and (folder / "index.csv").exists():
            raise FileError(f"{folder}: holds an index.csv already: choose an empty folder")
        fields.mkdir(parents=True, exist_ok=True)
        rows = []
        reference, field = b"", None
        for number, item in enumerate(data.frames(paths)):
            if field is None or item.reference.jpeg != reference:
                reference, field = item.reference.jpeg or b"", GelslimField(item.reference)
            name = f"shear_fields/{number:06d}.npy"
            np.save(folder / name, field.update(item.frame).channels)
            wrench = [-float(v) for v in (*item.wrench.force_n, *item.wrench.torque_nm)]
            rows.append((str(wrench), name, item.path, item.phase, int(item.labels["level"])))
            _progress(number + 1)
        _write_index(folder / "index.csv", rows)
    except OSError as error:
        raise FileError(f"{folder}: cannot be written ({error.strerror}): free some space or choose another") from error
    return len(rows)


def main(arguments: list[str] | None = None) -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m sensing.export_dataset",
        description="Write labelled frames in the authors' format, index.csv and shear_fields/*.npy.",
    )
    parser.add_argument("--data", type=Path, required=True, help="folder written by python -m sensing.simulator data")
    parser.add_argument("--out", type=Path, required=True, help="folder to write")
    options = parser.parse_args(arguments)
    try:
        count = export_dataset(LabelledSet(options.data), options.out)
    except EndcapError as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{options.out}: {count} fields and index.csv")
    return 0


def _write_index(path: Path, rows: list[tuple[str, str, int, str, int]]) -> None:
    stream = io.StringIO(newline="")
    writer = csv.writer(stream)
    writer.writerow(COLUMNS)
    writer.writerows(rows)
    temporary = path.with_name(path.name + ".part")
    try:
        temporary.write_text(stream.getvalue())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def _progress(done: int) -> None:
    if sys.stderr.isatty() and done % 100 == 0:
        print(f"\r{done} frames ", end="", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
