"""Fitting a library (level 4) to level 2 (mm, N, degrees).

    python -m sensing.simulator.reduced.library.fit --out lib.npz

At every tilt a few winding paths cross the range of normal and tangential force; each tilt's states determine their
own polynomials, and Lagrange interpolation joins the tilts. Paths wind, so that the fit averages over histories.
Friction is high, so that the cone of any smaller friction is covered.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cad.errors import EndcapError, ParameterError
from cad.extras import program
from cad.materials import DEFAULT_SILICONE, silicone
from cad.messages import LOG, show, transient
from cad.whole_file import make_folder, require_place
from sensing.arguments import number, silicone_name, whole
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Target
from sensing.simulator.press.state import Refusal
from sensing.simulator.reduced.basis import mirrored
from sensing.simulator.reduced.library.library import (
    SCALARS_EVEN,
    Library,
    local_variables,
    polynomial_terms,
    shell_key,
)
from sensing.simulator.scene import Scene, SceneState
from sensing.simulator.similarity.ratios import LoadScale
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.mesh import Index

TILTS_DEG = (0.0, 7.0, 17.0, 28.0, 39.0, 48.0, 54.0)  # denser at the ends, against Runge's oscillation
NORMAL_N = (1.0, 38.0)  # for D=130 T=8 in Smooth-Sil 950, as the stiffness below; scaled to other shells
CONE = 0.7  # largest T / N of the fitted states
FRICTION = 0.9  # Coulomb coefficient of the fitted states
DEGREE = 5  # total degree of the polynomials
STATES = 80  # states at every tilt
MAX_MODES = 60  # modes of each symmetry
MODE_SHARE = 2e-6  # part of the squared norm that the dropped modes may hold
RANK = 1e-10  # singular values below this part of the largest count as zero
MIN_FREE = 0.05  # least 1 - leverage in the leave-one-out error, which divides by it
STIFFNESS_N_MM = 4.5  # E: tangential stiffness, by which a travel is chosen for a wanted force


@dataclass(frozen=True)
class Sample:
    """One solved state at a tilt, degrees."""

    tilt_deg: float
    state: SceneState


def winding_path(rng: np.random.Generator, states: int, cone: float = CONE) -> Iterator[tuple[float, Array]]:
    """Wanted normal force and tangential force (2,) of each state for D=130 T=8 in Smooth-Sil 950, N.

    Args:
        rng: source of the path's random numbers.
        states: number of states.
        cone: largest T / N.
    """
    low, high = NORMAL_N
    angle, phase, press = (float(rng.uniform(0, 2 * math.pi)) for _ in range(3))
    sense = float(rng.choice([-1.0, 1.0]))
    for _ in range(states):
        normal = low + (high - low) * (1 - math.cos(press)) / 2
        size = cone * math.sqrt((1 - math.cos(phase)) / 2) * normal  # uniform over the disc, slowly varying
        yield normal, size * np.array([math.cos(angle), math.sin(angle)])
        press += float(rng.uniform(0.15, 0.45))
        phase += float(rng.uniform(0.3, 0.7))
        angle += sense * float(rng.uniform(0.3, 0.8))


def sample_tilt(simulator: Simulator, tilt_deg: float, states: int, seed: int, friction: float) -> list[Sample]:
    """States of winding paths at one tilt; a refused state ends a path, and a new path begins.

    Args:
        simulator: simulator of the shell.
        tilt_deg: tilt of the plane, degrees.
        states: number of states.
        seed: seed of the paths, together with the tilt.
        friction: Coulomb's mu.
    """
    rng = np.random.default_rng([seed, round(1000 * tilt_deg)])
    scene = Scene(Indenter(tilt_deg), friction)
    scale = LoadScale.of(simulator.geometry, simulator.law.shear_mpa)
    found: list[Sample] = []
    for _ in range(5):
        walk = simulator.walk(scene, half=False)
        shift, tangential = np.zeros(2), np.zeros(2)
        for normal, wanted in winding_path(rng, states - len(found), min(CONE, 0.9 * friction)):
            shift = shift + scale.shift * (wanted - tangential / scale.force) / STIFFNESS_N_MM
            try:
                state = walk(Target(normal_n=scale.force * normal, shift_mm=(float(shift[0]), float(shift[1]))))
            except Refusal as refusal:
                LOG.info(f"tilt {tilt_deg:g}: {refusal}")
                break
            tangential = np.array(state.tangential_n)
            found.append(Sample(tilt_deg, state))
        if len(found) >= states:
            return found
    raise Refusal("unconverged", f"only {len(found)} of {states} states at tilt {tilt_deg:g} could be solved")


def fit(simulator: Simulator, samples: list[Sample], degree: int = DEGREE) -> Library:
    """Library fitted to solved states: at each tilt at least as many as the polynomial has terms.

    Args:
        simulator: simulator of the shell.
        samples: solved states at all tilts.
        degree: total degree of the polynomials.

    Raises:
        ParameterError: too few states.
    """
    tilts = np.unique([sample.tilt_deg for sample in samples])
    powers, even_count = _powers(degree)
    normal, tangential = _forces(samples)
    cone = float(min(CONE, (np.linalg.norm(tangential, axis=1) / normal).max()))
    limits = np.array([normal.min(), normal.max()])
    terms = polynomial_terms(powers, local_variables(normal, tangential, limits, cone))
    below = powers.sum(axis=1) < degree
    fields = np.array([s.state.surface_mm / s.state.normal_n for s in samples])
    scalars = np.array([_scalars(s.state) for s in samples])
    parities = []
    for columns, field, of in (
        (slice(0, even_count), mirrored(simulator.surface.position, fields, 1.0), slice(0, len(SCALARS_EVEN))),
        (slice(even_count, None), mirrored(simulator.surface.position, fields, -1.0), slice(len(SCALARS_EVEN), None)),
    ):
        modes, weights = _modes(field)
        parities.append(_Parity(terms[:, columns], below[columns], modes, weights, scalars[:, of]))
    tables: list[list[Array]] = [[], [], [], []]
    errors = np.zeros((len(samples), 2))
    for tilt in tilts:
        rows = np.array([s.tilt_deg == tilt for s in samples])
        _check_count(int(rows.sum()), even_count)
        for k, parity in enumerate(parities):
            upper, lower, errors[rows, k] = parity.fitted(rows)
            tables[k].append(upper)
            tables[2 + k].append(lower)
    size = np.linalg.norm(np.concatenate([parity.weights for parity in parities], axis=1), axis=1)
    residual = float(np.sqrt(np.mean((np.linalg.norm(errors, axis=1) / size) ** 2)))
    return Library(
        tilts, limits, np.array([cone]), powers,
        np.array(tables[0]), np.array(tables[1]), np.array(tables[2]), np.array(tables[3]),
        np.concatenate([parity.modes for parity in parities]), np.array([residual]),
        shell_key(simulator.geometry, simulator.law),
    )  # fmt: skip


@dataclass(frozen=True)
class _Parity:
    """Data of the fit that are symmetric, or antisymmetric, in the mirror plane: terms (s, p), which of them the lower
    degree has (p,), modes (r, k, 3), their weights (s, r) and scalars (s, q).
    """

    terms: Array
    below: NDArray[np.bool_]
    modes: Array
    weights: Array
    scalars: Array

    def fitted(self, rows: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
        """Coefficients of both degrees (p, r + q), and leave-one-out error of each state's weights (rows,)."""
        terms, targets = self.terms[rows], np.column_stack([self.weights[rows], self.scalars[rows]])
        upper = np.linalg.lstsq(terms, targets, rcond=RANK)[0]
        lower = np.zeros_like(upper)
        lower[self.below] = np.linalg.lstsq(terms[:, self.below], targets, rcond=RANK)[0]
        left, size, _ = np.linalg.svd(terms, full_matrices=False)
        leverage = (left[:, size > RANK * size[0]] ** 2).sum(axis=1)
        missed = (terms @ upper - targets)[:, : self.weights.shape[1]]
        return np.asarray(upper), lower, np.linalg.norm(missed, axis=1) / np.maximum(1 - leverage, MIN_FREE)


