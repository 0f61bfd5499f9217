"""Validity of a converged state: the body outside the shell, on enough Gauss points, away from the rim.

A residual of zero does not imply validity. A small body that a step moves by more than its radius can lie beyond the
surface, where it presses nothing or presses outward; between two Gauss points of contact its force is too low; on the
bonded rim it presses nodes that the model holds fixed, and the base that it would meet there is not modelled.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from cad.messages import LOG
from sensing.simulator.contact.friction import POINTS_PER_SIDE
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.press.state import Refusal, State
from sensing.simulator.scene import SceneState
from sensing.simulator.solid.element import face_rule, shape_quad
from sensing.simulator.solid.shell import ShellModel

MAX_REACH = 0.15  # of depth or radius: reach between Gauss points; about the relative error of the force
REACH_FLOOR_MM = 0.1  # the first touch of a plane lies between Gauss points, too, by at most a third of this
MAX_RIM_SHARE = 0.01  # of the contact force, on nodes that the clamp holds
ROUND_OFF = 1e-6  # of a force: by less than this it has not fallen
STRIDE = 0.5  # of a body's radius: its largest step of depth, so that its centre stays outside the shell
_, _GRADIENT = shape_quad(face_rule(POINTS_PER_SIDE)[0])  # (g, 9, 2) local gradients at the Gauss points


def after(refusal: Refusal, solved: Sequence[SceneState]) -> Refusal:
    """The refusal of a press, with the load to which it was solved.

    Args:
        refusal: reason why the press ended.
        solved: last state before it; empty where there is none.
    """
    if not solved:
        return refusal
    last = solved[-1]
    reached = f"solved to {last.normal_n:.3g} N at a depth of {last.depth_mm:.3g} mm: give less"
    return Refusal(refusal.reason, f"{refusal.text}; {reached}")


def warn_of_fall(solved: Sequence[SceneState]) -> None:
    """Warn where the force of a press to a depth falls, from a state to the next or by its slope at a state.

    The last state alone does not show a snap on the way. A coarse mesh snaps, fold by fold, where the shell does not.

    Args:
        solved: states of the press in order.
    """
    for before, here in pairwise(solved):
        slope = here.certificate.force_stiffness_n_mm if here.certificate else 0.0
        fell = here.normal_n < before.normal_n * (1 - ROUND_OFF)
        if here.shift_mm == before.shift_mm and here.depth_mm > before.depth_mm and (fell or slope < 0):
            falls = f"from {before.normal_n:.4g} to {here.normal_n:.4g} N" if slope >= 0 else f"by {-slope:.3g} N/mm"
            LOG.warning(
                f"the force falls {falls} at {here.depth_mm:.3g} mm of depth: the shell snaps, or its mesh is too "
                "coarse there; compare with a finer density"
            )
            return


def first_share(indenter: Indenter, state: State, depth_mm: float | None) -> float:
    """Share of the way to a depth that the first step takes: at most :data:`STRIDE` radii for a sphere or edge.

    Args:
        indenter: the body.
        state: state at which the step begins.
        depth_mm: depth at its end, mm; None under a given force.
    """
    if depth_mm is None or indenter.kind not in ("sphere", "edge"):
        return 1.0
    travel = abs(depth_mm - state.depth_mm)
    return min(1.0, STRIDE * indenter.radius_mm / travel) if travel > 0 else 1.0


def has_passed(model: ShellModel, state: State) -> bool:
    """Whether the body's centre lies on the inner side of the surface.

    At the place nearest to the body, the body's outward normal points into the shell as long as the body is outside.
    """
    assert state.contact is not None
    face, point = np.unravel_index(int(state.contact.gap.argmin()), state.contact.gap.shape)
    nodes, gradient = model.surface.nodes[face], _GRADIENT[point]
    rest = model.solid.mesh.points[nodes]
    normal = np.cross(*(gradient.T @ (rest + state.displacement[nodes])))
    middle = rest.mean(axis=0) - np.array(model.geometry.centre_mm)
    side = np.cross(*(gradient.T @ rest)) @ middle  # the order of a face's nodes does not determine its outer side
    return bool(state.contact.gradient[face, point] @ normal * side > 0)


def require_outside(model: ShellModel, state: State) -> None:
    """Refuse a state whose body has passed through the surface.

    Raises:
        Refusal: ``mesh``; shorter steps may reach a valid state.
    """
    if has_passed(model, state):
        raise Refusal(
            "mesh",
            f"the body has passed through the surface on the way to depth {state.depth_mm:.2f} mm: it is too small for "
            "this mesh; take a finer density or a larger radius",
        )


def require_valid(model: ShellModel, indenter: Indenter, state: State) -> State:
    """The state itself, if it is valid.

    Args:
        model: the shell.
        indenter: the body.
        state: a converged state.

    Raises:
        Refusal: ``mesh`` where the body reaches between the Gauss points of contact, so that the force is too low;
            ``range`` where it presses on the clamped rim.
    """
    assert state.certificate is not None
    require_measured(indenter, state.depth_mm, state.certificate.reach_mm - state.certificate.penetration_mm)
    share = rim_share(model, state)
    if share > MAX_RIM_SHARE:
        raise Refusal(
            "range",
            f"{100 * share:.0f} % of the force acts on the clamped rim (at most {100 * MAX_RIM_SHARE:.0f} %): "
            f"tilt_deg={indenter.tilt_deg:g} is too near to the rim at {_rim_deg(model):.0f} degrees for this load, "
            "and the base is not modelled; take a smaller tilt or load",
        )
    return state


def require_measured(indenter: Indenter, depth_mm: float, missed_mm: float) -> None:
    """Refuse a body whose reach between the Gauss points of contact is too large.

    Args:
        indenter: the body.
        depth_mm: its approach, mm.
        missed_mm: its reach beyond that at any Gauss point, mm.

    Raises:
        Refusal: ``mesh`` where the reach is over the limit.
    """
    blunt = indenter.radius_mm if indenter.kind != "plane" else np.inf
    limit = max(REACH_FLOOR_MM, MAX_REACH * min(max(depth_mm, 0.0), blunt))
    if missed_mm > limit:
        small = f"its radius_mm={indenter.radius_mm:g} is too small for this mesh at this depth"
        why, larger = ("the mesh is too coarse there", "") if indenter.kind == "plane" else (small, "a larger radius, ")
        raise Refusal(
            "mesh",
            f"the {indenter.kind} reaches {missed_mm:.2f} mm into the surface between the points where contact is "
            f"measured, over {limit:.2f} mm: {why}; take a finer density, {larger}or press deeper",
        )


def rim_share(model: ShellModel, state: State) -> float:
    """Share of the contact force that acts on clamped nodes; 0 without contact."""
    assert state.contact is not None
    force = state.contact.force
    whole = float(np.linalg.norm(force.sum(axis=(0, 1))))
    held = np.isin(model.surface.nodes, model.clamped)
    return float(np.linalg.norm(force[held].sum(axis=0))) / whole if whole > 0 else 0.0


def _rim_deg(model: ShellModel) -> float:
    return float(np.degrees(model.geometry.clamp_polar_rad(model.geometry.outer_radius_mm)))
