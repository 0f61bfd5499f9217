"""How wrong the models are on frames they have never seen: ``python -m sensing.evaluate --help``.

    python -m sensing.evaluate exports/test --weights weights.safetensors --train exports/data --csv table.csv

With ``--train`` the comparisons are fitted to the same training data: ridge, physics inverse, and the paper's model on
its own field with its own recipe (also scored on its own random split). A test that shares a loading path with the
training is refused.
"""

from __future__ import annotations

import argparse
import csv
import io
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cad.errors import EndcapError, FileError, ParameterError
from sensing.samples import Samples, read_samples, shared_between
from sensing.scores import Score, score, table
from sensing.train import read_all

MOVING = ("circle", "drag", "impact")  # phases of motion


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        scores = evaluate(options.test, options.weights, options.train, options.paper_epochs)
        print(table(scores))
        if options.csv:
            _write_csv(options.csv, scores)
    except EndcapError as error:
        print(f"sensing.evaluate: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\nsensing.evaluate: stopped, nothing written", file=sys.stderr)
        return 130
    return 0


def evaluate(
    tests: Sequence[Path], weights: Path, train: Sequence[Path] = (), paper_epochs: int = 100
) -> dict[str, Score]:
    """Scores by "model, what"; the comparisons only with training data.

    Raises:
        ParameterError: test and training share a path, a pose or a picture. FileError: what cannot be read.
    """
    from sensing.wrench_model import WrenchModel

    first = read_samples(tests[0])
    model = WrenchModel.load(weights, first.design)
    found: dict[str, Score] = {}
    training = read_all(train, model.method) if train else None
    for folder in tests:
        test = read_samples(folder, model.method, model.shape)
        _refuse_leaks(model.about["training"]["paths"], training, test)
        value, covariance = model.predict(test.inputs)
        flagged = model.out_of_range(test.inputs)
        for what, rows in _subsets(test).items():
            name = f"{Path(folder).name} {what}".strip()
            truth, contact = test.wrenches[rows], test.contact[rows]
            found[f"ours, {name}"] = score(value[rows], truth, contact, covariance[rows], flagged[rows])
        if training is not None:
            found |= _comparisons(training, test, Path(folder).name)
    if training is not None:
        found |= _paper(train, tests, paper_epochs)
    return found


def _subsets(test: Samples) -> dict[str, np.ndarray]:
    moving = np.isin(test.phase, MOVING)
    parts = {"": np.full(len(test), True), "moving": moving, "at rest": ~moving}
    return {name: rows for name, rows in parts.items() if rows.any() and (name == "" or not rows.all())}


def _refuse_leaks(trained_paths: Sequence[str], training: Samples | None, test: Samples) -> None:
    shared = [f"path {name}" for name in sorted(set(trained_paths) & set(test.path))]
    if training is not None:
        shared += shared_between(training, test)
    if shared:
        raise ParameterError(
            f"{test.source}: shares {len(shared)} paths, poses or pictures with the training ({shared[0]}): its errors "
            "would be flattering; make a test set with another --seed",
            name="test",
            value=shared[0],
        )


def _comparisons(training: Samples, test: Samples, name: str) -> dict[str, Score]:
    from sensing.compliance import fit_compliance
    from sensing.ridge import fit_ridge

    side = training.fields.shape[2]
    weights, _ = fit_ridge(training.inputs, training.wrenches, training.path, side)
    found = {f"ridge, {name}": score(test.inputs @ weights.T, test.wrenches, test.contact)}
    if np.isfinite(training.tilt_deg).any():
        told = fit_compliance(training).predict(test.inputs)
        found[f"physics inverse, {name}"] = score(told, test.wrenches, test.contact)
    return found


def _paper(train: Sequence[Path], tests: Sequence[Path], epochs: int) -> dict[str, Score]:
    """The paper's model, once with whole paths for validation and once on the paper's random split."""
    from sensing.paper_model import predict
    from sensing.paper_recipe import random_split, train_paper_model

    samples = read_all(train, "gelslim", (30, 30))
    rows = np.arange(len(samples))
    names = np.random.default_rng(0).permutation(np.unique(samples.path))
    held = np.isin(samples.path, names[: max(1, len(names) // 7)])
    honest = train_paper_model(
        samples.fields, samples.wrenches.astype(np.float32), 0, epochs, (rows[~held], rows[held], rows[held])
    )
    found = {}
    for folder in tests:
        test = read_samples(folder, "gelslim", (30, 30))
        found[f"paper, {Path(folder).name}"] = score(predict(honest.model, test.fields), test.wrenches, test.contact)
    split = random_split(len(samples), 0)
    leaky = train_paper_model(samples.fields, samples.wrenches.astype(np.float32), 0, epochs, split)
    part = samples.take(split[1])
    found["paper, random split"] = score(predict(leaky.model, part.fields), part.wrenches, part.contact)
    return found


def _write_csv(path: Path, scores: dict[str, Score]) -> None:
    stream = io.StringIO()
    rows = [{"name": name, **s.row()} for name, s in scores.items()]
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)
    temporary = None
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".part")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(stream.getvalue())
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except OSError as error:
        raise FileError(f"{path}: {error.strerror}: give a folder that exists and may be written") from None
    finally:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m sensing.evaluate",
        description="Errors of a wrench model, and of comparisons, on folders of labelled frames it has never seen.",
        epilog="Wrenches about the sphere's centre, N and N m. Bad input: one line on stderr, exit status 2.",
    )
    parser.add_argument("test", type=Path, nargs="+", metavar="TEST", help="folders of labelled frames")
    parser.add_argument("--weights", type=Path, required=True, metavar="FILE", help="from python -m sensing.train")
    parser.add_argument(
        "--train", type=Path, nargs="*", default=[], metavar="DATA", help="fit the comparisons to these"
    )
    parser.add_argument("--paper-epochs", type=int, default=100, metavar="N", help="of the paper's recipe (100)")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write all numbers")
    return parser


if __name__ == "__main__":
    sys.exit(main())
