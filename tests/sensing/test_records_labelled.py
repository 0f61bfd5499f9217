"""Reader and exporter of labelled frames, on a folder made by hand, without the simulator."""

from __future__ import annotations

import csv
import errno
import fcntl
import hashlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest

from cad.errors import FileError, ParameterError
from cad.params import EndcapParams
from sensing.export_dataset import export_dataset, main
from sensing.learning.authors_dataset import read_authors_dataset
from sensing.learning.lerobot_dataset import _runs, write_lerobot
from sensing.records_labelled import COLUMNS, LabelledSet
from sensing.set_manifest import FORMAT
from sensing.simulator.dataset.card import write_card

ROOT = Path(__file__).resolve().parents[2]
MANIFEST = {
    "format": FORMAT, "phases": ["approach", "load"], "request": {"diameter_mm": 130.0, "wall_mm": 8.0}
}  # fmt: skip
CARD_MANIFEST = MANIFEST | {
    "request": MANIFEST["request"] | {"protocol": "static", "seed": 0, "silicone": "Smooth-Sil 950"}
}
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
    (tmp_path / "manifest.json").write_text(json.dumps(MANIFEST))
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


def test_neither_side_of_a_split_is_empty(folder: Path) -> None:
    """A test on no frames has no error: its mean is NaN, and nothing says why."""
    data = LabelledSet(folder)
    assert [len(part) for part in data.split(0.04, seed=1)] == [9, 1]
    assert [len(part) for part in data.split(0.96, seed=1)] == [1, 9]
    assert [len(part) for part in data.split(0, seed=1)] == [10, 0]
    for file in data.shards:
        arrays = dict(np.load(file))
        np.savez(file, **{**arrays, "path": np.zeros_like(arrays["path"])})
    with pytest.raises(ParameterError, match="1 path or scene, at least 2 needed"):
        LabelledSet(folder).split(0.5, seed=1)


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


@pytest.mark.parametrize(
    "change", [{"tilt_deg": None}, {"torque_nm": np.ones((5, 3))}, {"reference": np.full(10, 3)}], ids=str
)
def test_columns_that_do_not_hold_a_row_are_a_corrupt_shard(folder: Path, change: dict) -> None:
    file = folder / "shards" / "00001.npz"
    arrays = dict(np.load(file)) | change
    np.savez(file, **{name: array for name, array in arrays.items() if array is not None})
    with pytest.raises(FileError, match=r"00001\.npz: not a whole shard \(row"):
        list(LabelledSet(folder).frames())


