"""Page of the wrench model against the cells that the evaluation wrote."""

from __future__ import annotations

import csv
import re

import numpy as np
from test_architecture import ROOT

ROW = re.compile(r"^\| (nominal|\d+) \|(.*)\|$", re.M)
WITH_FILE, WITHOUT_FILE = "ours", "ours, no camera file"


def coverage_percent() -> dict[str, float]:
    """By name of an evaluation, over all its frames in contact."""
    with (ROOT / "bench" / "wrench_cells.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    found = {}
    for name in {row["name"] for row in rows}:
        own = [row for row in rows if row["name"] == name]
        frames = [float(row["frames"]) for row in own]
        found[name] = 100 * float(np.average([float(row["coverage"]) for row in own], weights=frames))
    return found


def test_the_coverage_of_each_sensor_is_that_of_its_cells():
    text = (ROOT / "docs" / "wrench_accuracy.md").read_text(encoding="utf-8").split("**Sensors never seen**")[1]
    table = text[text.index("| sensor |") :].split("\n\n")[0]
    head = table.splitlines()[0].strip("|").split("|")
    columns = [place for place, name in enumerate(head) if name.strip() == "95 % covers, flagged frames too"]
    written = {}
    for sensor, rest in ROW.findall(table):
        entries = [sensor, *(entry.strip() for entry in rest.split("|"))]
        for name, column in zip((WITH_FILE, WITHOUT_FILE), columns, strict=True):
            written[f"{name}, sensor{0 if sensor == 'nominal' else sensor}"] = entries[column]
    assert written == {name: f"{percent:.1f} %" for name, percent in coverage_percent().items()}
