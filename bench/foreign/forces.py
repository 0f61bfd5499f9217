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
OURS = ("data", "fine", "reference", "converged")
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
        ours = [our_presses(folder, straight, density) for density in OURS]
        sizes = [GRAINS[grain].touch_mm for grain in THEIRS], [1 / DENSITIES[density].core for density in OURS]
        rows += _rows("CalculiX", THEIRS, path, sizes[0], theirs)
        rows += _rows("ours", OURS, path, sizes[1], [forces for forces, _ in ours])
        answered = [_answered(shown_of(state)[:PRESSES], model) for state in states]
        rows += _rows("weights on CalculiX's dots", THEIRS, path, sizes[0], answered)
        rows += _rows("weights on our dots", OURS, path, sizes[1], [_answered(shown, model) for _, shown in ours])
    return rows


def extrapolated(sizes: list[float], values: Array) -> tuple[float, float]:
    """Limit at size 0 of three values, and the order seen (Richardson); the finest value where they show no order.

    Args:
        sizes: of the elements, falling (3,). values: found with them (3,).
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
        folder: what lies here is taken. path: of the plane. density: of the mesh.
    """
    file = folder / f"ours_{density}_{path.tilt_deg:g}.npz"
    if not file.exists():
        model = shell_model(GEOMETRY, silicone().neo_hooke(), density, half=True)
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


def _rows(
    what: str, meshes: tuple[str, ...], path: PlanePath, sizes: list[float], forces: list[Array]
) -> list[dict[str, Any]]:
    """Lines of the table, the limit of the three finest meshes last.

    Args:
        what: was asked. meshes: their names. path: of the plane. sizes: of elements. forces: of every mesh (places,) N.
    """
    limits = [extrapolated(sizes[-3:], found) for found in np.array(forces[-3:]).T]
    values, orders = np.array([limit for limit, _ in limits]), np.array([order for _, order in limits])
    return [
        {"what": what, "mesh": mesh, "tilt_deg": path.tilt_deg}
        | {f"force_n_at_{depth:g}_mm": force for (depth, _), force in zip(path.places[:PRESSES], found, strict=True)}
        for mesh, found in zip([*meshes, "limit", "order"], [*forces, values, orders], strict=True)
    ]
