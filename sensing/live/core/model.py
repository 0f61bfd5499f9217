"""Wrench models by name, behind one small interface; heavy libraries are imported only for the models that need them.

``default`` ships with the toolkit (dots, numpy only). ``paper`` is the released network on the released field; its
checkpoint is the authors' and has to be given. Forces in N; wrenches about the sphere's centre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cad import plugins
from cad.errors import FileError, ParameterError
from cad.identity import differing, name_of
from cad.materials import DEFAULT_SILICONE
from cad.params import EndcapParams
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.records import ShearField, Wrench
from sensing.tracking.methods import known_methods
from sensing.wrench.contact import ContactThreshold
from sensing.wrench.model import WrenchModel, load_wrench_model
from sensing.wrench.stiffness import load_scale_of, weights_digest
from sensing.wrench.weight_files import find_weights

CONTACT_N = 1.0  # E: above the answer at rest, at D=130 T=8; python -m sensing.setup measures it
RELEASE_N = 0.6


class WrenchEstimator(Protocol):
    """One field in, one wrench out; remembers nothing."""

    def estimate(self, field: ShearField) -> Wrench:
        """Wrench on the endcap, frame "sphere"."""
        ...


@dataclass(frozen=True)
class LiveModel:
    """A model ready to answer.

    Attributes:
        name: of the model.
        method: field method it was made for.
        shape: (H, W) of its field.
        estimator: the model.
        rest_n: norm of its force for a field of zeros (1.85 N for the released network).
    """

    name: str
    method: str
    shape: tuple[int, int]
    estimator: WrenchEstimator
    rest_n: float

    @property
    def radial(self) -> NDArray[np.float64] | None:
        """Of trained weights, :attr:`sensing.wrench.model.WrenchModel.radial`; None of other estimators."""
        return self.estimator.radial if isinstance(self.estimator, WrenchModel) else None

    @property
    def load_scale(self) -> float:
        """How large the forces are that it answers (:mod:`sensing.wrench.load_scale`)."""
        return load_scale_of(self.estimator)

    @property
    def most_n(self) -> float:
        """Largest force that trained weights know, N; infinite of other estimators, and where weights do not say it."""
        return self.estimator.range.force_n if isinstance(self.estimator, WrenchModel) else math.inf

    def threshold(self, on_n: float = 0.0, off_n: float = 0.0, gain: float = 1.0) -> ContactThreshold:
        """Contact threshold: the one given, or for 0 a force above the model's own answer at rest.

        Args:
            on_n: at which contact begins.
            off_n: at which it ends; 0 for the model's own share of ``on_n``, as no force is below 0.
            gain: from the model's force to the endcap's.
        """
        if on_n > 0:
            return ContactThreshold(on_n, off_n or on_n * RELEASE_N / CONTACT_N, float("nan"), 0.0, True)
        on_n, off_n = (gain * (self.rest_n + force_n * self.load_scale) for force_n in (CONTACT_N, RELEASE_N))
        return ContactThreshold(on_n, off_n, float("nan"), 0.0, True)


def require_reachable(model: LiveModel, endcap: EndcapConfig) -> None:
    """Refuse a contact threshold beyond all forces that an endcap's model answers: millinewtons, perhaps.

    Args:
        model: a model that answers for the endcap.
        endcap: with its threshold and gain.

    Raises:
        ParameterError: contact would never begin.
    """
    most_n = endcap.gain * model.most_n
    if endcap.contact_on_n >= most_n:
        raise ParameterError(
            f"contact_on_n={endcap.contact_on_n:g} of {endcap.name}: its weights know forces to {most_n:.3g} N, so "
            "contact would never begin: give newtons, or 0 for the model's own",
            name="contact_on_n",
            value=endcap.contact_on_n,
        )


def other_silicone(model: LiveModel, endcap: EndcapConfig) -> str:
    """Silicone that a model was trained for where an endcap is of another one and needs a gain; else empty.

    Args:
        model: a model that answers for the endcap.
        endcap: with its silicone.
    """
    made_for = getattr(model.estimator, "identity", None)
    if made_for is None or not differing(made_for, endcap.identity, ("silicone",)):
        return ""
    return name_of(made_for, "silicone")


def live_model(
    name: str, estimator: WrenchEstimator, shape: tuple[int, int] = (30, 30), method: str = "dots"
) -> LiveModel:
    """Any estimator as a model.

    Args:
        name: of the model.
        estimator: field to wrench.
        shape: (H, W) of its field.
        method: field method it was made for.
    """
    rest = estimator.estimate(ShearField(0.0, np.zeros((2, *shape), np.float32)))
    return LiveModel(name, method, shape, estimator, float(np.linalg.norm(rest.force_n)))


def known_weights(name: str, params: EndcapParams, silicone: str = DEFAULT_SILICONE) -> Path | None:
    """File of the weights that ship for an endcap or that this user trained for it; None where there are none.

    Args:
        name: of the model.
        params: the design.
        silicone: row of cad/materials.csv.
    """
    return find_weights(params, silicone) if name == "default" else None


def weights_in_use(config: LiveConfig, endcap: EndcapConfig, any_silicone: bool = False) -> Path | None:
    """File that answers for an endcap; None where there is none.

    Args:
        config: names model and weights.
        endcap: one of that configuration; a weighed one takes the weights that its gain was found with, of its own
            silicone or of the default one.
        any_silicone: the endcap is about to be weighed: those of the default silicone serve where its own has none.
    """
    given = config.weights_of(endcap)
    own = given or known_weights(config.model, endcap.params, endcap.silicone)
    if given or not (any_silicone or endcap.weighed):
        return own
    usual = known_weights(config.model, endcap.params)
    if any_silicone:
        return own or usual
    both = own is not None and usual is not None and endcap.gain_weights != ""
    return own if both and _digest(usual) != endcap.gain_weights else usual or own


def _digest(weights: Path | None) -> str:
    """That of :func:`sensing.wrench.stiffness.weights_digest`, of a file."""
    return weights_digest(load_wrench_model(path=weights, silicone=None))


def load_model(
    name: str,
    params: EndcapParams,
    weights: Path | None = None,
    method: str | None = None,
    silicone: str | None = DEFAULT_SILICONE,
) -> LiveModel:
    """The model of that name for a design.

    Args:
        name: ``default``, ``paper`` or a plug-in's.
        params: the design.
        weights: file; None for :func:`known_weights`.
        method: another field method than the model's own (of weights, the one that they were trained with).
        silicone: row of cad/materials.csv that the endcap is cast of; None where a gain makes any weights fit.

    Raises:
        ParameterError: unknown name.
        FileError: no weights, those of another endcap, or those for a method of a plug-in that is not installed.
    """
    if name == "default":
        model = load_wrench_model(params, weights, silicone)
        if model.method not in known_methods():
            raise FileError(
                f"{weights or name}: weights for fields of {model.method}, which no plug-in here adds: install it, or "
                f"give weights for one of {', '.join(known_methods())}"
            )
        return live_model(name, model, model.shape, method or model.method)
    if name == "paper":
        if weights is None:
            raise FileError(
                "--model paper needs the authors' checkpoint: give --weights wrench_regression_model.pth from their "
                "repository"
            )
        import torch

        from sensing.wrench.paper_model import PaperEstimator, load_paper_model

        torch.set_num_threads(1)  # a network of 1800 x 64 gains nothing from more
        return live_model(name, PaperEstimator(load_paper_model(weights)), (30, 30), method or "gelslim")
    if name in plugins.names(plugins.Kind.WRENCH_MODEL):
        made = plugins.make(plugins.Kind.WRENCH_MODEL, name, "estimate", params, weights)
        own = str(getattr(made, "method", "dots"))
        return live_model(name, made, getattr(made, "shape", (30, 30)), method or own)
    raise ParameterError(f"model={name!r}: choose default or paper, or a plug-in's", name="model", value=name)
