"""Speed against error of level 3: ``python bench/bench_reduced.py`` writes bench/reduced.csv and .png.

Modes and cubature tolerance, D = 130, T = 8, tilt 30, half model, against level 2 in the same run, on a path and at a
friction that training has not seen. No estimate is applied: every state that level 3 finds is its own. (Training takes
a minute, the path on level 2 another, every setting seconds.)
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from cad.materials import silicone
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.press.frozen import FrozenPress
from sensing.simulator.press.press import Press
from sensing.simulator.reduced.basis import FRICTION, STATES, reduced_model, training_states
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.shell import shell_model
from sensing.simulator.verification.reduced import UNSEEN_FRICTION, exact_states, judge, level_2_rate, unseen_path

HERE = Path(__file__).parent
MODES = (10, 20, 35, 50)
CUBATURE = (5e-2, 1e-2, 2e-3)


def main() -> None:
    """Train once, judge every setting, write table and plot."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    model = shell_model(shell_geometry(130, 8), silicone().neo_hooke(), "data", half=True)
    tilted = Indenter(30.0)
    states = training_states(FrozenPress(Press(model, tilted, FRICTION)), STATES)
    press, path = Press(model, tilted, UNSEEN_FRICTION), unseen_path(half=True)
    fast = FrozenPress(press)
    exact, level_2 = exact_states(press, path), level_2_rate(fast, path)
    rows = []
    for modes in MODES:
        for error in CUBATURE:
            reduced = replace(reduced_model(model, states, modes, error), estimate_factor=0.0)
            found = judge(fast, reduced, path, exact)
            rows.append({
                "modes": modes, "cubature": error, "elements": len(reduced.cells), "answered": len(found.error),
                "fallbacks": found.fallbacks, "mean": float(found.error.mean()),
                "p95": float(np.percentile(found.error, 95)), "states_s": found.rate,
                "level_2_states_s": level_2,
            })  # fmt: skip
            print(rows[-1], file=sys.stderr, flush=True)
    write_table(HERE / "reduced.csv", rows, figures=4)
    plot(rows)


def plot(rows: list) -> None:
    """Error against time a state, one line for each cubature tolerance."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(6.5, 4), layout="constrained")
    for error, (dx, dy) in zip(CUBATURE, ((-5, 2), (5, 1), (5, -8)), strict=True):
        line = [row for row in rows if row["cubature"] == error]
        axes.loglog(
            [1000 / r["states_s"] for r in line], [100 * r["p95"] for r in line], "o-", label=f"cubature {error:g}"
        )
        for r in line:
            axes.annotate(f"{r['modes']}/{r['elements']}", (1000 / r["states_s"], 100 * r["p95"]), fontsize=7,
                          xytext=(dx, dy), ha="left" if dx > 0 else "right", textcoords="offset points")  # fmt: skip
    axes.axvline(1000 / rows[0]["level_2_states_s"], color="k", ls=":", label="level 2")
    axes.set(
        xlabel="processor ms a state",
        ylabel="marker error, 95 % quantile, %",
        title="Level 3: modes / elements (of 126)",
    )
    axes.set_xticks([5, 10, 20, 50, 100], ["5", "10", "20", "50", "100"])
    axes.minorticks_off()
    axes.set_xlim(5, 120)
    axes.legend(fontsize=7, loc="center right", bbox_to_anchor=(0.9, 0.5))
    figure.savefig(HERE / "reduced.png", dpi=110)


if __name__ == "__main__":
    sys.exit(in_one_line(main))
