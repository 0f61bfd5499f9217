"""Settings of training (apart from torch, so that a command line can list them without loading it)."""

from __future__ import annotations

from dataclasses import dataclass

from cad.errors import ParameterError
from sensing.learning.symmetry import COUNT


@dataclass(frozen=True)
class FitConfig:
    """Settings of training.

    Attributes:
        components: number of principal fields.
        hidden: width of the perceptron of the mean.
        doubting: width of the perceptron of the covariance.
        depth: number of hidden layers of the mean, two or three.
        epochs: passes over the training data for the mean; a third of them more for the covariance.
        seconds: longest time for the mean, s; a third of it for the covariance.
        rate: first learning rate of AdamW, falling to zero.
        batch: number of samples in a step.
        decay: weight decay of AdamW.
        symmetric: whether the eight symmetries of the square are used.
        seed: seed of the random numbers.
        device: torch's name of the device, for example ``cpu`` or ``cuda``.

    Raises:
        ParameterError: a number out of range.
    """

    components: int = 120
    hidden: int = 64
    doubting: int = 64
    depth: int = 2
    epochs: int = 20
    seconds: float = 1e6
    rate: float = 5e-3
    batch: int = 1024
    decay: float = 1e-2
    symmetric: bool = True
    seed: int = 0
    device: str = "cpu"

    def __post_init__(self) -> None:
        for name, low, high in (
            ("components", 1, 512), ("hidden", 1, 4096), ("doubting", 1, 4096), ("depth", 2, 3),
            ("seconds", 0.0, 1e6), ("rate", 1e-6, 1.0),
            ("batch", 1, 10**6), ("decay", 0.0, 10.0), ("seed", 0, 2**32), ("epochs", 0, 10**6),
        ):  # fmt: skip
            value = getattr(self, name)
            if not low <= value <= high:
                raise ParameterError(f"{name}={value} outside {low:g}..{high:g}", name=name, value=value)

    @property
    def symmetries(self) -> range:
        """Numbers of the symmetries that are used."""
        return range(COUNT if self.symmetric else 1)
