"""The paper's training, as published (P, NET11 to NET14): Adam 1e-3, batches of 32, 100 epochs, best validation.

The loss is the mean square over six axes, N and N m mixed; the split is random over samples that follow one another in
time, so neighbours of training samples are tested on. It is unchanged for comparison; our own training is
:mod:`sensing.train`.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from cad.errors import ParameterError
from sensing.wrench.paper_model import FIELD_SIZE, PaperModel, predict

LEARNING_RATE = 1e-3  # P, NET11
BATCH = 32  # P, NET12
EPOCHS = 100  # P, NET12
SHARES = (0.70, 0.15, 0.15)  # P, NET14: training, test, validation


@dataclass(frozen=True)
class PaperResult:
    """A trained network and its errors.

    Attributes:
        model: weights of the epoch with the lowest validation error.
        best_epoch: its number, from 1.
        train_mse, test_mse, validation_mse: mean squared error over samples and axes, N and N m mixed.
        history: (epochs, 2) training loss and validation error.
    """

    model: PaperModel
    best_epoch: int
    train_mse: float
    test_mse: float
    validation_mse: float
    history: NDArray[np.float64]


def random_split(count: int, seed: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Indices for training, test and validation, drawn sample by sample as the paper does (neighbours leak)."""
    order = np.random.default_rng(seed).permutation(count)
    first, second = round(SHARES[0] * count), round((SHARES[0] + SHARES[1]) * count)
    return order[:first], order[first:second], order[second:]


def train_paper_model(
    fields: NDArray[np.float32],
    wrenches: NDArray[np.float32],
    seed: int = 0,
    epochs: int = EPOCHS,
    split: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]] | None = None,
    progress: Callable[[int, float, float], None] | None = None,
) -> PaperResult:
    """Train from scratch.

    Args:
        fields: (N, 2, 30, 30).
        wrenches: (N, 6) labels, N and N m.
        seed: seed of weights, split and order.
        epochs: number of epochs; the paper has 100.
        split: indices for training, test, validation; None for the paper's random one.
        progress: called after each epoch with (epoch, training loss, validation error).

    Raises:
        ParameterError: too few samples, shapes that do not fit, or numbers that are not finite.
    """
    _check(fields, wrenches)
    train, test, validation = split or random_split(len(fields), seed)
    x, y = (torch.from_numpy(np.array(a, np.float32)) for a in (fields, wrenches))
    x = x.flatten(1)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        model = PaperModel()
    order = np.random.default_rng([seed, 1])
    optimizer = torch.optim.Adam(model.parameters(), lr=LEARNING_RATE)
    best, best_epoch, lowest = copy.deepcopy(model.state_dict()), 0, float("inf")
    history = []
    for epoch in range(1, epochs + 1):
        loss = _epoch(model, optimizer, x, y, order.permutation(train))
        error = _mse(model, x[validation], y[validation])
        history.append((loss, error))
        if error < lowest:
            best, best_epoch, lowest = copy.deepcopy(model.state_dict()), epoch, error
        if progress is not None:
            progress(epoch, loss, error)
    model.load_state_dict(best)
    a, b, c = (_mse(model.eval(), x[part], y[part]) for part in (train, test, validation))
    return PaperResult(model, best_epoch, a, b, c, np.array(history))


def _epoch(
    model: nn.Module, optimizer: torch.optim.Optimizer, x: torch.Tensor, y: torch.Tensor, order: NDArray[np.int64]
) -> float:
    model.train()
    total = 0.0
    for start in range(0, len(order), BATCH):
        batch = torch.from_numpy(order[start : start + BATCH])
        optimizer.zero_grad()
        loss = nn.functional.mse_loss(model(x[batch]), y[batch])
        loss.backward()
        optimizer.step()
        total += float(loss.detach()) * len(batch)
    return total / len(order)


def _mse(model: nn.Module, x: torch.Tensor, y: torch.Tensor) -> float:
    return float(((predict(model, x.numpy()) - y.double().numpy()) ** 2).mean()) if len(x) else float("nan")


def _check(fields: NDArray[np.float32], wrenches: NDArray[np.float32]) -> None:
    count = len(fields)
    if np.shape(wrenches) != (count, 6) or count < 7 or np.asarray(fields).size != count * FIELD_SIZE:
        raise ParameterError(
            f"fields {np.shape(fields)} and wrenches {np.shape(wrenches)}: need (N, 2, 30, 30), (N, 6), N at least 7",
            name="fields",
            value=np.shape(fields),
        )
    if not (np.isfinite(fields).all() and np.isfinite(wrenches).all()):
        raise ParameterError("fields or wrenches hold numbers that are not finite: drop those samples", name="fields")
