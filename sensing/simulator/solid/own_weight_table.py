"""Writes the table of the skin's sag under its own weight over the valid region, by which estimates are corrected.

    python -m sensing.simulator.solid.own_weight_table --out own_weight.csv

A row has a shell's T / R, the height of its centre above the clamp over R, a polar angle, and the five profiles of
:func:`sensing.simulator.solid.own_weight.own_weight_profiles` there, in units of rho g R^2 / mu. It takes a minute.
"""

from __future__ import annotations

import argparse
import csv
import io
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cad.errors import EndcapError
from cad.extras import program
from cad.materials import silicone
from cad.messages import LOG
from cad.whole_file import replace_file, require_place
from sensing.simulator.similarity.nodes import NODES
from sensing.simulator.similarity.ratios import ShellRatios
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.own_weight import KG_PER_MM3, own_weight_profiles
from sensing.simulator.solid.shell import shell_model

POLAR_DEG = np.arange(0.0, 91.0, 5.0)  # rows of a shell
COLUMNS = ("wall", "clamp", "polar_deg", "side_outward", "side_polar", "side_azimuth", "axis_outward", "axis_polar")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.simulator.solid.own_weight_table"), description=__doc__.splitlines()[0]
    )
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.csv")
    options = parser.parse_args(arguments)
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)
    try:
        require_place(options.out)
        for number, (diameter_mm, wall_mm) in enumerate(NODES):
            LOG.info(f"D={diameter_mm:g} T={wall_mm:g} ({number + 1} of {len(NODES)})")
            table.writerows([f"{round(float(value), 6):.7g}" for value in row] for row in rows_of(diameter_mm, wall_mm))
        replace_file(options.out, text.getvalue().encode())
    except EndcapError as error:
        LOG.error(f"sensing.simulator.solid.own_weight_table: {error}")
        return 2
    return 0


def rows_of(diameter_mm: float, wall_mm: float) -> list[list[float]]:
    """Rows of one shell; of its silicone only Poisson's ratio matters.

    Args:
        diameter_mm, wall_mm: outer diameter D and wall T, mm.
    """
    material, geometry = silicone(), shell_geometry(diameter_mm, wall_mm)
    law, ratios = material.neo_hooke(), ShellRatios.of(geometry)
    found = own_weight_profiles(shell_model(geometry, law, "data"), material.density_g_cm3, POLAR_DEG)
    unit_mm = material.density_g_cm3 * KG_PER_MM3 * geometry.outer_radius_mm**2 / law.shear_mpa
    return [[ratios.wall, ratios.clamp, polar, *row] for polar, row in zip(POLAR_DEG, found / unit_mm, strict=True)]


if __name__ == "__main__":
    sys.exit(main())
