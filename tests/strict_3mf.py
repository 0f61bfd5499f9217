"""A 3MF file read by the consortium's own library, strictly: what the tests of every writer share."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lib3mf import get_wrapper


def read_strictly(path: Path) -> Any:
    """The model of a file that may give no warning; an extension's words without their place raise."""
    model = get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(path))
    assert reader.GetWarningCount() == 0
    return model
