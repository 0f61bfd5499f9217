"""Fits our network to samples: principal fields, straight and bent part, covariance, calibration, range.

Paths are divided into three parts: training, validation (choice of the epoch, and further data for the covariance) and
calibration (scale of the covariance), so that nothing is tested on its training data. Each axis counts in its own unit
(:data:`sensing.learning.ridge.UNITS`), and errors under load count less (:func:`sensing.wrench.model.tolerance`), in
the loads of D=130 T=8 whatever the endcap (:mod:`sensing.learning.reference_loads`).
Equal samples and settings give equal weights on one machine; with ``seconds`` they depend on its speed.

Notes:
    The calibration of an axis is the 95 % quantile of |error| / sigma on the calibration paths over 1.96, each path
    with the same weight. It is an estimate without guarantee: the paths are few, and the sensors are those of training.
    Intervals that hold on other sensors need pictures of other sensors (:mod:`sensing.evaluation.intervals`).
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from cad.errors import ParameterError
from sensing.learning.checkpoint import Checkpoint, Descent
from sensing.learning.covered_range import covered_range
from sensing.learning.fit_config import FitConfig
from sensing.learning.net import Bent, WrenchNet, as_net, negative_log_likelihood, sized_as
from sensing.learning.path_quantile import path_quantile
from sensing.learning.principal import leading, pattern_tensor, principal_fields
from sensing.learning.provenance import provenance
from sensing.learning.reference_loads import in_reference_loads, rescaled, wrench_scale
from sensing.learning.ridge import UNITS
from sensing.learning.samples import Samples, are_simulated
from sensing.learning.symmetry import COUNT, moved_inputs, moved_wrenches, symmetric_gram, symmetric_moments
from sensing.wrench.model import WrenchModel, tolerance
from sensing.wrench.range import NORMAL_95
from sensing.wrench.tensors import RADIAL
from sensing.wrench.weight_files import SIMULATED

Array = NDArray[np.float64]
Progress = Callable[[str, float, float], None]
RIDGE_SHARE = 1e-4  # of the mean square principal part: regularisation of the linear map from which training starts
BLOCK, JUDGED = 65536, 7  # samples whose residuals are computed at a time; every seventh validates the covariance
HELD = 40  # E: paths that suffice to choose an epoch, or to scale the covariance; the others train
GAIN_SHARE = 1e-3  # of the mean square answer: regularisation of fine-tuning toward no change


def fit(
    samples: Samples,
    config: FitConfig,
    start: WrenchModel | None = None,
    progress: Progress | None = None,
    checkpoint: Path | None = None,
    pictures: Samples | None = None,
    others: Samples | None = None,
) -> WrenchModel:
    """Train weights on samples of one design.

    Args:
        samples: at least three loading paths.
        config: size of the network and settings of the training.
        start: weights that are fine-tuned: their answers are first mapped to the new labels, then the perceptrons are
            trained further, with more principal fields where ``config`` has more.
        progress: called after each epoch with (part, seconds, error).
        checkpoint: file of the state, from which the same training goes on; the caller removes it after saving weights.
        pictures: the same paths through the real tracker, if there are pictures; the covariance is then scaled on
            those of its calibration paths, because domain-randomised sensors lack some errors of real ones.
        others: contacts of other kinds, to which only the covariance is fitted: it learns where the mean is wrong, and
            ``out_of_range`` is raised where that makes the interval of a force too wide
            (:mod:`sensing.learning.covered_range`).

    Raises:
        ParameterError: too few paths, a field that is not square, or a start of another design or shape.
    """
    config = config if start is None else sized_as(start, config)
    unit, origin = wrench_scale(samples), provenance(samples, config, start, others)
    samples, start = in_reference_loads(samples), start and rescaled(start, 1 / wrench_scale(start))
    pictures, others = (part and in_reference_loads(part) for part in (pictures, others))
    height, width = samples.fields.shape[2:]
    if height != width:
        raise ParameterError(f"field of {height}x{width}: the symmetries need a square one", name="shape")
    rest, calibration = samples.split(0.15, config.seed, HELD)
    train, validation = rest.split(0.18, config.seed + 1, HELD)
    torch.manual_seed(config.seed)
    net = _prepared(train, config, height) if start is None else _started(start, train, config.components)
    net.to(config.device)
    of = f"{asdict(config)} {samples.digest} {start.about if start else None} {others and others.digest}"
    kept = Checkpoint(checkpoint, of)
    parts = _parts(net, train, config)
    bent = _fit_mean(net, parts, _parts(net, validation, config, 1), config, progress, kept)
    seen = [parts, _parts(net, validation, config), *([] if others is None else [_parts(net, others, config)])]
    _fit_spread(net, bent, [torch.cat(part) for part in zip(*seen, strict=True)], config, progress, kept)
    bent.into(net)
    net.cpu().eval()
    _calibrate(net, [view for view in (pictures, samples) if view is not None], calibration.path)
    about = {
        "training": origin,
        SIMULATED: are_simulated(origin["paths"]),
        "metrics": {"validation_rmse": _rmse(net, validation, unit), "calibration_rmse": _rmse(net, calibration, unit)},
    }
    weights = _tensors(net, train, start)
    covered = covered_range(weights, rest, config, height, start, taught=others is not None)
    model = WrenchModel(weights, samples.design, samples.method, (height, width), covered, about, samples.identity)
    return rescaled(model, unit)


def _prepared(train: Samples, config: FitConfig, side: int) -> WrenchNet:
    principal = principal_fields(train, config.components)
    net = WrenchNet(2 * side * side, len(principal), config.hidden, config.doubting, config.depth)
    net.principal.copy_(torch.from_numpy(principal))
    net.units.copy_(torch.from_numpy(UNITS))
    net.linear.copy_(torch.from_numpy(_straight(train, principal, side)))
    return net


def _tensors(net: WrenchNet, train: Samples, start: WrenchModel | None) -> dict[str, NDArray[np.float32]]:
    weights = {name: value.detach().cpu().numpy().astype(np.float32) for name, value in net.state_dict().items()}
    weights |= {} if start is None else {name: value for name, value in start.weights.items() if name in RADIAL}
    return weights | pattern_tensor(weights["principal"], train, start.weights if start else None)


def _straight(samples: Samples, principal: Array, side: int) -> Array:
    """(6, D) least-squares linear map of the principal parts by P (K, D): the rest of a field is mostly noise.

    It is fitted to the samples and their symmetric copies; ``side`` is the number of cells along a side.
    """
    gram, moment = np.zeros((2 * side * side,) * 2), np.zeros((2 * side * side, 6))
    for part in samples.blocks():
        weight = 1 / tolerance(part.wrenches[:, :3])
        more = symmetric_moments(part.inputs * weight, part.wrenches * weight, side)
        gram, moment = gram + more[0], moment + more[1]
    inner = principal @ gram @ principal.T
    inner += RIDGE_SHARE * np.trace(inner) / len(inner) * np.eye(len(inner))
    return np.asarray(np.linalg.solve(inner, principal @ moment).T @ principal)


def _started(start: WrenchModel, samples: Samples, components: int) -> WrenchNet:
    of_start = start.design.label, start.shape, start.method
    of_data = samples.design.label, samples.fields.shape[2:], samples.method
    if start.design.digest != samples.design.digest or of_start[1:] != of_data[1:]:
        said, seen = ("{} {}, fields of {}".format(*each) for each in (of_start, of_data))
        raise ParameterError(
            f"start is for {said}, the data are {seen}: give weights of the same design and --method", name="start"
        )
    net = as_net(start)
    net.calibration.fill_(1.0)
    net.tracking.fill_(0.0)
    gain = torch.from_numpy(_gain(start, samples).astype(np.float32))
    with torch.no_grad():
        net.linear.copy_(gain @ net.linear)
        net.mean.last.weight.copy_((gain * net.units / net.units[:, None]) @ net.mean.last.weight)
    return net if components <= len(net.principal) else _grown(net, samples, components)


def _grown(net: WrenchNet, samples: Samples, components: int) -> WrenchNet:
    """The same answers with more principal fields: the leading ones of the new samples' residuals."""
    old = net.principal.detach().numpy().astype(float)
    size, side = old.shape[1], samples.fields.shape[2]
    gram, known = np.zeros((size, size)), old.T @ np.linalg.pinv(old).T
    for part in samples.blocks():
        left = part.inputs - part.inputs @ known
        gram += left.T @ left
    more = leading(symmetric_gram(gram, side) / (COUNT * len(samples)), np.zeros((size, size)), components - len(old))
    weights = net.state_dict()
    widths = len(weights["mean.first.bias"]), len(weights["spread.0.bias"])
    grown = WrenchNet(size, len(old) + len(more), *widths, net.mean.depth)
    weights["principal"] = torch.cat([net.principal, torch.from_numpy(more.astype(np.float32))])
    for name in ("mean.first.weight", "spread.0.weight"):
        weights[name] = torch.cat([weights[name], weights[name].new_zeros(len(weights[name]), len(more))], dim=1)
    grown.load_state_dict(weights)
    return grown


