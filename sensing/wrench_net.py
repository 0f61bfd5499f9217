"""Our network: linear part plus a small network on principal fields, exactly zero at zero shear, with a covariance.

    f(x) = W x + units * (g(z) - g(0)),   z = P x,   covariance C = S L L' S

x: (2 H W) field in pixels of the 200 x 200 crop, W: ridge regression, P: leading principal fields of the training data
(not centred, so that zero stays zero), g: a perceptron, L: lower triangular from a second perceptron, S: calibration of
each axis. Wrenches on the endcap about the sphere's centre, N and N m. Torch module; plain arrays in
:class:`sensing.wrench_model.WrenchModel`.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

MIN_SPREAD, MAX_SPREAD = 0.02, 100.0  # of an axis, in its unit: keeps the covariance definite and finite


class WrenchNet(nn.Module):
    """The network of the module's text.

    Args:
        inputs: 2 H W. components: rows of P. hidden: width of both perceptrons.
    """

    def __init__(self, inputs: int, components: int, hidden: int) -> None:
        super().__init__()
        self.linear = nn.Parameter(torch.zeros(6, inputs), requires_grad=False)
        self.principal = nn.Parameter(torch.zeros(components, inputs), requires_grad=False)
        self.units = nn.Parameter(torch.ones(6), requires_grad=False)
        self.calibration = nn.Parameter(torch.ones(6), requires_grad=False)
        self.mean = _perceptron(components, hidden, 6)
        self.spread = _perceptron(components, hidden, 21)
        nn.init.zeros_(self.mean[-1].weight)  # type: ignore[arg-type]  # training starts from the linear part
        nn.init.zeros_(self.spread[-1].weight)  # type: ignore[arg-type]

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """(B, 2 H W) to wrenches (B, 6) and factors (B, 6, 6) of their covariances C = F F'."""
        return self.wrench(x), self.factor(x) * (self.calibration * self.units)[:, None]

    def wrench(self, x: Tensor) -> Tensor:
        """(B, 6)."""
        z = x @ self.principal.T
        rest = self.mean(torch.zeros_like(z[:1]))
        return x @ self.linear.T + (self.mean(z) - rest) * self.units

    def factor(self, x: Tensor) -> Tensor:
        """(B, 6, 6) lower triangular, in units, before calibration."""
        raw = self.spread(x @ self.principal.T)
        rows, columns = torch.tril_indices(6, 6)
        factor = raw.new_zeros(len(raw), 6, 6)
        factor[:, rows, columns] = MAX_SPREAD * torch.tanh(raw / MAX_SPREAD)
        diagonal = MIN_SPREAD + nn.functional.softplus(torch.diagonal(factor, dim1=1, dim2=2))
        return torch.tril(factor, -1) + torch.diag_embed(diagonal)


def negative_log_likelihood(residual: Tensor, factor: Tensor) -> Tensor:
    """Mean Gaussian score of residuals (B, 6) under covariances F F', without the constant."""
    scaled = torch.linalg.solve_triangular(factor, residual[:, :, None], upper=False)[:, :, 0]
    return (0.5 * scaled.square().sum(1) + torch.diagonal(factor, dim1=1, dim2=2).log().sum(1)).mean()


def _perceptron(inputs: int, hidden: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(inputs, hidden), nn.SiLU(), nn.Linear(hidden, hidden), nn.SiLU(), nn.Linear(hidden, outputs)
    )
