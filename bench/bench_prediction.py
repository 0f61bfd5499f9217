"""Prediction to now against holding the last value: ``python bench/bench_prediction.py`` writes prediction.csv, .png.

Forces on motions whose parameters are drawn anew (seeds 100 to 103; the filter was tuned on others), measured at 30, 60
and 120 Hz with 0.1 N of noise, capture jitter and lost frames, and answered 20, 50 or 100 ms late. RMSE of the force
vector in N: the last filtered value held, the filter's rate taken as it is, and the rate weighted by what it was worth
(:mod:`sensing.wrench.trend`).
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from sensing.records import Wrench
from sensing.wrench.filter import WrenchFilter

HERE = Path(__file__).parent
SEEDS = tuple(range(100, 104))
RATES_HZ = (30.0, 60.0, 120.0)
DELAYS_S = (0.02, 0.05, 0.1)
NOISE_N, SECONDS, START_S = 0.1, 8.0, 1.0
Path3 = Callable[[np.ndarray], np.ndarray]  # times (n,) -> forces (n, 3)


def circle(low_hz: float, high_hz: float) -> Callable[[np.random.Generator], Path3]:
    """A steady load drawn in a circle."""

    def made(rng: np.random.Generator) -> Path3:
        hz, size, normal, phase = (
            math.exp(rng.uniform(math.log(low_hz), math.log(high_hz))),
            *rng.uniform(1, 8, 2),
            rng.uniform(0, 6),
        )
        return lambda t: np.stack(
            [
                size * np.cos(2 * math.pi * hz * t + phase),
                size * np.sin(2 * math.pi * hz * t + phase),
                -normal - 5 + 0 * t,
            ],
            1,
        )

    return made


def rest(rng: np.random.Generator) -> Path3:
    """A load that stands."""
    force = rng.uniform(-10, 10, 3)
    return lambda t: np.tile(force, (len(t), 1))


def ramps(rng: np.random.Generator) -> Path3:
    """Up, hold, down, hold, at some N/s."""
    slope, size, direction = rng.uniform(5, 80), rng.uniform(5, 25), rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    rise, hold = size / slope, rng.uniform(0.2, 1.0)
    period = 2 * (rise + hold)

    def path(t: np.ndarray) -> np.ndarray:
        late = t % period
        level = np.clip(late / rise, 0, 1) * np.clip((2 * rise + hold - late) / rise, 0, 1)
        return size * level[:, None] * direction

    return path


def steps(rng: np.random.Generator) -> Path3:
    """Jumps at random times."""
    times = np.cumsum(rng.exponential(0.4, 60))
    levels = rng.uniform(-15, 15, (61, 3))
    return lambda t: levels[np.searchsorted(times, t)]


def stick_slip(rng: np.random.Generator) -> Path3:
    """A saw: slow rise, sudden fall."""
    hz, size = rng.uniform(0.5, 8), rng.uniform(1, 6)
    return lambda t: np.stack([size * (t * hz % 1.0), 0 * t, -15 + 0 * t], 1)


def impacts(rng: np.random.Generator) -> Path3:
    """Half sines of 40 to 150 ms with gaps."""
    length, gap, size = rng.uniform(0.04, 0.15), rng.uniform(0.1, 0.6), rng.uniform(5, 30)

    def path(t: np.ndarray) -> np.ndarray:
        late = t % (length + gap)
        push = np.where(late < length, np.sin(math.pi * np.minimum(late / length, 1)), 0.0)
        return np.stack([0 * t, 0 * t, -size * push], 1)

    return path


def wander(rng: np.random.Generator) -> Path3:
    """A random walk of 10 N over a second, smoothed over 20 ms."""
    grid = np.arange(0, SECONDS + 1, 0.005)
    walk = np.cumsum(rng.normal(0, 10 * math.sqrt(0.005), (len(grid), 3)), axis=0)
    soft = np.stack([np.convolve(column, np.ones(4) / 4, "same") for column in walk.T], 1)
    return lambda t: np.stack([np.interp(t, grid, column) for column in soft.T], 1)


def chirp(rng: np.random.Generator) -> Path3:
    """A sine from 0.2 to 12 Hz."""
    size, turn = rng.uniform(2, 8), rng.uniform(0, 6)
    return lambda t: np.stack(
        [size * np.sin(2 * math.pi * 0.2 * 60 ** (t / SECONDS) * SECONDS / math.log(60) + turn), 0 * t, -10 + 0 * t], 1
    )


MOTIONS: dict[str, Callable[[np.random.Generator], Path3]] = {
    "rest": rest, "ramps": ramps, "circle under 0.5 Hz": circle(0.1, 0.5), "circle 0.5 to 2 Hz": circle(0.5, 2.0),
    "circle 2 to 5 Hz": circle(2.0, 5.0), "circle 5 to 12 Hz": circle(5.0, 12.0), "steps": steps,
    "stick-slip": stick_slip, "impacts": impacts, "random walk": wander, "chirp": chirp,
}  # fmt: skip


def errors(path: Path3, rate_hz: float, delay_s: float, seed: int) -> np.ndarray:
    """(3,) mean square errors: held, the filter's rate, the weighted rate."""
    rng = np.random.default_rng([seed, int(rate_hz), int(1000 * delay_s)])
    times = np.arange(0, SECONDS, 1 / rate_hz)
    times = np.sort(times + rng.normal(0, 0.03 / rate_hz, len(times)))[rng.uniform(size=len(times)) > 0.02]
    truth, later = path(times), path(times + delay_s)
    smooth, rows = WrenchFilter(), []
    covariance = np.diag([NOISE_N**2] * 3 + [0.01**2] * 3)
    for time_s, force, now in zip(times, truth, later, strict=True):
        wrench = Wrench(time_s, force + rng.normal(0, NOISE_N, 3), np.zeros(3), "sphere", covariance)
        held = smooth.update(wrench)
        if time_s > START_S:
            plain, weighted = smooth.at(time_s + delay_s), smooth.now(time_s + delay_s)
            rows.append([((answer.force_n - now) ** 2).sum() for answer in (held, plain, weighted)])
    return np.mean(rows, axis=0)


