"""Our network, for training: linear part plus a small network on principal fields, exactly zero at zero shear.

    f(x) = W x + units * g(z),   z = P x,   g(0) = 0,   covariance C = S L L' S + diag(t)^2 (|F| / (F0 + |F|))^2

x: (2 H W) field in pixels of the 200 x 200 crop, W: ridge regression, P: leading principal fields of the training data
(not centred, so that zero stays zero), g: a perceptron whose activations are silu(a + b) - silu(b), which is zero at
a = 0 whatever b, L: lower triangular from a second perceptron (a spread
of each axis times a unit triangle), S: calibration of each axis. t: standard deviations that tracking adds from a light
touch on, |F| the force of the answer, F0 = ONSET units of it (:mod:`sensing.evaluation.intervals` finds S and t).
Wrenches on the endcap about the sphere's centre, N and N m. :mod:`sensing.wrench.model` computes the same without
torch.
"""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor, nn
from torch.nn.functional import linear, silu, softplus

from cad.errors import ParameterError
from sensing.learning.fit_config import FitConfig
from sensing.wrench.model import LAYERS, MAX_MIX, MAX_SPREAD, MIN_SPREAD, WrenchModel
from sensing.wrench.tensors import BESIDE, ONSET

OUTPUTS = 6  # components of a wrench
FACTOR = 21  # entries of a lower triangle


class WrenchNet(nn.Module):
    """The network in the module's text.

    Args:
        inputs: number of inputs, 2 H W.
        components: number of rows of P.
        hidden: width of the perceptron of the mean.
        doubting: width of the perceptron of the covariance.
        depth: number of hidden layers of the mean.
    """

    def __init__(self, inputs: int, components: int, hidden: int, doubting: int, depth: int) -> None:
        super().__init__()
        self.linear = nn.Parameter(torch.zeros(OUTPUTS, inputs), requires_grad=False)
        self.principal = nn.Parameter(torch.zeros(components, inputs), requires_grad=False)
        self.units = nn.Parameter(torch.ones(OUTPUTS), requires_grad=False)
        self.calibration = nn.Parameter(torch.ones(OUTPUTS), requires_grad=False)
        self.tracking = nn.Parameter(torch.zeros(OUTPUTS), requires_grad=False)
        self.mean = Anchored(components, hidden, depth)
        self.spread = nn.Sequential(
            nn.Linear(components, doubting),
            nn.SiLU(),
            nn.Linear(doubting, doubting),
            nn.SiLU(),
            nn.Linear(doubting, FACTOR),
        )
        nn.init.zeros_(self.spread[-1].weight)  # type: ignore[arg-type]  # training starts from a constant covariance

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Wrenches (B, 6) and factors (B, 6, 12) of their covariances C = F F', from fields (B, 2 H W)."""
        z = x @ self.principal.T
        value, scaled = x @ self.linear.T + self.mean(z) * self.units, (self.calibration * self.units)[:, None]
        force = value[:, :3].norm(dim=1, keepdim=True)
        tracking = torch.diag_embed(force / (force + ONSET * self.units[2]) * (self.tracking * self.units))
        return value, torch.cat([self.factor(z) * scaled, tracking], dim=2)

    def factor(self, z: Tensor) -> Tensor:
        """(B, 6, 6) lower triangular factors, in units, before calibration, from principal parts (B, components)."""
        raw = self.spread(z)
        rows, columns = torch.tril_indices(OUTPUTS, OUTPUTS)
        square = raw.new_zeros(len(raw), OUTPUTS, OUTPUTS)
        square[:, rows, columns] = raw
        spread = MIN_SPREAD + softplus(MAX_SPREAD * torch.tanh(torch.diagonal(square, dim1=1, dim2=2) / MAX_SPREAD))
        mix = torch.tril(MAX_MIX * torch.tanh(square / MAX_MIX), -1) + torch.eye(OUTPUTS, device=raw.device)
        return spread[:, :, None] * mix


class Bent(nn.Module):
    """The trained part of the mean: a linear map plus a perceptron that corrects it.

    The linear part W of :class:`WrenchNet` is fixed in training; :meth:`into` adds this linear map to it at the end.
    """

    def __init__(self, mean: Anchored) -> None:
        super().__init__()
        self.mean = mean
        self.straight = nn.Linear(mean.first.in_features, OUTPUTS, bias=False)
        nn.init.zeros_(self.straight.weight)

    def forward(self, z: Tensor) -> Tensor:
        """Means (B, 6), in units, from principal parts (B, components)."""
        line: Tensor = self.straight(z)
        return line + self.mean(z)

    def into(self, net: WrenchNet) -> None:
        """Add the linear map to W of a network."""
        with torch.no_grad():
            net.linear.add_(net.units[:, None] * (self.straight.weight @ net.principal))


class Anchored(nn.Module):
    """Perceptron that is exactly zero at zero; before training it is zero everywhere.

    Args:
        inputs: number of inputs.
        hidden: width of the hidden layers.
        depth: number of hidden layers, two or three.
    """

    def __init__(self, inputs: int, hidden: int, depth: int) -> None:
        super().__init__()
        self.first, self.second = nn.Linear(inputs, hidden), nn.Linear(hidden, hidden)
        if depth == len(LAYERS):
            self.third = nn.Linear(hidden, hidden)
        self.depth = depth
        self.last = nn.Linear(hidden, OUTPUTS, bias=False)
        nn.init.zeros_(self.last.weight)

    def forward(self, z: Tensor) -> Tensor:
        """Outputs (B, 6) of inputs (B, inputs)."""
        for name in LAYERS[: self.depth]:
            layer = getattr(self, name)
            z = silu(linear(z, layer.weight) + layer.bias) - silu(layer.bias)
        return self.last(z)


def as_net(model: WrenchModel) -> WrenchNet:
    """A model as a torch network, for training and export."""
    weights = {name: torch.from_numpy(value.copy()) for name, value in model.weights.items() if name not in BESIDE}
    components, inputs = model.weights["principal"].shape
    widths = len(weights["mean.first.bias"]), len(weights["spread.0.bias"])
    net = WrenchNet(inputs, components, *widths, len(model.layers))
    net.load_state_dict({"tracking": net.tracking, **weights})
    return net.eval()


def sized_as(model: WrenchModel, config: FitConfig) -> FitConfig:
    """Settings with the size that a network has, and with no fewer principal fields.

    Args:
        model: the network.
        config: settings of its fine-tuning.

    Raises:
        ParameterError: settings that ask for another size.
    """
    hidden, depth = len(model.weights["mean.first.bias"]), len(model.layers)
    for name, size in (("hidden", hidden), ("depth", depth)):
        if getattr(config, name) not in (getattr(FitConfig(), name), size):
            asked = f"{name}={getattr(config, name)}"
            raise ParameterError(f"{asked}: weights that are fine-tuned keep their {size}; leave it out", name=name)
    components = max(config.components, len(model.weights["principal"]))
    doubting = len(model.weights["spread.0.bias"])
    return replace(config, components=components, hidden=hidden, doubting=doubting, depth=depth)


def negative_log_likelihood(residual: Tensor, factor: Tensor) -> Tensor:
    """Mean Gaussian score of residuals (B, 6) under covariances F F', without the constant."""
    scaled = torch.linalg.solve_triangular(factor, residual[:, :, None], upper=False)[:, :, 0]
    return (0.5 * scaled.square().sum(1) + torch.diagonal(factor, dim1=1, dim2=2).log().sum(1)).mean()
