"""A set's own columns, such as the motion of the dots' outlines, come through the reader as all others do."""

import json
from pathlib import Path

import numpy as np
import pytest

from cad.errors import ParameterError
from sensing.records_labelled import COLUMNS, LabelledSet
from sensing.set_manifest import FORMAT

OUTLINE = np.arange(12.0).reshape(2, 2, 3)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two frames of one path, without pictures worth opening."""
    manifest = {"format": FORMAT, "phases": ["load"], "columns": COLUMNS | {"outline_mm": "motion of the outline"}}
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    (tmp_path / "shards").mkdir()
    columns = {name: np.zeros(2) for name in COLUMNS} | {"outline_mm": OUTLINE, "phase": np.zeros(2, int)}
    columns |= {"reference": np.zeros(2, int), "force_n": np.zeros((2, 3)), "torque_nm": np.zeros((2, 3))}
    columns |= {"jpeg": np.zeros(2, np.uint8), "jpeg_end": np.array([1, 2])}
    columns |= {"reference_jpeg": np.zeros(1, np.uint8), "reference_jpeg_end": np.array([1])}
    np.savez(tmp_path / "shards" / "00000.npz", **columns)
    return tmp_path


def test_a_column_that_the_manifest_names_is_read_and_stands_among_the_labels(folder: Path) -> None:
    data = LabelledSet(folder)
    assert np.array_equal(data.column("outline_mm"), OUTLINE)
    assert data.columns["outline_mm"] == "motion of the outline" and data.columns.keys() > COLUMNS.keys()
    assert np.array_equal(data[1].labels["outline_mm"], OUTLINE[1])


@pytest.mark.parametrize("columns", [None, ["outline_mm"], COLUMNS])
def test_one_that_it_does_not_name_is_refused_with_those_there_are(folder: Path, columns: object) -> None:
    manifest = json.loads((folder / "manifest.json").read_text()) | {"columns": columns}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(ParameterError, match=r"'outline_mm' is none of path, .*, reference$"):
        LabelledSet(folder).column("outline_mm")
