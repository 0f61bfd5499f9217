"""Labelled frames, or the two numbers, to weights: ``python -m sensing.train --help``.

    python -m sensing.train --design 180 10                                   # minutes: states by similarity
    python -m sensing.train exports/data --out weights.safetensors
    python -m sensing.train exports/data --intervals exports/sensor71 exports/sensor72 --out weights.safetensors
    python -m sensing.train --start default --intervals exports/sensor71 exports/sensor72 --out weights.safetensors
    python -m sensing.train exports/endcap3 --method dots --start default --out endcap3.safetensors      # own recording

A training that was stopped goes on with the same command. Wrenches about the sphere's centre, N and N m.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cad.design_arguments import HELP, design_of
from cad.errors import EndcapError, FileError, ParameterError
from cad.extras import program
from cad.identity import MUST_AGREE, require_same
from cad.materials import DEFAULT_SILICONE
from cad.messages import LOG, show, transient
from cad.whole_file import make_folder, replace_file, require_place
from sensing.arguments import number, refuse_unused, scientific, silicone_name, whole
from sensing.learning.contenders import read_all
from sensing.learning.fit_config import FitConfig
from sensing.learning.radial import radial_tensors
from sensing.learning.samples import MARKERS, SHAPE, Samples
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
        again = "the same command goes on from here" if options.data or options.design else "nothing was written"
        LOG.error(f"\nsensing.train: stopped; {again}")
        return 130


def _run(options: argparse.Namespace) -> int:
    config = FitConfig(
        components=options.components, hidden=options.hidden, epochs=options.epochs, seconds=options.seconds,
        seed=options.seed, device=options.device, rate=options.rate, depth=options.depth,
    )  # fmt: skip
    rescale = bool(options.start and options.intervals)
    if options.design is not None or not (options.data or rescale):
        return _design(options, config)
    _refuse_ignored(options)
    if options.out is None:
        raise ParameterError("--out is missing: name the file of the weights", name="out")
    _require_out(options.out)
    if not options.data:
        return _rescaled(options)
    return _trained(options, config)


def _trained(options: argparse.Namespace, config: FitConfig) -> int:
    """Weights from folders of labelled frames."""
    from sensing.learning.fitting import fit  # torch takes seconds to load: bad options are refused before
    from sensing.learning.net import sized_as
    from sensing.wrench.model import load_wrench_model
    from sensing.wrench.tensors import radial_of

    shape = (options.cells, options.cells)
    start = None
    if options.start is not None:
        given = None if str(options.start) == DEFAULT else options.start
        design = LabelledSet(options.data[0]).params
        start = load_wrench_model(design, given, silicone=None)  # fine-tuning fits another stiffness
        config = sized_as(start, config)
    radial = None if start is None else start.radial
    learnt = radial_tensors(options.data, shape) if radial is None else {}
    samples, pictures, others = _read(options, shape, radial_of(learnt) if radial is None else radial)
    if options.intervals:
        from sensing.evaluation.intervals import require_intervals, with_intervals

        require_intervals(options.intervals, [part for part in (samples, others) if part], start, options.tilt_to)

    def progress(part: str, spent: float, error: float) -> None:
        transient(f"{part}: {spent:.0f} s, {error:.4f}")

    kept = options.out.with_name(f".{options.out.name}.checkpoint")
    model = fit(samples, config, start, progress, kept, pictures, others)
    model = replace(model, weights=model.weights | learnt)
    if options.intervals:
        model = with_intervals(model, options.intervals, options.tilt_to)
    model.save(options.out)
    kept.unlink(missing_ok=True)  # not before: without it a full disk, or a stop above, would cost the whole training
    rmse = model.about["metrics"]["validation_rmse"]
    said = ", ".join(f"{value:.3f}" for value in rmse[:3]), ", ".join(f"{value:.4f}" for value in rmse[3:])
    show(
        f"{options.out}: {samples.design.label}, {len(samples)} frames of {len(set(samples.path))} paths; RMSE on "
        f"paths held out: {said[0]} N, {said[1]} N m"
    )
    return 0


def _read(
    options: argparse.Namespace, shape: tuple[int, int], radial: NDArray[np.float64] | None
) -> tuple[Samples, Samples | None, Samples | None]:
    """Samples to learn from, the same frames tracked where markers have pictures, and contacts of other kinds.

    Raises:
        ParameterError, FileError: folders of several endcaps, or one that cannot be read.
    """
    samples = read_all(options.data, options.method, shape, radial)
    marked = options.method == MARKERS
    pictured = [folder for folder in options.data if marked and LabelledSet(folder).has_pictures]
    pictures = read_all(pictured, "dots", shape, radial) if pictured else None
    others = read_all(options.others, options.method, shape, radial) if options.others else None
    if others is not None:
        fix = f"give folders of the endcap of {samples.where}"
        require_same(others.where, "data", others.identity, samples.identity, fix, MUST_AGREE)
    return samples, pictures, others


def _rescaled(options: argparse.Namespace) -> int:
    """Only the intervals of given weights, on frames of other sensors."""
    from sensing.evaluation.intervals import with_intervals
    from sensing.wrench.model import load_wrench_model

    design = LabelledSet(options.intervals[0]).params
    given = None if str(options.start) == DEFAULT else options.start
    model = with_intervals(load_wrench_model(design, given, silicone=None), options.intervals, options.tilt_to)
    model.save(options.out)
    found = model.about["intervals"]
    paths = len(found["paths"])
    said, more = (", ".join(f"{value:.3g}" for value in found[name]) for name in ("scale", "tracking"))
    show(f"{options.out}: intervals of {options.start} scaled by {said} on {paths} paths; tracking adds {more}")
    return 0


def _design(options: argparse.Namespace, config: FitConfig) -> int:
    """Weights of a design from the library of solved states."""
    _require_design(options)
    from sensing.design.weights import DesignRequest, known_weights, saved_weights
    from sensing.wrench.weight_files import weights_folder, weights_name

    options.diameter, options.wall = options.design
    request = DesignRequest(design_of(options), options.silicone)
    _ = request.scale  # an unknown silicone is refused before torch loads
    out = options.out or weights_folder() / weights_name(request.params, request.silicone)
    if options.out is None:
        make_folder(out.parent)
    _require_out(out)
    if options.copy_to is not None:
        require_place(options.copy_to / out.name)
    known = known_weights(request) if options.unless_there and options.out is None else None
    if known is not None:
        show(f"{known}: weights of {request.params.label} in {request.silicone} are there")
        return _copied(known, options.copy_to)
    begin = time.monotonic()
    model = saved_weights(out, request, config, lambda text: LOG.info(f"{text} ..."))
    rmse, top = model.about["metrics"]["validation_rmse"], request.scale.top_n
    force = (sum(value**2 for value in rmse[:3]) / 3) ** 0.5
    show(
        f"{out}: {request.params.label} in {request.silicone}, loads to {top:.3g} N; RMSE on paths held out: "
        f"{force:.3g} N an axis ({100 * force / top:.2f} % of that load); {time.monotonic() - begin:.0f} s"
    )
    return _copied(out, options.copy_to)


def _require_out(out: Path) -> None:
    if not out.parent.is_dir():
        raise ParameterError(f"--out {out}: its folder is not there: make it first", name="out")
    require_place(out)


def _require_design(options: argparse.Namespace) -> None:
    """Refuse a design that is missing, and options that have no meaning beside one."""
    if options.design is None:
        raise ParameterError(
            "nothing to train on: give folders of labelled frames and --out, or --design D T, as in --design 180 10, "
            "or --start and --intervals to scale intervals alone",
            name="data",
        )
    taken = "DATA --start --intervals --tilt-to --method --others --cells"
    refuse_unused(_parser(), options, taken, "--design", "its states come from the library; give one or the other")


def _refuse_ignored(options: argparse.Namespace) -> None:
    """Refuse options of a design where the folders record it, and those of a training where nothing is trained."""
    parser, reason = _parser(), "it belongs to --design, and folders state their own endcap; leave it out"
    refuse_unused(parser, options, "--dot-rings --dot-mm --copy-to --silicone --unless-there", "folders", reason)
    if not options.data:
        reason = "nothing is trained; give folders, too, or leave it out"
        trained = "--others --method --cells --components --hidden --depth --epochs --rate --seconds --seed --device"
        refuse_unused(parser, options, trained, "--intervals without DATA", reason)
    if not options.intervals:
        refuse_unused(parser, options, "--tilt-to", "no --intervals", "it chooses among their contacts; leave it out")


def _copied(weights: Path, folder: Path | None) -> int:
    """Write a copy into a folder, if the options name one; returns 0."""
    if folder is not None:
        try:
            replace_file(folder / weights.name, weights.read_bytes())
        except OSError as error:
            raise FileError(f"{weights}: {error.strerror}: train again") from None
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.train"),
        description="Train a wrench model: on folders of labelled frames of one design, or for any design in minutes.",
        epilog="Bad input: one line on stderr, exit status 2. Evaluate with python -m sensing.evaluate.",
    )
    _add_data(parser)
    _add_design(parser.add_argument_group("weights of a design, from the library of solved states"))
    _add_fit(parser.add_argument_group("how the model is fitted"))
    return parser


def _add_data(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("data", type=Path, nargs="*", default=[], metavar="DATA", help="folders of labelled frames")
    parser.add_argument(
        "--out", type=Path, metavar="FILE",
        help="weights.safetensors to write; with --design by default where live finds it",
    )  # fmt: skip
    parser.add_argument(
        "--others", type=Path, nargs="+", default=[], metavar="DATA",
        help="contacts of other kinds: the covariance alone learns from them, and they come out flagged",
    )  # fmt: skip
    parser.add_argument("--start", type=Path, metavar="FILE", help=f"weights to fine-tune; {DEFAULT}: those that ship")
    parser.add_argument(
        "--method", default=MARKERS,
        help=f"{MARKERS}: labels of simulated frames as domain-randomised sensors would see them (default); dots: "
        "the pictures, through the tracker (own recordings)",
    )  # fmt: skip
    parser.add_argument(
        "--intervals", type=Path, nargs="+", default=[], metavar="DATA",
        help="frames of other sensors on paths of their own: the live errors there scale the 95 %% intervals",
    )  # fmt: skip
    parser.add_argument(
        "--tilt-to", type=number, default=90.0, metavar="DEG", help="of the contacts that --intervals counts (90: all)"
    )


def _add_design(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--design", type=number, nargs=2, metavar=("D", "T"),
        help="weights for this diameter and wall (mm), from the library of solved states",
    )  # fmt: skip
    group.add_argument("--dot-rings", metavar="COUNTS", help=HELP["dot_rings"])
    group.add_argument("--dot-mm", type=number, metavar="MM", help=HELP["dot_mm"])
    group.add_argument(
        "--silicone", type=silicone_name, default=DEFAULT_SILICONE, metavar="NAME",
        help=f"that it is cast of ({DEFAULT_SILICONE})"
    )  # fmt: skip
    group.add_argument("--unless-there", action="store_true", help="only where live finds none yet")
    group.add_argument("--copy-to", type=Path, metavar="DIR", help="leave a copy in this folder, too")


def _add_fit(group: argparse._ArgumentGroup) -> None:
    plain = FitConfig()
    group.add_argument("--epochs", type=whole, default=plain.epochs, metavar="N", help=f"passes ({plain.epochs})")
    group.add_argument(
        "--rate", type=scientific, default=plain.rate, metavar="R",
        help=f"of learning, at first; less to fine-tune ({plain.rate:g})",
    )  # fmt: skip
    seconds = "stop after so long, if sooner"
    group.add_argument("--seconds", type=number, default=plain.seconds, metavar="S", help=seconds)
    group.add_argument("--cells", type=whole, default=SHAPE[0], metavar="N", help=f"field of N x N ({SHAPE[0]})")
    group.add_argument("--components", type=whole, default=plain.components, metavar="N", help="principal fields")
    group.add_argument("--hidden", type=whole, default=plain.hidden, metavar="N", help="width of the network")
    group.add_argument(
        "--depth", type=whole, default=plain.depth, metavar="N", help=f"its layers, 2 or 3 ({plain.depth})"
    )
    group.add_argument("--seed", type=whole, default=0, metavar="N", help="of the random numbers (0)")
    group.add_argument("--device", default="cpu", help="torch's device (cpu)")


if __name__ == "__main__":
    sys.exit(main())
