"""The models that ours is compared with, fitted to the same loading paths, and the fields that each of them uses.

Ours and ridge learn from domain-randomised sensors' marker fields, the physics inverse and the paper's model from
pictures (their methods have no noise model); all are tested on pictures through the real tracker or the released
pipeline. Wrenches on the endcap about the sphere's centre, N and N m.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from cad.identity import MUST_AGREE, require_same
from sensing.learning.samples import MARKERS, ROW_ARRAYS, SHAPE, Samples, read_samples
from sensing.wrench.model import WrenchModel

Array = NDArray[np.float64]
RELEASED_SHAPE = (30, 30)  # P, NET06: grid of the released field
HELD_SHARE = 0.15  # part of the frames or paths that is held out
HELD_TILT_DEG = (25.0, 35.0)  # tilts that are held out
HELD_FRICTION = 0.8  # least Coulomb coefficient of the paths that are held out
Answer = Callable[["Views"], tuple[Array, Array | None, NDArray[np.bool_] | None]]


@dataclass(frozen=True)
class Views:
    """The same frames as fields for each kind of model.

    Attributes:
        dots: fields of dots tracked in the pictures.
        gelslim: the released field (None if it is not needed).
        markers: fields of domain-randomised sensors on the same loading paths; for training only.
    """

    dots: Samples
    gelslim: Samples | None = None
    markers: Samples | None = None

    def where(self, keep: Callable[[Samples], NDArray[np.bool_]]) -> Views:
        """The frames of all views that a rule selects."""
        parts = [None if s is None else s.take(keep(s)) for s in (self.dots, self.gelslim, self.markers)]
        assert parts[0] is not None
        return Views(parts[0], parts[1], parts[2])


def read_views(
    folders: Sequence[Path], released: bool, markers: bool, shape: tuple[int, int] = SHAPE, radial: Array | None = None
) -> Views:
    """Read the views of folders of one design.

    Args:
        folders: folders of labelled frames.
        released: whether the released field is needed.
        markers: whether the fields of domain-randomised sensors are needed.
        shape: (H, W) of our field.
        radial: radial map of the weights (:func:`sensing.learning.samples.read_samples`).

    Raises:
        ParameterError: folders of different designs.
        FileError: a folder that cannot be read.
    """
    return Views(
        read_all(folders, "dots", shape, radial),
        read_all(folders, "gelslim", RELEASED_SHAPE) if released else None,
        read_all(folders, MARKERS, shape) if markers else None,
    )


def read_all(
    folders: Sequence[Path], method: str, shape: tuple[int, int] = SHAPE, radial: Array | None = None
) -> Samples:
    """Samples of several folders of one design, joined.

    Args:
        folders: folders of labelled frames.
        method: method of the field.
        shape: (H, W) of the field.
        radial: radial map of the weights (:func:`sensing.learning.samples.read_samples`).

    Raises:
        ParameterError: folders of different designs.
        FileError: a folder that cannot be read.
    """
    parts = [read_samples(folder, method, shape, radial) for folder in folders]
    designs = {part.design.label for part in parts}
    if len(designs) > 1:
        raise ParameterError(f"data of {', '.join(sorted(designs))}: give folders of one design", name="data")
    for folder, part in zip(folders[1:], parts[1:], strict=True):
        require_same(
            folder, "data", part.identity, parts[0].identity, f"give folders of one endcap ({folders[0]})", MUST_AGREE
        )
    joined: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in ROW_ARRAYS}
    return replace(parts[0], **joined, sources=tuple(map(str, folders)))


def held_out(views: Views, what: str, seed: int = 0) -> tuple[Views, Views]:
    """(rest, held out) parts of one data set.

    Args:
        views: all samples of the data set.
        what: ``random`` frames as the paper draws them (neighbours in time on both sides), whole ``path``s, ``pose``:
            all tilts between 25 and 35 degrees, or ``friction``: all above 0.8.
        seed: seed of the random choices of ``random`` and ``path``.

    Raises:
        ParameterError: an unknown name, or nothing on one side.
    """
    frames = np.unique(frame_keys(views.dots))
    rules: dict[str, Callable[[Samples], NDArray[np.bool_]]] = {
        "random": lambda s: np.isin(frame_keys(s), _part(frames, seed)),
        "path": lambda s: np.isin(s.path, _part(np.unique(views.dots.path), seed)),
        "pose": lambda s: (s.tilt_deg > HELD_TILT_DEG[0]) & (s.tilt_deg < HELD_TILT_DEG[1]),
        "friction": lambda s: s.friction > HELD_FRICTION,
    }
    if what not in rules:
        raise ParameterError(f"holdout={what!r}: choose from {', '.join(rules)}", name="holdout", value=what)
    rest, held = views.where(lambda s: ~rules[what](s)), views.where(rules[what])
    if not len(rest.dots) or not len(held.dots):
        raise ParameterError(f"holdout={what}: {len(held.dots)} frames of {len(views.dots)} held out: give more paths")
    return rest, held


def frame_keys(samples: Samples) -> NDArray[np.str_]:
    """(N,) identity of the frame behind every sample."""
    rows = zip(samples.path, samples.azimuth_deg, samples.time_s, strict=True)
    return np.array([f"{path} {azimuth:.6f} {time:.6f}" for path, azimuth, time in rows])


def fitted(train: Views, ours: WrenchModel | None, paper_epochs: int, seed: int = 0) -> dict[str, Answer]:
    """Every model by name, fitted to the training views; ours unchanged.

    Args:
        train: the training views.
        ours: our model; None leaves it out.
        paper_epochs: number of epochs of the paper's recipe.
        seed: seed of the paper's recipe.
    """
    from sensing.learning.compliance import fit_compliance
    from sensing.learning.ridge import fit_ridge

    answers: dict[str, Answer] = {} if ours is None else {"ours": _network(ours)}
    known = train.markers or train.dots
    weights, _ = fit_ridge(known.inputs, known.wrenches, known.path, known.fields.shape[2])
    answers["ridge"] = lambda test: (test.dots.inputs @ weights.T, None, None)
    if np.isfinite(train.dots.tilt_deg[train.dots.contact]).any():
        inverse = fit_compliance(train.dots)
        answers["physics inverse"] = lambda test: (inverse.predict(test.dots.inputs), None, None)
    if train.gelslim is not None:
        answers["paper"] = _paper(train.gelslim, paper_epochs, seed)
    return answers


def _network(ours: WrenchModel) -> Answer:
    return lambda test: (*ours.predict(test.dots.inputs), ours.out_of_range(test.dots.inputs))


def _part(names: NDArray, seed: int) -> NDArray:
    order = np.random.default_rng(seed).permutation(names)
    return order[: max(1, round(HELD_SHARE * len(names)))]


def _paper(train: Samples, epochs: int, seed: int) -> Answer:
    """The paper's recipe: weights of the best epoch on a random part of the training frames, as in the paper."""
    from sensing.learning.paper_recipe import train_paper_model
    from sensing.wrench.paper_model import predict

    order = np.random.default_rng(seed).permutation(len(train))
    held = max(1, round(HELD_SHARE * len(train)))
    split = order[held:], order[:held], order[:held]
    model = train_paper_model(train.fields, train.wrenches.astype(np.float32), seed, epochs, split).model

    def answer(test: Views) -> tuple[Array, Array | None, NDArray[np.bool_] | None]:
        assert test.gelslim is not None
        return predict(model, test.gelslim.fields), None, None

    return answer
