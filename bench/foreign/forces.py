"""Whose force is right: the same straight presses on finer and finer meshes of both programs, and their limits."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq

from bench.foreign.links import GEOMETRY, nominal_answers, shown_of
from bench.foreign.mesh import GRAINS, Array
from bench.foreign.press import PlanePath
from bench.foreign.solved import COMPARED, DESIGN, GRAIN, PRESSES, solved
from cad.materials import silicone
from sensing.camera.nominal import nominal_mount
from sensing.live.core.model import LiveModel
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.press.press import Press, Target
from sensing.simulator.shown import shown_mm
from sensing.simulator.solid.mesh import DENSITIES
from sensing.simulator.solid.shell import shell_model
from sensing.simulator.solid.surface import outline_directions, surface_sampler

THEIRS = ("draft", "coarse", "middle")
OURS = {name: DENSITIES[name] for name in ("data", "fine", "reference", "converged")} | {
    "fine, 2 layers": replace(DENSITIES["fine"], layers=2),
    "reference, 2 layers": replace(DENSITIES["reference"], layers=2),
    "reference, 3 layers": replace(DENSITIES["reference"], layers=3),
}
# Limits are taken of meshes that differ in the size of their elements alone: of one number of layers.
OUR_FAMILY = ("fine, 2 layers", "reference, 2 layers", "converged")
STEP_MM = 0.8
ORDERS = (1.0, 6.0)  # between which the observed order is looked for


def force_rows(folder: Path, model: LiveModel) -> list[dict[str, Any]]:
    """Force of every press on every mesh, the limits of both programs, and what a model answers about CalculiX's dots.

    Args:
        folder: of CalculiX's states. model: answers about exact dots, as the nominal camera sees them.
    """
    rows = []
    for path in COMPARED:
        straight = replace(path, places=path.places[:PRESSES])
        states = [solved(folder, straight if grain != GRAIN else path, grain) for grain in THEIRS]
        theirs = [np.linalg.norm(state.wrench[:PRESSES, :3], axis=1) for state in states]
        ours = {name: our_presses(folder, straight, name) for name in OURS}
        rows += _rows("CalculiX", path, dict(zip(THEIRS, theirs, strict=True)))
        rows += _limits("CalculiX", path, [GRAINS[grain].touch_mm for grain in THEIRS], theirs)
        rows += _ours(path, {name: forces for name, (forces, _) in ours.items()})
        answered = [_answered(shown_of(state)[:PRESSES], model) for state in states]
        rows += _rows("weights on CalculiX's dots", path, dict(zip(THEIRS, answered, strict=True)))
        rows += _rows("weights on our dots", path, {name: _answered(shown, model) for name, (_, shown) in ours.items()})
    return rows


def our_rows(folder: Path) -> list[dict[str, Any]]:
    """The rows of :func:`force_rows` that need no other program: our forces, mesh by mesh, and their limit.

    Args:
        folder: of our states; what lies there is taken.
    """
    rows = []
    for path in COMPARED:
        straight = replace(path, places=path.places[:PRESSES])
        rows += _ours(path, {name: our_presses(folder, straight, name)[0] for name in OURS})
    return rows


def _ours(path: PlanePath, forces: dict[str, Array]) -> list[dict[str, Any]]:
    family = [forces[name] for name in OUR_FAMILY]
    return _rows("ours", path, forces) + _limits("ours", path, [1 / OURS[name].core for name in OUR_FAMILY], family)


def extrapolated(sizes: list[float], values: Array) -> tuple[float, float]:
    """Limit at size 0 of three values, and the order seen (Richardson); the finest value where they show no order.

    Args:
        sizes: of the elements, falling (3,), of meshes alike in all else. values: found with them (3,).
    """
    h, f = np.array(sizes) / sizes[-1], np.asarray(values, dtype=float)
    first, second = f[0] - f[1], f[1] - f[2]

    def off(order: float) -> float:
        powers = h**order
        return float(first * (powers[1] - powers[2]) - second * (powers[0] - powers[1]))

    if first * second <= 0 or off(ORDERS[0]) * off(ORDERS[1]) >= 0:
        return float(f[2]), math.nan
    order = float(brentq(off, *ORDERS))
    return float(f[2] - second / (h[1] ** order - 1)), order


def our_presses(folder: Path, path: PlanePath, density: str) -> tuple[Array, Array]:
    """Forces (places,) N of our full model on a straight press, and (places, d, 3) mm what windows show of its dots.

    Args:
        folder: what lies here is taken. path: of the plane. density: name of the mesh in :data:`OURS`.
    """
    file = folder / f"ours_{density.replace(', ', '_').replace(' ', '_')}_{path.tilt_deg:g}.npz"
    if not file.exists():
        model = shell_model(GEOMETRY, silicone().neo_hooke(), OURS[density], half=True)
        sampler = surface_sampler(model, outline_directions(GEOMETRY))
        press = Press(model, Indenter(path.tilt_deg), path.friction)
        state, before, forces, shown = press.start(), 0.0, [], []
        for depth, _ in path.places:
            steps = max(1, math.ceil((depth - before) / STEP_MM))
            for k in range(1, steps + 1):
                state = press.advance(state, Target(depth_mm=before + (depth - before) * k / steps))
            forces.append(np.linalg.norm(state.wrench[:3]))
            shown.append(shown_mm(GEOMETRY, sampler.sample(state.displacement), nominal_mount(DESIGN)))
            before = depth
        np.savez(file, forces=forces, shown=shown)
    with np.load(file) as found:
        return found["forces"], found["shown"]


def _answered(shown: Array, model: LiveModel) -> Array:
    """(places,) forces that the model answers."""
    return np.asarray(np.linalg.norm(nominal_answers(shown, model)[:, :3], axis=1))


def _rows(what: str, path: PlanePath, forces: dict[str, Array]) -> list[dict[str, Any]]:
    """Lines of the table.

    Args:
        what: was asked. path: of the plane. forces: of every line (places,) N, by its name.
    """
    return [
        {"what": what, "mesh": mesh, "tilt_deg": path.tilt_deg}
        | {f"force_n_at_{depth:g}_mm": force for (depth, _), force in zip(path.places[:PRESSES], found, strict=True)}
        for mesh, found in forces.items()
    ]


def _limits(what: str, path: PlanePath, sizes: list[float], forces: list[Array]) -> list[dict[str, Any]]:
    """Limit, order and scatter of a family's three finest meshes.

    Args:
        what: was asked. path: of the plane. sizes: of elements. forces: of the same meshes (places,) N.
    """
    finest = np.array(forces[-3:])
    limits = [extrapolated(sizes[-3:], found) for found in finest.T]
    values, orders = np.array([limit for limit, _ in limits]), np.array([order for _, order in limits])
    return _rows(what, path, {"limit": values, "order": orders, "scatter": np.ptp(finest, axis=0) / 2})