def _gain(start: WrenchModel, samples: Samples) -> Array:
    """(6, 6) map from the old answers to the new labels, near the identity: few samples show another stiffness."""
    reported, reported_for = start.predict(samples.inputs)[0] / UNITS, samples.wrenches / UNITS
    gram = reported.T @ reported
    damping = GAIN_SHARE * float(np.trace(gram)) / 6 + 1e-9
    change = np.linalg.solve(gram + damping * np.eye(6), reported.T @ (reported_for - reported)).T
    return (np.eye(6) + change) * UNITS[:, None] / UNITS


def _parts(net: WrenchNet, samples: Samples, config: FitConfig, copies: int = COUNT) -> list[Tensor]:
    """Principal parts z (M, K), linear answers (M, 6) and labels (M, 6), with the symmetric copies; they replace x,
    because principal fields and linear part are fixed."""
    side, numbers = samples.fields.shape[2], list(config.symmetries)[:copies]
    sizes = (len(net.principal), *(2 * (len(net.units),)))
    found = [torch.empty(len(numbers) * len(samples), size, device=config.device) for size in sizes]
    at = 0
    for part in samples.blocks():
        for number in numbers:
            x = torch.from_numpy(moved_inputs(part.inputs, number, side).astype(np.float32)).to(config.device)
            y = torch.from_numpy(moved_wrenches(part.wrenches, number).astype(np.float32))
            for kept, value in zip(found, (x @ net.principal.T, x @ net.linear.T, y), strict=True):
                kept[at : at + len(part)] = value
            at += len(part)
    return found


