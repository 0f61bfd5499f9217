"""Rate effects: a Prony series on the isochoric stress (MPa, s), for :class:`sensing.simulator.press.press.Press`.

    S(t) = S_vol + S_inf + sum_i H_i,     dH_i/dt + H_i / tau_i = b_i dS_inf/dt,     b_i = g_i / (1 - sum g)

S second Piola-Kirchhoff stress (Simo 1987, doi:10.1016/0045-7825(87)90107-1; g_i relative to the instantaneous modulus
as in :mod:`cad.materials`; the table's constants are the slow, long-term ones). The midpoint rule over a step dt

    H_i' = exp(-dt/tau_i) H_i + b_i exp(-dt/2tau_i) (S_inf' - S_inf)

makes the step elastic again: isochoric constants times 1 + sum b_i exp(-dt/2tau_i), and a known prestress
Q = sum_i exp(-dt/tau_i) H_i - b_i exp(-dt/2tau_i) S_inf with the potential C:Q / 2. The elastic solver is unchanged.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from cad.errors import ParameterError
from cad.materials import HyperelasticLaw
from sensing.simulator.solid import elasticity as elastic
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.system import Solid

Prony = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class ViscousHistory:
    """History variables of the material: H (terms, e, 27, 3, 3) and S_inf (e, 27, 3, 3) of the last step, MPa."""

    overstress: Array
    isochoric: Array


def checked(prony: Prony) -> Prony:
    """The series itself, if it is valid.

    Raises:
        ParameterError: no term, g outside 0..1 or summing to 1 or more, tau not positive.
    """
    total = sum(g for g, _ in prony)
    if not prony or not all(g > 0 and tau > 0 and math.isfinite(tau) for g, tau in prony) or not total < 1:
        raise ParameterError(
            f"prony={prony} is no series: give pairs (g, tau_s) with g > 0 summing to less than 1 and tau_s > 0 "
            "(cad/materials.csv has them for some silicones)",
            name="prony",
            value=prony,
        )
    return prony


def isochoric_stress(law: HyperelasticLaw, solid: Solid, displacement: Array) -> Array:
    """Second Piola-Kirchhoff stress of the isochoric energy (e, 27, 3, 3), MPa.

    Args:
        law: hyperelastic constants.
        solid: its mesh and element data.
        displacement: nodal (n, 3), mm.
    """
    gradient = elastic.deformation_gradient(solid.data, displacement[solid.mesh.cells])
    cauchy_green = gradient.swapaxes(2, 3) @ gradient
    scale = np.linalg.det(gradient) ** (-2 / 3)
    first = np.trace(cauchy_green, axis1=2, axis2=3)
    x = scale * first - 3
    slope = 2 * scale * (law.c10_mpa + 2 * law.c20_mpa * x + 3 * law.c30_mpa * x * x)
    inverse = np.linalg.inv(cauchy_green)
    return slope[..., None, None] * (np.eye(3) - first[..., None, None] / 3 * inverse)


def rest(solid: Solid, prony: Prony) -> ViscousHistory:
    """History of a solid that was never strained."""
    shape = (*solid.data.weight.shape, 3, 3)
    return ViscousHistory(np.zeros((len(prony), *shape)), np.zeros(shape))


def step_solid(solid: Solid, history: ViscousHistory, prony: Prony, dt_s: float) -> Solid:
    """The elastic solid that is equivalent to a step.

    Args:
        solid: the solid with its long-term law.
        history: history before the step.
        prony: pairs (g, tau_s).
        dt_s: length of the step, s.

    Raises:
        ParameterError: ``dt_s`` is not positive.
    """
    if not dt_s > 0:
        raise ParameterError(f"dt_s={dt_s:g} is not positive: time goes forward", name="dt_s", value=dt_s)
    stiffer, known = 1.0, np.zeros_like(history.isochoric)
    for (b, tau), overstress in zip(over_slow(prony), history.overstress, strict=True):
        middle = b * math.exp(-dt_s / (2 * tau))
        stiffer += middle
        known += math.exp(-dt_s / tau) * overstress - middle * history.isochoric
    law = solid.law
    scaled = HyperelasticLaw(stiffer * law.c10_mpa, stiffer * law.c20_mpa, stiffer * law.c30_mpa, law.bulk_mpa)
    return replace(solid, law=scaled, prestress=elastic.prestress(known, solid.data))


def remember(solid: Solid, history: ViscousHistory, prony: Prony, dt_s: float, displacement: Array) -> ViscousHistory:
    """History after a step.

    Args:
        solid: the solid with its long-term law.
        history: history before the step.
        prony: pairs (g, tau_s).
        dt_s: length of the step, s.
        displacement: nodal displacement at its end (n, 3), mm.
    """
    now = isochoric_stress(solid.law, solid, displacement)
    overstress = [
        math.exp(-dt_s / tau) * h + b * math.exp(-dt_s / (2 * tau)) * (now - history.isochoric)
        for (b, tau), h in zip(over_slow(prony), history.overstress, strict=True)
    ]
    return ViscousHistory(np.array(overstress), now)


def over_slow(prony: Prony) -> Prony:
    """Pairs (b, tau_s): the terms relative to the long-term modulus, g / (1 - sum g)."""
    slow = 1 - sum(g for g, _ in prony)
    return tuple((g / slow, tau) for g, tau in prony)
