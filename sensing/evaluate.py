"""How wrong the models are on frames they have never seen: ``python -m sensing.evaluate --help``.

    python -m sensing.evaluate exports/test                       # the weights that ship, by tilt and load
    python -m sensing.evaluate exports/test --weights weights.safetensors --train exports/data --csv table.csv
    python -m sensing.evaluate --train exports/data --holdout pose friction path random

Our answers are those of :class:`sensing.live.core.pipeline.EndcapPipeline`, frame by frame, as a user runs it: once
with the camera that ``sensing.calibrate`` finds from the first untouched picture, once without a calibration; each with
tables by tilt and load. The true camera that lies beside simulated frames is used with ``--true-camera`` only.

With ``--train`` the comparisons are fitted to the same loading paths: ridge, physics inverse, and the paper's model on
its own field with its own recipe. With ``--holdout`` all models are fitted anew to a part of the training data and
tested on the rest. Answers are computed from pictures through the real tracker. A test that shares a path, a pose or a
picture with the training is refused.
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
from numpy.typing import NDArray

from cad.errors import EndcapError, ParameterError
from cad.extras import program
from cad.identity import MUST_AGREE, require_same
from cad.messages import LOG, show
from cad.whole_file import replace_file, require_place
from sensing.arguments import refuse_unused, whole
from sensing.evaluation.cells import Cell, cell_tables, cells, cells_csv
from sensing.evaluation.live_answers import LiveAnswers, live_answers
from sensing.learning.contenders import Answer, Views, fitted, held_out, read_views
from sensing.learning.found_camera import camera_of_set
from sensing.learning.samples import Samples, shared_between
from sensing.learning.scores import Score, score, table
from sensing.learning.timeliness import LATENCY_S, filtered_score
from sensing.live.core.config import known_models
from sensing.live.core.model import LiveModel, live_model, load_model
from sensing.records_labelled import LabelledSet
from sensing.wrench.model import WrenchModel, load_wrench_model

MOVING = ("circle", "drag", "impact")  # phases of motion, in the dynamic protocol
HOLDOUTS = ("random", "path", "pose", "friction")
HOLDOUT_EPOCHS = 10
LATE = f"filter, {1000 * LATENCY_S:g} ms late, predicted to now"
HELD = f"filter, {1000 * LATENCY_S:g} ms late, lag left in"


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        _require_used(options)
        for path in filter(None, (options.csv, options.cells_csv)):
            require_place(path)
        scores: dict[str, Score] = {}
        by_cell: dict[str, list[Cell]] = {}
        if options.test:
            model = None
            if options.model != "default":
                model = load_model(options.model, LabelledSet(options.test[0]).params, options.weights)
            scores, by_cell = evaluate(
                options.test, options.weights, options.train, options.paper_epochs, options.true_camera, model
            )
        scores |= cross_validate(options.train, options.holdout, options.paper_epochs, options.seed)
        show(table(scores))
        for name, found in by_cell.items():
            show(f"\n{name}, by tilt of first contact and true force\n{cell_tables(found)}")
        if options.csv:
            _write_csv(options.csv, scores)
        if options.cells_csv:
            replace_file(options.cells_csv, cells_csv(by_cell))
    except EndcapError as error:
        LOG.error(f"sensing.evaluate: {error}")
        return 2
    except KeyboardInterrupt:
        LOG.error("\nsensing.evaluate: stopped, nothing written")
        return 130
    return 0


def evaluate(
    tests: Sequence[Path | str],
    weights: Path | None = None,
    train: Sequence[Path] = (),
    paper_epochs: int = 100,
    true_camera: bool = False,
    model: LiveModel | None = None,
) -> tuple[dict[str, Score], dict[str, list[Cell]]]:
    """(scores by "model, what" on test folders, ours also by tilt and load); comparisons only with training data.

    Args:
        tests: folders; scores name them by their last parts, as many as make them differ.
        weights: file, or None for those that ship.
        train: folders the comparisons are fitted to.
        paper_epochs: of the paper's recipe.
        true_camera: also with the camera that lies beside simulated frames.
        model: one of your own instead of the weights (:func:`sensing.live.core.model.live_model`); which paths it has
            learned from is not known, so that only ``train`` guards against testing on them.

    Raises:
        ParameterError: test and training share a path, a pose or a picture; a folder that is given twice.
        FileError: what cannot be read.
    """
    network = None if model else _weights_for(LabelledSet(tests[0]), weights)
    live = model if network is None else live_model("evaluated", network, network.shape, network.method)
    assert live is not None
    released = bool(train) and paper_epochs > 0
    training = read_views(train, released, markers=True, shape=live.shape) if train else None
    comparisons = {} if training is None else fitted(training, None, paper_epochs)
    made_for = LabelledSet(tests[0]).identity if network is None else network.identity
    found: dict[str, Score] = {}
    tables: dict[str, list[Cell]] = {}
    for folder, name in zip(tests, _names(tests), strict=True):
        fix = "make test frames of the endcap that the model is for"
        require_same(folder, "test frames", LabelledSet(folder).identity, made_for, fix, MUST_AGREE)
        test = read_views([Path(folder)], released, markers=False, shape=live.shape, radial=live.radial)
        _refuse_leaks(network, None if training is None else training.dots, test.dots)
        ours = _through_live(LabelledSet(folder), live, true_camera)
        tables |= {f"{who}, {name}": cells(given, live.load_scale) for who, given in ours.items()}
        answers = {who: _answer(given) for who, given in ours.items()} | comparisons
        found |= _scores(answers, test, name, live.load_scale)
        found |= _filtered(ours["ours"], test.dots, live.load_scale, name)
    return found, tables


def _weights_for(data: LabelledSet, weights: Path | None) -> WrenchModel:
    """The file that was named, else the weights for a set's design and silicone."""
    return load_wrench_model(data.params, weights, silicone=None if weights else data.silicone)


