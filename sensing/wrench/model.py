"""Weights on disk and the estimator that live code uses: shear field in, wrench with covariance and flags out.

    model = load_wrench_model(EndcapParams(130, 8))       # the default that ships with the package, or path="..."
    seen = model_input(reference, model.shape, model.design)          # of sensing.tracking.model_input
    seen = model_input(reference, model.shape, model.design, camera, model.radial)       # with a calibrated camera
    wrench = model.estimate(seen.update(frame))

Wrenches on the endcap about the sphere's centre, N and N m. A file holds tensors and, as JSON, the design's digest, how
it was trained and how well it did. Weights of another design are refused. Nothing is unpickled, and torch is not
needed: compiled kernels compute the network of :mod:`sensing.learning.net`.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cad.errors import FileError, ParameterError
from cad.identity import MUST_AGREE, Identity, identity, recorded, require_same
from cad.materials import DEFAULT_SILICONE
from cad.params import EndcapParams
from cad.whole_file import replace_file
from sensing.camera.chosen_module import other_module_words
from sensing.records import ShearField, Wrench
from sensing.wrench.kernels import estimate_many, estimate_one, input_of
from sensing.wrench.load_scale import load_scale, recorded_shear_mpa
from sensing.wrench.range import Range, range_measures
from sensing.wrench.tensors import OPTIONAL, SHAPES, onset_n_of, pattern_of, radial_of, tracking_of
from sensing.wrench.weight_files import FORMAT, command_for, find_weights, read_weights

Array = NDArray[np.float64]
LEAST_VALID = 0.5  # share of the cells that count (valid in training) under which dots_lost is flagged
TWICE_N = 20.0  # E: force at which an error may be twice that of a light touch (goals: 0.1 N to 35 N, 1 % beyond)
LARGEST_PX = 1e6  # a field beyond it is no measurement
SLOPE_SAMPLES = 64  # E: random fields over which the derivative is averaged
MIN_SPREAD, MAX_SPREAD = 0.02, 100.0  # of an axis, in its unit: keeps the covariance definite and finite
MAX_MIX = 3.0  # entries of the unit lower triangle: keeps the covariance definite in floating point, too
LAYERS = ("first", "second", "third")


@dataclass(frozen=True)
class WrenchModel:
    """A trained network, its design and its provenance.

    Attributes:
        weights: tensors by name (:mod:`sensing.wrench.tensors`), float32.
        design: the endcap that it was trained for.
        method: field method that it was trained with.
        shape: (H, W) of the field.
        range: limits of the training data.
        about: provenance and metrics (plain JSON).
        identity: what the endcap is made of; None for one of this toolkit's pattern and default silicone.

    Raises:
        ParameterError: a tensor that is missing, of another shape, or not finite.
    """

    weights: dict[str, NDArray[np.float32]]
    design: EndcapParams
    method: str
    shape: tuple[int, int]
    range: Range
    about: dict[str, Any]
    identity: Identity | None = None

    def __post_init__(self) -> None:
        if self.identity is None:
            object.__setattr__(self, "identity", identity(self.design, DEFAULT_SILICONE))
        cells = self.shape[0] * self.shape[1]
        sizes = {"6": 6, "21": 21, "C": cells, "D": 2 * cells}
        shapes = SHAPES.copy()
        for more in OPTIONAL:
            shapes |= more if more.keys() & self.weights.keys() else {}
        for name, letters in shapes.items():
            found = self.weights.get(name, np.zeros(0))
            for letter, size in zip(letters, found.shape, strict=False):
                sizes.setdefault(letter, size)
            expected = tuple(sizes.get(letter, 0) for letter in letters)
            if found.shape != expected or not np.isfinite(found).all():
                raise ParameterError(f"{name} of shape {found.shape}: need {expected}, all finite", name=name)
        for name in ("units", "calibration"):
            if not (self.weights[name] > 0).all():
                raise ParameterError(f"{name}: need numbers above 0", name=name)
        if self.range.cells.shape != self.shape:
            raise ParameterError(
                f"range_cells of shape {self.range.cells.shape}: need {self.shape}", name="range_cells"
            )

    def estimate(self, field: ShearField) -> Wrench:
        """Wrench on the endcap about the sphere's centre; exactly zero at zero shear.

        Flags: ``out_of_range`` (a field unlike those of training, a larger force, or one further from the tip),
        ``dots_lost`` (too few valid cells), ``missing`` (no usable number: the wrench is zero and its covariance NaN).

        Raises:
            ParameterError: a field of another shape than the model's.
        """
        if field.channels.shape != (2, *self.shape) or field.names != ("u", "v"):
            raise ParameterError(
                f"field {field.channels.shape} {field.names}: the weights take u, v of {self.shape[0]}x{self.shape[1]}",
                name="field",
                value=field.channels.shape,
            )
        x, largest, valid, counting = input_of(field.channels, field.valid, self.range.cells)
        if not valid or not largest < LARGEST_PX:
            flags = frozenset({"missing", "out_of_range" if valid else "dots_lost"})
            return Wrench(field.time_s, np.zeros(3), np.zeros(3), "sphere", flags=flags)
        value, covariance, distance, rest = estimate_one(x, *self._packed)
        beyond = distance > self.range.distance or self.range.leaves_too_much(rest, math.hypot(*value[:3]))
        beyond = beyond or self._is_beyond(value[None], covariance[None])[0]
        flags = frozenset({"out_of_range"} if beyond else ())
        if counting < LEAST_VALID * self._counted_cells:
            flags |= {"dots_lost"}
        return Wrench(field.time_s, value[:3], value[3:], "sphere", covariance, flags)

    def predict(self, inputs: Array) -> tuple[Array, Array]:
        """(N, 6) wrenches and (N, 6, 6) covariances from (N, 2 H W)."""
        return estimate_many(np.array(inputs, dtype=np.float64, order="C", ndmin=2), *self._packed)

    def out_of_range(self, inputs: Array) -> NDArray[np.bool_]:
        """(N,) True where a field (N, 2 H W), or the contact estimated from it, is outside the training data."""
        seen = inputs * np.tile(self.range.cells.ravel(), 2)
        distance, rest = range_measures(self._doubles["principal"], self._patterns, seen)
        value, covariance = self.predict(inputs)
        outside = self.range.leaves_too_much(rest, np.linalg.norm(value[:, :3], axis=1))
        return (distance > self.range.distance) | outside | self._is_beyond(value, covariance)

    def _is_beyond(self, value: Array, covariance: Array) -> NDArray[np.bool_]:
        return self.range.is_beyond(value, covariance, self.design.outer_radius_mm, self.load_scale)

    @property
    def shear_mpa(self) -> float:
        """Shear modulus of the silicone of the training data, MPa; that of the default silicone where it is unknown."""
        return recorded_shear_mpa(self.identity)

    @cached_property
    def load_scale(self) -> float:
        """Scale of the endcap's forces relative to the released one (:mod:`sensing.wrench.load_scale`)."""
        return load_scale(self.design.wall_mm, self.shear_mpa)

    @cached_property
    def _counted_cells(self) -> int:
        """Number of the cells that count."""
        return int(np.count_nonzero(self.range.cells))

    @cached_property
    def radial(self) -> Array | None:
        """(H W, 2 H W) radial displacement of the skin in the cells by the field, mm by px of the 200 x 200 crop,
        outward positive (:mod:`sensing.learning.radial`); None for weights without it.
        """
        return radial_of(self.weights)

    @cached_property
    def slope(self) -> Array:
        """(6, 2 H W) derivative of the wrench by the field, N/px and N m/px, averaged over fields as in training."""
        w, rng, components = self._doubles, np.random.default_rng(0), len(self.weights["principal"])
        total = np.zeros((6, components))
        for z in rng.standard_normal((SLOPE_SAMPLES, components)):
            slope = np.eye(components)
            for layer in self.layers:
                weight, bias = w[f"mean.{layer}.weight"], w[f"mean.{layer}.bias"]
                a = weight @ z + bias
                z, slope = _silu(a) - _silu(bias), _silu_slope(a)[:, None] * (weight @ slope)
            total += w["mean.last.weight"] @ slope
        return w["linear"] + w["units"][:, None] * (total / SLOPE_SAMPLES) @ w["principal"]

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the hidden layers of the mean's perceptron."""
        return tuple(layer for layer in LAYERS if f"mean.{layer}.weight" in self.weights)

    def save(self, path: str | Path) -> None:
        """Write under a temporary name, then rename.

        Raises:
            FileError: the place cannot be written.
        """
        from safetensors.numpy import save

        about = {
            **self.about,
            "design": self.design.record,
            "digest": self.design.digest,
            "identity": None if self.identity is None else self.identity.record(),
            "method": self.method,
            "shape": self.shape,
            "range": {k: v for k, v in vars(self.range).items() if k != "cells" and math.isfinite(v)},
        }
        tensors: dict[str, Any] = {name: np.ascontiguousarray(value) for name, value in self.weights.items()}
        tensors["range_cells"] = self.range.cells.astype(np.uint8)
        replace_file(Path(path), save(tensors, {"format": FORMAT, "about": json.dumps(about, sort_keys=True)}))

    @cached_property
    def _doubles(self) -> dict[str, Array]:
        return {name: value.astype(np.float64) for name, value in self.weights.items()}

    @cached_property
    def _packed(self) -> tuple[Any, ...]:
        """Arguments of :func:`sensing.wrench.kernels.estimate_one` after the field."""
        w, back = {name: np.array(value, order="C") for name, value in self.weights.items()}, self._patterns
        last = self._doubles["mean.last.weight"] * self._doubles["units"][:, None]
        deeper = [np.array([w[f"mean.{layer}.{part}"] for layer in self.layers[1:]]) for part in ("weight", "bias")]
        spread = [f"spread.{layer}.{part}" for layer in (0, 2, 4) for part in ("weight", "bias")]
        return (
            np.tile(self.range.cells.ravel(), 2).astype(np.float32), w["linear"], w["principal"],
            np.ascontiguousarray(back.T), back.T @ back,
            (w["mean.first.weight"], w["mean.first.bias"], *deeper, last),
            tuple(w[name] for name in spread), self._doubles["calibration"] * self._doubles["units"],
            np.append(tracking_of(self.weights), onset_n_of(self.weights)), (MIN_SPREAD, MAX_SPREAD, MAX_MIX),
        )  # fmt: skip

    @cached_property
    def _patterns(self) -> Array:
        return pattern_of(self.weights)


