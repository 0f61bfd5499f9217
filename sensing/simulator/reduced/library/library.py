"""Level 4: a fitted library of equilibria over tilt, normal and tangential force (mm, N, N mm; contact on azimuth 0).

Divided by the normal force N, the displacement u of the inner surface is a sum of modes, whose weights are polynomials:

    u / N = sum_r Phi_r w_r(tilt, N, tx, ty),   w_r = sum_jk L_j(tilt) c_jkr B_k(N, tx, ty),   t = T / (tau N)

L_j are the Lagrange polynomials of the tilts at which it was fitted, B_k the products of Chebyshev polynomials up to a
total degree. The mirror plane splits modes: those symmetric in y take even powers of ty, the others odd ones. Wrench
forces are the inputs themselves; depth, travel, patch area and moments are fitted like the weights.

What is left out: the path (at equal forces it changes markers by a percent or two) and the friction coefficient, except
that the force stays in its cone. ``error_estimate`` combines the leave-one-out residual of the fit with the change from
the next lower degree; a state outside the fitted range, or whose estimate is over a limit, is left to level 2.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cad.errors import FileError
from cad.materials import HyperelasticLaw
from cad.whole_file import replace_file
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.geometry import ShellGeometry
from sensing.simulator.solid.mesh import Index

FORMAT = 1  # version of the file format
# Scalars that are symmetric in y, and antisymmetric ones; divided by the normal force.
SCALARS_EVEN = ("depth_mm", "shift_meridian_mm", "patch_mm2", "moment_y_nmm")
SCALARS_ODD = ("shift_lateral_mm", "moment_x_nmm", "moment_z_nmm")
CHUNK = 2000  # states that are evaluated together, so that their polynomial terms stay in the processor's cache


@dataclass(frozen=True)
class LibraryStates:
    """Results of the library for ``s`` states.

    Attributes:
        weights: weights of the modes (s, r), mm.
        wrench: wrench on the endcap at its origin (s, 6), N and N mm.
        depth_mm, patch_mm2: depth of the plane, mm, and contact area, mm2 (s,).
        shift_mm: tangential travel along (meridian, lateral) (s, 2), mm.
        error_estimate: expected relative rms error of the markers (s,).
        inside: whether the state lies in the fitted range (s,).
    """

    weights: Array
    wrench: Array
    depth_mm: Array
    shift_mm: Array
    patch_mm2: Array
    error_estimate: Array
    inside: NDArray[np.bool_]


@dataclass(frozen=True)
class Library:
    """A fitted library; see the module's text. It consists of arrays, so that its file holds nothing that could run.

    Attributes:
        tilt_deg: fitted tilts, ascending (t,), degrees.
        normal_n: range of the normal force (2,), N.
        cone: tau, largest T / N fitted (1,).
        powers: degrees of the polynomial terms in (N, tx, ty) (p, 3); terms even in ty first.
        even, odd: coefficients (t, pe, re), (t, po, ro) of the modes' weights, then of the scalars.
        even_below, odd_below: the same for the fit of one degree less.
        modes: surface fields (r, k, 3), orthonormal; those symmetric in y first.
        residual: relative rms leave-one-out error of the fit on its own states (1,).
        shell: parameters of its shell (:func:`shell_key`) (6,).
    """

    tilt_deg: Array
    normal_n: Array
    cone: Array
    powers: Index
    even: Array
    odd: Array
    even_below: Array
    odd_below: Array
    modes: Array
    residual: Array
    shell: Array

    def states(self, tilt_deg: Array, normal_n: Array, tangential_n: Array) -> LibraryStates:
        """States at tilts, normal and tangential forces.

        Args:
            tilt_deg, normal_n: (s,) tilts, degrees, and normal forces, N.
            tangential_n: tangential forces along (meridian, lateral) (s, 2), N.
        """
        tilt_deg, normal_n = np.broadcast_arrays(np.asarray(tilt_deg, float), np.asarray(normal_n, float))
        tangential_n = np.asarray(tangential_n, float).reshape(-1, 2)
        parts = [
            self._chunk(tilt_deg[k : k + CHUNK], normal_n[k : k + CHUNK], tangential_n[k : k + CHUNK])
            for k in range(0, len(normal_n), CHUNK)
        ]
        joined = [np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(LibraryStates)]
        return LibraryStates(*joined)

    def fields(self, weights: Array, modes: Array | None = None) -> Array:
        """Displacements (s, k, 3) of the inner surface, or of any points at which ``modes`` (r, m, 3) were sampled."""
        modes = self.modes if modes is None else modes
        return (weights @ modes.reshape(len(modes), -1)).reshape(len(weights), -1, 3)

    def inside(self, tilt_deg: Array, normal_n: Array, tangential_n: Array) -> NDArray[np.bool_]:
        """Which states (s,) lie in the fitted range.

        Args:
            tilt_deg, normal_n: (s,) tilts, degrees, and normal forces, N.
            tangential_n: tangential forces along (meridian, lateral) (s, 2), N.
        """
        low, high = self.normal_n
        return np.asarray(
            (tilt_deg >= self.tilt_deg[0])
            & (tilt_deg <= self.tilt_deg[-1])
            & (normal_n >= low)
            & (normal_n <= high)
            & (np.linalg.norm(tangential_n, axis=1) <= self.cone[0] * normal_n)
        )

    def save(self, path: Path) -> None:
        """Write the library to a file (.npz).

        Raises:
            FileError: it cannot be written.
        """
        content = {f.name: getattr(self, f.name) for f in fields(self)}
        np.savez_compressed(buffer := io.BytesIO(), format=FORMAT, **content)
        replace_file(path, buffer.getvalue(), "choose another place")

    @staticmethod
    def load(path: Path) -> Library:
        """Read a library from a file.

        Raises:
            FileError: missing, corrupt or of another format.
        """
        try:
            with np.load(path, allow_pickle=False) as archive:
                if int(archive["format"]) != FORMAT:
                    raise ValueError(f"format {int(archive['format'])}, this program reads {FORMAT}")
                return Library(**{f.name: archive[f.name] for f in fields(Library)})
        except Exception as error:  # a truncated zip raises many types of error
            raise FileError(f"{path}: not a library ({error}): fit it again") from error

    def _chunk(self, tilt_deg: Array, normal_n: Array, tangential_n: Array) -> LibraryStates:
        terms = polynomial_terms(self.powers, self._local(normal_n, tangential_n))  # (s, p)
        tilts = lagrange_terms(self.tilt_deg, tilt_deg)  # (s, t)
        pe, even_count = self.even.shape[1], self.even.shape[2] - len(SCALARS_EVEN)
        even, below_even = _both(tilts, terms[:, :pe], self.even, self.even_below)
        odd, below_odd = _both(tilts, terms[:, pe:], self.odd, self.odd_below)
        odd_count = odd.shape[1] - len(SCALARS_ODD)
        weights = np.concatenate([even[:, :even_count], odd[:, :odd_count]], axis=1)
        apart = np.concatenate([below_even[:, :even_count], below_odd[:, :odd_count]], axis=1) - weights
        size = np.maximum(np.linalg.norm(weights, axis=1), 1e-12)
        scalars = {name: even[:, even_count + k] * normal_n for k, name in enumerate(SCALARS_EVEN)}
        scalars |= {name: odd[:, odd_count + k] * normal_n for k, name in enumerate(SCALARS_ODD)}
        return LibraryStates(
            weights=weights * normal_n[:, None],
            wrench=_wrench(tilt_deg, normal_n, tangential_n, scalars),
            depth_mm=scalars["depth_mm"],
            shift_mm=np.stack([scalars["shift_meridian_mm"], scalars["shift_lateral_mm"]], axis=1),
            patch_mm2=scalars["patch_mm2"],
            error_estimate=np.hypot(self.residual[0], np.linalg.norm(apart, axis=1) / size),
            inside=self.inside(tilt_deg, normal_n, tangential_n),
        )

    def _local(self, normal_n: Array, tangential_n: Array) -> Array:
        return local_variables(normal_n, tangential_n, self.normal_n, float(self.cone[0]))


def shell_key(geometry: ShellGeometry, law: HyperelasticLaw) -> Array:
    """(6,) parameters of a library's shell: diameter, wall, mm; C10, C20, C30, bulk modulus, MPa."""
    return np.array(
        [2 * geometry.outer_radius_mm, geometry.wall_mm, law.c10_mpa, law.c20_mpa, law.c30_mpa, law.bulk_mpa]
    )


