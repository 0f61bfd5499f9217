"""Labelled frames as a LeRobot data set, format v3.0: an episode for each run, a loading path at one azimuth.

    count = write_lerobot(data, Path("exports/lerobot"))
    LeRobotDataset("endcap", root="exports/lerobot")             # of the package lerobot

Layout (``meta/info.json``, ``meta/tasks.parquet``, ``meta/episodes``, ``data``): that of lerobot 0.4. Pictures are the
JPEGs as they are in the set, inside the parquet files. Features: ``observation.images.endcap``; ``observation.state``,
the wrench on the endcap at the origin of its frame (N, N m); ``observation.contact``; ``observation.time_s``, the true
time; ``path``, its number: runs of one path have the same motion, and must stay on one side of a split. ``timestamp``
is frame over rate, as the format prescribes; the rate is that of the set. There is no ``action``: a plane presses, not
a robot.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cad.errors import FileError
from cad.whole_file import new_folder
from sensing.decode import decode_gray
from sensing.records_labelled import LabelledFrame, LabelledSet

VERSION = "v3.0"  # of the format
RATE_HZ = 30  # frame rate of a set in which no frame follows another
# Names of the features.
IMAGE, STATE, CONTACT = "observation.images.endcap", "observation.state", "observation.contact"
TIME, PATH = "observation.time_s", "path"
# Names of the six components of the state.
WRENCH = ("force_x_n", "force_y_n", "force_z_n", "torque_x_nm", "torque_y_nm", "torque_z_nm")
COUNTERS = ("frame_index", "episode_index", "index", "task_index")  # columns that the format prescribes
FILE_MB, FILES_IN_CHUNK = 100, 1000  # defaults of the format
STATS_PICTURES = 100  # number of pictures for their statistics
QUANTILES = (0.01, 0.1, 0.5, 0.9, 0.99)  # of each feature, as lerobot 0.4 writes them
PATTERN = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"  # paths of the data files


def write_lerobot(data: LabelledSet, folder: Path, task: str = "") -> int:
    """Write all frames of a set; the folder is written whole or not at all.

    Args:
        data: labelled frames with pictures.
        folder: folder that is new or empty.
        task: description of the task; empty for the protocol's.

    Returns:
        Number of frames.

    Raises:
        FileError: a corrupt shard, a set without pictures, or a folder that cannot be written or is not empty.
    """
    task = task or f"press the endcap: {data.manifest['request'].get('protocol', 'path')}"
    try:
        with new_folder(folder) as place:
            writer = _Writer(place, frame_rate_hz(data))
            for episode, frames in enumerate(_runs(data)):
                writer.add(episode, frames, task)
            writer.finish(task)
    except OSError as error:
        raise FileError(f"{folder}: cannot be written ({error.strerror}): free some space or choose another") from error
    return writer.frames


def frame_rate_hz(data: LabelledSet) -> int:
    """Frames a second of a set: the median over neighbours of one episode, a whole number as the format has it."""
    time_s, path, azimuth = (data.column(name) for name in ("time_s", "path", "azimuth_deg"))
    follows = (np.diff(path) == 0) & ((np.diff(azimuth) == 0) | np.isnan(azimuth[1:]))
    steps_s = np.diff(time_s)[follows]
    steps_s = steps_s[steps_s > 0]
    return max(1, round(1 / float(np.median(steps_s)))) if len(steps_s) else RATE_HZ


def _runs(data: LabelledSet) -> Iterator[list[LabelledFrame]]:
    for _, frames in groupby(data.frames(), key=lambda item: (item.path, str(item.labels["azimuth_deg"]))):
        yield list(frames)


class _Writer:
    """Collects episodes into files of some hundred MB; only this format needs pyarrow, which is loaded here."""

    def __init__(self, place: Path, rate_hz: int) -> None:
        import pyarrow
        import pyarrow.parquet

        self._arrow, self._parquet, self._place = pyarrow, pyarrow.parquet, place
        self.frames, self._rate_hz = 0, rate_hz
        self._episodes: list[dict[str, Any]] = []
        self._columns: list[dict[str, NDArray[Any]]] = []
        self._sampled: list[NDArray[np.float64]] = []
        self._size, self._file, self._shape = 0, 0, (0, 0)
        self._stream: Any = None

    def add(self, episode: int, frames: Sequence[LabelledFrame], task: str) -> None:
        """Add one episode.

        Args:
            episode: number of the episode.
            frames: its frames in order of time.
            task: description of the task.
        """
        count = len(frames)
        jpegs = [item.frame.jpeg or b"" for item in frames]
        gray = decode_gray(frames[0].frame)
        self._shape = gray.shape[0], gray.shape[1]
        if len(self._sampled) < STATS_PICTURES:
            self._sampled.append(gray.astype(float) / 255.0)
        columns: dict[str, NDArray[Any]] = {
            STATE: np.array([[*item.wrench.force_n, *item.wrench.torque_nm] for item in frames], np.float32),
            CONTACT: np.array([item.contact for item in frames], bool),
            TIME: np.array([item.frame.time_s for item in frames], np.float32),
            PATH: np.array([item.path for item in frames], np.int64),
            "timestamp": (np.arange(count) / self._rate_hz).astype(np.float32),
            "frame_index": np.arange(count),
            "episode_index": np.full(count, episode),
            "index": self.frames + np.arange(count),
            "task_index": np.zeros(count, int),
        }
        chunk, file = divmod(self._file, FILES_IN_CHUNK)
        self._write(columns, jpegs)
        self._episodes.append({
            "episode_index": episode, "tasks": [task], "length": count,
            "data/chunk_index": chunk, "data/file_index": file,
            "dataset_from_index": self.frames, "dataset_to_index": self.frames + count,
            "meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0,
        })  # fmt: skip
        self._columns.append(columns)
        self.frames += count

    def finish(self, task: str) -> None:
        """Close the data files and write the metadata."""
        if self._stream is not None:
            self._stream.close()
        if not self.frames:
            raise FileError("a set without frames: let the command that writes it run first")
        arrow, meta = self._arrow, self._place / "meta"
        episodes = meta / "episodes" / PATTERN.format(chunk_index=0, file_index=0)
        episodes.parent.mkdir(parents=True)
        self._parquet.write_table(arrow.Table.from_pylist(self._episodes), episodes)
        tasks = arrow.table({"task_index": arrow.array([0]), "__index_level_0__": arrow.array([task])})
        tasks = tasks.replace_schema_metadata({b"pandas": json.dumps(_PANDAS).encode()})
        self._parquet.write_table(tasks, meta / "tasks.parquet")
        (meta / "info.json").write_text(json.dumps(self._info(), indent=4) + "\n")
        (meta / "stats.json").write_text(json.dumps(self._stats(), indent=4) + "\n")

    def _write(self, columns: dict[str, NDArray[Any]], jpegs: list[bytes]) -> None:
        """Write the rows of an episode, into a new file where the last one is full."""
        arrow = self._arrow
        picture = arrow.struct([("bytes", arrow.binary()), ("path", arrow.string())])
        arrays = {IMAGE: arrow.array([{"bytes": jpeg, "path": None} for jpeg in jpegs], picture)}
        state = arrow.array(columns[STATE].ravel())
        arrays[STATE] = arrow.FixedSizeListArray.from_arrays(state, len(WRENCH))
        arrays |= {name: arrow.array(values) for name, values in columns.items() if name != STATE}
        table = arrow.table(arrays)
        if self._stream is None:
            chunk, file = divmod(self._file, FILES_IN_CHUNK)
            path = self._place / "data" / PATTERN.format(chunk_index=chunk, file_index=file)
            path.parent.mkdir(parents=True, exist_ok=True)
            self._stream = self._parquet.ParquetWriter(path, table.schema)
        self._stream.write_table(table)
        self._size += sum(map(len, jpegs))
        if self._size > FILE_MB * 1e6:
            self._stream.close()
            self._stream, self._size, self._file = None, 0, self._file + 1

    def _info(self) -> dict[str, Any]:
        height, width = self._shape
        features: dict[str, Any] = {
            IMAGE: {"dtype": "image", "shape": [height, width, 3], "names": ["height", "width", "channels"]},
            STATE: {"dtype": "float32", "shape": [len(WRENCH)], "names": list(WRENCH)},
            CONTACT: {"dtype": "bool", "shape": [1], "names": None},
            TIME: {"dtype": "float32", "shape": [1], "names": None},
            PATH: {"dtype": "int64", "shape": [1], "names": None},
            "timestamp": {"dtype": "float32", "shape": [1], "names": None},
        }
        features |= {name: {"dtype": "int64", "shape": [1], "names": None} for name in COUNTERS}
        return {
            "codebase_version": VERSION, "robot_type": "endcap", "total_episodes": len(self._episodes),
            "total_frames": self.frames, "total_tasks": 1, "chunks_size": FILES_IN_CHUNK,
            "data_files_size_in_mb": FILE_MB, "video_files_size_in_mb": 200, "fps": self._rate_hz,
            "splits": {"train": f"0:{len(self._episodes)}"}, "data_path": "data/" + PATTERN, "video_path": None,
            "features": features,
        }  # fmt: skip

    def _stats(self) -> dict[str, Any]:
        stats = {}
        for name in self._columns[0]:
            values = np.concatenate([columns[name] for columns in self._columns]).astype(float)
            stats[name] = _spread(values.reshape(len(values), -1)) | {"count": [self.frames]}
        pictures = np.stack(self._sampled)
        one = {name: [[[value[0]]]] * 3 for name, value in _spread(pictures.reshape(-1, 1)).items()}
        stats[IMAGE] = one | {"count": [len(pictures)]}
        return stats


def _spread(values: NDArray[np.float64]) -> dict[str, Any]:
    """Statistics of each column; policies that normalise by quantiles look for ``q01`` and ``q99``."""
    quantiles = np.quantile(values, QUANTILES, axis=0)
    return {
        "min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist(),
        "mean": values.mean(axis=0).tolist(), "std": values.std(axis=0).tolist(),
    } | {f"q{round(100 * part):02d}": row.tolist() for part, row in zip(QUANTILES, quantiles, strict=True)}  # fmt: skip


def _column(name: str | None, field: str, kind: str, numpy_kind: str) -> dict[str, Any]:
    return {"name": name, "field_name": field, "pandas_type": kind, "numpy_type": numpy_kind, "metadata": None}


_PANDAS = {  # the tasks are the index of their table, which lerobot reads with pandas
    "index_columns": ["__index_level_0__"],
    "column_indexes": [],
    "columns": [
        _column("task_index", "task_index", "int64", "int64"),
        _column(None, "__index_level_0__", "unicode", "object"),
    ],
    "creator": {"library": "pyarrow", "version": "15"},
    "pandas_version": "2.2",
}