def table(seeds: tuple[int, ...], rates: tuple[float, ...], delays: tuple[float, ...]) -> list[dict[str, object]]:
    """Rows by motion, rate and delay."""
    rows: list[dict[str, object]] = []
    for name, made in MOTIONS.items():
        paths = [(seed, made(np.random.default_rng([seed, 5]))) for seed in seeds]
        for rate_hz in rates:
            for delay_s in delays:
                each = np.sqrt([errors(path, rate_hz, delay_s, seed) for seed, path in paths])
                held, plain, weighted = np.sqrt((each**2).mean(axis=0))
                rows.append({
                    "motion": name, "rate_hz": rate_hz, "delay_ms": round(1000 * delay_s), "held_n": f"{held:.4f}",
                    "rate_n": f"{plain:.4f}", "weighted_n": f"{weighted:.4f}",
                    "weighted_over_held": f"{weighted / held:.3f}",
                    "worst_path": f"{(each[:, 2] / each[:, 0]).max():.3f}",
                })  # fmt: skip
    return rows


def plot(rows: list[dict[str, object]]) -> None:
    """Errors at 50 ms over that of holding, by motion."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(RATES_HZ), figsize=(11, 3.6), sharey=True, layout="constrained")
    for axis, rate_hz in zip(axes, RATES_HZ, strict=True):
        chosen = [row for row in rows if row["rate_hz"] == rate_hz and row["delay_ms"] == 50]
        place = np.arange(len(chosen))
        for column, label, shift in (("rate_n", "rate as it is", -0.2), ("weighted_n", "weighted", 0.2)):
            ratio = [float(str(row[column])) / float(str(row["held_n"])) for row in chosen]
            axis.barh(place + shift, np.minimum(ratio, 2.5), 0.4, label=label)
        axis.axvline(1, color="k", lw=1)
        axis.set_yticks(place, [str(row["motion"]) for row in chosen])
        axis.set_title(f"{rate_hz:g} Hz")
        axis.set_xlabel("error over that of holding")
    axes[0].legend(loc="upper left", bbox_to_anchor=(0.0, -0.15), ncols=2)
    figure.savefig(HERE / "prediction.png", dpi=90)


def main() -> None:
    """Run everything and write table and plot."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    rows = table(SEEDS, RATES_HZ, DELAYS_S)
    write_table(HERE / "prediction.csv", rows)
    plot(rows)
    for row in rows:
        print(*row.values(), sep="\t")


if __name__ == "__main__":
    sys.exit(in_one_line(main))
