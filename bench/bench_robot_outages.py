"""Streams of a standing robot that fall silent, several at once: how far off its bars are, and what health says.

    python bench/bench_robot_outages.py              # bench/robot_outages.csv: a row a drawn set of outages

A robot stands for 20 s; in its first ten, after the start, every stream (inertial sensors, cable lengths, endcaps) is
silent up to three times for 0.3 to 2.5 s. Asked at 12 s and at the end.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from sensing.robot.estimate import RobotEstimate
from sensing.robot.estimator import RobotEstimator
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import LengthSample, Sample
from sensing.tensegrity.shape import rotation_of

HERE = Path(__file__).parent
sys.path.append(str(HERE.parent / "tests"))
from standing_robot import feed, standing_samples  # noqa: E402

ASKED_S = (12.0, 19.9)


def main() -> None:
    """Draw, estimate, write, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=20, help="drawn sets of outages (default: %(default)s)")
    parser.add_argument("--out", type=Path, default=HERE / "robot_outages.csv", metavar="FILE.csv")
    options = parser.parse_args()
    robot, rows = load_robot(), []
    for seed in range(options.sets):
        poses, samples = standing_samples(robot, ASKED_S[-1] + 0.1, seed=seed, rate_hz=100.0)
        estimator, left = RobotEstimator(robot), list(ASKED_S)
        for sample in with_outages(samples, seed):
            feed(estimator, [sample])
            if left and sample.time_s >= left[0]:
                rows.append(row(seed, left.pop(0), estimator.state(), poses))
                print(*rows[-1].values(), sep=", ")
    write_table(options.out, rows)


def with_outages(samples: list[Sample], seed: int) -> list[Sample]:
    """All samples but those of streams that are silent."""
    draw, gone = np.random.default_rng(1000 + seed), {}
    for name in sorted({name_of(sample) for sample in samples}):
        begins = draw.uniform(1.5, 9.0, draw.integers(0, 4))
        gone[name] = [(begin, begin + draw.uniform(0.3, 2.5)) for begin in begins]
    return [s for s in samples if not any(a < s.time_s < b for a, b in gone[name_of(s)])]


def name_of(sample: Sample) -> str:
    """Of the stream."""
    if isinstance(sample, LengthSample):
        return "lengths"
    return str(getattr(sample, "sensor", "") or getattr(sample, "endcap", ""))


def row(seed: int, at_s: float, estimate: RobotEstimate | None, poses: np.ndarray) -> dict[str, object]:
    """One answer beside the truth."""
    assert estimate is not None
    worst = max(off_deg(bar.T_world_bar, pose) for bar, pose in zip(estimate.bars, poses, strict=True))
    sd = max(math.degrees(math.sqrt(np.linalg.eigvalsh(bar.covariance[3:5, 3:5])[-1])) for bar in estimate.bars)
    return {
        "set": seed, "time_s": at_s, "off_deg": f"{worst:.2f}", "sd_deg": f"{sd:.2f}",
        "good": int(estimate.health.good), "notes": "; ".join(estimate.health.notes),
    }  # fmt: skip


def off_deg(found: np.ndarray, true: np.ndarray) -> float:
    """Angle between two attitudes, the heading left out."""
    turn = found[:3, :3] @ true[:3, :3].T
    turn = rotation_of(np.array([0, 0, -math.atan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])])) @ turn
    return math.degrees(math.acos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))


if __name__ == "__main__":
    sys.exit(in_one_line(main))
