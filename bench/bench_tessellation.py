"""Tessellation tolerance against volume error, time and file size, over all printed and cast solids of D=130 T=8.

Writes bench/tessellation.csv and bench/tessellation.png. The reference is each solid's own volume; the relative
deflection that OCCT's exporters use by default is measured in the same run.
"""

import argparse
import csv
import sys
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from cad.interface import build_interface
from cad.mold.cup import cup_parts
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.design import build_core_solids
from fab.meshing.mesh import TOLERANCE_MM, tessellate
from fab.packed import packed_group

HERE = Path(__file__).parent
TOLERANCES_MM = (0.2, 0.1, 0.05, 0.02, 0.01, 0.005)
STL_BYTES_A_FACE = 50


def main() -> None:
    """Measure, write, plot."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    layout = MoldLayout(EndcapParams(130, 8))
    parts = [*cup_parts(layout), *build_core_solids(layout, lambda _: None), build_interface(layout.params)]
    parts += [packed.unpacked()[0] for packed in packed_group("hardware", layout, None)]
    solids = {part.name: part.solid for part in parts if part.role != "bought"}
    rows = []
    for tolerance in TOLERANCES_MM:
        start = time.process_time()
        meshes = {name: tessellate(solid, tolerance) for name, solid in solids.items()}
        seconds = time.process_time() - start
        errors = [abs(meshes[name].volume / solid.volume - 1) for name, solid in solids.items()]
        megabytes = sum(len(mesh.faces) for mesh in meshes.values()) * STL_BYTES_A_FACE / 1e6
        rows.append((tolerance, max(errors), seconds, megabytes))
        print(f"{tolerance:6.3f} mm: worst volume error {max(errors):.2e}, {seconds:.1f} s, {megabytes:.1f} MB")
    with (HERE / "tessellation.csv").open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["tolerance_mm", "worst_volume_error_ratio", "cpu_s", "stl_mb"])
        writer.writerows((t, f"{e:.3e}", f"{s:.2f}", f"{m:.2f}") for t, e, s, m in rows)
    plot(rows)


def plot(rows: list[tuple[float, float, float, float]]) -> None:
    """Volume error against time and size."""
    figure, left = plt.subplots(figsize=(7, 4), dpi=120)
    left.loglog([r[2] for r in rows], [r[1] for r in rows], "o-", color="tab:blue")
    for tolerance, error, seconds, megabytes in rows:
        left.annotate(f"{tolerance:g} mm, {megabytes:.0f} MB", (seconds, error), (4, 6), textcoords="offset points")
        if tolerance == TOLERANCE_MM:
            left.plot(seconds, error, "o", ms=14, mfc="none", color="tab:red", label="default")
    left.axhline(1e-3, color="grey", lw=0.8, ls="--", label="0.1 %, the most that a check lets pass")
    left.set(xlabel="time for all parts, CPU s", ylabel="worst volume error of a part (ratio)")
    left.legend()
    left.margins(0.25)
    left.set_xlim(right=200)
    figure.tight_layout()
    figure.savefig(HERE / "tessellation.png")


if __name__ == "__main__":
    sys.exit(in_one_line(main))
