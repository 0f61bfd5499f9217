"""Fits our network to samples: linear part, principal fields, perceptron, covariance, calibration, range.

Paths are parted three ways: training, validation (which epoch is best), calibration (how wide the covariance must be),
so that nothing is judged on what it was fitted to. Each axis counts in its own unit (:data:`sensing.ridge.UNITS`).

Notes:
    The calibration of an axis is the 95 % quantile of |error| / sigma on the calibration paths over 1.96 (split
    conformal prediction, Vovk, Gammerman, Shafer 2005): intervals keep their level whatever the errors' law.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from cad.errors import ParameterError
from sensing.ridge import UNITS, fit_ridge
from sensing.samples import Samples
from sensing.symmetry import COUNT, moved_inputs, moved_wrenches
from sensing.wrench_model import Range, WrenchModel, range_measures
from sensing.wrench_net import WrenchNet, negative_log_likelihood

Array = NDArray[np.float64]
Progress = Callable[[str, float, float], None]
NORMAL_95 = 1.959964  # half width of the 95 % interval in standard deviations
RANGE_MARGIN = 1.3  # E: over the largest of the training data


@dataclass(frozen=True)
class FitConfig:
    """Knobs of training.

    Attributes:
        components: principal fields. hidden: width of the perceptrons.
        seconds: time for the mean; the covariance takes a third of it more.
        rate: Adam's. batch: samples in a step. noise_px: field noise added in training.
        seed: of everything drawn. device: torch's, for example ``cpu`` or ``cuda``.
        epochs: stop after so many, if sooner (for tests: time plays no part then).

    Raises:
        ParameterError: a number out of range.
    """

    components: int = 40
    hidden: int = 64
    seconds: float = 60.0
    rate: float = 2e-3
    batch: int = 128
    noise_px: float = 0.02
    seed: int = 0
    device: str = "cpu"
    epochs: int = 100_000

    def __post_init__(self) -> None:
        for name, low, high in (
            ("components", 1, 512), ("hidden", 1, 4096), ("seconds", 0.0, 1e6), ("rate", 1e-6, 1.0),
            ("batch", 1, 10**6), ("noise_px", 0.0, 10.0), ("seed", 0, 2**32), ("epochs", 0, 10**7),
        ):  # fmt: skip
            value = getattr(self, name)
            if not low <= value <= high:
                raise ParameterError(f"{name}={value} outside {low:g}..{high:g}", name=name, value=value)


def fit(
    samples: Samples, config: FitConfig, start: WrenchModel | None = None, progress: Progress | None = None
) -> WrenchModel:
    """Train on samples of one design.

    Args:
        samples: at least three loading paths.
        start: weights to go on from (fine-tuning): linear part and principal fields stay, the perceptrons learn on.
        progress: called after each epoch with (part, seconds, error).

    Raises:
        ParameterError: too few paths, a field that is not square, or a start of another design or shape.
    """
    height, width = samples.fields.shape[2:]
    if height != width:
        raise ParameterError(f"field of {height}x{width}: the symmetries need a square one", name="shape")
    rest, calibration = samples.split(0.15, config.seed)
    train, validation = rest.split(0.18, config.seed + 1)
    torch.manual_seed(config.seed)
    net = _prepared(train, config, height) if start is None else _started(start, samples)
    net.to(config.device)
    turned = _turned(train, height, config.device)
    _fit_mean(net, turned, _tensors(validation, config.device), config, progress)
    both = [torch.cat(pair) for pair in zip(turned, _turned(validation, height, config.device), strict=True)]
    _fit_spread(net, (both[0], both[1]), config, progress)
    net.cpu().eval()
    _calibrate(net, calibration)
    about = {
        "training": {
            "sources": [samples.source], "paths": sorted(map(str, set(samples.path))),
            "frames": len(samples), "seed": config.seed, "seconds": config.seconds, "components": config.components,
            "hidden": config.hidden, "torch": str(torch.__version__),
            "start": start.about.get("training") if start is not None else None,
        },
        "metrics": {"validation_rmse": _rmse(net, validation), "calibration_rmse": _rmse(net, calibration)},
    }  # fmt: skip
    covered = _covered(net, rest, height)
    return WrenchModel(net, samples.design, samples.method, (height, width), covered, about)


def principal_fields(inputs: Array, count: int, side: int) -> Array:
    """(count, 2 side side) leading directions of the symmetrised, uncentred data, scaled so that P x has variance 1."""
    gram = sum(m.T @ m for m in (moved_inputs(inputs, k, side) for k in range(COUNT))) / (COUNT * max(len(inputs), 1))
    values, vectors = np.linalg.eigh(np.asarray(gram))
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


def _started(start: WrenchModel, samples: Samples) -> WrenchNet:
    if start.design.digest != samples.design.digest or start.shape != samples.fields.shape[2:]:
        raise ParameterError(
            f"start is for {start.design.label} {start.shape}, the data are {samples.design.label} "
            f"{samples.fields.shape[2:]}: give weights of the same design",
            name="start",
        )
    net = copy.deepcopy(start.net)
    net.calibration.fill_(1.0)
    return net


def _tensors(samples: Samples, device: str) -> tuple[Tensor, Tensor]:
    x, y = (torch.from_numpy(np.asarray(a, np.float32)).to(device) for a in (samples.inputs, samples.wrenches))
    return x, y


def _turned(samples: Samples, side: int, device: str) -> tuple[Tensor, Tensor]:
    x = np.concatenate([moved_inputs(samples.inputs, k, side) for k in range(COUNT)])
    y = np.concatenate([moved_wrenches(samples.wrenches, k) for k in range(COUNT)])
    return torch.from_numpy(x.astype(np.float32)).to(device), torch.from_numpy(y.astype(np.float32)).to(device)


def _fit_mean(
    net: WrenchNet,
    train: tuple[Tensor, Tensor],
    held: tuple[Tensor, Tensor],
    config: FitConfig,
    progress: Progress | None,
) -> None:
    """Huber loss in units; the best epoch on the validation paths stays, the linear part alone included."""

    def loss(x: Tensor, y: Tensor) -> Tensor:
        return torch.nn.functional.smooth_l1_loss(net.wrench(x) / net.units, y / net.units)

    def judge() -> float:
        with torch.inference_mode():
            return float(((net.wrench(held[0]) - held[1]) / net.units).square().mean())

    _descend(net, net.mean, train, loss, judge, config, config.seconds, ("mean", progress))


def _fit_spread(net: WrenchNet, data: tuple[Tensor, Tensor], config: FitConfig, progress: Progress | None) -> None:
    """Gaussian score of the residuals, the mean held fast."""
    with torch.inference_mode():
        residual = ((data[1] - net.wrench(data[0])) / net.units).clone()

    def loss(x: Tensor, r: Tensor) -> Tensor:
        return negative_log_likelihood(r, net.factor(x))

    def judge() -> float:
        with torch.inference_mode():
            return float(loss(data[0][:4096], residual[:4096]))

    _descend(net, net.spread, (data[0], residual), loss, judge, config, config.seconds / 3, ("spread", progress))


def _descend(
    net: WrenchNet,
    part: torch.nn.Module,
    data: tuple[Tensor, Tensor],
    loss: Callable[[Tensor, Tensor], Tensor],
    judge: Callable[[], float],
    config: FitConfig,
    seconds: float,
    report: tuple[str, Progress | None],
) -> None:
    """AdamW with a rate that falls to zero over the time allowed; keeps the best weights of ``part``."""
    optimizer = torch.optim.AdamW(part.parameters(), lr=config.rate, weight_decay=1e-3)
    order = torch.Generator().manual_seed(config.seed)
    best, lowest = copy.deepcopy(part.state_dict()), judge()
    begin = time.monotonic()
    for epoch in range(config.epochs):
        spent = time.monotonic() - begin
        share = max(spent / seconds if seconds > 0 else 1.0, epoch / config.epochs)
        if share >= 1:
            break
        for group in optimizer.param_groups:
            group["lr"] = config.rate * 0.5 * (1 + np.cos(np.pi * share))
        for rows in torch.randperm(len(data[0]), generator=order).split(config.batch):
            x = data[0][rows.to(data[0].device)]
            x = x + config.noise_px * torch.randn(x.shape, generator=order).to(x.device) * (x != 0)
            optimizer.zero_grad()
            loss(x, data[1][rows.to(x.device)]).backward()
            torch.nn.utils.clip_grad_norm_(part.parameters(), 10.0)
            optimizer.step()
        error = judge()
        if error < lowest:
            best, lowest = copy.deepcopy(part.state_dict()), error
        if report[1] is not None:
            report[1](report[0], time.monotonic() - begin, error)
    part.load_state_dict(best)


def _calibrate(net: WrenchNet, held: Samples) -> None:
    with torch.inference_mode():
        value, factor = net(torch.from_numpy(held.inputs.astype(np.float32)))
        sigma = factor.square().sum(2).sqrt()
        ratio = ((torch.from_numpy(held.wrenches.astype(np.float32)) - value).abs() / sigma).numpy()
    level = min(1.0, 0.95 * (1 + 1 / len(ratio)))
    scale = np.quantile(ratio, level, axis=0) / NORMAL_95
    net.calibration.copy_(torch.from_numpy(np.clip(scale, 1e-3, 1e3)))


def _covered(net: WrenchNet, samples: Samples, side: int) -> Range:
    measures = [range_measures(net, moved_inputs(samples.inputs, k, side)) for k in (0, 1, 4)]
    distance, rest = (RANGE_MARGIN * float(max(m[k].max() for m in measures)) for k in (0, 1))
    return Range(distance, rest, samples.valid.mean(axis=0) > 0.9)


def _rmse(net: WrenchNet, samples: Samples) -> list[float]:
    with torch.inference_mode():
        value = net.wrench(torch.from_numpy(samples.inputs.astype(np.float32))).double().numpy()
    return [round(float(e), 5) for e in np.sqrt(((value - samples.wrenches) ** 2).mean(axis=0))]
