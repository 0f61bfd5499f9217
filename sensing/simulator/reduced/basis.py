"""Level 3's model: displacement modes of one shell under one body, and the few elements that stand for all (N, mm).

Modes V are the principal directions of level 2 states along winding paths, per newton, so that light touches count as
much as hard presses; on a whole model they are split into those symmetric and antisymmetric in the mirror plane.
Internal forces are summed over a cubature: elements e with weights w_e >= 0 chosen such that on the training states

    sum_e w_e V_e' f_e(V_e q)  =  V' f(V q)        within ``CUBATURE_ERROR``

(energy-conserving sampling and weighting: Farhat, Chapman, Avery 2015, doi:10.1002/nme.4820; the greedy non-negative
least squares of Lawson and Hanson, stopped early). Since w >= 0, the sum keeps an energy with a positive tangent.

Assembling that tangent costs as much as twenty evaluations of the forces, so it is interpolated from those at the
training states, K(q) = K_mean + sum_k g(|q - q_k|) C_k with a Gaussian g (radial basis functions); it steers Newton's
iteration and does not affect which states are accepted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from cad.materials import HyperelasticLaw
from sensing.simulator.contact.friction import ContactSurface
from sensing.simulator.press.frozen import FrozenPress
from sensing.simulator.press.press import Target
from sensing.simulator.press.state import Refusal, State
from sensing.simulator.press.tangential import tangential_n
from sensing.simulator.similarity.ratios import LoadScale
from sensing.simulator.solid import elasticity as elastic
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.mesh import Index
from sensing.simulator.solid.shell import ShellModel

MODES = 50  # displacement modes of a whole or half model
STATES = 90  # training states
CUBATURE_ERROR = 2e-3  # relative error of the projected internal forces
MAX_ELEMENTS = 60  # elements of the cubature
REACH = 1.0  # width of the Gaussians that interpolate the tangent, in median distances of the training states
RIDGE = 1e-6  # added to the diagonal of ones of the interpolation's kernel
FACE_MARGIN_MM = 4.0  # faces that came nearer than this to the body in training may touch
NORMAL_N = (0.5, 38.0)  # of D=130 T=8 in Smooth-Sil 950, as is the stiffness below; of others in proportion
CONE = 0.95  # T / N of the training paths over their friction
FRICTION = 1.0  # Coulomb coefficient of the training paths
STIFFNESS_N_MM = 4.5  # E: tangential stiffness, by which a travel is chosen for a wanted force


@dataclass(frozen=True)
class TangentMap:
    """The elastic tangent by interpolation.

    Attributes:
        places: weights of the modes at the training states (t, m).
        reach_mm: width of the Gaussians, mm.
        mean: K_mean (m, m).
        parts: C (t, m m).
    """

    places: Array
    reach_mm: float
    mean: Array
    parts: Array

    def at(self, weights: Array) -> Array:
        """Tangent (m, m), N/mm, at mode weights (m,)."""
        away = ((self.places - weights) ** 2).sum(axis=1) / self.reach_mm**2
        return np.asarray(self.mean + (np.exp(-away) @ self.parts).reshape(self.mean.shape))


@dataclass(frozen=True)
class ReducedModel:
    """Modes, cubature and the faces that may touch.

    Attributes:
        modes: V over the unknowns (u, m), orthonormal.
        cells: numbers of the chosen elements (k,).
        weights: cubature weights w (k,).
        element_modes: V over the nodes of the chosen elements (k, 81, m).
        data: element data of the chosen elements, volumes not weighted.
        tangents: interpolated elastic tangent.
        faces: faces that may touch (f,).
        surface: contact quadrature of these faces, with nodes numbered within ``nodes``.
        nodes: numbers of the nodes of these faces (s,).
        node_modes: V over these nodes (3 s, m).
        face_modes: V over each face's nodes (f, 27, m).
        estimate_factor: marker error over the indicator (:mod:`sensing.simulator.reduced.press`), 95 % of states.
    """

    modes: Array
    cells: Index
    weights: Array
    element_modes: Array
    data: elastic.ElementData
    tangents: TangentMap
    faces: Index
    surface: ContactSurface
    nodes: Index
    node_modes: Array
    face_modes: Array
    estimate_factor: float

    def internal(self, law: HyperelasticLaw, weights: Array) -> Array:
        """Projected internal forces (m,) by the cubature."""
        flat = self.element_modes.reshape(-1, len(weights))
        _, force = elastic.energy_and_force(law, self.data, (flat @ weights).reshape(-1, 27, 3))
        return np.asarray((force * self.weights[:, None, None]).ravel() @ flat)

    def stiffness(self, law: HyperelasticLaw, weights: Array) -> Array:
        """Projected elastic tangent (m, m) by the cubature."""
        flat = self.element_modes.reshape(-1, len(weights))
        blocks = elastic.tangent(law, self.data, (flat @ weights).reshape(-1, 27, 3)) * self.weights[:, None, None]
        return np.asarray(flat.T @ (blocks @ self.element_modes).reshape(flat.shape))


def training_states(fast: FrozenPress, states: int = STATES, seed: int = 0) -> list[State]:
    """Level 2 states along winding paths of normal and tangential force; a refused step begins a new path.

    Args:
        fast: level 2 press.
        states: number of states.
        seed: seed of the paths.

    Raises:
        Refusal: level 2 could solve too few states.
    """
    rng = np.random.default_rng(seed)
    model = fast.press.model
    scale = LoadScale.of(model.geometry, model.solid.law.shear_mpa)
    found: list[State] = []
    for _ in range(5):
        state, shift, pull = fast.start(), np.zeros(2), np.zeros(2)
        for normal, wanted in _winding(rng, states - len(found), model.half):
            shift = shift + scale.shift * (wanted - pull / scale.force) / STIFFNESS_N_MM
            load = scale.force * normal
            try:
                state = fast.advance(state, Target(normal_n=load, shift_mm=(float(shift[0]), float(shift[1]))))
            except Refusal:
                break
            pull = np.array(tangential_n(state, fast.press.frame))
            found.append(state)
        if len(found) >= states:
            return found
    raise Refusal("unconverged", f"only {len(found)} of {states} training states could be solved")


def reduced_model(
    model: ShellModel, states: list[State], modes: int = MODES, cubature_error: float = CUBATURE_ERROR
) -> ReducedModel:
    """Modes and cubature from states; ``estimate_factor`` is infinite until the model is tested.

    Args:
        model: the shell.
        states: training states, under load (:func:`training_states`).
        modes: number of modes.
        cubature_error: relative error of the projected internal forces.
    """
    solid, surface = model.solid, model.surface
    loads = np.array([state.normal_n for state in states])
    fields = np.array([state.displacement for state in states]) / loads[:, None, None]
    parts = [fields] if model.half else [mirrored(solid.mesh.points, fields, sign) for sign in (1.0, -1.0)]
    basis = _principal([np.array([solid.gather(field) for field in part]) for part in parts], modes)
    nodal = np.array([solid.spread(column) for column in basis.T])  # (m, n, 3)
    cells, weights = _cubature(model, nodal, states, cubature_error)
    near = [s.contact.gap.min(axis=1) < FACE_MARGIN_MM for s in states if s.contact is not None]
    touched = np.logical_or.reduce(near)
    faces = np.flatnonzero(touched | _twin_faces(model, touched))
    nodes, inverse = np.unique(surface.nodes[faces], return_inverse=True)
    local = replace(
        surface, cells=surface.cells[faces], nodes=inverse.reshape(-1, 9).astype(np.int64), area=surface.area[faces]
    )
    data = solid.data
    found = ReducedModel(
        modes=basis,
        cells=cells,
        weights=weights,
        element_modes=_by_nodes(nodal, solid.mesh.cells[cells]),
        data=elastic.ElementData(
            data.gradient[cells], data.rows[cells], data.weight[cells], data.psi, data.mass_inverse[cells]
        ),
        tangents=TangentMap(np.zeros((0, len(nodal))), 1.0, np.zeros((0, 0)), np.zeros((0, 0))),
        faces=faces,
        surface=local,
        nodes=nodes,
        node_modes=nodal[:, nodes].reshape(len(nodal), -1).T.copy(),
        face_modes=_by_nodes(nodal, surface.nodes[faces]),
        estimate_factor=math.inf,
    )
    places = np.array([basis.T @ solid.gather(state.displacement) for state in states])
    return replace(found, tangents=tangent_map(places, np.array([found.stiffness(solid.law, q) for q in places])))


def tangent_map(places: Array, tangents: Array) -> TangentMap:
    """Interpolation of tangents (t, m, m), N/mm, known at mode weights (t, m)."""
    apart = cdist(places, places, "sqeuclidean")
    reach = REACH * math.sqrt(float(np.median(apart)))
    kernel = np.exp(-apart / reach**2) + RIDGE * np.eye(len(places))
    mean = tangents.mean(axis=0)
    return TangentMap(places, reach, mean, np.linalg.solve(kernel, (tangents - mean).reshape(len(places), -1)))


def _winding(rng: np.random.Generator, states: int, half: bool) -> list[tuple[float, Array]]:
    """Wanted normal force and tangential force (2,) of each state, N; on a half model along the meridian only."""
    low, high = NORMAL_N
    press, angle, phase = (float(v) for v in rng.uniform(0, 2 * math.pi, 3))
    sense, path = float(rng.choice([-1.0, 1.0])), []
    for _ in range(states):
        normal = low + (high - low) * ((1 - math.cos(press)) / 2) ** 1.5  # favours light touches
        size = CONE * FRICTION * math.sqrt((1 - math.cos(phase)) / 2) * normal
        direction = np.array([math.cos(angle), 0.0 if half else math.sin(angle)])
        path.append((normal, size * direction))
        press, phase = press + float(rng.uniform(0.2, 0.5)), phase + float(rng.uniform(0.3, 0.7))
        angle += sense * float(rng.uniform(0.3, 0.8))
    return path


def mirrored(points: Array, fields: Array, sign: float) -> Array:
    """Part of fields (s, n, 3) that is symmetric (sign 1) or antisymmetric (-1) in y = 0.

    Args:
        points: (n, 3) points of the fields, mm, each with its mirror image.
        fields: (s, n, 3) vectors at these points.
        sign: 1 or -1.
    """
    mirror = np.array([1.0, -1.0, 1.0])
    _, twin = cKDTree(points).query(points * mirror)
    return (fields + sign * fields[:, twin] * mirror) / 2


def _twin_faces(model: ShellModel, touched: Array) -> Array:
    if model.half:
        return touched
    middle = model.solid.mesh.points[model.surface.nodes[:, 4]]
    _, twin = cKDTree(middle).query(middle * [1.0, -1.0, 1.0])
    return np.asarray(touched[twin])


def _principal(parts: list[Array], modes: int) -> Array:
    """Orthonormal columns (u, m): the directions of largest variance of all parts (s, u) together."""
    found = [np.linalg.svd(part, full_matrices=False)[1:] for part in parts]
    sizes = np.concatenate([size for size, _ in found])
    rows = np.concatenate([right for _, right in found])
    return np.ascontiguousarray(rows[np.argsort(-sizes, kind="stable")[:modes]].T)


def _by_nodes(nodal: Array, numbers: Index) -> Array:
    """(g, 3 a, m) modes (m, n, 3) at groups of nodes (g, a)."""
    return np.ascontiguousarray(nodal[:, numbers].reshape(len(nodal), len(numbers), -1).transpose(1, 2, 0))


def _cubature(model: ShellModel, nodal: Array, states: list[State], error: float) -> tuple[Index, Array]:
    """Elements (k,) and weights (k,) that reproduce the projected internal forces of the states."""
    solid = model.solid
    everywhere = _by_nodes(nodal, solid.mesh.cells)  # (e, 81, m)
    flat = nodal.reshape(len(nodal), -1)
    blocks = []
    for state in states:
        field = (flat.T @ (flat @ state.displacement.ravel())).reshape(-1, 3)  # V V' u
        _, force = elastic.energy_and_force(solid.law, solid.data, field[solid.mesh.cells])
        shares = np.einsum("eam,ea->me", everywhere, force.reshape(len(force), -1), optimize=True)
        blocks.append(shares / np.linalg.norm(shares.sum(axis=1)))
    table = np.concatenate(blocks)
    return sparse_weights(table, table.sum(axis=1), error)


def sparse_weights(table: Array, wanted: Array, error: float) -> tuple[Index, Array]:
    """Few columns (k,) of a table and weights >= 0 (k,) whose sum is the wanted one; at most :data:`MAX_ELEMENTS`.

    Args:
        table: (r, e).
        wanted: sum to reach (r,).
        error: norm of the residual over the norm of ``wanted`` at which the search stops.
    """
    gram, goal = table.T @ table, table.T @ wanted
    chosen: list[int] = []
    weights = np.zeros(0)
    rest = wanted
    for _ in range(3 * MAX_ELEMENTS):  # a column may be chosen and dropped again
        if np.linalg.norm(rest) <= error * np.linalg.norm(wanted) or len(chosen) == min(MAX_ELEMENTS, table.shape[1]):
            break
        slope = goal - gram[:, chosen] @ weights
        slope[chosen] = -np.inf
        chosen.append(int(slope.argmax()))
        root = np.linalg.cholesky(gram[np.ix_(chosen, chosen)] + 1e-13 * np.trace(gram) * np.eye(len(chosen)))
        weights, _ = nnls(root.T, np.linalg.solve(root, goal[chosen]))
        kept = weights > 0
        chosen, weights = [c for c, k in zip(chosen, kept, strict=True) if k], weights[kept]
        rest = wanted - table[:, chosen] @ weights
    order = np.argsort(chosen)
    return np.array(chosen)[order], weights[order]