def _fit_mean(
    net: WrenchNet, train: list[Tensor], held: list[Tensor], config: FitConfig, progress: Progress | None,
    kept: Checkpoint,
) -> Bent:  # fmt: skip
    """Train the mean on the Huber loss in units and tolerances; returns the best epoch's on the validation paths."""
    bent = Bent(net.mean).to(config.device)

    def loss(z: Tensor, rest: Tensor, allowed: Tensor) -> Tensor:
        return torch.nn.functional.smooth_l1_loss(bent(z) / allowed, rest / allowed)

    def judge() -> float:
        with torch.inference_mode():
            off = bent(held[0]) - (held[2] - held[1]) / net.units
            return float((off / tolerance(held[2][:, :3])).square().mean())

    data = train[0], (train[2] - train[1]) / net.units, tolerance(train[2][:, :3])
    _descend(("mean", bent), data, loss, judge, config, 1.0, progress, kept)
    return bent


def _fit_spread(
    net: WrenchNet, bent: Bent, parts: list[Tensor], config: FitConfig, progress: Progress | None, kept: Checkpoint
) -> None:
    """Train the covariance on the Gaussian score of the residuals; the mean is fixed."""
    with torch.inference_mode():
        residual = torch.cat([
            (labels - linear) / net.units - bent(z)
            for z, linear, labels in zip(*(part.split(BLOCK) for part in parts), strict=True)
        ]).clone()  # fmt: skip

    def loss(z: Tensor, r: Tensor) -> Tensor:
        return negative_log_likelihood(r, net.factor(z))

    def judge() -> float:
        with torch.inference_mode():
            return float(loss(parts[0][::JUDGED], residual[::JUDGED]))

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
    """Train with AdamW and a rate that falls to zero over the epochs (or seconds) allowed; keeps the best weights."""
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


def _calibrate(net: WrenchNet, views: list[Samples], paths: NDArray[np.str_]) -> None:
    """Scale the covariance on the first of the views that contains some of the paths."""
    parts = [view.take(np.isin(view.path, paths)) for view in views]
    held = next(part for part in parts if len(part))
    with torch.inference_mode():
        value, factor = net(torch.from_numpy(held.inputs.astype(np.float32)))
        sigma = factor.square().sum(2).sqrt()
        ratio = ((torch.from_numpy(held.wrenches.astype(np.float32)) - value).abs() / sigma).numpy()
    scale = path_quantile(ratio, held.path, 0.95) / NORMAL_95
    net.calibration.copy_(torch.from_numpy(np.clip(scale, 1e-3, 1e3)))


def _rmse(net: WrenchNet, samples: Samples, unit: Array) -> list[float]:
    with torch.inference_mode():
        value = net(torch.from_numpy(samples.inputs.astype(np.float32)))[0].double().numpy()
    errors = np.sqrt(((value - samples.wrenches) ** 2).mean(axis=0))
    return [round(round(float(e), 5) * float(one), 7) for e, one in zip(errors, unit, strict=True)]