def _names(tests: Sequence[Path | str]) -> list[str]:
    """Names of the test folders in tables and files: two folders of one name must not replace one another there."""
    parts = [Path(os.path.abspath(folder)).parts for folder in tests]  # of "." or "..", too
    twice = next((str(folder) for folder, own in zip(tests, parts, strict=True) if parts.count(own) > 1), None)
    if twice is not None:
        raise ParameterError(f"test={twice} is given twice: its rows would be the same; give it once", name="test")
    count = next(k for k in range(1, 1 + max(map(len, parts))) if len({own[-k:] for own in parts}) == len(parts))
    return ["/".join(own[-count:]) for own in parts]


def _filtered(given: LiveAnswers, test: Samples, load_scale: float, name: str) -> dict[str, Score]:
    """Filtered wrenches of moving contacts; between states at rest no time passes."""
    if not (np.isin(test.phase, MOVING).any() and LabelledSet(test.sources[0]).column("latency_s").any()):
        return {}
    cases = (("filter", 0.0, True), (LATE, LATENCY_S, True), (HELD, LATENCY_S, False))
    return {
        f"ours + {case}, {name}": filtered_score(given.value, given.covariance, test, load_scale, latency, predict)
        for case, latency, predict in cases
    }


def cross_validate(
    train: Sequence[Path], holdouts: Sequence[str], paper_epochs: int = 100, seed: int = 0
) -> dict[str, Score]:
    """Scores by "model, leave out what": everything fitted to a part of the data and tested on the rest.

    Args:
        train: folders of labelled frames.
        holdouts: names of :func:`sensing.learning.contenders.held_out`.
        paper_epochs: of the paper's recipe, 0 without it.
        seed: of the split and the fits.
    """
    from sensing.learning.fit_config import FitConfig
    from sensing.learning.fitting import fit

    if not holdouts:
        return {}
    views = read_views(train, released=paper_epochs > 0, markers=True)
    found: dict[str, Score] = {}
    for what in holdouts:
        rest, held = held_out(views, what, seed)
        assert rest.markers is not None
        ours = fit(rest.markers, FitConfig(epochs=HOLDOUT_EPOCHS, seed=seed), pictures=rest.dots)
        found |= _scores(fitted(rest, ours, paper_epochs, seed), held, f"leave out {what}", ours.load_scale)
    return found


def _through_live(data: LabelledSet, model: LiveModel, true_camera: bool = False) -> dict[str, LiveAnswers]:
    """Answers of the live pipeline with the camera found from the rest picture, and as a user without one runs it."""
    camera, plain = camera_of_set(data), live_answers(data, model, None)
    if camera is None:
        return {"ours": plain}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "camera.json"
        camera.save(path, data.identity)
        found = {"ours": live_answers(data, model, path), "ours, no camera file": plain}
    if true_camera and (data.folder / "camera.json").exists():
        found["ours, true camera"] = live_answers(data, model, data.folder / "camera.json")
    return found