def _check_count(count: int, terms: int) -> None:
    if count < 1.5 * terms:
        raise ParameterError(
            f"states={count} at a tilt under {1.5 * terms:g} (1.5 for each of the {terms} terms of a polynomial): "
            "solve more, or lower the degree",
            name="states",
            value=count,
        )


def fit_library(simulator: Simulator, states: int = STATES, seed: int = 0) -> Library:
    """Solve states and fit a library to them (minutes: :data:`TILTS_DEG` times ``states`` on level 2).

    Args:
        simulator: level 2 simulator of the shell.
        states: number of states at each tilt.
        seed: seed of the paths.

    Raises:
        ParameterError: too few states.
    """
    _check_count(states, _powers(DEGREE)[1])  # before the solver runs for minutes
    samples: list[Sample] = []
    for count, tilt in enumerate(TILTS_DEG):
        transient(f"tilt {tilt:g} degrees ({count + 1}/{len(TILTS_DEG)})")
        samples += sample_tilt(simulator, tilt, states, seed, FRICTION)
        simulator.forget()
    return fit(simulator, samples)


def _powers(degree: int) -> tuple[Index, int]:
    """Degrees (p, 3) up to a total, even ones in ty first; and how many are even."""
    known = [p for p in product(range(degree + 1), repeat=3) if sum(p) <= degree]
    even = [p for p in known if p[2] % 2 == 0]
    return np.array(even + [p for p in known if p[2] % 2]), len(even)


