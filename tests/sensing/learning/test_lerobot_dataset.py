"""A set in LeRobot's format has the frame rate with which it was recorded, and statistics of what it holds."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from sensing.learning.lerobot_dataset import RATE_HZ, _spread, frame_rate_hz, write_lerobot
from sensing.records_labelled import COLUMNS, LabelledSet
from sensing.set_manifest import FORMAT

FRAMES = 12


def recorded(folder: Path, time_s: np.ndarray, path: np.ndarray) -> LabelledSet:
    """A set as ``sensing.record`` writes it: no azimuth is known."""
    (folder / "shards").mkdir()
    manifest = {"format": FORMAT, "phases": ["recorded"], "columns": COLUMNS, "request": {"protocol": "recorded"}}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    count = len(time_s)
    columns = {name: np.full(count, np.nan) for name in COLUMNS}
    columns |= {name: np.zeros(count, int) for name in ("phase", "step", "reference", "contact")}
    columns |= {"force_n": np.zeros((count, 3)), "torque_nm": np.zeros((count, 3)), "time_s": time_s, "path": path}
    jpeg = cv2.imencode(".jpg", np.full((48, 64, 3), 90, np.uint8))[1].ravel()
    columns |= {"jpeg": np.tile(jpeg, count), "jpeg_end": len(jpeg) * (1 + np.arange(count))}
    columns |= {"reference_jpeg": jpeg, "reference_jpeg_end": np.array([len(jpeg)])}
    np.savez(folder / "shards" / "00000.npz", **columns)
    return LabelledSet(folder)


@pytest.mark.parametrize("rate_hz", [15, 30, 60])
def test_the_rate_is_that_of_the_frames_though_some_are_missing_and_a_path_begins_later(tmp_path, rate_hz):
    numbers = np.delete(np.arange(FRAMES + 2), [4, 5])
    time_s = numbers / rate_hz + np.random.default_rng(0).normal(0, 1e-3, FRAMES) / rate_hz
    path = np.repeat([0, 1], FRAMES // 2)
    assert frame_rate_hz(recorded(tmp_path, time_s + 20.0 * path, path)) == rate_hz


def test_frames_that_follow_none_have_the_rate_of_simulated_ones(tmp_path):
    assert frame_rate_hz(recorded(tmp_path, np.arange(3.0), np.arange(3))) == RATE_HZ


def test_the_format_says_the_rate_and_counts_with_it(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    data = recorded(tmp_path, np.arange(FRAMES) / 60, np.zeros(FRAMES, int))
    write_lerobot(data, tmp_path / "out")
    assert json.loads((tmp_path / "out" / "meta" / "info.json").read_text())["fps"] == 60
    table = parquet.read_table(tmp_path / "out" / "data" / "chunk-000" / "file-000.parquet")
    assert table["timestamp"].to_pylist() == pytest.approx((np.arange(FRAMES) / 60).tolist(), abs=1e-6)


def test_quantiles_part_the_values_as_they_say():
    values = np.random.default_rng(3).normal(size=(200, 2)) ** 3
    found = _spread(values)
    for part, name in ((0.01, "q01"), (0.1, "q10"), (0.5, "q50"), (0.9, "q90"), (0.99, "q99")):  # lerobot's names
        below = (values <= np.array(found[name])).mean(axis=0)  # counted, not sorted
        assert (np.abs(below - part) <= 1 / len(values)).all(), name