def _answer(given: LiveAnswers) -> Answer:
    return lambda test: (given.value, given.covariance, given.flagged)


def _scores(answers: dict[str, Answer], test: Views, name: str, load_scale: float) -> dict[str, Score]:
    found: dict[str, Score] = {}
    for model, answer in answers.items():
        value, covariance, flagged = answer(test)
        subsets = _subsets(test.dots)
        if flagged is not None and 0 < flagged.sum() < len(flagged):
            subsets["where not flagged"] = ~flagged
        for what, rows in subsets.items():
            found[f"{model}, {name} {what}".strip()] = score(
                value[rows], test.dots.wrenches[rows], test.dots.contact[rows],
                None if covariance is None else covariance[rows], None if flagged is None else flagged[rows],
                load_scale,
            )  # fmt: skip
    return found


def _subsets(test: Samples) -> dict[str, NDArray[np.bool_]]:
    """All rows, and each kind of motion where there is more than one."""
    parts = {"": np.full(len(test), True)}
    kinds = [phase for phase in MOVING if (test.phase == phase).any()]
    if len(kinds) > 1:
        parts |= {kind: np.isin(test.path, np.unique(test.path[test.phase == kind])) for kind in kinds}
    return parts


def _require_used(options: argparse.Namespace) -> None:
    """Refuse options that lack what they need, or that would do nothing."""
    if not options.test and not options.holdout:
        raise ParameterError("nothing to test on: give folders of test frames, or --train and --holdout")
    if options.holdout and not options.train:
        raise ParameterError("--holdout parts the training data: give them with --train")
    for what, given, flags in (
        ("test folders", options.test, "--weights --model --true-camera --cells-csv"),
        ("--train", options.train, "--paper-epochs"), ("--holdout", options.holdout, "--seed"),
    ):  # fmt: skip
        if not given:
            refuse_unused(_parser(), options, flags, f"no {what}", "nothing reads it; leave it out")
    if options.csv and options.cells_csv and os.path.abspath(options.csv) == os.path.abspath(options.cells_csv):
        raise ParameterError(f"--csv and --cells-csv are both {options.csv}: give them two names", name="csv")


def _refuse_leaks(model: WrenchModel | None, training: Samples | None, test: Samples) -> None:
    about = {} if model is None else model.about
    learned = {path for part in ("training", "intervals") for path in about.get(part, {}).get("paths", ())}
    shared = [f"path {name}" for name in sorted(learned & set(test.path))]
    if training is not None:
        shared += shared_between(training, test)
    if shared:
        raise ParameterError(
            f"{test.where}: shares {len(shared)} paths, poses or pictures with the training ({shared[0]}): its errors "
            "would be flattering; make a test set with another --seed",
            name="test",
            value=shared[0],
        )


def _write_csv(path: Path, scores: dict[str, Score]) -> None:
    stream = io.StringIO()
    rows = [{"name": name, **s.row()} for name, s in scores.items()]
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)
    replace_file(path, stream.getvalue().encode())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.evaluate"),
        description="Errors of a wrench model, and of comparisons, on folders of labelled frames it has never seen.",
        epilog="Wrenches about the sphere's centre, N and N m. Bad input: one line on stderr, exit status 2.",
    )
    parser.add_argument("test", type=Path, nargs="*", metavar="TEST", help="folders of labelled frames")
    parser.add_argument("--weights", type=Path, metavar="FILE", help="from python -m sensing.train (those that ship)")
    parser.add_argument(
        "--model", choices=known_models(), default="default", help="default: ours; a plug-in's runs in its place"
    )
    parser.add_argument(
        "--train", type=Path, nargs="+", default=[], metavar="DATA", help="fit the comparisons to these"
    )
    parser.add_argument(
        "--holdout", nargs="+", default=[], choices=HOLDOUTS, help="fit all to a part of --train and test on the rest"
    )
    parser.add_argument(
        "--paper-epochs", type=whole, default=100, metavar="N", help="of the paper's recipe (100); 0 leaves it out"
    )
    parser.add_argument("--seed", type=whole, default=0, metavar="N", help="of what is held out (0)")
    parser.add_argument(
        "--true-camera", action="store_true", help="also with the true camera that lies beside simulated frames"
    )
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write all numbers")
    parser.add_argument("--cells-csv", type=Path, metavar="FILE", help="write ours by tilt and load")
    return parser


if __name__ == "__main__":
    sys.exit(main())
