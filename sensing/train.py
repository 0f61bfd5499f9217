"""Labelled frames to weights: ``python -m sensing.train --help``.

python -m sensing.train exports/data --out weights.safetensors
python -m sensing.train my_recording --start weights.safetensors --out mine.safetensors      # fine-tuning
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cad.errors import EndcapError, ParameterError
from sensing.samples import ROW_ARRAYS, SHAPE, Samples, read_samples


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        return _run(options)
    except EndcapError as error:
        print(f"sensing.train: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\nsensing.train: stopped, nothing written", file=sys.stderr)
        return 130


def read_all(folders: Sequence[Path], method: str, shape: tuple[int, int] = SHAPE) -> Samples:
    """Samples of several folders of one design, in one.

    Raises:
        ParameterError: folders of different designs. FileError: a folder that cannot be read.
    """
    parts = [read_samples(folder, method, shape) for folder in folders]
    designs = {part.design.label for part in parts}
    if len(designs) > 1:
        raise ParameterError(f"data of {', '.join(sorted(designs))}: give folders of one design", name="data")
    joined: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in ROW_ARRAYS}
    return replace(parts[0], **joined, source=" ".join(map(str, folders)))


def _run(options: argparse.Namespace) -> int:
    from sensing.fitting import FitConfig, fit  # torch takes seconds to load: bad options are told before
    from sensing.wrench_model import WrenchModel

    config = FitConfig(
        components=options.components, hidden=options.hidden, seconds=options.seconds, seed=options.seed,
        device=options.device,
    )  # fmt: skip
    if not options.out.parent.is_dir():
        raise ParameterError(f"--out {options.out}: its folder is not there: make it first", name="out")
    samples = read_all(options.data, options.method)
    start = WrenchModel.load(options.start, samples.design) if options.start else None

    def progress(part: str, spent: float, error: float) -> None:
        if sys.stderr.isatty():
            print(f"\r{part}: {spent:.0f} s, {error:.4f}   ", end="", file=sys.stderr)

    model = fit(samples, config, start, progress)
    model.save(options.out)
    rmse = model.about["metrics"]["validation_rmse"]
    said = ", ".join(f"{value:.3f}" for value in rmse[:3]), ", ".join(f"{value:.4f}" for value in rmse[3:])
    print(
        f"{options.out}: {samples.design.label}, {len(samples)} frames of {len(set(samples.path))} paths; RMSE on "
        f"paths held out: {said[0]} N, {said[1]} N m"
    )
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m sensing.train",
        description="Train a wrench model on folders of labelled frames of one design.",
        epilog="Bad input: one line on stderr, exit status 2. Evaluate with python -m sensing.evaluate.",
    )
    parser.add_argument("data", type=Path, nargs="+", metavar="DATA", help="folders of labelled frames")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="weights.safetensors to write")
    parser.add_argument("--start", type=Path, metavar="FILE", help="weights to go on from (fine-tuning)")
    parser.add_argument("--seconds", type=float, default=60.0, metavar="S", help="time for the fit (60)")
    parser.add_argument("--method", default="dots", help="field method (dots)")
    parser.add_argument("--components", type=int, default=40, metavar="N", help="principal fields (40)")
    parser.add_argument("--hidden", type=int, default=64, metavar="N", help="width of the network (64)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of everything drawn (0)")
    parser.add_argument("--device", default="cpu", help="torch's device (cpu)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