def load_wrench_model(
    design: EndcapParams | None = None, path: str | Path | None = None, silicone: str | None = DEFAULT_SILICONE
) -> WrenchModel:
    """Read weights: the ones that ship for a design, or a file; with a design, only those of that endcap.

    Args:
        design: the endcap at hand; None takes weights of any.
        path: file; None for what ships or this user trained (of D130_T8 without a design).
        silicone: row of cad/materials.csv that the endcap is cast of; None takes weights of any.

    Raises:
        FileError: no weights for this endcap, the file is missing, damaged or of another kind, or its weights are
            for another design, dot pattern, camera or silicone.
    """
    if path is None:
        wanted, cast_of = design or EndcapParams(130.0, 8.0), silicone or DEFAULT_SILICONE
        path = find_weights(wanted, cast_of)
        if path is None:
            raise FileError(
                f"no weights for {wanted.label} in {cast_of}: make them in minutes with "
                f"{command_for(wanted, cast_of)}; with weights of another silicone, weigh it (docs/weigh.md)"
            )
    model = _built(Path(path))
    if design is not None and design.digest != model.design.digest:
        raise FileError(
            f"{path}: weights of {model.design.label}, this endcap is {design.label}: shells of other sizes deform "
            f"otherwise; leave the file out, or make one with {command_for(design, silicone or DEFAULT_SILICONE)}"
        )
    if design is not None:
        made = command_for(design, silicone or DEFAULT_SILICONE)
        here = identity(design, silicone)
        fix = f"{other_module_words(model.identity, here)}make them with {made}; of another silicone, weigh it"
        require_same(path, "weights", model.identity, here, f"{fix} (docs/weigh.md)", MUST_AGREE)
    return model


