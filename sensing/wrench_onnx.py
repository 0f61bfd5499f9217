"""A wrench model as an ONNX graph that gives the same numbers, for runtimes without Python.

    python -m sensing.wrench_onnx --out wrench.onnx                            # the model that ships
    python -m sensing.wrench_onnx --weights mine.safetensors --storage int8 --out wrench.onnx

Input ``field`` (N, 2 H W): u then v, row by row, pixels of the 200 x 200 crop. Outputs ``wrench`` (N, 6) on the endcap
about the sphere's centre, N and N m, and ``covariance`` (N, 6, 6). The graph computes in float32; ``storage`` says how
the large matrices lie in the file: float32, float16, or int8 with a scale for each row. The file says all this itself.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cad.errors import EndcapError, FileError, ParameterError
from cad.extras import program
from cad.messages import LOG, show
from cad.whole_file import replace_file
from sensing.wrench.model import MAX_MIX, MAX_SPREAD, MIN_SPREAD, WrenchModel, load_wrench_model
from sensing.wrench.tensors import onset_n_of, tracking_of

if TYPE_CHECKING:
    from onnx import ModelProto

STORAGE = ("float32", "float16", "int8")
OPSET, IR = 17, 8  # understood since ONNX Runtime 1.13
FLOAT16_MAX = 65504.0
# What the file says of itself, for readers that have nothing else.
GRAPH_DOC = (
    "Wrench of an endcap from the displacement field of its dots. The network alone: neither the flags (out of range, "
    "dots lost) nor what live adds to the covariance (noise and calibration of the camera, simulated training)."
)
FIELD_DOC = (
    "u then v of {height} x {width} cells, row by row: displacement from the untouched endcap, px of the 200 x 200 "
    "centre crop, as sensing.tracking.model_input gives it; 0 in cells without a value"
)
WRENCH_DOC = "force x y z (N), torque x y z (N m) of the world on the endcap, endcap axes, about the sphere's centre"
COVARIANCE_DOC = "of the wrench, in its order and units"


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(prog=program("python -m sensing.wrench_onnx"), description=__doc__.splitlines()[0])
    parser.add_argument("--weights", type=Path, metavar="FILE", help="from python -m sensing.train (those that ship)")
    parser.add_argument("--storage", choices=STORAGE, default=STORAGE[0], help="of the matrices in the file (float32)")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="wrench.onnx to write")
    options = parser.parse_args(arguments)
    try:
        model = load_wrench_model(path=options.weights)
        data = onnx_graph(model, options.storage).SerializeToString()
        replace_file(options.out, data)
    except EndcapError as error:
        LOG.error(f"sensing.wrench_onnx: {error}")
        return 2
    show(f"{options.out}: network of {model.design.label}, {len(data) / 1000:.0f} kB, matrices in {options.storage}")
    return 0


def onnx_graph(model: WrenchModel, storage: str = "float32") -> ModelProto:
    """The graph of a model.

    Raises:
        ParameterError: an unknown storage, or numbers too large for it.
        FileError: the onnx package is missing.
    """
    if storage not in STORAGE:
        raise ParameterError(f"storage={storage!r}: choose from {', '.join(STORAGE)}", name="storage", value=storage)
    try:
        from onnx import checker, helper
    except ImportError:
        raise FileError("onnx is not installed: run pip install 'endcap-toolkit[onnx]'") from None
    draft = _Draft(storage)
    _mean(draft, model)
    _covariance(draft, model)
    height, width = model.shape
    field = helper.make_tensor_value_info(
        "field", 1, ["N", 2 * height * width], FIELD_DOC.format(height=height, width=width)
    )
    wrench = helper.make_tensor_value_info("wrench", 1, ["N", 6], WRENCH_DOC)
    covariance = helper.make_tensor_value_info("covariance", 1, ["N", 6, 6], COVARIANCE_DOC)
    graph = helper.make_graph(draft.nodes, "wrench", [field], [wrench, covariance], draft.constants, GRAPH_DOC)
    made = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR, producer_name="endcap-toolkit",
        doc_string=GRAPH_DOC,
    )  # fmt: skip
    known = {"design": model.design.label, "digest": model.design.digest, "about": json.dumps(model.about)}
    known["method"] = model.method
    known["identity"] = json.dumps(model.identity.record() if model.identity else None)
    helper.set_model_props(made, known)
    checker.check_model(made)
    return made


class _Draft:
    """Nodes and constants of a graph, written down in order."""

    def __init__(self, storage: str) -> None:
        self.storage = storage
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def op(self, kind: str, *inputs: str, out: str = "", **options: Any) -> str:
        """Adds a node with one output; returns the output's name."""
        from onnx import helper

        name = out or f"t{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, list(inputs), [name], **options))
        return name

    def constant(self, name: str, value: NDArray[Any]) -> str:
        """Add a constant without conversion."""
        from onnx import numpy_helper

        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(value), name))
        return name

    def matrix(self, name: str, weights: NDArray[np.float32]) -> str:
        """Add a weight matrix (outputs, inputs), transposed, in the chosen storage type."""
        if self.storage == "float32":
            return self.constant(name, weights.T.astype(np.float32))
        if self.storage == "float16":
            if np.abs(weights).max() > FLOAT16_MAX:
                raise ParameterError(f"{name} holds {np.abs(weights).max():g}, float16 at most 65504: use float32")
            return self.op("Cast", self.constant(name, weights.T.astype(np.float16)), to=1)
        scale = np.maximum(np.abs(weights).max(axis=1), 1e-30) / 127
        steps = np.rint(weights / scale[:, None]).astype(np.int8)
        names = [self.constant(name, steps.T), self.constant(f"{name}.scale", scale.astype(np.float32))]
        return self.op("DequantizeLinear", *names, axis=1)

    def limited(self, x: str, name: str, most: float) -> str:
        """x bent smoothly so that it stays within -most..most."""
        limit = self.constant(name, np.full(1, most, np.float32))
        return self.op("Mul", self.op("Tanh", self.op("Div", x, limit)), limit)

    def silu(self, x: str) -> str:
        """x times its logistic function."""
        return self.op("Mul", x, self.op("Sigmoid", x))