def local_variables(normal_n: Array, tangential_n: Array, normal_range: Array, cone: float) -> Array:
    """Polynomial variables (s, 3): N on -1..1, and T over tau N.

    Args:
        normal_n: normal forces (s,), N.
        tangential_n: tangential forces along (meridian, lateral) (s, 2), N.
        normal_range: least and largest fitted N (2,), N.
        cone: tau, largest fitted T / N.
    """
    low, high = normal_range
    first = (2 * normal_n - low - high) / (high - low)
    return np.column_stack([first, tangential_n / (cone * np.maximum(normal_n, 1e-9))[:, None]])


def polynomial_terms(powers: Index, local: Array) -> Array:
    """Products of Chebyshev polynomials (s, p) of degrees ``powers`` (p, 3) at ``local`` (s, 3)."""
    degree = int(powers.max())
    table = np.ones((degree + 1, *local.shape))  # (d, s, 3)
    if degree:
        table[1] = local
    for d in range(2, degree + 1):
        table[d] = 2 * local * table[d - 1] - table[d - 2]
    return np.asarray(table[powers[:, 0], :, 0] * table[powers[:, 1], :, 1] * table[powers[:, 2], :, 2]).T


def lagrange_terms(nodes: Array, x: Array) -> Array:
    """Lagrange polynomials (s, t) of ``nodes`` (t,) at x (s,)."""
    found = np.ones((len(x), len(nodes)))
    for j, node in enumerate(nodes):
        for other in np.delete(nodes, j):
            found[:, j] *= (x - other) / (node - other)
    return found


def _both(tilts: Array, terms: Array, upper: Array, lower: Array) -> tuple[Array, Array]:
    """Values (s, q) of both fits: products of the tilt and the force terms times their coefficients."""
    product = (tilts[:, :, None] * terms[:, None, :]).reshape(len(tilts), -1)
    count = upper.shape[2]
    values = product @ np.concatenate([upper, lower], axis=2).reshape(-1, 2 * count)
    return values[:, :count], values[:, count:]


def _wrench(tilt_deg: Array, normal_n: Array, tangential_n: Array, scalars: dict[str, Array]) -> Array:
    sine, cosine = np.sin(np.radians(tilt_deg)), np.cos(np.radians(tilt_deg))
    along = tangential_n[:, 0]
    force = np.stack([along * cosine - normal_n * sine, tangential_n[:, 1], -normal_n * cosine - along * sine], axis=1)
    moment = np.stack([scalars["moment_x_nmm"], scalars["moment_y_nmm"], scalars["moment_z_nmm"]], axis=1)
    return np.concatenate([force, moment], axis=1)
