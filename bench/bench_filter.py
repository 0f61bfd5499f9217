"""What the filter's steady motions are worth, and what they cost: ``python bench/bench_filter.py`` writes filter.csv.

The filter as it is and without them, on the same simulated measurements (seeds from 300; the filter was set on others).
The error has a part that is new in every picture and one that repeats for a state, as the tracker's does: a smooth
function of the force. ``rest`` and ``onset``: an untouched endcap that is then pressed by a step or a ramp; frames from
its begin until the force norm passes a threshold that one frame in a thousand passes at rest, each filter its own.
``interval``: motions of bench_prediction.py; share of answers inside their 95 % interval, mean normalised square of the
errors (1 where the covariance is honest), root mean square error, N.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from bench_prediction import MOTIONS
from one_line import in_one_line
from table_file import write_table

from sensing.records import Wrench
from sensing.wrench.filter import STANDARD, FilterConfig, WrenchFilter

HERE = Path(__file__).parent
FILTERS = {"steady": FilterConfig(), "without": FilterConfig(tuple(m for m in STANDARD if not m.steady))}
SCATTER = FilterConfig().scatter
REST_SD = np.array([0.0126, 0.0136, 0.0319, 0.0018, 0.0015, 0.0016])  # M: what the model states at rest, N and N m
RATE_HZ, REST_S, START = 30.0, 10.0, 40
ONSETS = {"step": (0.03, 0.04, 0.05, 0.07, 0.1, 1.0), "ramp": (0.05, 0.1, 0.3, 1.0, 10.0)}  # N, N/s
SHOWN = ("rest", "ramps", "circle under 0.5 Hz", "circle 0.5 to 2 Hz", "circle 2 to 5 Hz", "steps", "random walk")


def main() -> None:
    """Measure, print, write."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    rows = [*onsets(200), *intervals(range(340, 352))]
    write_table(HERE / "filter.csv", rows)
    for row in rows:
        print(*row.values(), sep="\t")


def onsets(count: int) -> Iterator[dict[str, str]]:
    """Rows of the rest and of each onset, along x and z."""
    frames = round(REST_S * RATE_HZ)
    rest = {name: np.array([norms(config, np.zeros((frames, 3)), [300, k]) for k in range(50)]) for name, config in
            FILTERS.items()}  # fmt: skip
    on_n = {name: float(np.quantile(norm[:, 20:], 0.999)) for name, norm in rest.items()}
    for name, norm in rest.items():
        numbers = {"median_n": np.median(norm), "most_n": norm.max(), "threshold_n": on_n[name]}
        yield row("rest", "rest", RATE_HZ, name, numbers)
    for kind, sizes in ONSETS.items():
        for size in sizes:
            for axis in (0, 2):
                late = np.maximum(np.arange(160) - START + 1, 0)
                path = np.zeros((160, 3))
                path[:, axis] = -size * (late > 0 if kind == "step" else late / RATE_HZ)
                seeds = [[310 + axis, round(1000 * size), k] for k in range(count)]
                found = {
                    name: np.array([first(norms(config, path, seed), on_n[name]) for seed in seeds])
                    for name, config in FILTERS.items()
                }
                unit = "N" if kind == "step" else "N/s"
                for name, delays in found.items():
                    numbers = {"delay_frames": np.mean(delays), "later": np.mean(delays > found["without"])}
                    yield row("onset", f"{kind} {size:g} {unit} {'xyz'[axis]}", RATE_HZ, name, numbers)


def norms(config: FilterConfig, path: np.ndarray, seed: list[int]) -> np.ndarray:
    """(n,) force norms that the filter answers on a path (n, 3), the repeating error that of the rest."""
    rng, smooth = np.random.default_rng(seed), WrenchFilter(config)
    repeats = 0.5 * SCATTER * rng.normal(size=6)
    found = []
    for number, force in enumerate(path):
        measured = np.array([*force, 0, 0, 0]) + repeats + SCATTER * rng.normal(size=6)
        wrench = Wrench(number / RATE_HZ, measured[:3], measured[3:], "sphere", np.diag(REST_SD**2))
        found.append(np.linalg.norm(smooth.update(wrench).force_n))
    return np.array(found)


def first(norm: np.ndarray, on_n: float) -> int:
    """Frames from the begin of the press to the first at or over the threshold; all that are left where none is."""
    hit = np.flatnonzero(norm[START:] >= on_n)
    return int(hit[0]) if len(hit) else len(norm) - START


def intervals(seeds: range) -> Iterator[dict[str, str]]:
    """Rows of the intervals on motions."""
    for motion in SHOWN:
        for rate_hz in (30.0, 120.0):
            for name, config in FILTERS.items():
                found = np.concatenate([judged(config, motion, rate_hz, seed) for seed in seeds])
                covered, square, error = found.mean(axis=0)
                numbers = {"covered": covered, "normalised_square": square, "rmse_n": np.sqrt(3 * error)}
                yield row("interval", motion, rate_hz, name, numbers)


def judged(config: FilterConfig, motion: str, rate_hz: float, seed: int) -> np.ndarray:
    """(n, 3) shares inside, normalised squares and squares of the errors of one path, means of the three forces."""
    rng, smooth, found = np.random.default_rng(seed), WrenchFilter(config), []
    times = np.arange(0, 4, 1 / rate_hz)
    force = MOTIONS[motion](np.random.default_rng([seed, 5]))(times)
    waves, phase = 0.15 * rng.normal(size=(4, 3, 3)), rng.uniform(0, 2 * np.pi, (4, 1, 3))
    smooth_error = np.sqrt(0.5) * np.sin(np.einsum("ni,kij->knj", force, waves) + phase).sum(axis=0)
    stated = REST_SD[:3] + 0.004 * np.linalg.norm(force, axis=1)[:, None] * [1, 1, 2]
    measured = force + smooth_error * np.sqrt(stated**2 - SCATTER[:3] ** 2) + rng.normal(size=force.shape) * SCATTER[:3]
    for time_s, value, deviation, truth in zip(times, measured, stated, force, strict=True):
        covariance = np.diag([*deviation**2, *(0.1 * deviation) ** 2])
        answer = smooth.update(Wrench(time_s, value, np.zeros(3), "sphere", covariance))
        off, variance = answer.force_n - truth, answer.covariance.diagonal()[:3]
        if time_s > 0.5:
            inside = np.abs(off) < 1.96 * np.sqrt(variance)
            found.append([inside.mean(), (off**2 / variance).mean(), (off**2).mean()])
    return np.array(found)


def row(what: str, motion: str, rate_hz: float, name: str, numbers: dict[str, float]) -> dict[str, str]:
    """A row of the table: three numbers at most, each with its name."""
    cells = [f"{key}={value:.4g}" for key, value in numbers.items()]
    return {"what": what, "motion": motion, "rate_hz": f"{rate_hz:g}", "filter": name, "numbers": " ".join(cells)}


if __name__ == "__main__":
    sys.exit(in_one_line(main))
