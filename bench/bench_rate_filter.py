"""Load, dwell, unload with rate effects: ``python bench/bench_rate_filter.py`` writes rate_filter.csv and .png.

An endcap of Smooth-Sil 950 that relaxes (mesh ``draft``) stands under a dead weight of 18 N for five seconds.
``sensing.weighing.dwell`` finds the constants from the live pipeline's answers. Then it is loaded, held and released on
other paths, tilts and loads, by force and by depth; errors of the force vector (root mean square over frames and axes,
N) without the filter, with the constants found, with the simulator's own, and with those wrong by factors. What is left
with the simulator's own constants is the network's and the tracker's error.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from pressed_films import Film, Recipe, asked_film, pressed_film

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from cad.materials import silicone
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.model import load_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.records import Wrench
from sensing.simulator.press.press import Target
from sensing.tracking.zero import single_zero
from sensing.weighing.dwell import fit_dwell
from sensing.wrench.relaxation import RateFilter, Term

HERE = Path(__file__).parent
OUT = HERE.parent / "exports" / "bench"
FRAME_S = 1 / 30
WEIGHT_N = 18.0
FACTORS = (0.25, 0.5, 0.75, 1.25, 1.5, 2.0, 4.0)


@dataclass(frozen=True)
class Motion:
    """A path by its corner points.

    Attributes:
        tilt_deg, azimuth_deg: of first touch. corners: (time in s, force in N or depth in mm); the first at the end of
            rest, the last at release. by_depth: what the corners state.
    """

    tilt_deg: float
    azimuth_deg: float
    corners: tuple[tuple[float, float], ...]
    by_depth: bool = False


MOTIONS = {
    "dead weight": Motion(0.0, 0.0, ((0.3, 0.0), (0.45, WEIGHT_N), (5.5, WEIGHT_N), (5.65, 0.5))),
    "20 N for 3 s": Motion(20.0, 70.0, ((0.3, 0.0), (0.6, 20.0), (3.6, 20.0), (3.9, 0.5))),
    "5 mm for 3 s": Motion(35.0, 200.0, ((0.3, 0.0), (0.5, 5.0), (3.5, 5.0), (3.7, 0.1)), True),
    "taps": Motion(10.0, 310.0, (
        (0.3, 0.0), (0.4, 15.0), (0.9, 15.0), (1.0, 5.0), (1.5, 5.0), (1.6, 18.0), (2.1, 18.0), (2.2, 0.5),
    )),
}  # fmt: skip
AFTER_S = 2.5


def targets(motion: Motion) -> list[Target | None]:
    """Ten pictures at rest, then one every 1/30 s where something changes, and fewer where little does."""
    times: list[float] = []
    last_s = motion.corners[-1][0]
    for (begin_s, a), (end_s, b) in pairwise((*motion.corners, (last_s + AFTER_S, motion.corners[-1][1]))):
        here = begin_s
        while here < end_s - 1e-9:
            late = here - begin_s
            here = min(end_s, here + (FRAME_S if a != b or late < 0.35 else 0.1 if late < 1.2 else 0.25))
            times.append(here)
    found: list[Target | None] = [None] * 10
    for time_s in times:
        level = float(np.interp(time_s, *zip(*motion.corners, strict=True)))
        if time_s > last_s + 1e-9:
            found.append(Target(depth_mm=-1.0, time_s=time_s))
        elif motion.by_depth:
            found.append(Target(depth_mm=level, time_s=time_s))
        else:
            found.append(Target(normal_n=level, time_s=time_s))
    return found


def film(name: str) -> Film:
    """Pictures of a motion."""
    motion, number = MOTIONS[name], list(MOTIONS).index(name)
    recipe = Recipe(
        tilt_deg=motion.tilt_deg, azimuth_deg=motion.azimuth_deg, rate_effects=True, noise=20_000 + 1000 * number,
        density="draft",
    )  # fmt: skip
    return pressed_film(OUT / f"rate_{number}", recipe, targets(motion), 0.0)


def answers(endcap: EndcapConfig, shown: Film) -> tuple[list[Wrench], np.ndarray]:
    """Single-frame answers of the live pipeline, and the true forces (n, 3)."""
    pipeline = EndcapPipeline(endcap, load_model("default", endcap.params), single_zero(shown.frames[0]))
    found = []
    for k, frame in enumerate(shown.frames[1:], 1):
        timed = replace(frame, time_s=frame.time_s if k >= 10 else 0.03 * k)
        reading = pipeline.update(timed)
        assert reading is not None and reading.valid, reading
        found.append(reading.estimate)
    return found, shown.wrench[1:, :3]


def rms(found: Sequence[Wrench], truth: np.ndarray) -> tuple[float, float]:
    """(root mean square over frames and axes, largest norm) of the force's error, N."""
    error = np.array([wrench.force_n for wrench in found]) - truth
    return float(np.sqrt((error**2).mean())), float(np.linalg.norm(error, axis=1).max())