def _modes(fields: Array) -> tuple[Array, Array]:
    """Orthonormal modes (r, k, 3) of fields (s, k, 3), and their weights (s, r)."""
    flat = fields.reshape(len(fields), -1)
    left, size, right = np.linalg.svd(flat, full_matrices=False)
    rest = 1 - np.cumsum(size**2) / np.sum(size**2)
    count = min(MAX_MODES, int(np.searchsorted(-rest, -MODE_SHARE)) + 1)
    return right[:count].reshape(count, -1, 3), left[:, :count] * size[:count]


def _scalars(state: SceneState) -> list[float]:
    even = [state.depth_mm, state.shift_mm[0], state.patch_mm2, float(state.wrench[4])]
    odd = [state.shift_mm[1], float(state.wrench[3]), float(state.wrench[5])]
    return [value / state.normal_n for value in even + odd]


def _forces(samples: list[Sample]) -> tuple[Array, Array]:
    return np.array([s.state.normal_n for s in samples]), np.array([s.state.tangential_n for s in samples])


def main(arguments: list[str] | None = None) -> int:
    """Fit and write a library; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.simulator.reduced.library.fit"),
        description="Fit the level 4 library of one shell (some minutes on one core).",
    )
    parser.add_argument("--out", type=Path, required=True, help="file to write, .npz")
    parser.add_argument("--diameter", type=number, default=130, help="diameter D, mm (default 130)")
    parser.add_argument("--wall", type=number, default=8, help="wall T, mm (default 8)")
    parser.add_argument(
        "--silicone",
        type=silicone_name,
        default=DEFAULT_SILICONE,
        help=f"row of the table (default {DEFAULT_SILICONE})",
    )
    parser.add_argument("--density", default="data", help="mesh (default data)")
    parser.add_argument("--states", type=whole, default=STATES, help=f"states at each tilt (default {STATES})")
    parser.add_argument("--seed", type=whole, default=0, help="of the paths (default 0)")
    options = parser.parse_args(arguments)
    try:
        law = silicone(options.silicone).neo_hooke()
        make_folder(options.out.parent)
        require_place(options.out)  # before the solver runs for minutes
        simulator = Simulator(shell_geometry(options.diameter, options.wall), law, options.density)
        library = fit_library(simulator, options.states, options.seed)
        library.save(options.out)
    except EndcapError as error:
        LOG.error(f"sensing.simulator.reduced.library.fit: {error}")
        return 2
    show(f"{options.out}: {len(library.modes)} modes, residual {100 * float(library.residual[0]):.2f} %")
    return 0


if __name__ == "__main__":
    sys.exit(main())
