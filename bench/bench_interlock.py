"""Does a scene need the interlock? Effective stiffness of its unit cell, and what it changes: ``bench_interlock.py``.

    python bench/bench_interlock.py                        # two and a half minutes of processor time

1. bench/interlock_cell.csv: modulus of TPU gyroid in silicone by voxels along a period, phases that share a voxel side
   by side or in series (the truth lies between), beside the bounds of Voigt, Reuss, Hashin and Shtrikman.
2. bench/interlock.csv: the shell D=130 T=8 with that zone as plain silicone, as the composite, and a hundred times
   stiffer (about rigid): depth under the load, the dots' displacement, and the error of weights that were trained on
   plain silicone, on four paths that they have not seen.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from bench_similarity import TEST, TRAIN, errors, tested_on
from one_line import in_one_line
from table_file import write_table

from cad.materials import silicone
from cad.params import EndcapParams
from sensing.design.pressed import GYROID_FRACTION
from sensing.design.weights import DesignRequest, design_weights
from sensing.learning.fit_config import FitConfig
from sensing.simulator.similarity.labelled import shell_of, solved_source
from sensing.simulator.verification.unit_cell import Phase, effective, gyroid_share, hashin_shtrikman, voxels

HERE = Path(__file__).parent
COUNTS = (27, 45, 63, 81)
TPU_YOUNG_MPA, TPU_POISSON = 26.0, 0.48  # E: data sheets of TPU 95A filaments give 10 to 50 MPa
OTHER_TPU_MPA = (10.0, 50.0)
RIGID = 100.0
MESH = "draft"  # all three shells on the same: differences count
TILTS_DEG, LOADS_N = (10.0, 30.0, 50.0), (10.0, 35.0)
DESIGN = (130.0, 8.0)


def cells(counts: Sequence[int]) -> tuple[list[dict[str, Any]], float]:
    """(rows of the cell, composite's Young's modulus over the silicone's on the finest)."""
    law = silicone().neo_hooke()
    soft, rows = Phase(law.bulk_mpa, law.shear_mpa), []
    for young, count in [*((TPU_YOUNG_MPA, count) for count in counts), *((young, 63) for young in OTHER_TPU_MPA)]:
        stiff = Phase.of(young, TPU_POISSON)
        share = gyroid_share(count, GYROID_FRACTION)
        low, high = (effective(voxels(share, soft, stiff, series)) for series in (True, False))
        bounds = hashin_shtrikman(GYROID_FRACTION, soft, stiff)
        voigt, reuss = (voxels(np.array(GYROID_FRACTION), soft, stiff, series) for series in (False, True))
        rows.append(
            {"tpu_young_mpa": young, "voxels": count, "silicone_mpa": law.young_mpa, "reuss_mpa": _young(reuss)}
            | {"hashin_shtrikman_low_mpa": _young(bounds[0]), "series_mpa": low.young_mpa}
            | {
                "parallel_mpa": high.young_mpa,
                "hashin_shtrikman_high_mpa": _young(bounds[1]),
                "voigt_mpa": _young(voigt),
            }
            | {"zener": high.anisotropy, "ratio": 0.5 * (low.young_mpa + high.young_mpa) / law.young_mpa}
        )
        print({name: round(float(value), 4) for name, value in rows[-1].items()}, flush=True)
    return rows, float(next(row["ratio"] for row in rows if row["voxels"] == max(counts)))


def _young(phase: Phase) -> float:
    bulk, shear = float(phase.bulk_mpa), float(phase.shear_mpa)
    return 9 * bulk * shear / (3 * bulk + shear)


def pressed(factor: float) -> dict[tuple[float, float], tuple[float, np.ndarray]]:
    """Depth and dots' displacement by tilt and load."""
    request = DesignRequest(EndcapParams(*DESIGN)).data("off", 1)
    simulator, found = shell_of(replace(request, density=MESH, interlock=factor))[0], {}
    for tilt in TILTS_DEG:
        for load in LOADS_N:
            state = simulator.press(load, tilt)
            found[tilt, load] = state.depth_mm, simulator.markers(state)
    return found


def weights_on(factors: Sequence[float], config: FitConfig) -> list[float]:
    """Force error an axis (N), on shells with each factor, of weights that know plain silicone."""
    request, found = DesignRequest(EndcapParams(*DESIGN), pictures=False, numbers=TRAIN), []
    model = design_weights(request, config)
    for factor in factors:
        simulator = shell_of(replace(request.data("off", 1), density=MESH, interlock=factor))[0]
        found.append(errors(model, tested_on(request, TEST[1::2], solved_source(simulator), MESH)).force_n)
        print(f"interlock x {factor:.3g}: {found[-1]:.4f} N", flush=True)
    return found


def main(arguments: list[str] | None = None) -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(description="Whether a scene needs the interlock's stiffness.")
    parser.add_argument("--voxels", type=int, nargs="+", default=list(COUNTS), help="along a period, odd")
    parser.add_argument("--ratio", type=float, help="of the composite to silicone; without, the cell is solved")
    options = parser.parse_args(arguments)
    ratio = options.ratio
    if ratio is None:
        rows, ratio = cells(options.voxels)
        write_table(HERE / "interlock_cell.csv", rows, figures=5)
    factors = (1.0, ratio, RIGID)
    states = [pressed(factor) for factor in factors]
    table = []
    for factor, found, error in zip(factors, states, weights_on(factors, FitConfig()), strict=True):
        depth = [100 * (found[place][0] / states[0][place][0] - 1) for place in found]
        moved = [_apart(found[place][1], states[0][place][1]) for place in found]
        table.append(
            {"stiffer": factor, "depth_mean_percent": np.mean(depth), "depth_most_percent": min(depth)}
            | {"dots_mean_percent": np.mean(moved), "dots_most_percent": max(moved), "force_error_n": error}
            | {"force_error_percent": 100 * error / 35}
        )
    write_table(HERE / "interlock.csv", table, figures=5)
    return 0


def _apart(dots: np.ndarray, plain: np.ndarray) -> float:
    return 100 * float(np.linalg.norm(dots - plain) / np.linalg.norm(plain))


if __name__ == "__main__":
    sys.exit(in_one_line(main))