def tolerance(force: Any) -> Any:
    """(N, 1) weight of errors under forces (N, 3), N: the error accepted relative to a light touch; numpy or torch."""
    return 1 + (force**2).sum(1)[:, None] ** 0.5 / TWICE_N


def _built(path: Path) -> WrenchModel:
    tensors, about = read_weights(path)
    try:
        made_for = EndcapParams(**about["design"])
        if made_for.digest != about["digest"]:
            raise ValueError("the digest is not that of its design")
        cells = tensors.pop("range_cells").astype(bool)
        unlimited = {"force_n": math.inf, "tilt_deg": math.inf, "rest_px_per_n": 0.0, "interval_n": math.inf}
        limits = unlimited | about["range"]
        names = ("distance", "rest_px", "rest_px_per_n", "force_n", "tilt_deg", "interval_n")
        sizes = {name: float(limits[name]) for name in names}
        covered = Range(cells=cells, **sizes)
        shape = (int(about["shape"][0]), int(about["shape"][1]))
        made_of = recorded(about.get("identity"), made_for)
        return WrenchModel(tensors, made_for, str(about["method"]), shape, covered, about, made_of)
    except (KeyError, ValueError, TypeError, IndexError, AttributeError, OverflowError) as error:
        raise FileError(f"{path}: damaged weights ({' '.join(str(error).split())[:100]}): train again") from error


def _silu_slope(a: Array) -> Array:
    gate = 1.0 / (1.0 + np.exp(-np.clip(a, -700.0, None)))
    return gate * (1.0 + a * (1.0 - gate))


def _silu(a: Array) -> Array:
    return a / (1.0 + np.exp(-np.clip(a, -700.0, None)))
