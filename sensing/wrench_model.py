"""Weights on disk and the estimator that live code uses: shear field in, wrench with covariance and flags out.

    model = WrenchModel.load("weights.safetensors", EndcapParams(130, 8))
    wrench = model.estimate(field)                        # about the sphere's centre, on the endcap

A file holds tensors and, as JSON, the design's digest, how it was trained and how well it did. Weights of another
design are refused. Nothing is unpickled.
"""

from __future__ import annotations

import json
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from cad.errors import FileError, ParameterError
from cad.params import EndcapParams
from sensing.records import ShearField, Wrench
from sensing.wrench_net import WrenchNet

FORMAT = "endcap-wrench-1"
LEAST_VALID = 0.5  # share of the cells valid in training that must be valid


@dataclass(frozen=True)
class Range:
    """What the training data covered.

    Attributes:
        distance: largest norm of the whitened principal part. rest_px: largest norm of what the principal fields leave.
        cells: cells (H, W) that were usually valid.
    """

    distance: float
    rest_px: float
    cells: NDArray[np.bool_]


class WrenchModel:
    """A trained network, its design and its provenance.

    Attributes:
        net: the network, on the CPU. design: the endcap it is for. method: field method that it was trained with.
        shape: (H, W). range: what training covered. about: provenance and metrics (plain JSON).
    """

    def __init__(
        self,
        net: WrenchNet,
        design: EndcapParams,
        method: str,
        shape: tuple[int, int],
        covered: Range,
        about: dict[str, Any],
    ) -> None:
        self.net, self.design, self.method, self.shape = net.eval(), design, method, shape
        self.range, self.about = covered, about

    def estimate(self, field: ShearField) -> Wrench:
        """Wrench on the endcap about the sphere's centre.

        Flags: ``out_of_range`` (a field unlike those of training), ``dots_lost`` (too few valid cells), ``missing`` (no
        usable number: the wrench is zero and its covariance NaN).

        Raises:
            ParameterError: a field of another shape than the model's.
        """
        if field.channels.shape != (2, *self.shape) or field.names != ("u", "v"):
            raise ParameterError(
                f"field {field.channels.shape} {field.names}: the weights take u, v of {self.shape[0]}x{self.shape[1]}",
                name="field",
                value=field.channels.shape,
            )
        x = np.where(field.valid, field.channels, 0.0).reshape(1, -1).astype(np.float64)
        if not np.isfinite(x).all() or not np.abs(x).max() < 1e6:
            flags = frozenset({"missing", "out_of_range"})
            return Wrench(field.time_s, np.zeros(3), np.zeros(3), "sphere", flags=flags)
        value, covariance = self.predict(x)
        flags = frozenset({"out_of_range"} if self.out_of_range(x)[0] else set())
        if field.valid[self.range.cells].mean() < LEAST_VALID:
            flags |= {"dots_lost"}
        return Wrench(field.time_s, value[0, :3], value[0, 3:], "sphere", covariance[0], flags)

    def predict(self, inputs: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(N, 6) wrenches and (N, 6, 6) covariances from (N, 2 H W)."""
        with torch.inference_mode():
            value, factor = self.net(torch.from_numpy(np.asarray(inputs, np.float32)))
        root = factor.double().numpy()
        return value.double().numpy(), root @ root.transpose(0, 2, 1)

    def out_of_range(self, inputs: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N,) True where a field is unlike those of training."""
        distance, rest = range_measures(self.net, inputs)
        return (distance > self.range.distance) | (rest > self.range.rest_px)

    def save(self, path: str | Path) -> None:
        """Write under a temporary name, then rename.

        Raises:
            FileError: the place cannot be written.
        """
        path = Path(path)
        about = {
            **self.about,
            "design": {"diameter_mm": self.design.diameter_mm, "wall_mm": self.design.wall_mm},
            "digest": self.design.digest,
            "method": self.method,
            "shape": self.shape,
            "range": {"distance": self.range.distance, "rest_px": self.range.rest_px},
        }
        tensors = {name: value.contiguous() for name, value in self.net.state_dict().items()}
        tensors["range_cells"] = torch.from_numpy(self.range.cells.astype(np.uint8))
        data = save(tensors, {"format": FORMAT, "about": json.dumps(about, sort_keys=True)})
        temporary = None
        try:
            handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".part")
            with os.fdopen(handle, "wb") as stream:
                stream.write(data)
            os.chmod(temporary, 0o644)
            os.replace(temporary, path)
        except OSError as error:
            raise FileError(f"{path}: {error.strerror}: give a folder that exists and may be written") from None
        finally:
            if temporary is not None:
                Path(temporary).unlink(missing_ok=True)

    @staticmethod
    def load(path: str | Path, design: EndcapParams | None = None) -> WrenchModel:
        """Read weights; with a design, only those of that design.

        Raises:
            FileError: missing, damaged, of another kind, or of another design (both are named).
        """
        tensors, about = _read(Path(path))
        try:
            made_for = EndcapParams(**about["design"])
            net = WrenchNet(
                tensors["linear"].shape[1], tensors["principal"].shape[0], tensors["mean.0.weight"].shape[0]
            )
            cells = tensors.pop("range_cells").numpy().astype(bool)
            net.load_state_dict(tensors)
            covered = Range(float(about["range"]["distance"]), float(about["range"]["rest_px"]), cells)
            shape = (int(about["shape"][0]), int(about["shape"][1]))
            method = str(about["method"])
            if made_for.digest != about["digest"]:
                raise ValueError("the digest is not that of its design")
        except (KeyError, ValueError, TypeError, RuntimeError, IndexError) as error:
            raise FileError(f"{path}: damaged weights ({' '.join(str(error).split())[:100]}): train again") from error
        if not all(torch.isfinite(value).all() for value in tensors.values()):
            raise FileError(f"{path}: weights that are not finite: train again")
        if design is not None and design.digest != made_for.digest:
            raise FileError(
                f"{path}: weights of {made_for.label}, this endcap is {design.label}: shells of other sizes deform "
                f"otherwise; train with python -m sensing.train on data of {design.label}"
            )
        return WrenchModel(net, made_for, method, shape, covered, about)


def range_measures(net: WrenchNet, inputs: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N,) norm of the whitened principal part, and (N,) norm of the rest in px."""
    principal = net.principal.double().numpy()
    z = inputs @ principal.T
    rest = inputs - z @ np.linalg.pinv(principal).T if len(principal) else inputs
    return np.linalg.norm(z, axis=1), np.linalg.norm(rest, axis=1)


def _read(path: Path) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    try:
        with safe_open(path, framework="pt") as file:
            extra = file.metadata() or {}
            if extra.get("format") != FORMAT:
                raise FileError(f"{path}: no weights of this toolkit (format {extra.get('format')}): give {FORMAT}")
            return {name: file.get_tensor(name) for name in file.keys()}, json.loads(extra["about"])  # noqa: SIM118
    except FileError:
        raise
    except OSError as error:
        raise FileError(f"{path}: cannot read the weights ({error}): check the path") from error
    except (SafetensorError, ValueError, KeyError) as error:
        raise FileError(f"{path}: damaged weights ({error}): train again") from error
