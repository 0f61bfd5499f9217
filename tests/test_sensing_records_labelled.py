"""Reader and exporter of labelled frames, on a folder made by hand, without the simulator."""

from __future__ import annotations

import ast
import csv
import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from cad.errors import FileError, ParameterError
from sensing.export_dataset import export_dataset, main
from sensing.records_labelled import COLUMNS, FORMAT, LabelledSet

ROOT = Path(__file__).resolve().parent.parent
SHIFT_PX = 4  # of the loaded pictures, at 480 rows: 200 / 480 of it in the field's unit


def picture(shift_px: int) -> bytes:
    noise = np.random.default_rng(0).normal(0, 1, (480, 640)).astype(np.float32)
    gray = cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 6), None, 20, 230, cv2.NORM_MINMAX)
    rolled = np.roll(gray.astype(np.uint8), shift_px, axis=1)
    return cv2.imencode(".jpg", cv2.merge([rolled] * 3), [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()


@pytest.fixture()
def folder(tmp_path: Path) -> Path:
    """Ten paths of two frames, in two shards."""
    (tmp_path / "shards").mkdir()
    (tmp_path / "manifest.json").write_text(json.dumps({"format": FORMAT, "phases": ["approach", "load"]}))
    for shard in range(2):
        path = np.repeat(np.arange(5) + 5 * shard, 2)
        columns = {name: np.zeros(10) for name in COLUMNS}
        columns |= {"path": path, "phase": np.tile([0, 1], 5), "step": np.tile([0, 1], 5), "scene": np.full(10, -1)}
        columns |= {"contact": np.tile([False, True], 5), "reference": np.zeros(10, int)}
        columns |= {"force_n": np.arange(30.0).reshape(10, 3), "torque_nm": np.ones((10, 3)) * [0.1, 0.2, 0.3]}
        columns |= {"dots_mm": np.zeros((10, 3, 3)), "dots_px": np.zeros((10, 3, 2)), "dots_visible": np.ones((10, 3))}
        both = [picture(0), picture(SHIFT_PX)]
        data, ends = b"".join(both * 5), np.cumsum([len(p) for p in both * 5])
        columns |= {"jpeg": np.frombuffer(data, np.uint8), "jpeg_end": ends}
        columns |= {"reference_jpeg": np.frombuffer(both[0], np.uint8), "reference_jpeg_end": np.array([len(both[0])])}
        np.savez(tmp_path / "shards" / f"{shard:05d}.npz", **columns)
    return tmp_path


def test_frames_come_back_with_their_labels(folder: Path) -> None:
    frames = list(LabelledSet(folder).frames())
    assert len(frames) == 20 and [f.path for f in frames[::2]] == list(range(10))
    assert frames[1].phase == "load" and frames[1].contact and not frames[0].contact
    assert frames[3].wrench.force_n.tolist() == [9, 10, 11]
    assert frames[1].frame.jpeg == picture(SHIFT_PX) and frames[1].reference.jpeg == picture(0)
    assert [f.path for f in LabelledSet(folder).frames({7})] == [7, 7]


def test_a_split_keeps_paths_and_scenes_whole(folder: Path) -> None:
    data = LabelledSet(folder)
    train, test = data.split(0.3, seed=1)
    assert len(test) == 3 and len(train) == 7 and not train & test
    assert data.split(0.3, seed=1) == (train, test) != data.split(0.3, seed=2)
    for file in data.shards:
        arrays = dict(np.load(file))
        np.savez(file, **{**arrays, "scene": arrays["path"] // 2})
    train, test = data.split(0.4, seed=1)
    assert {p // 2 for p in train} & {p // 2 for p in test} == set() and len(test) == 4
    with pytest.raises(ParameterError, match="share=2 outside"):
        data.split(2, seed=0)


def test_bad_folders_are_named(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    data = LabelledSet(folder)
    with pytest.raises(ParameterError, match="column='mass' is none of"):
        data.column("mass")
    file = folder / "shards" / "00001.npz"
    file.write_bytes(file.read_bytes()[:-100])
    with pytest.raises(FileError, match=r"00001\.npz: not a whole shard"):
        list(data.frames())
    np.savez(file, **{name: np.zeros(1) for name in COLUMNS})
    with pytest.raises(FileError, match="holds no pictures"):
        list(data.frames())
    with pytest.raises(FileError, match="cannot read"):
        LabelledSet(tmp_path_factory.mktemp("empty"))
    (folder / "manifest.json").write_text(json.dumps({"format": 1}))
    with pytest.raises(FileError, match="format 1, need 2"):
        LabelledSet(folder)


def test_reading_does_not_load_the_simulator() -> None:
    code = "import sensing.records_labelled, sys; print([m for m in sys.modules if 'simulator' in m or m == 'numba'])"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_the_authors_format(folder: Path, tmp_path_factory: pytest.TempPathFactory, capsys) -> None:
    out = tmp_path_factory.mktemp("authors") / "set"
    assert export_dataset(LabelledSet(folder), out) == 20
    with (out / "index.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert ast.literal_eval(rows[3]["wrench"]) == [-9, -10, -11, -0.1, -0.2, -0.3]
    still, moved = (np.load(out / rows[k]["array_path"]) for k in (0, 1))
    assert still.shape == moved.shape == (2, 30, 30) and moved.dtype == np.float32
    assert np.abs(still).max() < 0.05
    assert np.median(moved[0]) == pytest.approx(SHIFT_PX * 200 / 480, rel=0.05) and abs(np.median(moved[1])) < 0.05
    assert main(["--data", str(folder), "--out", str(out)]) == 2
    assert "holds an index.csv already" in capsys.readouterr().err
    assert main(["--data", str(out), "--out", str(out)]) == 2
    assert "manifest.json: cannot read" in capsys.readouterr().err
