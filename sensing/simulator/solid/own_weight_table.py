"""Writes the table of the skin's sag under its own weight over the valid region, by which estimates are corrected.

    python -m sensing.simulator.solid.own_weight_table --out own_weight.csv

A row has a shell's T / R, the height of its centre above the clamp over R, a polar angle as a part of that at which the
inner surface meets the clamp (93 to 133 degrees), and the five profiles of
:func:`sensing.simulator.solid.own_weight.own_weight_profiles` there, in units of rho g R^2 / mu. At the clamp they are
zero. So shells of every depth of neck have the same rows, and dots beyond the equator have theirs. It takes a minute.
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

SHARES = np.linspace(0.0, 1.0, 27)  # rows of a shell: polar angles over that of the clamp
COLUMNS = ("wall", "clamp", "polar_share", "side_outward", "side_polar", "side_azimuth", "axis_outward", "axis_polar")


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
    clamp_deg = np.degrees(geometry.clamp_polar_rad(geometry.inner_radius_mm))
    model, unit_mm = shell_model(geometry, law, "data"), geometry.outer_radius_mm**2 / law.shear_mpa * KG_PER_MM3
    free = own_weight_profiles(model, material.density_g_cm3, SHARES[:-1] * clamp_deg)
    found = np.vstack([free, np.zeros(free.shape[1])]) / (unit_mm * material.density_g_cm3)
    return [[ratios.wall, ratios.clamp, share, *row] for share, row in zip(SHARES, found, strict=True)]


if __name__ == "__main__":
    sys.exit(main())
