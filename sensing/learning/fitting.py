"""Fits our network to samples: linear part, principal fields, perceptron, covariance, calibration, range.

Paths are parted three ways: training, validation (which epoch is best, and more data for the covariance), calibration
(how wide the covariance must be), so that nothing is judged on what it was fitted to. Each axis counts in its own unit
(:data:`sensing.learning.ridge.UNITS`), and errors under load count less (:func:`sensing.wrench.model.tolerance`).
Equal samples and settings give equal weights on one machine; ``seconds`` alone makes them depend on its speed.

Notes:
    The calibration of an axis is the 95 % quantile of |error| / sigma on the calibration paths over 1.96, each path
    with the same weight. It is an estimate, no guarantee: the paths are few, and the sensors those of training.
    Intervals that hold on other sensors take pictures of other sensors (:mod:`sensing.evaluation.intervals`).
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from cad.errors import ParameterError
from sensing.learning.checkpoint import Checkpoint, Descent
from sensing.learning.covered_range import covered_range, usual_doubt
from sensing.learning.fit_config import FitConfig
from sensing.learning.net import WrenchNet, negative_log_likelihood
from sensing.learning.path_quantile import path_quantile
from sensing.learning.ridge import UNITS, fit_ridge
from sensing.learning.samples import Samples
from sensing.learning.symmetry import COUNT, moved_inputs, moved_wrenches, symmetric_moments
from sensing.wrench.model import WrenchModel, tolerance

Array = NDArray[np.float64]
Progress = Callable[[str, float, float], None]
NORMAL_95 = 1.959964  # half width of the 95 % interval in standard deviations
GAIN_SHARE = 1e-3  # of the mean square answer: how firmly fine-tuning begins from no change


def fit(
    samples: Samples,
    config: FitConfig,
    start: WrenchModel | None = None,
    progress: Progress | None = None,
    checkpoint: Path | None = None,
    pictures: Samples | None = None,
    others: Samples | None = None,
) -> WrenchModel:
    """Train on samples of one design.

    Args:
        samples: at least three loading paths.
        start: weights to go on from (fine-tuning): the answers are first mapped onto
            the new labels, then the perceptrons learn on, with more principal fields where ``config`` has more.
        progress: called after each epoch with (part, seconds, error).
        checkpoint: file that is kept during training; an interrupted run of the same samples and settings goes on.
        pictures: the same paths through the real tracker, where there are pictures; the covariance is then scaled on
            those of its calibration paths: domain-randomised sensors are not wrong in every way in which a real one is.
        others: contacts of other kinds, to which only the covariance is fitted: it learns where the mean is wrong, and
            ``out_of_range`` fires where it doubts more than on the samples.

    Raises:
        ParameterError: too few paths, a field that is not square, or a start of another design or shape.
    """
    height, width = samples.fields.shape[2:]
    if height != width:
        raise ParameterError(f"field of {height}x{width}: the symmetries need a square one", name="shape")
    rest, calibration = samples.split(0.15, config.seed)
    train, validation = rest.split(0.18, config.seed + 1)
    torch.manual_seed(config.seed)
    net = _prepared(train, config, height) if start is None else _started(start, train, config.components)
    net.to(config.device)
    kept = Checkpoint(
        checkpoint, f"{asdict(config)} {samples.digest} {start.about if start else None} {others and others.digest}"
    )
    parts = _parts(net, train, config)
    _fit_mean(net, parts, _parts(net, validation, config, 1), config, progress, kept)
    seen = [parts, _parts(net, validation, config), *([] if others is None else [_parts(net, others, config)])]
    _fit_spread(net, [torch.cat(part) for part in zip(*seen, strict=True)], config, progress, kept)
    net.cpu().eval()
    kept.remove()
    views = [view.take(np.isin(view.path, calibration.path)) for view in (pictures, samples) if view is not None]
    _calibrate(net, next(view for view in views if len(view)))
    about = {
        "training": _provenance(samples, config, start),
        "metrics": {"validation_rmse": _rmse(net, validation), "calibration_rmse": _rmse(net, calibration)},
    }
    weights = {name: value.detach().cpu().numpy().astype(np.float32) for name, value in net.state_dict().items()}
    covered = covered_range(weights["principal"].astype(float), rest, config, height, start)
    model = WrenchModel(weights, samples.design, samples.method, (height, width), covered, about, samples.identity)
    return model if others is None else replace(model, range=replace(covered, doubt=usual_doubt(model, rest)))


def as_net(model: WrenchModel) -> WrenchNet:
    """The torch twin of a model, for training and export."""
    weights = {name: torch.from_numpy(value.copy()) for name, value in model.weights.items()}
    net = WrenchNet(weights["linear"].shape[1], len(weights["principal"]), len(weights["mean.first.bias"]))
    net.load_state_dict(weights)
    return net.eval()


def principal_fields(inputs: Array, count: int, side: int) -> Array:
    """(count, 2 side side) leading directions of the symmetrised, uncentred data, scaled so that P x has variance 1.

    Args:
        inputs: (N, 2 side side) fields. count: directions wanted, at most. side: cells along one side of the square
            grid.
    """
    gram = symmetric_moments(inputs, np.zeros((len(inputs), 6)), side)[0] / (COUNT * max(len(inputs), 1))
    values, vectors = np.linalg.eigh(gram)
    keep = np.argsort(values)[::-1][:count]
    keep = keep[values[keep] > 1e-9 * max(values[-1], 1e-30)]
    if not len(keep):
        raise ParameterError(
            "fields are all zero: nothing to learn from; were the frames pressed at all?", name="fields"
        )
    return (vectors[:, keep] / np.sqrt(values[keep])).T


def _prepared(train: Samples, config: FitConfig, side: int) -> WrenchNet:
    principal = principal_fields(train.inputs, config.components, side)
    weights, _ = fit_ridge(train.inputs, train.wrenches, train.path, side)
    net = WrenchNet(2 * side * side, len(principal), config.hidden)
    net.linear.copy_(torch.from_numpy(weights))
    net.principal.copy_(torch.from_numpy(principal))
    net.units.copy_(torch.from_numpy(UNITS))
    return net


def _started(start: WrenchModel, samples: Samples, components: int) -> WrenchNet:
    if start.design.digest != samples.design.digest or start.shape != samples.fields.shape[2:]:
        raise ParameterError(
            f"start is for {start.design.label} {start.shape}, the data are {samples.design.label} "
            f"{samples.fields.shape[2:]}: give weights of the same design",
            name="start",
        )
    net = as_net(start)
    net.calibration.fill_(1.0)
    gain = torch.from_numpy(_gain(start, samples).astype(np.float32))
    with torch.no_grad():
        net.linear.copy_(gain @ net.linear)
        net.mean.last.weight.copy_((gain * net.units / net.units[:, None]) @ net.mean.last.weight)
    return net if components <= len(net.principal) else _grown(net, samples, components)


def _grown(net: WrenchNet, samples: Samples, components: int) -> WrenchNet:
    """The same answers with more principal fields: the leading ones of what its own leave of new samples."""
    old = net.principal.detach().numpy().astype(float)
    left = samples.inputs - samples.inputs @ old.T @ np.linalg.pinv(old).T
    left /= tolerance(samples.wrenches[:, :3])
    more = principal_fields(left, components - len(old), samples.fields.shape[2])
    grown = WrenchNet(old.shape[1], len(old) + len(more), len(net.mean.first.bias))
    weights = net.state_dict()
    weights["principal"] = torch.cat([net.principal, torch.from_numpy(more.astype(np.float32))])
    for name in ("mean.first.weight", "spread.0.weight"):
        weights[name] = torch.cat([weights[name], weights[name].new_zeros(len(weights[name]), len(more))], dim=1)
    grown.load_state_dict(weights)
    return grown


def _gain(start: WrenchModel, samples: Samples) -> Array:
    """(6, 6) that takes the old answers to the new labels, near the identity: a few samples show another stiffness."""
    reported, reported_for = start.predict(samples.inputs)[0] / UNITS, samples.wrenches / UNITS
    gram = reported.T @ reported
    damping = GAIN_SHARE * float(np.trace(gram)) / 6 + 1e-9
    change = np.linalg.solve(gram + damping * np.eye(6), reported.T @ (reported_for - reported)).T
    return (np.eye(6) + change) * UNITS[:, None] / UNITS


def _parts(net: WrenchNet, samples: Samples, config: FitConfig, copies: int = COUNT) -> list[Tensor]:
    """Principal parts z (M, K), linear answers (M, 6) and labels (M, 6), with the symmetric copies: x is not needed
    again, because linear part and principal fields stand fast."""
    rows: list[list[Tensor]] = [[], [], []]
    side = samples.fields.shape[2]
    for number in list(config.symmetries)[:copies]:
        x = torch.from_numpy(moved_inputs(samples.inputs, number, side).astype(np.float32)).to(config.device)
        y = torch.from_numpy(moved_wrenches(samples.wrenches, number).astype(np.float32)).to(config.device)
        for kept, part in zip(rows, (x @ net.principal.T, x @ net.linear.T, y), strict=True):
            kept.append(part)
    return [torch.cat(part) for part in rows]


def _fit_mean(
    net: WrenchNet, train: list[Tensor], held: list[Tensor], config: FitConfig, progress: Progress | None,
    kept: Checkpoint,
) -> None:  # fmt: skip
    """Huber loss in units and tolerances; the best epoch on the validation paths stays, the linear part included."""

    def loss(z: Tensor, rest: Tensor, allowed: Tensor) -> Tensor:
        return torch.nn.functional.smooth_l1_loss(net.mean(z) / allowed, rest / allowed)

    def judge() -> float:
        with torch.inference_mode():
            off = net.mean(held[0]) - (held[2] - held[1]) / net.units
            return float((off / tolerance(held[2][:, :3])).square().mean())

    data = train[0], (train[2] - train[1]) / net.units, tolerance(train[2][:, :3])
    _descend(("mean", net.mean), data, loss, judge, config, 1.0, progress, kept)


def _fit_spread(
    net: WrenchNet, parts: list[Tensor], config: FitConfig, progress: Progress | None, kept: Checkpoint
) -> None:
    """Gaussian score of the residuals, the mean held fast."""
    with torch.inference_mode():
        residual = ((parts[2] - parts[1]) / net.units - net.mean(parts[0])).clone()

    def loss(z: Tensor, r: Tensor) -> Tensor:
        return negative_log_likelihood(r, net.factor(z))

    def judge() -> float:
        with torch.inference_mode():
            return float(loss(parts[0][::7], residual[::7]))

    _descend(("spread", net.spread), (parts[0], residual), loss, judge, config, 1 / 3, progress, kept)


def _descend(
    stage: tuple[str, torch.nn.Module],
    data: tuple[Tensor, ...],
    loss: Callable[..., Tensor],
    judge: Callable[[], float],
    config: FitConfig,
    effort: float,
    progress: Progress | None,
    kept: Checkpoint,
) -> None:
    """AdamW with a rate that falls to zero over the epochs (or seconds) allowed; keeps the best weights."""
    name, part = stage
    epochs, seconds = int(np.ceil(config.epochs * effort)), config.seconds * effort
    optimizer = torch.optim.AdamW(part.parameters(), lr=config.rate, weight_decay=config.decay)
    state = kept.begin(name, part, optimizer) or Descent(0, 0.0, judge(), copy.deepcopy(part.state_dict()))
    begin = time.monotonic() - state.seconds
    for epoch in range(state.epoch, epochs):
        share = max((time.monotonic() - begin) / max(seconds, 1e-9), epoch / epochs)
        if share >= 1:
            break
        for group in optimizer.param_groups:
            group["lr"] = config.rate * 0.5 * (1 + np.cos(np.pi * share))
        order = torch.Generator().manual_seed(config.seed * 1_000_003 + epoch)
        for rows in torch.randperm(len(data[0]), generator=order).to(data[0].device).split(config.batch):
            optimizer.zero_grad()
            loss(*(part[rows] for part in data)).backward()
            torch.nn.utils.clip_grad_norm_(part.parameters(), 10.0)
            optimizer.step()
        error = judge()
        best, lowest = (copy.deepcopy(part.state_dict()), error) if error < state.lowest else (state.best, state.lowest)
        state = Descent(epoch + 1, time.monotonic() - begin, lowest, best)
        kept.keep(name, part, optimizer, state)
        if progress is not None:
            progress(name, state.seconds, error)
    part.load_state_dict(state.best)
    kept.finish(name, part)


def _calibrate(net: WrenchNet, held: Samples) -> None:
    with torch.inference_mode():
        value, factor = net(torch.from_numpy(held.inputs.astype(np.float32)))
        sigma = factor.square().sum(2).sqrt()
        ratio = ((torch.from_numpy(held.wrenches.astype(np.float32)) - value).abs() / sigma).numpy()
    scale = path_quantile(ratio, held.path, 0.95) / NORMAL_95
    net.calibration.copy_(torch.from_numpy(np.clip(scale, 1e-3, 1e3)))


def _provenance(samples: Samples, config: FitConfig, start: WrenchModel | None) -> dict[str, Any]:
    known = set() if start is None else set(start.about.get("training", {}).get("paths", ()))
    return {
        "sources": [samples.source], "paths": sorted(known | set(map(str, samples.path))), "frames": len(samples),
        "config": asdict(config), "torch": str(torch.__version__), "data_digest": samples.digest,
        "start": start.about.get("training") if start is not None else None,
    }  # fmt: skip


def _rmse(net: WrenchNet, samples: Samples) -> list[float]:
    with torch.inference_mode():
        value = net(torch.from_numpy(samples.inputs.astype(np.float32)))[0].double().numpy()
    return [round(float(e), 5) for e in np.sqrt(((value - samples.wrenches) ** 2).mean(axis=0))]
