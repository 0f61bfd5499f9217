"""The ONNX graph gives the model's numbers, in every storage, and nothing that is no number."""

from dataclasses import replace

import numpy as np
import pytest

from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.records import ShearField
from sensing.wrench.model import WrenchModel
from sensing.wrench.range import Range
from sensing.wrench.tensors import SHAPES, THIRD, TRACKING

pytest.importorskip("onnx")
onnxruntime = pytest.importorskip("onnxruntime")

from sensing import wrench_onnx  # noqa: E402

SIDE, COMPONENTS, HIDDEN, DOUBTING = 8, 10, 16, 12


@pytest.fixture(scope="module", params=[SHAPES, SHAPES | THIRD | TRACKING], ids=["two layers", "three"])
def model(request):
    """Weights drawn at random, of the sizes that trained ones have."""
    rng = np.random.default_rng(0)
    sizes = {"6": 6, "21": 21, "D": 2 * SIDE**2, "K": COMPONENTS, "M": HIDDEN, "S": DOUBTING}
    weights = {
        name: (rng.normal(size=[sizes[letter] for letter in letters]) * 0.2).astype(np.float32)
        for name, letters in request.param.items()
    }
    weights |= {"units": np.full(6, 0.1, np.float32), "calibration": np.full(6, 0.9, np.float32)}
    covered = Range(10.0, 10.0, np.ones((SIDE, SIDE), bool))
    return WrenchModel(weights, EndcapParams(130, 8), "dots", (SIDE, SIDE), covered, {"training": {"paths": []}})


def answers(model, storage, inputs):
    data = wrench_onnx.onnx_graph(model, storage).SerializeToString()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
    return session.run(None, {"field": inputs.astype(np.float32)})


@pytest.mark.parametrize(("storage", "close"), [("float32", 2e-6), ("float16", 2e-3), ("int8", 4e-2)])
def test_onnx_gives_the_models_numbers(model, storage, close):
    inputs = np.random.default_rng(1).normal(size=(40, 2 * SIDE**2))
    value, covariance = model.predict(inputs)
    reported, spread = answers(model, storage, inputs)
    assert np.abs(reported - value).max() < close * np.abs(value).max()
    assert np.abs(spread - covariance).max() < 3 * close * np.abs(covariance).max()
    sigma = np.sqrt(np.diagonal(spread, axis1=1, axis2=2))
    assert (np.linalg.eigvalsh(spread / sigma[:, :, None] / sigma[:, None]) > 0).all()


def test_the_file_says_units_order_and_frame_of_what_goes_in_and_comes_out(model):
    made = wrench_onnx.onnx_graph(model)
    assert made.producer_name == "endcap-toolkit" and "neither the flags" in made.doc_string
    said = {value.name: value.doc_string for value in (*made.graph.input, *made.graph.output)}
    assert said["field"].startswith(f"u then v of {SIDE} x {SIDE} cells, row by row") and "px of the" in said["field"]
    assert "(N m) of the world on the endcap" in said["wrench"] and "about the sphere's centre" in said["wrench"]
    assert said["covariance"] == "of the wrench, in its order and units"


def test_the_graph_names_the_method_whose_fields_it_takes(model):
    graph = wrench_onnx.onnx_graph(replace(model, method="farneback"))
    assert {each.key: each.value for each in graph.metadata_props}["method"] == "farneback"


@pytest.mark.parametrize("storage", wrench_onnx.STORAGE)
def test_zero_stays_exactly_zero_and_huge_stays_finite(model, storage):
    zero, one = answers(model, storage, np.zeros((3, 2 * SIDE**2)))
    assert not zero.any() and np.isfinite(one).all()
    for level in (1e-30, 1.0, 1e3, 1e6):
        value, covariance = answers(model, storage, np.full((2, 2 * SIDE**2), level))
        assert np.isfinite(value).all() and np.isfinite(covariance).all()


@pytest.mark.parametrize("seed", range(4))
def test_compiled_and_onnx_give_what_the_network_that_is_trained_gives(model, seed):
    """The torch network in float64 is the authority; the kernels keep to it to 1e-9, the float32 graph to 3e-6."""
    torch = pytest.importorskip("torch")
    from sensing.learning.net import as_net

    rng = np.random.default_rng(seed)
    weights = {
        name: (value * rng.uniform(0.2, 3.0, value.shape)).astype(np.float32) for name, value in model.weights.items()
    }
    drawn = replace(model, weights=weights)
    inputs = rng.normal(size=(40, 2 * SIDE**2)) * rng.uniform(0.1, 3.0, (40, 1))
    inputs = inputs.astype(np.float32).astype(float)
    with torch.inference_mode():
        value, root = (tensor.numpy() for tensor in as_net(drawn).double()(torch.from_numpy(inputs)))
    covariance = root @ root.transpose(0, 2, 1)
    for close, (reported, spread) in ((1e-9, drawn.predict(inputs)), (3e-6, answers(drawn, "float32", inputs))):
        assert np.abs(reported - value).max() < close * np.abs(value).max()
        assert np.abs(spread - covariance).max() < 3 * close * np.abs(covariance).max()
    alone = [drawn.estimate(ShearField(0.0, field.reshape(2, SIDE, SIDE).astype(np.float32))) for field in inputs]
    assert np.allclose(
        [np.concatenate([w.force_n, w.torque_nm]) for w in alone], value, rtol=0, atol=1e-9 * abs(value).max()
    )


def test_float16_refuses_what_it_cannot_hold(model):
    weights = {**model.weights, "linear": model.weights["linear"] + np.float32(1e6)}
    large = WrenchModel(weights, model.design, "dots", model.shape, model.range, model.about)
    with pytest.raises(ParameterError, match="65504"):
        wrench_onnx.onnx_graph(large, "float16")
    with pytest.raises(ParameterError, match="storage='int4'"):
        wrench_onnx.onnx_graph(model, "int4")


def test_command_line_writes_a_whole_file_or_none(model, tmp_path, capsys):
    model.save(tmp_path / "w.safetensors")
    out = tmp_path / "w.onnx"
    assert wrench_onnx.main(["--weights", str(tmp_path / "w.safetensors"), "--out", str(out)]) == 0
    assert out.stat().st_size > 1000 and "float32" in capsys.readouterr().out
    assert wrench_onnx.main(["--weights", str(tmp_path / "none"), "--out", str(out)]) == 2
    assert wrench_onnx.main(["--weights", str(tmp_path / "w.safetensors"), "--out", str(tmp_path / "no" / "w")]) == 2
    assert sorted(p.name for p in tmp_path.iterdir()) == ["w.onnx", "w.safetensors"]


def test_a_field_of_any_numbers_gives_numbers(model):
    rng = np.random.default_rng(3)
    for _ in range(300):
        field = (10.0 ** rng.uniform(-10, 8) * rng.normal(size=(2, SIDE, SIDE))).astype(np.float32)
        field[rng.random(field.shape) < 0.05] = rng.choice([np.nan, np.inf, -np.inf, 0.0])
        wrench = model.estimate(ShearField(0.0, field))
        assert np.isfinite(wrench.force_n).all() and np.isfinite(wrench.torque_nm).all()
        if "missing" not in wrench.flags:
            assert (np.linalg.eigvalsh(wrench.covariance) > 0).all()
