"""Start and end of a print on every printer: home, level, heat, fill the nozzle in the free edge, cool down."""

from __future__ import annotations

import numpy as np
import pytest

from fab.slice import printers
from fab.slice.excluded import reach_mm
from fab.slice.gcode import read_gcode


def test_every_printer_homes_then_levels_then_heats_and_cools_down_at_the_end():
    for name, each in printers.printers().items():
        start = each.start_gcode(215, 60).split("\\n")
        assert start.index("G28") < start.index(each.levelling[0]) < start.index("M109 S215"), name
        assert any(line.startswith("G29") for line in each.levelling)
        assert {"M104 S0", "M140 S0"} <= set(each.end)


def test_every_printer_fills_its_hot_nozzle_in_the_free_edge_of_its_bed(tmp_path):
    for name, each in printers.printers().items():
        start = each.start_gcode(230, 45).split("\\n")
        path = tmp_path / f"{name}.gcode"
        path.write_text("\n".join(start))
        assert not any(" E" in line for line in start[: start.index("M109 S230")]), name
        purge = read_gcode(path)
        middle, width = purge.start[:, 0], purge.volume_mm3 / purge.length_mm / 0.3 + 0.3 * (1 - np.pi / 4)
        assert purge.top_mm == pytest.approx(0.3) and 15 < purge.volume_mm3.sum() < 30 and (purge.layer == -1).all()
        assert (middle - width / 2 > 0).all() and (middle + width / 2 < 1.0).all()  # a brim of 3 mm in a margin of 4
        assert max(purge.start[:, 1].max(), purge.end[:, 1].max()) + 10 < each.depth_mm
        assert each.exclude_mm is None or reach_mm(purge.start, purge.end, 0.5, each.exclude_mm) <= 0
