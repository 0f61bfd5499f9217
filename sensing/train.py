"""Labelled frames to weights: ``python -m sensing.train --help``.

    python -m sensing.train exports/data --out weights.safetensors
    python -m sensing.train exports/endcap3 --method dots --start default --out endcap3.safetensors      # own recording

An interrupted run goes on when the same command is given again. Wrenches about the sphere's centre, N and N m.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from cad.errors import EndcapError, ParameterError
from cad.extras import program
from cad.messages import LOG, transient
from sensing.learning.contenders import read_all
from sensing.learning.fit_config import FitConfig
from sensing.learning.samples import MARKERS, SHAPE
from sensing.records_labelled import LabelledSet

DEFAULT = "default"


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        return _run(options)
    except EndcapError as error:
        LOG.error(f"sensing.train: {error}")
        return 2
    except KeyboardInterrupt:
        LOG.error("\nsensing.train: stopped; the same command goes on from here")
        return 130


def _run(options: argparse.Namespace) -> int:
    from sensing.learning.fitting import fit  # torch takes seconds to load: bad options are refused before
    from sensing.wrench.model import load_wrench_model

    config = FitConfig(
        components=options.components, hidden=options.hidden, epochs=options.epochs, seconds=options.seconds,
        seed=options.seed, device=options.device,
    )  # fmt: skip
    if not options.out.parent.is_dir():
        raise ParameterError(f"--out {options.out}: its folder is not there: make it first", name="out")
    shape = (options.cells, options.cells)
    samples = read_all(options.data, options.method, shape)
    pictured = (
        [folder for folder in options.data if LabelledSet(folder).has_pictures] if options.method == MARKERS else []
    )
    pictures = read_all(pictured, "dots", shape) if pictured else None
    start = None
    if options.start is not None:
        given = None if str(options.start) == DEFAULT else options.start
        start = load_wrench_model(samples.design, given, silicone=None)  # fine-tuning fits another stiffness

    def progress(part: str, spent: float, error: float) -> None:
        transient(f"{part}: {spent:.0f} s, {error:.4f}")

    kept = options.out.with_name(f".{options.out.name}.checkpoint")
    model = fit(samples, config, start, progress, kept, pictures)
    model.save(options.out)
    rmse = model.about["metrics"]["validation_rmse"]
    said = ", ".join(f"{value:.3f}" for value in rmse[:3]), ", ".join(f"{value:.4f}" for value in rmse[3:])
    print(
        f"{options.out}: {samples.design.label}, {len(samples)} frames of {len(set(samples.path))} paths; RMSE on "
        f"paths held out: {said[0]} N, {said[1]} N m"
    )
    return 0


def _parser() -> argparse.ArgumentParser:
    plain = FitConfig()
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.train"),
        description="Train a wrench model on folders of labelled frames of one design.",
        epilog="Bad input: one line on stderr, exit status 2. Evaluate with python -m sensing.evaluate.",
    )
    parser.add_argument("data", type=Path, nargs="+", metavar="DATA", help="folders of labelled frames")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="weights.safetensors to write")
    parser.add_argument("--start", type=Path, metavar="FILE", help=f"weights to fine-tune; {DEFAULT}: those that ship")
    parser.add_argument("--epochs", type=int, default=plain.epochs, metavar="N", help=f"passes ({plain.epochs})")
    parser.add_argument(
        "--seconds", type=float, default=plain.seconds, metavar="S", help="stop after so long, if sooner"
    )
    parser.add_argument(
        "--method", default=MARKERS,
        help=f"{MARKERS}: labels of simulated frames as domain-randomised sensors would see them (default); dots: "
        "the pictures, through the tracker (own recordings)",
    )  # fmt: skip
    parser.add_argument("--cells", type=int, default=SHAPE[0], metavar="N", help=f"field of N x N ({SHAPE[0]})")
    parser.add_argument("--components", type=int, default=plain.components, metavar="N", help="principal fields")
    parser.add_argument("--hidden", type=int, default=plain.hidden, metavar="N", help="width of the network")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of everything drawn (0)")
    parser.add_argument("--device", default="cpu", help="torch's device (cpu)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
