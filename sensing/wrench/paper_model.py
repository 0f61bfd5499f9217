"""The released network, unchanged: shear field to wrench (P, NET08).

    model = load_paper_model("wrench_regression_model.pth")
    wrench = PaperEstimator(model).estimate(field)         # field of sensing.tracking.gelslim, 30 x 30, u and v

Input: vec(2, 30, 30) = 1800 numbers, u then v, row by row, pixels of the 200 x 200 crop, not normalised. A residual
block to 64 with a linear shortcut, a residual block 64 to 64, a linear layer to (Fx, Fy, Fz, Tx, Ty, Tz) in N and N m.
ReLU after each sum.

Known to be weak, and kept: the network has biases, so zero shear gives 1.85 N; the nodes' threshold of 0.2 N is always
passed. Signs, frame: :mod:`sensing.frames`.
"""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from cad.errors import FileError, ParameterError
from sensing.frames import AUTHORS_LABEL_SIGN
from sensing.records import ShearField, Wrench

FIELD_SIZE = 1800  # P, NET08: 2 x 30 x 30
HIDDEN = 64  # P, NET08
SIX_CAMERA_THRESHOLD_N = 0.2  # P, NET10: below it that node publishes zero


class ResidualBlock(nn.Module):
    """ReLU(fc2(ReLU(fc1(x))) + shortcut(x)); the shortcut is the identity where the sizes agree."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.fc1 = nn.Linear(inputs, outputs)
        self.fc2 = nn.Linear(outputs, outputs)
        if inputs != outputs:
            self.shortcut = nn.Linear(inputs, outputs)

    def forward(self, x: Tensor) -> Tensor:
        """(B, inputs) to (B, outputs)."""
        past = self.shortcut(x) if hasattr(self, "shortcut") else x
        return torch.relu(self.fc2(torch.relu(self.fc1(x))) + past)


class PaperModel(nn.Module):
    """The residual MLP 1800 -> 64 -> 64 -> 6, with the released names of its weights."""

    def __init__(self) -> None:
        super().__init__()
        self.res_blocks = nn.ModuleList([ResidualBlock(FIELD_SIZE, HIDDEN), ResidualBlock(HIDDEN, HIDDEN)])
        self.fc_out = nn.Linear(HIDDEN, 6)

    def forward(self, fields: Tensor) -> Tensor:
        """(B, 2, 30, 30) or (B, 1800) to (B, 6)."""
        x = fields.flatten(1)
        for block in self.res_blocks:
            x = block(x)
        return self.fc_out(x)


def load_paper_model(path: str | Path) -> PaperModel:
    """The network with the authors' checkpoint, ready to answer.

    Raises:
        FileError: missing, not a plain file of weights, or weights of another network.
    """
    try:
        weights = torch.load(path, map_location="cpu", weights_only=True)
        model = PaperModel()
        model.load_state_dict(weights)
    except OSError as error:
        raise FileError(f"{path}: cannot read the checkpoint ({error.strerror or error}): check the path") from error
    except (RuntimeError, pickle.UnpicklingError, EOFError, TypeError, AttributeError, KeyError) as error:
        reason = " ".join(str(error).split())[:120]
        raise FileError(
            f"{path}: not the weights of the released network ({reason}): give wrench_regression_model.pth"
        ) from error
    if not all(torch.isfinite(value).all() for value in model.state_dict().values()):
        raise FileError(f"{path}: weights that are not finite: fetch the checkpoint again")
    return model.eval()


class PaperEstimator:
    """Shear fields in, wrenches out as the released nodes publish them.

    Args:
        model: the network.
        threshold_n: force norm under which the whole wrench is published as zero.
    """

    def __init__(self, model: PaperModel, threshold_n: float = SIX_CAMERA_THRESHOLD_N) -> None:
        if not threshold_n >= 0:
            raise ParameterError(f"threshold_n={threshold_n}: give 0 N or more", name="threshold_n", value=threshold_n)
        self.model, self.threshold_n = model, threshold_n

    def estimate(self, field: ShearField) -> Wrench:
        """Wrench on the endcap about the sphere's centre.

        Raises:
            ParameterError: a field that is not (u, v) of 30 x 30 finite numbers.
        """
        if field.channels.shape != (2, 30, 30) or field.names != ("u", "v"):
            raise ParameterError(
                f"field {field.channels.shape} {field.names}: the released network takes (2, 30, 30) of u, v "
                "(sensing.tracking.gelslim)",
                name="field",
                value=field.channels.shape,
            )
        if not np.isfinite(field.channels).all():
            raise ParameterError("field holds numbers that are not finite: drop the frame", name="field")
        published = AUTHORS_LABEL_SIGN * predict(self.model, field.channels[None])[0]
        if np.linalg.norm(published[:3]) < self.threshold_n:
            published = np.zeros(6)
        return Wrench(field.time_s, published[:3], published[3:], frame="sphere")


def predict(model: nn.Module, fields: NDArray[np.float32]) -> NDArray[np.float64]:
    """(N, 6) in the sign of the labels, from (N, 2, 30, 30)."""
    with torch.inference_mode():
        return model(torch.from_numpy(np.array(fields, np.float32))).double().numpy()