def test_reading_does_not_load_the_simulator() -> None:
    code = "import sensing.records_labelled, sys; print([m for m in sys.modules if 'simulator' in m or m == 'numba'])"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_the_authors_format_comes_back_through_its_reader(folder: Path, tmp_path: Path) -> None:
    """Sign and origin by hand: what the endcap does to the plane, about the sphere's centre (38.37 mm up)."""
    out = tmp_path / "authors" / "set"
    assert export_dataset(LabelledSet(folder), out) == 20
    back = read_authors_dataset(out)
    assert back.fields.shape == (20, 2, 30, 30) and back.fields.dtype == np.float32
    fx, fy, fz, arm_m = 9.0, 10.0, 11.0, 1e-3 * EndcapParams(130, 8).centre_height_mm
    about_centre = [0.1 + arm_m * fy, 0.2 - arm_m * fx, 0.3]
    assert back.wrenches[3] == pytest.approx([-fx, -fy, -fz, *(-t for t in about_centre)], rel=1e-6)
    still, moved = back.fields[:2]
    assert np.abs(still).max() < 0.05
    assert np.median(moved[0]) == pytest.approx(SHIFT_PX * 200 / 480, rel=0.05) and abs(np.median(moved[1])) < 0.05
    with (out / "index.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["path"] for row in rows[::2]] == list("0123456789") and rows[1]["phase"] == "load"
    assert export_dataset(LabelledSet(folder), tmp_path / "few", {7}) == 2
    with pytest.raises(FileError, match="no frame to write"):
        export_dataset(LabelledSet(folder), tmp_path / "none", {70})
    assert not (tmp_path / "none").exists()


def test_an_export_that_fails_is_one_line_and_leaves_nothing(folder: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "out"

    def refused(data: Path, words: str) -> None:
        assert main(["--data", str(data), "--out", str(out)]) == 2
        error = capsys.readouterr().err
        assert words in error and error.count("\n") == 1

    refused(tmp_path / "none", "manifest.json: cannot read")
    (folder / "manifest.json").write_text(json.dumps({**MANIFEST, "request": {}}))
    refused(folder, "no design in it")
    (folder / "manifest.json").write_text(json.dumps({**MANIFEST, "shards": 3}))
    refused(folder, "not whole (2 of 3 shards)")
    (folder / "manifest.json").write_text(json.dumps(MANIFEST))
    with full_disk():
        refused(folder, "cannot be written (No space left on device)")
    file = folder / "shards" / "00001.npz"
    file.write_bytes(file.read_bytes()[:-100])
    refused(folder, "00001.npz: not a whole shard")
    assert not list(tmp_path.glob("out*"))
    out.write_text("")
    refused(folder, "not an empty folder")


@contextmanager
def full_disk() -> Iterator[None]:
    """The fourth array finds no space."""
    plain, calls = np.save, []

    def save(path: Path, array: np.ndarray) -> None:
        calls.append(path)
        if len(calls) == 4:
            raise OSError(errno.ENOSPC, "No space left on device")
        plain(path, array)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(np, "save", save)
        yield


def test_a_set_that_is_not_whole_is_refused(folder: Path) -> None:
    LabelledSet(folder).require_whole()  # a manifest that does not say how many shards there are
    (folder / "manifest.json").write_text(json.dumps({**MANIFEST, "shards": 3}))
    with pytest.raises(FileError, match=r"not whole \(2 of 3 shards\), still being written or interrupted"):
        LabelledSet(folder).require_whole()
    (folder / "manifest.json").write_text(json.dumps({**MANIFEST, "shards": 2}))
    LabelledSet(folder).require_whole()
    with (folder / ".lock").open("w") as writer:
        fcntl.flock(writer, fcntl.LOCK_EX)
        with pytest.raises(FileError, match="still being written"):
            LabelledSet(folder).require_whole()
    LabelledSet(folder).require_whole()
    for shard in (folder / "shards").iterdir():
        shard.unlink()
    with pytest.raises(FileError, match="a set without shards"):
        LabelledSet(folder).require_whole()


def test_the_lerobot_format_holds_every_frame(folder: Path, tmp_path: Path, capsys) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    out = tmp_path / "lerobot"
    assert main(["--data", str(folder), "--out", str(out), "--format", "lerobot"]) == 0
    info = json.loads((out / "meta" / "info.json").read_text())
    assert (info["codebase_version"], info["total_episodes"], info["total_frames"]) == ("v3.0", 10, 20)
    rows = parquet.read_table(out / "data" / "chunk-000" / "file-000.parquet").to_pylist()
    assert set(rows[0]) == set(info["features"]) and [row["index"] for row in rows] == list(range(20))
    assert rows[3]["observation.state"] == pytest.approx([9, 10, 11, 0.1, 0.2, 0.3])
    assert rows[3]["observation.images.endcap"]["bytes"] == picture(SHIFT_PX)
    assert [row["observation.contact"] for row in rows[:2]] == [False, True]
    assert [(row["episode_index"], row["frame_index"]) for row in rows[:3]] == [(0, 0), (0, 1), (1, 0)]
    episodes = parquet.read_table(out / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()
    assert [(e["dataset_from_index"], e["dataset_to_index"]) for e in episodes[:2]] == [(0, 2), (2, 4)]
    stats = json.loads((out / "meta" / "stats.json").read_text())
    forces = np.array([row["observation.state"] for row in rows])
    assert stats["observation.state"]["mean"] == pytest.approx(forces.mean(axis=0).tolist(), rel=1e-5)
    assert 0.3 < stats["observation.images.endcap"]["mean"][0][0][0] < 0.7


def test_every_azimuth_of_a_path_is_a_lerobot_episode(folder: Path, tmp_path: Path) -> None:
    """A path is labelled at several azimuths, one after the other: between them contact and time jump."""
    columns = dict(np.load(folder / "shards" / "00000.npz"))
    columns |= {"path": np.array([0] * 6 + [1] * 4), "azimuth_deg": np.repeat([10.0, 20.0, 30.0, 10.0, 20.0], 2)}
    columns["time_s"] = np.tile([0.1, 0.2], 5)
    np.savez(folder / "shards" / "00000.npz", **columns)
    episodes = list(_runs(LabelledSet(folder)))
    assert len(episodes) == 10 and all(run[0].frame.time_s < run[1].frame.time_s for run in episodes[:5])
    parquet = pytest.importorskip("pyarrow.parquet")
    out = tmp_path / "lerobot"
    write_lerobot(LabelledSet(folder), out)
    rows = parquet.read_table(out / "data" / "chunk-000" / "file-000.parquet").to_pylist()
    assert [row["episode_index"] for row in rows] == [k // 2 for k in range(20)]
    assert [row["path"] for row in rows[:10]] == columns["path"].tolist()


def test_lerobot_itself_loads_the_export(folder: Path, tmp_path: Path) -> None:
    lerobot = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    out = tmp_path / "lerobot"
    write_lerobot(LabelledSet(folder), out)
    loaded = lerobot.LeRobotDataset("endcap", root=out)
    assert len(loaded) == 20 and loaded.num_episodes == 10
    item = loaded[3]
    assert item["observation.state"].tolist() == pytest.approx([9, 10, 11, 0.1, 0.2, 0.3])
    assert item["task"] == "press the endcap: path" and tuple(item["observation.images.endcap"].shape) == (3, 480, 640)
    half = lerobot.LeRobotDataset("endcap", root=out, episodes=[2, 3])
    assert len(half) == 4


def test_the_card_names_every_file_with_its_digest(folder: Path) -> None:
    (folder / "manifest.json").write_text(json.dumps(CARD_MANIFEST))
    write_card(folder)
    card = json.loads((folder / "croissant.json").read_text())
    files = {entry["contentUrl"]: entry["sha256"] for entry in card["distribution"]}
    assert set(files) == {"manifest.json", "shards/00000.npz", "shards/00001.npz"}
    for name, digest in files.items():
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest
    assert [entry["name"] for entry in card["variableMeasured"]] == list(COLUMNS)
    assert "labelled frames" in card["description"] and "pictures (JPEG)" in card["description"]
    croissant = pytest.importorskip("mlcroissant")
    issues = croissant.Dataset(str(folder / "croissant.json")).metadata.issues
    assert not issues.errors


def test_the_card_of_states_promises_no_pictures_and_names_the_columns_there_are(folder: Path) -> None:
    request = CARD_MANIFEST["request"] | {"render": "off", "indenter": "sphere", "radius_mm": 15.0, "sensor": 7}
    columns = COLUMNS | {"outline_mm": "motion of the outline"}
    (folder / "manifest.json").write_text(json.dumps(CARD_MANIFEST | {"request": request, "columns": columns}))
    write_card(folder)
    card = json.loads((folder / "croissant.json").read_text())
    assert "JPEG" not in card["description"] and "labelled states" in card["description"]
    assert "sphere (radius 15 mm)" in card["description"] and "sensor 7" in card["description"]
    assert [entry["name"] for entry in card["variableMeasured"]][-1] == "outline_mm"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_export_that_is_stopped_leaves_nothing(folder: Path, tmp_path: Path, capsys, monkeypatch, number) -> None:
    monkeypatch.setattr("sensing.export_dataset.GelslimField", lambda _: os.kill(os.getpid(), number))
    before = sorted(tmp_path.rglob("*"))
    assert main(["--data", str(folder), "--out", str(tmp_path / "out")]) == 130
    assert capsys.readouterr().err == "sensing.export_dataset: stopped; nothing was written\n"
    assert sorted(tmp_path.rglob("*")) == before
