"""State from which an interrupted training continues: one safetensors file beside the weights, whole or not at all.

A checkpoint belongs to one set of samples and settings (its key) and is ignored for any other. It stays when the
training is done, for the caller to remove once the weights are saved. Times in seconds.
"""

from __future__ import annotations

import hashlib
import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from cad.whole_file import replace_file

EVERY_S = 5.0  # s between writings


@dataclass(frozen=True)
class Descent:
    """State of a descent.

    Attributes:
        epoch: number of epochs done.
        seconds: time spent, s.
        lowest: validation error of the best epoch.
        best: its weights by name.
    """

    epoch: int
    seconds: float
    lowest: float
    best: dict[str, torch.Tensor]


class Checkpoint:
    """The checkpoint file of one training; without a path it does nothing.

    Args:
        path: path of the file.
        key: text that identifies samples and settings.
    """

    def __init__(self, path: Path | None, key: str) -> None:
        self._path, self._key = path, hashlib.sha256(key.encode()).hexdigest()
        self._done: dict[str, torch.Tensor] = {}
        self._found = self._read()
        self._written = time.monotonic()

    def begin(self, stage: str, part: torch.nn.Module, optimizer: torch.optim.Optimizer) -> Descent | None:
        """Restore the state of a stage; None where none is stored.

        Args:
            stage: name of the stage.
            part, optimizer: those of the stage; both get the stored state.
        """
        tensors, about = self._found
        if f"{stage} done" in about:
            best = _named(tensors, f"{stage} best ")
            return Descent(10**9, 0.0, 0.0, best)
        if about.get("stage") != stage:
            return None
        part.load_state_dict(_named(tensors, f"{stage} now "))
        moments = optimizer.state_dict()
        moments["state"] = {
            number: _named(tensors, f"{stage} adam {number} ") for number in range(sum(1 for _ in part.parameters()))
        }
        optimizer.load_state_dict(moments)
        best = _named(tensors, f"{stage} best ")
        return Descent(int(about["epoch"]), float(about["seconds"]), float(about["lowest"]), best)

    def keep(self, stage: str, part: torch.nn.Module, optimizer: torch.optim.Optimizer, state: Descent) -> None:
        """Write the state, at most once in :data:`EVERY_S`.

        Args:
            stage: name of the stage.
            part, optimizer: those of the stage, in their present state.
            state: state of the descent.
        """
        if self._path is None or time.monotonic() - self._written < EVERY_S:
            return
        tensors = {f"{stage} now {name}": value for name, value in part.state_dict().items()}
        tensors |= {f"{stage} best {name}": value for name, value in state.best.items()}
        for number, moments in optimizer.state_dict()["state"].items():
            tensors |= {f"{stage} adam {number} {name}": value for name, value in moments.items()}
        about = {"stage": stage, "epoch": state.epoch, "seconds": state.seconds, "lowest": state.lowest}
        self._write(tensors, about)

    def finish(self, stage: str, part: torch.nn.Module) -> None:
        """Mark a stage as done and write that at once, so that it is not trained again."""
        self._done |= {f"{stage} best {name}": value.clone() for name, value in part.state_dict().items()}
        if self._path is not None:
            self._write({}, {})

    def _write(self, tensors: dict[str, torch.Tensor], about: dict[str, Any]) -> None:
        assert self._path is not None
        about |= {"key": self._key} | {f"{name.split()[0]} done": True for name in self._done}
        whole = {name: value.detach().cpu().contiguous().clone() for name, value in (tensors | self._done).items()}
        replace_file(self._path, save(whole, {"about": json.dumps(about)}))
        self._written = time.monotonic()

    def _read(self) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
        if self._path is None or not self._path.is_file():
            return {}, {}
        try:
            with safe_open(self._path, framework="pt") as file:
                about = json.loads((file.metadata() or {})["about"])
                if about["key"] != self._key:
                    return {}, {}
                return {name: file.get_tensor(name) for name in file.keys()}, about  # noqa: SIM118
        except (OSError, SafetensorError, ValueError, KeyError):
            return {}, {}  # damaged: training starts again


def _named(tensors: dict[str, torch.Tensor], prefix: str) -> dict[str, torch.Tensor]:
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