def _mean(draft: _Draft, model: WrenchModel) -> None:
    w = model.weights
    h = draft.op("MatMul", "field", draft.matrix("principal", w["principal"]), out="principal part")
    for layer in (f"mean.{name}" for name in model.layers):
        bias = w[f"{layer}.bias"].astype(float)
        inner = draft.op("MatMul", h, draft.matrix(layer, w[f"{layer}.weight"]))
        rest = draft.constant(f"{layer}.bias", bias.astype(np.float32))
        h = draft.op("Sub", draft.silu(draft.op("Add", inner, rest)), draft.silu(draft.op("Identity", rest)))
    bend = draft.op("MatMul", h, draft.matrix("mean.last", w["mean.last.weight"] * w["units"][:, None]))
    plain = draft.op("MatMul", "field", draft.matrix("linear", w["linear"]))
    draft.op("Add", plain, bend, out="wrench")


def _covariance(draft: _Draft, model: WrenchModel) -> None:
    w = model.weights
    h = "principal part"
    for number in (0, 2, 4):
        product = draft.op("MatMul", h, draft.matrix(f"spread.{number}", w[f"spread.{number}.weight"]))
        h = draft.op("Add", product, draft.constant(f"spread.{number}.bias", w[f"spread.{number}.bias"]))
        h = draft.silu(h) if number < 4 else h
    rows, columns = np.tril_indices(6)
    place, pick = np.zeros((21, 36), np.float32), np.zeros((21, 6), np.float32)
    below = rows > columns
    place[below, 6 * rows[below] + columns[below]] = 1.0
    pick[~below, rows[~below]] = 1.0
    mix = draft.limited(draft.op("MatMul", h, draft.constant("place", place)), "mix limit", MAX_MIX)
    mix = draft.op("Reshape", mix, draft.constant("square", np.array([-1, 6, 6], np.int64)))
    mix = draft.op("Add", mix, draft.constant("unit", np.eye(6, dtype=np.float32)))
    spread = draft.limited(draft.op("MatMul", h, draft.constant("pick", pick)), "spread limit", MAX_SPREAD)
    least = draft.constant("least", np.full(1, MIN_SPREAD, np.float32))
    spread = draft.op("Add", draft.op("Softplus", spread), least)
    column = draft.constant("column", np.array([-1, 6, 1], np.int64))
    root = draft.op("Mul", mix, draft.op("Reshape", spread, column))
    scale = draft.constant("scale", (w["calibration"] * w["units"])[:, None])
    scaled = draft.op("Mul", root, scale)
    own = draft.op("MatMul", scaled, draft.op("Transpose", scaled, perm=[0, 2, 1]))
    draft.op("Add", own, _tracking(draft, model), out="covariance")


def _tracking(draft: _Draft, model: WrenchModel) -> str:
    """What tracking adds to the covariance: see :mod:`sensing.learning.net`."""
    of_force = draft.constant("of force", np.eye(6, 3, dtype=np.float32).sum(axis=1, keepdims=True))
    force = draft.op("Sqrt", draft.op("MatMul", draft.op("Mul", "wrench", "wrench"), of_force))
    onset = draft.constant("onset", np.full(1, onset_n_of(model.weights), np.float32))
    share = draft.op("Div", force, draft.op("Add", force, onset))
    square = draft.op(
        "Reshape", draft.op("Mul", share, share), draft.constant("number", np.array([-1, 1, 1], np.int64))
    )
    return draft.op(
        "Mul", square, draft.constant("tracking", np.diag(tracking_of(model.weights) ** 2).astype(np.float32))
    )


if __name__ == "__main__":
    sys.exit(main())
