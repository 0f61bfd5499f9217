"""Samples as a torch data set, for own networks."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.utils.data import Dataset

from sensing.learning.samples import Samples


class FieldDataset(Dataset[tuple[Tensor, Tensor]]):
    """(field (2, H, W) in px of the 200 x 200 crop, wrench (6,) in N and N m about the sphere's centre), float32.

    Args:
        samples: samples of the data set; ``samples.split`` divides them by path, which a split by index does not.
    """

    def __init__(self, samples: Samples) -> None:
        self.samples = samples

    def __len__(self) -> int:
        return len(self.samples)

    def __getitem__(self, index: int) -> tuple[Tensor, Tensor]:
        wrench = torch.from_numpy(self.samples.wrenches[index]).float()
        return torch.from_numpy(self.samples.fields[index]), wrench