def filtered(found: Sequence[Wrench], terms: Sequence[Term]) -> list[Wrench]:
    """Answers behind a rate filter."""
    rate, moved = RateFilter(terms), []
    for wrench in found:
        step = rate.step(wrench)
        rate.take(step)
        moved.append(step.wrench)
    return moved


def scaled(terms: Sequence[Term], strength: float = 1.0, tau: float = 1.0) -> list[Term]:
    """Terms that are wrong by factors."""
    return [Term(strength * term.strength, tau * term.tau_s) for term in terms]


def main() -> None:
    """Identify, test, write; a number makes one film only."""
    number = asked_film(__doc__, len(MOTIONS))
    if number is not None:
        print(film(list(MOTIONS)[number]).folder)
        return
    endcap = EndcapConfig("relaxing", "0")
    found, _ = answers(endcap, film("dead weight"))
    time_s, force_n = (np.array(c) for c in zip(*((w.time_s, -w.force_n[2]) for w in found), strict=True))
    dwell = fit_dwell(time_s, force_n)
    slow = 1 - sum(g for g, _ in silicone().prony_series())
    own = [Term(g / slow, tau) for g, tau in silicone().prony_series()]
    print("found", dwell.terms, "simulator", own, flush=True)
    rows, live = [], replace(endcap, relaxation=tuple((t.strength, t.tau_s, t.sd) for t in dwell.terms))
    kept = {name: answers(endcap, film(name)) for name in MOTIONS}
    cases: list[tuple[str, Sequence[Term]]] = [("off", ()), ("found", dwell.terms), ("simulator's own", own)]
    cases += [(f"strength x {factor:g}", scaled(own, strength=factor)) for factor in FACTORS]
    cases += [(f"relaxation time x {factor:g}", scaled(own, tau=factor)) for factor in FACTORS]
    for case, terms in cases:
        for name, (given, true) in kept.items():
            error, largest = rms(filtered(given, terms), true)
            rows.append({"constants": case, "motion": name, "rms_n": f"{error:.4f}", "largest_n": f"{largest:.4f}"})
    for name in MOTIONS:  # through the pipeline itself
        given, true = answers(live, film(name))
        error, largest = rms(given, true)
        rows.append(
            {"constants": "found, live", "motion": name, "rms_n": f"{error:.4f}", "largest_n": f"{largest:.4f}"}
        )
    write_table(HERE / "rate_filter.csv", rows)
    for row in rows:
        print(*row.values(), sep="\t")
    plot(rows, kept, dwell.terms)


def plot(rows: list[dict[str, str]], kept: dict[str, tuple[list[Wrench], np.ndarray]], terms: Sequence[Term]) -> None:
    """One motion in time, and the error against how wrong the constants are."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
    given, true = kept["20 N for 3 s"]
    for label, shown in (("off", given), ("constants found", filtered(given, terms))):
        error = np.array([wrench.force_n for wrench in shown]) - true
        left.plot([wrench.time_s for wrench in shown], np.linalg.norm(error, axis=1), marker=".", label=label)
    left.set_xlabel("s")
    left.set_ylabel("error of the force, N (20 N for 3 s)")
    left.legend()
    for what in ("strength", "relaxation time"):
        points = [(factor, f"{what} x {factor:g}") for factor in FACTORS] + [(1.0, "simulator's own")]
        for name, style in zip(kept, ("-", "--", ":", "-."), strict=True):
            values = {row["constants"]: float(row["rms_n"]) for row in rows if row["motion"] == name}
            line = sorted((factor, values[case]) for factor, case in points)
            colour = "C0" if what == "strength" else "C1"
            right.semilogx(*zip(*line, strict=True), style, color=colour, label=f"{what}, {name}")
    right.set_xticks([0.25, 0.5, 1, 2, 4], ["1/4", "1/2", "1", "2", "4"], minor=False)
    right.minorticks_off()
    right.set_xlabel("factor by which the constants are wrong")
    right.set_ylabel("RMS error of the force, N")
    right.set_ylim(bottom=0)
    right.legend(fontsize=6)
    figure.savefig(HERE / "rate_filter.png", dpi=90)


if __name__ == "__main__":
    sys.exit(in_one_line(main))
